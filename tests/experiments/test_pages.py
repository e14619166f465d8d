"""Pages as text: what is in them, what is not, and that their colours can be told apart.
tests/browser opens them.
"""

from __future__ import annotations

import base64
import hashlib
import html
import itertools
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from infoset import InitialSet, Model, RateSensor, Recovery
from infoset.experiments.common.page_document import embedded_json, page
from infoset.experiments.interception.page import (
    OUTLINE_TOLERANCE,
    STEPS_OF_A_BOX,
    computed_again,
    interception_page,
    packed_outlines,
)
from infoset.experiments.interception.record_file import replayed
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Outcome, Record, fly_one
from infoset.sim.scenario import of_model

MAX_BYTES = 6_000_000


@pytest.fixture(scope="module")
def record() -> Record:
    return fly_one(load_scenario("asteroid-1997-single"))


@given(
    st.recursive(
        st.text() | st.floats(allow_nan=False, allow_infinity=False),
        lambda each: st.lists(each, max_size=3),
    )
)
def test_embedded_json_reads_back_and_cannot_end_its_block(value: object) -> None:
    text = embedded_json({"value": value, "more": "</script>\u2028&"})
    assert not re.search("[<>&\u2028\u2029]", text)
    assert json.loads(text)["value"] == value


def test_the_policy_names_each_script_and_the_style_and_nothing_else() -> None:
    text = page("A <b>title</b>", ["sets.js"], {"heading": "h", "about": []})
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', text)
    assert policy.startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in policy
    scripts = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    styles = re.findall(r"<style>(.*?)</style>", text, flags=re.DOTALL)
    assert len(scripts) == 5
    for code in scripts + styles:
        assert base64.b64encode(hashlib.sha256(code.encode()).digest()).decode() in policy
    assert policy.count("sha256-") == 6
    assert f"<title>{html.escape('A <b>title</b>')}</title>" in text


def test_a_page_is_small_and_fetches_nothing(record: Record) -> None:
    text = interception_page([record, replace(record, run=1)])
    assert len(text.encode()) < MAX_BYTES
    code = re.sub(r'<script type="application/json".*?</script>', "", text, flags=re.DOTALL)
    assert not re.search(
        r"https?:|src=|href=|@import|url\(|innerHTML|outerHTML|document\.write|eval\(", code
    )


def flown(name: str) -> Record:
    """Engagements of every kind: two noises, a set that is lost and recovered, the guaranteed
    model, a rate sensor.
    """
    scenario = load_scenario("asteroid-1997")
    model = scenario.set_model
    if name == "guaranteed":
        sound = replace(model, model=Model.GUARANTEED, initial_set=InitialSet.BOX)
        return fly_one(replace(scenario, **of_model(sound), rate_sensor=RateSensor(1.0, 2e-6)))
    if name == "space":
        space = load_scenario("asteroid-1997-space")
        sound = replace(space.set_model, model=Model.GUARANTEED, initial_set=InitialSet.BOX)
        return fly_one(replace(space, **of_model(sound), rate_sensor=RateSensor(1.0, 2e-6)))
    if name == "game":
        return fly_one(replace(scenario, noise=NoiseKind.GAME))
    recovery = Recovery.NONE if name == "lost" else Recovery.WIDENED
    return fly_one(
        replace(scenario, noise=NoiseKind.GAME, **of_model(replace(model, recovery=recovery))), 2
    )


@pytest.mark.parametrize("name", ["game", "guaranteed", "lost", "recovered", "space"])
def test_replaying_gives_the_recorded_sets_bit_for_bit(name: str) -> None:
    record = flown(name)
    assert (record.result.outcomes[0] is Outcome.SET_EMPTY) == (name in ("lost", "recovered"))
    after = itertools.islice(
        replayed(record.scenario, record.measured, record.impulse_m_s), 1, None, 2
    )
    for information, sections in zip(after, record.sections, strict=True):
        for found, recorded in zip(information.sections(), sections, strict=True):
            assert (found.label_m, found.range_m) == (recorded.label_m, recorded.range_m)
            np.testing.assert_array_equal(found.polygons.vertices, recorded.polygons.vertices)
    _, misses_m = computed_again(record, range(record.steps))
    for step, interval in enumerate(record.predicted_miss_m):
        assert np.isnan(interval).all() == (not misses_m[step].size)
        if misses_m[step].size:
            ends = np.stack(
                [misses_m[step][..., 0].min(axis=1), misses_m[step][..., 1].max(axis=1)], axis=1
            )
            np.testing.assert_array_equal(interval, ends)


@pytest.mark.parametrize("kind", list(Model))
def test_predicted_section_contains_the_measured_section(kind: Model) -> None:
    scenario = load_scenario("asteroid-1997")
    initial = InitialSet.BOX if kind is Model.GUARANTEED else InitialSet.RECTANGLE
    model = replace(scenario.set_model, model=kind, initial_set=initial)
    flown = fly_one(replace(scenario, **of_model(model)))
    predicted, _ = computed_again(flown, range(flown.steps))
    for step in range(0, flown.steps, 20):
        before = {section.label_m: section.polygons[0] for section in predicted[step]}
        for section in flown.sections[step]:
            if section.label_m in before:
                points = section.polygons[0].polygon()
                scale = np.abs(points).max()
                assert all(
                    before[section.label_m].margin(point) >= -1e-9 * scale for point in points
                )


def test_outlines_keep_their_boxes_exactly() -> None:
    outline = np.array([[1e-9, 3.0], [2e-9, 5.0], [1.75e-9, 7.0]])
    packed = packed_outlines([outline, np.array([[4.0, 4.0]])])
    boxes = np.frombuffer(base64.b64decode(packed["boxes"])).reshape(-1, 4)
    assert boxes.tolist() == [[1e-9, 3.0, 2e-9, 7.0], [4.0, 4.0, 4.0, 4.0]]
    grid = np.frombuffer(base64.b64decode(packed["vertices"]), dtype="<u2").reshape(-1, 2)
    assert grid.tolist() == [[0, 0], [STEPS_OF_A_BOX, 32768], [49151, STEPS_OF_A_BOX], [0, 0]]


def test_outlines_of_long_flights_have_few_vertices() -> None:
    turns = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    circle = np.column_stack([np.cos(turns), np.sin(turns)])
    triangle = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]])
    packed = packed_outlines(
        [circle, triangle, triangle[:1], triangle[:2], circle], OUTLINE_TOLERANCE
    )
    counts = np.frombuffer(base64.b64decode(packed["counts"]), dtype="<u4")
    assert counts[1:4].tolist() == [3, 1, 2]
    assert 20 < counts[0] == counts[4] < 150
    grid = np.frombuffer(base64.b64decode(packed["vertices"]), dtype="<u2").reshape(-1, 2)[
        : counts[0]
    ]
    drawn = 2.0 * grid / STEPS_OF_A_BOX - 1.0
    chords = 0.5 * (drawn + np.roll(drawn, 1, axis=0))
    assert np.hypot(*chords.T).min() > 1.0 - 2.0 * OUTLINE_TOLERANCE - 1e-4
    boxes = np.frombuffer(base64.b64decode(packed["boxes"])).reshape(-1, 4)
    np.testing.assert_allclose(boxes[0], [-1.0, -1.0, 1.0, 1.0])
