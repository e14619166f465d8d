from __future__ import annotations

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path

import pytest

from experiments.campaigns.cluster import PATIENCE_S, connected, is_open
from experiments.cli import main
from experiments.common.errors import InputError
from experiments.common.input_file import to_toml
from sim import Campaign, CampaignNoise, Scenario
from sim.storage import CampaignFolder

Infoset = Callable[..., tuple[int, str, str]]


@pytest.fixture
def infoset(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Infoset:
    """Run the command in an empty folder: exit code, stdout and stderr."""
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as left:
            main([str(each) for each in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return int(left.value.code or 0), captured.out, captured.err

    return run


@contextlib.contextmanager
def listening(answer: bytes | None) -> Iterator[str]:
    """Something that listens and is no scheduler: it says nothing, or this."""
    kept = []

    def accept(server: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = server.accept()
                kept.append(connection)
                if answer is not None:
                    connection.sendall(answer)

    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=accept, args=(server,), daemon=True)
        thread.start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)
        thread.join()
    for each in kept:
        each.close()


def refused(address: str) -> tuple[str, float]:
    """Why a cluster is refused, and after how long."""
    began_s = time.monotonic()
    with pytest.raises(InputError) as why, connected(address):
        pytest.fail("there is no cluster")
    return str(why.value), time.monotonic() - began_s


@pytest.mark.parametrize(
    "address",
    [
        "",
        "localhost",
        "localhost:8786",
        "http://h:1",
        "tcp://h",
        "tcp://h:0",
        "tcp://h:99999",
        "tcp://a b:1",
        "tcp://:1",
    ],
)
def test_what_is_no_address(address: str) -> None:
    assert "must be an address such as tcp://host:8786" in refused(address)[0]


def test_nobody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    said, after_s = refused(f"tcp://127.0.0.1:{port}")
    assert f"no Dask scheduler answers at tcp://127.0.0.1:{port} (Connection refused)" in said
    assert "dask scheduler" in said
    assert after_s < 10.0


def test_there_is_no_such_host() -> None:
    assert (
        "no Dask scheduler answers at tcp://no-such-host.invalid:8786" in refused("tcp://no-such-host.invalid:8786")[0]
    )


@pytest.mark.parametrize("answer", [None, b"HTTP/1.1 400 Bad Request\r\n\r\n" + b" " * 200, b"\x00" * 64])
def test_something_else_listens(answer: bytes | None, monkeypatch: pytest.MonkeyPatch) -> None:
    assert PATIENCE_S < 10.0
    monkeypatch.setattr("experiments.campaigns.cluster.PATIENCE_S", PATIENCE_S / 4.0)
    with listening(answer) as address:
        said, after_s = refused(address)
    assert f"no Dask scheduler answers at {address}" in said
    assert after_s < 10.0


def test_tls_without_certificates() -> None:
    with listening(None) as address:
        said, after_s = refused(address.replace("tcp", "tls"))
    assert "no Dask scheduler answers at tls://" in said
    assert after_s < 10.0


@pytest.mark.parametrize(
    ("address", "warned"),
    [
        ("tcp://127.0.0.1:8786", False),
        ("tcp://localhost:8786", False),
        ("tcp://[::1]:8786", False),
        ("tls://10.0.0.1:8786", False),
        ("tcp://10.0.0.1:8786", True),
        ("tcp://[2001:db8::1]:8786", True),
        ("tcp://localhost.example:8786", True),
        ("nothing", False),
    ],
)
def test_an_open_scheduler_is_warned_of(
    address: str, warned: bool, infoset: Infoset, brief: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(given: str) -> None:
        raise InputError(f"asked for {given}")

    assert is_open(address) == warned
    (tmp_path / "brief.toml").write_text(to_toml(brief))
    monkeypatch.setattr("experiments.campaigns.cluster.connected", refuse)
    code, _, err = infoset("campaign", "brief.toml", "--runs", 8, "--out", "runs", "--dask", address)
    assert code == 2
    assert f"asked for {address}" in err
    assert ("everyone who reaches that address can run programs there" in err) == warned


class Processes:
    """A Dask scheduler and workers, each a process of its own on the loopback."""

    def __init__(self, folder: Path, protocol: str = "tcp") -> None:
        self.folder = folder
        self.stack = contextlib.ExitStack()
        with socket.create_server(("127.0.0.1", 0)) as server:
            port = server.getsockname()[1]
        self.address = f"{protocol}://127.0.0.1:{port}"
        self.scheduler = self.start("scheduler", "--host", "127.0.0.1", "--port", str(port), "--protocol", protocol)

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
        log = self.stack.enter_context((self.folder / f"{what}-{time.monotonic_ns()}.log").open("wb"))
        process = subprocess.Popen(command, stdout=log, stderr=log, env={**os.environ, **environment}, cwd=self.folder)
        self.stack.callback(process.wait)
        self.stack.callback(process.kill)
        return process

    def worker(self, **environment: str) -> subprocess.Popen[bytes]:
        return self.start(
            "worker", self.address, "--nworkers", "1", "--nthreads", "1", "--no-nanny", "--local-directory", "space",
            **environment,
        )  # fmt: skip

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


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")  # of the cluster's own client
def test_two_workers_give_the_same_bits_and_one_that_dies_loses_nothing(
    infoset: Infoset, brief: Scenario, processes: Processes, tmp_path: Path
) -> None:
    (tmp_path / "brief.toml").write_text(to_toml(brief))
    workers = [processes.worker(), processes.worker()]
    processes.wait_for(2)
    options = ("--model", "paper", "--noise", "mixed", "--chunk", 16, "--dask", processes.address)
    asked = ("campaign", "brief.toml", *options, "--out")
    code, out, err = infoset(*asked, "two", "--runs", 400)
    assert (code, err) == (0, "2 Dask workers, 2 threads\nwrote shards, scenario.toml, summary.json in two\n")
    assert "400 runs" in out
    expected = Campaign(brief, 4000, tmp_path / "here", noise=CampaignNoise.MIXED).run().table
    assert CampaignFolder.read(tmp_path / "two").table().equals(expected.slice(0, 400))

    def kill() -> None:
        shards = tmp_path / "killed" / "shards"
        while not shards.is_dir() or len(list(shards.glob("*.parquet"))) < 20:
            time.sleep(0.02)
        workers[0].kill()

    killer = threading.Thread(target=kill)
    killer.start()
    assert infoset(*asked, "killed", "--runs", 4000, "-q") == (0, "", "")
    killer.join()
    assert workers[0].wait() != 0
    assert CampaignFolder.read(tmp_path / "killed").table().equals(expected)


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")
def test_a_scheduler_that_dies_is_one_message_and_the_campaign_goes_on_without(
    brief: Scenario, processes: Processes, tmp_path: Path
) -> None:
    (tmp_path / "brief.toml").write_text(to_toml(brief))
    processes.worker()
    processes.wait_for(1)
    asked = ["campaign", "brief.toml", "--model", "paper", "--runs", "6000", "--chunk", "16", "--out", "runs", "-q"]
    command = [sys.executable, "-m", "experiments", *asked]
    with subprocess.Popen(
        [*command, "--dask", processes.address], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    ) as process:
        shards = tmp_path / "runs" / "shards"
        while not shards.is_dir() or len(list(shards.glob("*.parquet"))) < 10:
            assert process.poll() is None
            time.sleep(0.05)
        processes.scheduler.kill()
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert errors.startswith("error: ")
    assert errors.count("\n") == 1
    assert "continue with --resume" in errors
    there = CampaignFolder.read(tmp_path / "runs")
    assert there.damaged == []
    assert 160 <= there.finished_runs < 6000
    result = Campaign(brief, 6000, tmp_path / "runs", chunk=16).run(resume=True)
    assert result.complete


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")
def test_workers_of_another_version_and_no_workers_at_all(
    infoset: Infoset, brief: Scenario, processes: Processes, tmp_path: Path
) -> None:
    (tmp_path / "brief.toml").write_text(to_toml(brief))
    asked = ("campaign", "brief.toml", "--runs", 16, "--out", "runs", "--dask", processes.address)
    began_s = time.monotonic()
    code, _, err = infoset(*asked)
    assert code == 2
    assert "has no workers; start some with: dask worker" in err
    assert time.monotonic() - began_s < 12.0
    old = tmp_path / "old" / "infoset-0.0.1.dist-info"
    old.mkdir(parents=True)
    (old / "METADATA").write_text("Metadata-Version: 2.1\nName: infoset\nVersion: 0.0.1\n")
    processes.worker(PYTHONPATH=str(tmp_path / "old"))
    processes.wait_for(1)
    code, _, err = infoset(*asked)
    assert code == 2
    assert f"infoset {version('infoset')} here, 0.0.1 there" in err
    assert not (tmp_path / "runs").exists()


@pytest.mark.thorough
@pytest.mark.filterwarnings("default")
@pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl, to make a certificate")
def test_an_encrypted_cluster_flies_and_lets_nobody_else_in(
    infoset: Infoset, brief: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As docs/campaigns.md says: one certificate for all, named in Dask's configuration."""
    import dask

    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=infoset"),
            *("-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(certificate)),
        ],
        check=True,
        capture_output=True,
    )
    names = {"DASK_DISTRIBUTED__COMM__TLS__CA_FILE": certificate}
    for who in ("SCHEDULER", "WORKER", "CLIENT"):
        names |= {
            f"DASK_DISTRIBUTED__COMM__TLS__{who}__CERT": certificate,
            f"DASK_DISTRIBUTED__COMM__TLS__{who}__KEY": key,
        }
    for name, path in names.items():
        monkeypatch.setenv(name, str(path))
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION", "True")
    (tmp_path / "brief.toml").write_text(to_toml(brief))
    asked = ("campaign", "brief.toml", "--model", "paper", "--runs", 64, "--chunk", 16, "--dask")
    found = Processes(tmp_path, "tls")
    with found.stack:
        found.wait_until_up()
        found.worker()
        # What stands in the environment is put into the configuration, beside the defaults, not in their place.
        with dask.config.set(dask.config.merge(dask.config.config, dask.config.collect_env())):
            found.wait_for(1)
            code, _, err = infoset(*asked, found.address, "--out", "runs")
        assert (code, err) == (0, "1 Dask workers, 1 threads\nwrote shards, scenario.toml, summary.json in runs\n")
        for address in (found.address, found.address.replace("tls", "tcp")):  # without a certificate, unencrypted
            code, out, err = infoset(*asked, address, "--out", "others")
            assert (code, out) == (2, "")
            assert err.startswith("error: --dask: no Dask scheduler answers at")
    expected = Campaign(brief, 64, tmp_path / "here").run().table
    assert CampaignFolder.read(tmp_path / "runs").table().equals(expected)
    assert not (tmp_path / "others").exists()
