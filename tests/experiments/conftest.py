"""Running commands in an empty folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.experiments.command_line import Command


@pytest.fixture
def infoset(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Command:
    """Run a command in an empty folder: exit code, stdout and stderr."""
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)
    return Command(capsys)
