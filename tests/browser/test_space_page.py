"""The replay page of engagements in space in a browser."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from infoset import InitialSet, Model
from infoset.experiments.interception.course import MAX_SHOWN_STEPS, complete_steps, kept_steps
from infoset.experiments.interception.page import interception_page
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Body, Record, fly_one
from infoset.sim.scenario import of_model
from tests.browser.conftest import Opened, numbers

Open = Callable[..., Opened]
STEP = 120
MEASURED = 4 * STEP + 1
IMPULSE = 4 * STEP + 2
SIX_DIGITS = 5e-6
AXES = ("y", "z")


@pytest.fixture(scope="module")
def space() -> list[Record]:
    scenario = replace(load_scenario("asteroid-1997-space"), body=Body(40.0))
    return [fly_one(replace(scenario, noise=kind)) for kind in (NoiseKind.RANDOM, NoiseKind.GAME)]


@pytest.fixture(scope="module")
def page(space: list[Record]) -> str:
    return interception_page(space[1:])


def test_both_planes_show_the_sections_of_the_record(
    open_page: Open, page: str, space: list[Record]
) -> None:
    opened = open_page(page)
    opened.page.evaluate(f"player.show({MEASURED})")
    captions = opened.page.locator("figcaption").all_inner_texts()
    for column, axis in enumerate(AXES):
        assert f"Sections of the set: line-of-sight rate ω and angle α along {axis}" in captions
        found = opened.page.evaluate(f"columns[{column}].sections.map((section) => section.points)")
        sections = space[1].sections[STEP]
        polygons = [section.omega_alpha[column] for section in sections]
        assert len(found) == len(polygons)
        for outline, polygon in zip(found, polygons, strict=True):
            wanted = polygon.polygon()
            np.testing.assert_allclose(
                outline, wanted, rtol=0.0, atol=1e-5 * np.ptp(wanted, axis=0).max()
            )


def test_the_b_plane_shows_the_predicted_misses_of_the_record(
    open_page: Open, page: str, space: list[Record]
) -> None:
    opened = open_page(page)
    opened.page.evaluate(f"player.show({MEASURED})")
    panel = "engagements[0].joint[0]"
    boxes = np.array(opened.page.evaluate(f"{panel}.rectangles(MEASURED, true)"))
    assert len(boxes) == len(space[1].sections[STEP])
    bounding = [*boxes[:, :2].min(axis=0), *boxes[:, 2:].max(axis=0)]
    ends = space[1].predicted_miss_m[STEP]
    assert bounding == ends.T.ravel().tolist()
    path = opened.page.evaluate(f"{panel}.path")
    assert path[STEP] == pytest.approx(ends.mean(axis=1).tolist(), rel=1e-12, abs=1e-9)
    assert len(path) == space[1].steps
    limits = opened.page.evaluate(f"[{panel}.chart.x, [{panel}.chart.low, {panel}.chart.high]]")
    factor = opened.page.evaluate(f"{panel}.unit[1]")
    for (low, high), (minimum, maximum) in zip(limits, ends, strict=True):
        assert low < minimum * factor
        assert high > maximum * factor
    pixels = opened.page.evaluate(
        f"(({{ left, right, top, bottom }}) => [right - left, bottom - top])({panel}.chart)"
    )
    scale = [(high - low) / length for (low, high), length in zip(limits, pixels, strict=True)]
    assert scale[0] == pytest.approx(scale[1])


@pytest.fixture(scope="module")
def long_flight() -> Record:
    """A flight of 1200 steps with four impulses, a cut-off and images in a window."""
    scenario = load_scenario("asteroid-1997-space", ["angle_sensor.period_s=1.0"])
    scenario = replace(
        scenario,
        body=Body(40.0),
        **of_model(replace(scenario.set_model, step_s=1.0 / 12.0, sections=5)),
    )
    sensor = replace(
        scenario.set_model.angle_sensor, period_s=1.0 / 12.0, first_image_s=90.0, last_image_s=2.0
    )
    model = replace(
        scenario.set_model, angle_sensor=sensor, model=Model.GUARANTEED, initial_set=InitialSet.BOX
    )
    thruster = replace(scenario.thruster, impulses_s=(60.0, 30.0, 15.0, 8.0), last_impulse_s=8.0)
    return fly_one(replace(scenario, **of_model(model), thruster=thruster, range_sensor=None))


def test_a_long_flight_is_thinned(open_page: Open, long_flight: Record, screenshots: Path) -> None:
    record = long_flight
    html = interception_page([record])
    kept = kept_steps(record)
    fired = np.flatnonzero(record.impulse_m_s.any(axis=1)).tolist()
    assert record.steps > 1000
    assert len(kept) <= MAX_SHOWN_STEPS
    assert {0, record.steps - 1, *fired} <= set(kept)
    assert 1 <= len(fired) <= 4
    assert len(html.encode()) < 4_000_000
    opened = open_page(html)
    page = opened.page
    facts = page.locator("h2 ~ p").nth(1).inner_text()
    assert facts.endswith(f"the page has {len(kept)} of {record.steps} steps")
    assert page.evaluate("DATA.records[0].fired_s") == record.time_s[fired].tolist()
    assert page.evaluate("player.frames") == 4 * len(kept)
    for frame in (*range(0, 4 * len(kept), 97), 4 * len(kept) - 1):
        page.evaluate(f"player.show({frame})")
    number = kept.index(fired[1])
    step = fired[1]
    after = fired[1] + 1
    page.evaluate(f"player.show({4 * number + 2})")
    assert opened.shown_at().endswith("before arrival), after the impulse")
    said = rows_of(opened)
    assert numbers(said["impulse modulus"]) == pytest.approx(
        [np.hypot(*record.impulse_m_s[step])], rel=SIX_DIGITS
    )
    page.wait_for_timeout(50)
    page.screenshot(path=screenshots / "space-long.png", full_page=True)
    page.evaluate(f"player.show({4 * number + 3})")
    labels = page.evaluate("columns[0].sections.map(({ label }) => label)")
    assert {section.label_m for section in record.sections[after]} <= set(labels)
    truth = [page.evaluate(f"columns[{k}].truth.angle") for k in (0, 1)]
    assert truth == record.true_angle_rad[after].tolist()


def test_the_possible_miss_and_the_projections(open_page: Open, long_flight: Record) -> None:
    record = long_flight
    opened = open_page(interception_page([record]))
    steps = kept_steps(record)
    complete = complete_steps(record)
    known = [number for number, index in enumerate(steps) if index in complete]
    kept = [steps[number] for number in known]
    assert len(kept) > 0.8 * len(steps)
    found = opened.page.evaluate("engagements[0].corridor")
    intervals = record.predicted_miss_m[kept]
    assert len(found["maximum"]) == len(steps)
    assert [number for number, value in enumerate(found["maximum"]) if value is not None] == known
    found["maximum"], found["centred"] = (
        [found[name][number] for number in known] for name in ("maximum", "centred")
    )
    np.testing.assert_allclose(found["maximum"], np.hypot(*np.abs(intervals).max(axis=2).T))
    np.testing.assert_allclose(
        found["centred"], np.hypot(*(0.5 * np.diff(intervals, axis=2)[:, :, 0].T))
    )
    np.testing.assert_allclose(found["truth"][-1], float(record.result.miss_m[0]), atol=0.05)
    for number in range(len(AXES)):
        places, truth, extents = (
            opened.page.evaluate(f"engagements[0].projections[{number}].{name}")
            for name in ("places", "truth", "extents")
        )
        np.testing.assert_allclose(10.0 ** -np.array(places), record.true_range_m[steps])
        truth, extents = ([values[number] for number in known] for values in (truth, extents))
        heights = [
            [section.polygons[number].polygon()[:, 1] for section in record.sections[step]]
            for step in kept
        ]
        ends = [(min(map(np.min, each)), max(map(np.max, each))) for each in heights]
        np.testing.assert_allclose(extents, ends, rtol=1e-6)
        inside = [low <= value <= high for value, (low, high) in zip(truth, ends, strict=True)]
        assert all(inside)


def rows_of(opened: Opened) -> dict[str, str]:
    """The numbers of the record."""
    cells = opened.page.locator("table").first.locator("th, td").all_inner_texts()
    return dict(zip(*[iter(cells)] * 2, strict=True))
