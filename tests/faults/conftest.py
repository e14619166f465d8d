from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

from infoset.experiments.common.input_file import to_toml
from infoset.experiments.interception.record_file import load_record
from infoset.sim import Scenario
from infoset.sim.storage import CampaignFolder
from tests.experiments.command_line import Command

ENDS = {
    ".png": b"IEND\xaeB`\x82",
    ".pdf": b"%%EOF\n",
    ".html": b"</html>\n",
    ".gif": b";",
    ".parquet": b"PAR1",
    ".csv": b"\n",
    ".toml": b"\n",
}
"""Last bytes of complete files."""


@dataclass(frozen=True)
class Left:
    """How a command ended."""

    code: int
    out: str
    err: str


@pytest.fixture
def file(brief: Scenario, tmp_path: Path) -> Path:
    path = tmp_path / "brief.toml"
    path.write_text(to_toml(brief))
    return path


@pytest.fixture
def infoset(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Command:
    """Run a command in this process, in an empty folder: exit code, stdout and stderr."""
    return Command.in_folder(tmp_path, capsys, monkeypatch)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 32 kB: a file of results fits, the figures do not."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=32k", "tmpfs", str(folder)]
    if (
        shutil.which("mount") is None
        or subprocess.run(command, capture_output=True, check=False).returncode != 0
    ):
        pytest.skip("a small tmpfs cannot be mounted here")
    yield folder
    subprocess.run(["umount", folder], check=True)


def begin(
    *arguments: object,
    folder: Path,
    environment: Mapping[str, str] | None = None,
    prefix: tuple[str, ...] = (),
) -> subprocess.Popen[str]:
    """Begin the command in another process."""
    return subprocess.Popen(
        [*prefix, sys.executable, "-m", "infoset", *map(str, arguments)],
        cwd=folder,
        env={**os.environ, "NO_COLOR": "1", **(environment or {})},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        encoding="utf-8",
    )


def ended(process: subprocess.Popen[str], patience_s: float = 300.0) -> Left:
    """Wait for a process."""
    try:
        out, err = process.communicate(timeout=patience_s)
    finally:
        process.kill()
    return Left(process.returncode, out, err)


def need_whole(folder: Path) -> None:
    """Check that every file in a folder is complete, and no temporary file is left."""
    for path in filter(Path.is_file, folder.rglob("*")):
        assert path.suffix != ".tmp", path
        if path.suffix == ".json":
            json.loads(path.read_bytes())
        elif path.suffix == ".npz":
            load_record(path)
        elif path.name != ".lock":
            assert path.read_bytes().endswith(ENDS[path.suffix]), path
    if (folder / "manifest.json").exists():
        assert CampaignFolder.read(folder).runs() is not None


@pytest.fixture
def ordinary() -> tuple[str, ...]:
    """A prefix that runs a command without the rights of root to ignore permissions."""
    if os.getuid() != 0:
        return ()
    prefix = ("setpriv", "--bounding-set=-dac_override,-dac_read_search,-fowner")
    if (
        shutil.which("setpriv") is None
        or subprocess.run([*prefix, "true"], check=False).returncode != 0
    ):
        pytest.skip("root cannot give up its rights here")
    return prefix
