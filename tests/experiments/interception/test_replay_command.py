"""infoset replay: pages and animations, from records alone."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from experiments.cli import main
from experiments.interception.figures.animation import animate
from experiments.interception.page import interception_page
from experiments.interception.record_file import write_record
from experiments.interception.scenario_file import load_scenario
from sim import Record, fly_one
from tests.experiments.command_line import Command


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
    record = shortened(record, 20)
    file.unlink()
    write_record(record, file)
    assert replay(file, "--html", "page.html", "--quiet") == 0
    assert capsys.readouterr() == ("", "")
    assert (file.parent / "page.html").read_text(encoding="utf-8") == interception_page([record])
    assert replay(file, "--html", "page.html") == 2
    assert "--overwrite" in capsys.readouterr().err
    assert replay(file, file, "--html", "page.html", "--overwrite", "--quiet") == 0
    assert sorted(each.name for each in file.parent.iterdir()) == ["a.npz", "page.html"]


def shortened(record: Record, steps: int) -> Record:
    """The first steps of an engagement."""
    return replace(record, steps=record.steps[:steps])


def test_an_animation_has_a_picture_a_moment(record: Record, tmp_path: Path) -> None:
    short = shortened(record, 3)
    told: list[float] = []
    file = tmp_path / "a.gif"
    file.write_bytes(animate([short, short], progress=told.append))
    with Image.open(file) as found:
        assert found.n_frames == 3  # type: ignore[attr-defined]
        pictures = []
        for index in range(3):
            found.seek(index)
            pictures.append(np.asarray(found.convert("RGB")))
    assert told == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert pictures[0].shape[1] > pictures[0].shape[0]
    assert (pictures[0] != pictures[2]).any()


def test_frames_and_width_of_an_animation_make_it_small(record: Record, tmp_path: Path) -> None:
    sizes = []
    for frames, width in ((6, 425), (3, 250)):
        content = animate([record], frames, width)
        with Image.open(BytesIO(content)) as found:
            assert (found.n_frames, found.size[0]) == (frames, width)  # type: ignore[attr-defined]
            assert sum(1 for _ in found.getcolors() or ()) <= 16
        sizes.append(len(content))
    assert sizes[0] < 6 * 17_000
    assert sizes[1] < 0.4 * sizes[0]


@pytest.mark.usefixtures("unrendered")
def test_figure_3_at_other_times(file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert replay(file, "--out", "sets", "--times", "2, 40,60,90", "-q") == 0
    assert (tmp_path / "sets" / "figure-3-sets.png").is_file()
    for times, part in (("1,x", "could not convert"), ("-1", "times must be"), ("1," * 12 + "1", "at most 12")):
        assert replay(file, "--out", "no", "--times", times) == 2
        assert f"--times: {part}" in capsys.readouterr().err


def test_times_that_draw_nothing_are_refused(infoset: Command, brief_file: Path) -> None:
    code, _, err = infoset("engage", brief_file, "--times", "1")
    assert (code, "--times: chooses the sets of figure 3, which only --out DIR writes" in err) == (2, True)
