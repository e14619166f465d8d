"""Running commands in an empty folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from infoset.experiments.common.input_file import to_toml
from infoset.sim import Scenario
from tests.experiments.command_line import Command
from tests.space import in_space


@pytest.fixture
def infoset(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Command:
    """Run a command in this process, in an empty folder: exit code, stdout and stderr."""
    return Command.in_folder(tmp_path, capsys, monkeypatch)


@pytest.fixture
def unrendered(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw figures, but write empty files, in tests that do not look at these files; with
    `rendered`, write them.

    Writing takes most of the time of a figure. Each kind of figure is written by some test.
    """
    if "rendered" not in request.fixturenames:
        empty = [("pdf", b""), ("png", b"")]
        monkeypatch.setattr(
            "infoset.experiments.common.figure_style.figure_bytes", lambda _figure: empty
        )


@pytest.fixture
def rendered() -> None:
    """Write the figures of a test in a module that otherwise does not write them."""


@pytest.fixture
def mine(tmp_path: Path) -> Callable[[str], Path]:
    """Write a problem file."""

    def write(text: str) -> Path:
        file = tmp_path / "mine.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return write


@pytest.fixture
def file(brief: Scenario, infoset: Command, tmp_path: Path) -> Path:
    """The scenario `brief` as a file in the empty folder."""
    path = tmp_path / "brief.toml"
    path.write_text(to_toml(brief))
    return path


@pytest.fixture
def space_file(brief: Scenario, tmp_path: Path) -> Path:
    """The scenario `brief` in space as a file."""
    path = tmp_path / "space.toml"
    path.write_text(to_toml(in_space(brief)))
    return path
