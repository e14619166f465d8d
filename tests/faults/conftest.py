from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

from experiments.cli import main
from experiments.common.input_file import to_toml
from experiments.interception.record_file import load_record
from sim import Scenario
from sim.storage import CampaignFolder


@dataclass(frozen=True)
class Left:
    """How a command ended."""

    code: int
    out: str
    err: str


Infoset = Callable[..., Left]


@pytest.fixture
def file(brief: Scenario, tmp_path: Path) -> Path:
    path = tmp_path / "brief.toml"
    path.write_text(to_toml(brief))
    return path


@pytest.fixture
def infoset(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Infoset:
    """Run the command in this process, in an empty folder."""
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object) -> Left:
        with pytest.raises(SystemExit) as left:
            main([str(each) for each in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return Left(int(left.value.code or 0), captured.out, captured.err)

    return run


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 32 kB: a file of results fits, the figures do not."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=32k", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("a small tmpfs cannot be mounted here")
    yield folder
    subprocess.run(["umount", folder], check=True)


def begin(
    *arguments: object, folder: Path, environment: Mapping[str, str] | None = None, prefix: tuple[str, ...] = ()
) -> subprocess.Popen[str]:
    """Begin the command in a process of its own."""
    return subprocess.Popen(
        [*prefix, sys.executable, "-m", "experiments", *map(str, arguments)],
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
    """Check that whatever lies in a folder is whole, and nothing is left of what was being written."""
    for path in folder.rglob("*"):
        assert path.suffix != ".tmp", path
        if not path.is_file() or path.name == ".lock":
            continue
        content = path.read_bytes()
        match path.suffix:
            case ".json":
                json.loads(content)
            case ".png":
                assert content.endswith(b"IEND\xaeB`\x82"), path
            case ".pdf":
                assert content.endswith(b"%%EOF\n"), path
            case ".html":
                assert content.rstrip().endswith(b"</html>"), path
            case ".gif":
                assert content.endswith(b";"), path
            case ".parquet":
                assert content.endswith(b"PAR1"), path
            case ".npz":
                load_record(path)
            case ".csv" | ".toml":
                assert content.endswith(b"\n"), path
            case other:
                pytest.fail(f"{path}: how does a whole {other} end?")
    if (folder / "manifest.json").exists():
        CampaignFolder.read(folder).runs()


@pytest.fixture
def ordinary() -> tuple[str, ...]:
    """What makes a command one of an ordinary user, whom permissions bind: root without the rights beyond them."""
    if os.getuid() != 0:
        return ()
    prefix = ("setpriv", "--bounding-set=-dac_override,-dac_read_search,-fowner")
    if shutil.which("setpriv") is None or subprocess.run([*prefix, "true"], check=False).returncode != 0:
        pytest.skip("root may write everywhere, and cannot lay that down here")
    return prefix
