"""--html of the commands that solve problems: a page is written whole, or nothing is."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.cli import main


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as left:
        main([str(each) for each in arguments])
    return int(left.value.code or 0)


@pytest.mark.parametrize(
    "command",
    [
        ["pareto", "pareto-2008"],
        ["multipoint", "service-3"],
        ["reach", "rendezvous-2021", "--select", "energy"],
        ["observe", "vehicle"],
    ],
)
def test_a_page_is_written(command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "page.html"
    assert run(*command, "--html", file, "--quiet") == 0
    assert capsys.readouterr() == ("", "")
    text = file.read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>")
    assert text.endswith("</html>\n")
    assert command[1] in text
    assert run(*command, "--html", file) == 2
    assert "--overwrite" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["pareto", "multipoint", "reach", "pursuit", "observe"])
def test_other_endings_are_refused_before_the_work(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(command, "--html", tmp_path / "page.pdf") == 2
    assert "must end in .html" in capsys.readouterr().err


def test_a_pursuit_is_written_and_an_escape_has_no_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("pursuit", "leo-pursuit", "--html", tmp_path / "page.html", "--quiet") == 0
    assert "leo-pursuit" in (tmp_path / "page.html").read_text(encoding="utf-8")
    stronger = ["--set", "evader.thrust_N=20", "--html", tmp_path / "none.html", "--json", tmp_path / "none.json"]
    assert run("pursuit", "leo-pursuit", *stronger, "--quiet") == 2
    assert "there is no trajectory to show" in capsys.readouterr().err
    assert [each.name for each in tmp_path.iterdir()] == ["page.html"]
