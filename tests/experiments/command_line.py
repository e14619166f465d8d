"""The command `infoset` in tests."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from infoset.experiments.cli import main


class Command:
    """Runs commands in this process."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    @classmethod
    def in_folder(
        cls, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> Command:
        """Commands in a folder, with a clock that stands: stderr has no times, which depend on the
        machine.
        """
        monkeypatch.setattr("infoset.experiments.common.screen.progress_clock", lambda: 0.0)
        monkeypatch.setenv("NO_COLOR", "1")
        monkeypatch.setenv("COLUMNS", "100")
        monkeypatch.chdir(folder)
        return cls(capsys)

    def __call__(self, *arguments: object) -> tuple[int, str, str]:
        """Exit code, stdout and stderr."""
        with pytest.raises(SystemExit) as left:
            main([str(each) for each in arguments])
        captured = self._capsys.readouterr()
        assert "Traceback" not in captured.err
        return int(left.value.code or 0), captured.out, captured.err

    def refused(self, *arguments: object) -> str:
        """The one message of a command that must be refused: ours, or Typer's after a line of
        usage.
        """
        code, out, err = self(*arguments)
        assert (code, out) == (2, "")
        assert err.startswith(("error: ", "Usage: "))
        assert err.lower().count("error: ") == 1
        return err

    def json(self, *arguments: object) -> Any:
        """The results of a command as JSON."""
        code, out, _ = self(*arguments, "--json", "-")
        assert code == 0
        return strict(out)


def strict(text: str) -> Any:
    """Return JSON without NaN and infinity as values."""
    return json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
