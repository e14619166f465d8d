"""infoset replay: pages and animations, from records alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from infoset.experiments.interception.figures.animation import animate
from infoset.experiments.interception.page import interception_page
from infoset.experiments.interception.record_file import write_record
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import Record, fly_one
from tests.experiments.command_line import Command
from tests.records import first_steps


@pytest.fixture(scope="module")
def record() -> Record:
    return fly_one(load_scenario("asteroid-1997-single"))


@pytest.fixture
def file(record: Record, infoset: Command, tmp_path: Path) -> Path:
    write_record(record, "a.npz")
    return tmp_path / "a.npz"


def test_page_is_replaced_only_with_overwrite(file: Path, record: Record, infoset: Command) -> None:
    record = first_steps(record, 20)
    file.unlink()
    write_record(record, file)
    assert infoset("replay", file, "--html", "page.html", "--quiet") == (0, "", "")
    assert (file.parent / "page.html").read_text(encoding="utf-8") == interception_page([record])
    assert "--overwrite" in infoset.refused("replay", file, "--html", "page.html")
    assert infoset("replay", file, file, "--html", "page.html", "--overwrite", "--quiet") == (
        0,
        "",
        "",
    )
    assert sorted(each.name for each in file.parent.iterdir()) == ["a.npz", "page.html"]


def test_animation_has_one_frame_for_each_time(record: Record, tmp_path: Path) -> None:
    short = first_steps(record, 3)
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


@pytest.mark.usefixtures("unrendered")
def test_replay_draws_figure_3_at_given_times(file: Path, tmp_path: Path, infoset: Command) -> None:
    assert infoset("replay", file, "--out", "sets", "--times", "2, 40,60,90", "-q")[0] == 0
    assert (tmp_path / "sets" / "figure-3-sets.png").is_file()
    assert "--times: could not convert" in infoset.refused(
        "replay", file, "--out", "no", "--times", "1,x"
    )
