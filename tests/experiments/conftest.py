"""Running commands in an empty folder; PDF files that are written quickly."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from experiments.common import figure_style
from tests.experiments.command_line import Command

FONT_TYPE = figure_style._STYLE["pdf.fonttype"]


@pytest.fixture(scope="session", autouse=True)
def pdfs_with_type_3_fonts() -> Iterator[None]:
    """Write PDF files with Type 3 fonts, which take a tenth of the time of the style's.

    `common/test_figure_style.py` tests those of the style, of the type `FONT_TYPE`. The tests of other folders import
    this fixture.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(figure_style._STYLE, "pdf.fonttype", 3)
        yield


@pytest.fixture
def infoset(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Command:
    """Run a command in an empty folder: exit code, stdout and stderr."""
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)
    return Command(capsys)


@pytest.fixture
def mine(tmp_path: Path) -> Callable[[str], Path]:
    """Write a problem file."""

    def write(text: str) -> Path:
        file = tmp_path / "mine.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return write
