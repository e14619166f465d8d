"""Disks that are full, and folders that may not be written."""

from __future__ import annotations

import errno
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from experiments.common.errors import InputError
from experiments.common.figure_style import new_figure
from experiments.common.output import Output
from tests.faults.conftest import Infoset, Left, begin, ended, need_whole

pytestmark = pytest.mark.thorough

COMMANDS = {
    "experiment": ("experiment", "brief.toml", "--runs", 2),
    "compare": ("compare", "brief.toml", "--model", "paper", "--runs", 2, "--strategies", "patient"),
    "bound": ("bound", "brief.toml", "--model", "paper", "--strategies", "patient", "--budget", 4),
    "engage": ("engage", "brief.toml"),
    "pareto": ("pareto",),
    "multipoint": ("multipoint",),
    "reach": ("reach",),
    "pursuit": ("pursuit",),
}
QUICK = ("experiment", "pareto")


def slow_but(*quick: str) -> list[object]:
    return [name if name in quick else pytest.param(name, marks=pytest.mark.thorough) for name in COMMANDS]


def refused(left: Left) -> str:
    """The one message of a command that ended as it should."""
    assert (left.code, left.out) == (2, "")
    said = [line for line in left.err.splitlines() if not line.startswith(("compiling", "warning: "))]
    assert len(said) == 1
    assert said[0].startswith("error: ")
    return said[0]


@pytest.mark.parametrize("name", slow_but(*QUICK))
def test_a_full_disk(name: str, infoset: Infoset, file: Path, small_disk: Path) -> None:
    left = infoset(*COMMANDS[name], "--out", small_disk / "o")
    message = refused(left)
    assert "No space left on device" in message
    assert str(small_disk / "o") in message
    need_whole(small_disk)


def test_a_report_on_a_full_disk(infoset: Infoset, file: Path, small_disk: Path) -> None:
    assert infoset("campaign", file, "--runs", 32, "--out", "flown", "-q").code == 0
    assert "No space left on device" in refused(infoset("report", "flown", "--out", small_disk / "o"))
    need_whole(small_disk)


@pytest.mark.parametrize("page", ["--html", pytest.param("--gif", marks=pytest.mark.thorough)])
def test_a_page_or_a_film_that_does_not_fit(page: str, infoset: Infoset, file: Path, small_disk: Path) -> None:
    assert infoset("engage", file, "--record", "flight.npz", "-q").code == 0
    (small_disk / "filler").write_bytes(b"\0" * 27_000)
    left = infoset("replay", "flight.npz", page, small_disk / f"page.{page[2:]}")
    assert "No space left on device" in refused(left)
    assert [each.name for each in small_disk.iterdir()] == ["filler"]


@pytest.mark.skipif(not hasattr(resource, "RLIMIT_FSIZE"), reason="there are no such limits")
def test_files_that_may_not_be_so_large(file: Path, tmp_path: Path) -> None:
    """Where nobody may mount anything: what does not fit is refused by the system, with EFBIG."""
    code = (
        "import resource, signal\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "from experiments.cli import main\n"
        "main(['pareto', '--out', 'o'])\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "File too large" in refused(Left(done.returncode, done.stdout, done.stderr))
    need_whole(tmp_path)


@pytest.mark.skipif(shutil.which("setpriv") is None and os.getuid() == 0, reason="root may write everywhere")
@pytest.mark.parametrize("name", [*COMMANDS, "campaign", "sweep"])
def test_a_folder_that_may_not_be_written(name: str, file: Path, tmp_path: Path, ordinary: tuple[str, ...]) -> None:
    sealed = tmp_path / "sealed"
    sealed.mkdir(mode=0o500)
    others = {
        "campaign": ("campaign", "brief.toml", "--model", "paper", "--runs", 8),
        "sweep": ("sweep", "brief.toml", "--model", "paper", "--runs", 8, "--vary", "thruster.budget_m_s=100:200:2"),
    }
    command = {**COMMANDS, **others}[name]
    for out in (sealed, sealed / "o"):
        message = refused(ended(begin(*command, "--out", out, folder=tmp_path, prefix=ordinary)))
        assert "Permission denied" in message
    assert list(sealed.iterdir()) == []


def test_a_figure_replaces_the_one_before_only_when_it_is_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    figure = new_figure(height_mm=20.0, width_mm=20.0)
    Output(tmp_path, {}, overwrite=True).figure("figure", figure)
    before = {each.name: each.read_bytes() for each in tmp_path.iterdir()}
    figure.text(0.5, 0.5, "another")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match="No space left on device"):
        Output(tmp_path, {}, overwrite=True).figure("figure", figure)
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == before


@pytest.mark.parametrize(
    ("error", "parts"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "/home/x/.cache/k.nbi"), ["k.nbi: No space left", "disk"]),
        (OSError(errno.EIO, "Input/output error"), ["Input/output error", "check the disk"]),
        (
            MemoryError("Unable to allocate 9 GiB"),
            ["Not enough memory (Unable to allocate 9 GiB). Free some memory"],
        ),
    ],
)
def test_what_nobody_has_made_a_message_of(
    error: Exception, parts: list[str], infoset: Infoset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that fills up while Numba stores a kernel, or memory that ends in the middle of a command."""

    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("experiments.interception.scenario_file.load_scenario", fail)
    message = refused(infoset("engage"))
    for part in parts:
        assert part in message
