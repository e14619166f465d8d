"""infoset replay: pages, animations and the terminal, from records alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.cli import main
from experiments.pages.interception import interception_page
from experiments.record_file import write_record
from experiments.scenario_file import load_scenario
from sim import Record, fly_one


@pytest.fixture(scope="module")
def record() -> Record:
    return fly_one(load_scenario("asteroid-1997-single"))


@pytest.fixture
def file(record: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_record(record, "a.npz")
    return tmp_path / "a.npz"


def replay(*arguments: object) -> int:
    with pytest.raises(SystemExit) as left:
        main(["replay", *(str(each) for each in arguments)])
    return int(left.value.code or 0)


def test_a_page_is_written_whole_and_replaced_only_when_told(
    file: Path, record: Record, capsys: pytest.CaptureFixture[str]
) -> None:
    assert replay(file, "--html", "page.html", "--quiet") == 0
    assert capsys.readouterr() == ("", "")
    assert (file.parent / "page.html").read_text(encoding="utf-8") == interception_page([record])
    assert replay(file, "--html", "page.html") == 2
    assert "--overwrite" in capsys.readouterr().err
    assert replay(file, file, "--html", "page.html", "--overwrite", "--quiet") == 0
    assert sorted(each.name for each in file.parent.iterdir()) == ["a.npz", "page.html"]


@pytest.mark.parametrize(("name", "hint"), [("page", ".html"), ("page.npz", ".html"), ("no/page.html", "no folder")])
def test_what_cannot_be_a_page_is_refused(file: Path, capsys: pytest.CaptureFixture[str], name: str, hint: str) -> None:
    assert replay(file, "--html", name) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert hint in err
    assert [each.name for each in file.parent.iterdir()] == ["a.npz"]
