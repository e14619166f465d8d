"""Proved wrong images on the screen, in JSON, in a figure and on the page."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.lines import Line2D

from infoset import Model
from infoset.experiments.interception.course import complete_steps, true_predicted_misses
from infoset.experiments.interception.figures.members import draw_members
from infoset.experiments.interception.figures.sets import planes_at
from infoset.experiments.interception.member_course import MemberCourse, member_courses
from infoset.experiments.interception.page import interception_page
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import Record, WrongImages, fly_one
from tests.experiments.command_line import Command

ALLOWED = ("--set", "information_set.model=guaranteed", "--set", "information_set.wrong_images=1")
SEVERAL = 11
"""Run in which several images are suspected first, see docs/wrong-images.md."""
PROVED = 50
NAMED = 56
"""Steps at which a wrong image is proved, and at which only one is suspected."""


@pytest.fixture(scope="module")
def record() -> Record:
    scenario = load_scenario("asteroid-1997")
    settings = replace(scenario.information_set, model=Model.GUARANTEED, wrong_images=1)
    wrong = WrongImages(1, size=(1.2, 1.4))
    return fly_one(replace(scenario, information_set=settings, wrong_images=wrong), SEVERAL)


@pytest.fixture(scope="module")
def courses(record: Record) -> list[MemberCourse]:
    return member_courses(record)


def test_members_end_at_their_refutation_or_division(courses: list[MemberCourse]) -> None:
    of_classes = [course for course in courses if course.group is None]
    of_images = [course for course in courses if course.group is not None]
    assert [course.steps for course in of_classes] == [range(PROVED)] * 4
    assert sum(course.is_refuted for course in of_classes) == 1
    assert [(course.group, course.is_refuted) for course in of_images] == [
        ((13,), True),
        ((36,), True),
        ((50,), False),
    ]
    assert [course.steps.start for course in of_images] == [PROVED] * 3
    assert [course.steps.stop for course in of_images[:2]] == [NAMED] * 2


def test_interval_of_the_set_is_that_of_all_members(
    record: Record, courses: list[MemberCourse]
) -> None:
    for step in range(record.steps):
        intervals_m = [
            course.intervals_m[step - course.first] for course in courses if step in course.steps
        ]
        if not intervals_m:
            assert np.isnan(record.predicted_miss_m[step]).all()
            continue
        assert np.min(intervals_m) == record.predicted_miss_m[step].min()
        assert np.max(intervals_m) == record.predicted_miss_m[step].max()


def test_complete_steps_do_not_depend_on_the_order_of_the_members() -> None:
    scenario = load_scenario("asteroid-1997-single")
    settings = replace(scenario.information_set, model=Model.GUARANTEED, wrong_images=1)
    record = fly_one(replace(scenario, information_set=settings))
    complete = complete_steps(record)
    assert 0 < len(complete) < record.steps

    others_first = tuple(sections[::-1] for sections in record.sections)
    reordered = replace(record, sections=others_first)
    np.testing.assert_array_equal(complete_steps(reordered), complete)


def test_figure_of_the_sets_draws_the_sections_of_every_member(record: Record) -> None:
    """Before a wrong image is proved, the set is the union of four members, of which not every one
    contains the true state.
    """
    time_s = float(record.time_s[PROVED - 1])
    (plane,) = planes_at([record], time_s, 3)
    assert len(plane.chosen) == 4 * 3
    ranges_m = [section.range_m for section in plane.chosen]
    assert ranges_m == sorted(ranges_m)

    for member in range(4):
        of_set = [each for each in record.sections[PROVED - 1] if each.member == member]
        drawn = [each for each in plane.chosen if each.member == member]
        assert (drawn[0], drawn[-1]) == (of_set[0], of_set[-1])


def test_set_without_wrong_images_has_no_members() -> None:
    assert member_courses(fly_one(load_scenario("asteroid-1997-single"))) == []


def test_figure_has_two_lines_of_each_member_and_marks_of_the_refuted_ones(
    record: Record, courses: list[MemberCourse]
) -> None:
    (axes,) = draw_members([record]).axes
    lines: dict[str, list[Line2D]] = {}
    for line in axes.lines:
        lines.setdefault(str(line.get_label()), []).append(line)
    assert len(lines["set without a class of images"]) == 2 * 4
    assert len(lines["set without suspected images"]) == 2 * 3
    assert len(lines["set refuted by the next image"]) == 3

    last = courses[-1]
    (_, upper) = lines["set without suspected images"][-2:]
    expected = np.array(last.intervals_m)[:, 0, 1] - true_predicted_misses(record)[last.steps, 0]
    np.testing.assert_array_equal(np.asarray(upper.get_ydata()), expected)


def test_page_has_the_members_only_if_images_may_be_wrong(record: Record) -> None:
    def data(shown: Record) -> dict[str, object]:
        found = re.search(
            r'type="application/json"[^>]*>(.*?)</script>', interception_page([shown])
        )
        assert found is not None
        loaded: dict[str, object] = json.loads(found[1])["records"][0]
        return loaded

    members = data(record)["axes"][0]["members"]  # type: ignore[index]
    assert len(members) == 7
    assert sum(member["refuted"] for member in members) == 3
    assert data(record)["wrong_image_proved_s"] == 25.0

    ordinary = data(fly_one(load_scenario("asteroid-1997-single")))
    assert ordinary["axes"][0]["members"] == []  # type: ignore[index]
    assert ordinary["wrong_image_proved_s"] is None


@pytest.mark.parametrize(
    ("number", "line"),
    [
        (0, "at most 1 wrong image assumed; none is proved"),
        (1, "at most 1 wrong image assumed; a wrong image is proved at 85 s: the image at 85 s"),
        (
            3,
            "a wrong image is proved at 39.5 s, and the set became empty at 85 s: more images are "
            "wrong, or another assumption does not hold",
        ),
    ],
)
def test_engage_says_which_image_is_wrong(number: int, line: str, infoset: Command) -> None:
    wrong = ("--set", f"wrong_images.number={number}")
    code, out, _ = infoset("engage", "asteroid-1997-single", *ALLOWED, *wrong)
    assert code == 0
    assert line in out


def test_json_of_engage_has_the_times_of_the_suspected_images(infoset: Command) -> None:
    found = infoset.json(
        *("engage", "asteroid-1997-single", *ALLOWED, "--set", "wrong_images.number=1"),
        *("--json", "-"),
    )
    assert found["suspected_s"] == [85.0]
    assert found["wrong_image_proved_s"] == 85.0
    assert found["suspected_images"] == 1
    assert found["wrong_image_s"] == 85.0
    assert "suspected_s" not in infoset.json("engage", "asteroid-1997-single", "--json", "-")


def test_experiment_counts_the_runs_with_a_proof(infoset: Command) -> None:
    wrong = ("--set", "wrong_images.number=1")
    code, out, _ = infoset("experiment", "asteroid-1997-single", "--runs", 3, *ALLOWED, *wrong)
    assert code == 0
    assert "curve 1: at most 1 wrong image assumed; proved in 3 of 3 runs, named in 3" in out
