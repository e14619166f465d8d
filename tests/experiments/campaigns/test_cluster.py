from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

import pytest

from infoset.experiments.campaigns.cluster import cluster
from infoset.experiments.common.errors import InputError
from infoset.sim import Campaign, CampaignNoise, Scenario
from infoset.sim.storage import CampaignFolder

Infoset = Callable[..., tuple[int, str, str]]


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")  # of the cluster's own client
@pytest.mark.parametrize(
    ("address", "is_open"),
    [("tcp://127.0.0.1:1", False), ("tls://10.0.0.1:8786", False), ("tcp://10.0.0.1:8786", True)],
)
def test_missing_scheduler_is_refused_and_unencrypted_address_has_a_warning(
    address: str, is_open: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    notes: list[str] = []
    monkeypatch.setattr("infoset.experiments.campaigns.cluster.PATIENCE_S", 0.5)
    with (
        pytest.raises(
            InputError,
            match=f"no Dask scheduler answers at {address} .*start one with: dask scheduler",
        ),
        cluster(address, notes.append),
    ):
        pytest.fail("there is no cluster")
    assert (
        any("everyone who reaches that address can run programs there" in note for note in notes)
        == is_open
    )


class Processes:
    """A Dask scheduler and workers, each a process on the loopback."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.stack = contextlib.ExitStack()
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self.scheduler = self.start("scheduler", "--host", "127.0.0.1", "--port", str(port))

    def wait_until_up(self) -> None:
        """Wait until the scheduler listens."""
        deadline = time.monotonic() + 60.0
        while True:
            with (
                contextlib.suppress(OSError),
                socket.create_connection(("127.0.0.1", int(self.address.split(":")[2]))),
            ):
                return
            assert time.monotonic() < deadline, "the scheduler did not start"
            time.sleep(0.1)

    def start(self, what: str, *arguments: str, **environment: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "dask", what, *arguments, "--no-dashboard"]
        log = self.stack.enter_context(
            (self.folder / f"{what}-{time.monotonic_ns()}.log").open("wb")
        )
        process = subprocess.Popen(
            command, stdout=log, stderr=log, env={**os.environ, **environment}, cwd=self.folder
        )
        self.stack.callback(process.wait)
        self.stack.callback(process.kill)
        return process

    def worker(self, **environment: str) -> subprocess.Popen[bytes]:
        options = ["--nworkers", "1", "--nthreads", "1", "--no-nanny", "--local-directory", "space"]
        return self.start("worker", self.address, *options, **environment)

    def wait_for(self, workers: int) -> None:
        """Wait until the workers have come, or gone."""
        from distributed import Client

        with Client(self.address, timeout=30, set_as_default=False) as client:
            deadline = time.monotonic() + 60.0
            while len(client.nthreads()) != workers:
                assert time.monotonic() < deadline, "the workers did not come"
                time.sleep(0.1)


@pytest.fixture
def processes(tmp_path: Path) -> Iterator[Processes]:
    found = Processes(tmp_path)
    with found.stack:
        found.wait_until_up()
        yield found


def kill_after(shards: Path, number: int, process: subprocess.Popen[bytes]) -> threading.Thread:
    """Kill a process once a campaign has stored some files."""

    def kill() -> None:
        while len(list(shards.glob("*.parquet"))) < number:
            time.sleep(0.02)
        process.kill()

    killer = threading.Thread(target=kill)
    killer.start()
    return killer


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")
def test_two_workers_give_the_same_bits_also_if_one_ends(
    infoset: Infoset, brief: Scenario, file: Path, processes: Processes, tmp_path: Path
) -> None:
    workers = [processes.worker(), processes.worker()]
    processes.wait_for(2)
    options = ("--model", "paper", "--noise", "mixed", "--chunk", 16, "--dask", processes.address)
    code, _, err = infoset("campaign", file, *options, "--out", "two", "--runs", 400)
    assert code == 0
    assert err.startswith("2 Dask workers, 2 threads\n")
    expected = Campaign(brief, 4000, tmp_path / "here", noise=CampaignNoise.MIXED).run().runs()
    assert CampaignFolder.read(tmp_path / "two").runs().equals(expected[:400])
    killer = kill_after(tmp_path / "killed" / "shards", 20, workers[0])
    assert infoset("campaign", file, *options, "--out", "killed", "--runs", 4000, "-q") == (
        0,
        "",
        "",
    )
    killer.join()
    assert CampaignFolder.read(tmp_path / "killed").runs().equals(expected)


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")
def test_campaign_is_resumed_without_a_scheduler_that_ended(
    brief: Scenario, file: Path, processes: Processes, tmp_path: Path
) -> None:
    processes.worker()
    processes.wait_for(1)
    asked = [
        "campaign",
        str(file),
        "--model",
        "paper",
        "--runs",
        "6000",
        "--chunk",
        "16",
        "--out",
        "runs",
        "-q",
    ]
    command = [sys.executable, "-m", "infoset", *asked, "--dask", processes.address]
    killer = kill_after(tmp_path / "runs" / "shards", 10, processes.scheduler)
    done = subprocess.run(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, check=False, timeout=120
    )
    killer.join()
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert "continue with --resume" in done.stderr
    assert 160 <= CampaignFolder.read(tmp_path / "runs").finished_runs < 6000
    assert Campaign(brief, 6000, tmp_path / "runs", chunk=16).run(resume=True).complete


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")
def test_scheduler_without_workers_or_with_other_versions_is_refused(
    infoset: Infoset, file: Path, processes: Processes, tmp_path: Path
) -> None:
    asked = ("campaign", file, "--runs", 16, "--out", "runs", "--dask", processes.address)
    code, _, err = infoset(*asked)
    assert code == 2
    assert "has no workers; start some with: dask worker" in err
    old = tmp_path / "old" / "infoset-0.0.1.dist-info"
    old.mkdir(parents=True)
    (old / "METADATA").write_text("Metadata-Version: 2.1\nName: infoset\nVersion: 0.0.1\n")
    processes.worker(
        PYTHONPATH=os.pathsep.join([str(tmp_path / "old"), os.environ.get("PYTHONPATH", "")])
    )
    processes.wait_for(1)
    code, _, err = infoset(*asked)
    assert code == 2
    assert f"infoset {version('infoset')} in the campaign, 0.0.1 on the worker" in err


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")
def test_error_of_own_code_on_a_worker_is_shown_and_not_repeated(
    infoset: Infoset, file: Path, processes: Processes, tmp_path: Path
) -> None:
    calls = tmp_path / "calls"
    (tmp_path / "failing.py").write_text(
        f"""class Failing:
    def measure(self, sight, predicted):
        with open({str(calls)!r}, "a") as file:
            file.write("called ")
        raise ValueError("the table ends here")
"""
    )
    processes.worker()
    processes.wait_for(1)

    asked = ("campaign", file, "--runs", 16, "--chunk", 16, "--out", "runs", "-q")
    code, _, err = infoset(*asked, "--noise", "failing.py:Failing", "--dask", processes.address)

    message = "failing.py, line 5: ValueError: the table ends here; correct the file"
    assert code == 2
    assert err.count(message) == 1
    assert calls.read_text() == "called "
