"""Sections of a window of labels contain every motion whose label is in the window, and the
sections of its labels.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from infoset import AngleSensor, InformationSet, InitialSet, Model, SetModel, StateBox
from infoset.engine import chains, replays, workspace
from infoset.engine.section_law import law_of
from infoset.engine.section_life import NEVER_EMPTIED, time_to_go
from infoset.engine.workspace import LAST_REPLAY, Past, past_of
from infoset.kernels import JIT

SPEED, STEP, STEPS = 58e3, 0.5, 190
ANGLE_ERROR, RATE_ERROR, PUSH = 2.3e-4, 1e-5, 0.02


def _extremes(label: float, near: float, far: float, past: Past) -> Any:
    """Return the extremes of the predicted miss in the section of a label in a window, displaced by
    (13).

    If the replay of the window is thinned, it applies the measurements that have cut the sections
    of three of its labels.
    """
    workspace.select(past, 0)
    if past.thinned:
        for each in (near, 0.5 * (near + far), far):
            replays.run(each, workspace.with_window(past, np.inf, -np.inf))
    window = Past(past.log, past.errors, past.laws, past.room, near, far, past.thinned)
    emptied_at = replays.run(label, window).emptied_at
    law = law_of(past.laws, 0)
    middle = workspace.middle_label(label, window)
    section = workspace.replayed_section(window, 0, LAST_REPLAY, middle)
    upper, lower = chains.max_and_min_miss(section, time_to_go(middle, past.log.elapsed, law))
    turn = past.room.drifts[0, 0] * (label - middle) / law.closing_speed
    return (
        emptied_at == NEVER_EMPTIED,
        lower - turn - past.room.drifts[0, 1],
        upper - turn + past.room.drifts[0, 1],
    )


extremes = JIT(_nrt=False)(_extremes)


def flight(seed: int, rate_period: int) -> tuple[Past, float, float]:
    """Return the history of a motion with errors, impulses and accelerations at their bounds, its
    label and miss.
    """
    draws = np.random.default_rng(seed)
    box = StateBox((-1e4, 1e4), (5.3e6, 6.3e6), (-100.0, 100.0), (-SPEED, -SPEED))
    model = SetModel(
        SPEED, STEP, box, AngleSensor(STEP, ANGLE_ERROR, ANGLE_ERROR, 5.8e6), disturbance_m_s2=PUSH,
        sections=3, fewest_sections=1, initial_set=InitialSet.BOX, model=Model.GUARANTEED,
        execution_error_relative=0.02,
    )  # fmt: skip
    label = draws.uniform(5.7e6, 5.9e6)
    z = draws.uniform(-1e3, 1e3)
    v = draws.uniform(-20.0, 20.0)
    information = InformationSet(model)
    for step in range(STEPS):
        x = label - SPEED * STEP * step
        omega = (v + SPEED * z / x) / x / (1.0 + (z / x) ** 2)
        information.measure_angle(
            math.atan(z / x) + draws.choice([-1.0, 1.0, draws.uniform(-1, 1)]) * ANGLE_ERROR
        )
        if step % rate_period == 0:
            information.measure_rate(
                omega + draws.choice([-1.0, 1.0, draws.uniform(-1, 1)]) * RATE_ERROR, RATE_ERROR
            )
        impulse = draws.uniform(-7.0, 7.0) * (draws.random() < 0.2)
        information.shift(impulse)
        information.predict()
        v -= impulse * (1.0 + 0.02 * draws.choice([-1.0, 1.0]))
        acceleration = PUSH * draws.choice([-1.0, 1.0])
        z = z + v * STEP + 0.5 * acceleration * STEP**2
        v = v + acceleration * STEP
    state = information._state
    return past_of(state.history, state.table), label, z + v * (label / SPEED - STEPS * STEP)


@pytest.mark.parametrize("thinned", [False, True])
@pytest.mark.parametrize("rate_period", [1, 7, 60])
@pytest.mark.parametrize("seed", range(6))
def test_section_of_a_window_contains_the_motion_and_the_sections_of_its_labels(
    seed: int, rate_period: int, thinned: bool
) -> None:
    past, label, miss = flight(seed, rate_period)
    windows = past._replace(thinned=thinned)
    is_feasible, lowest, highest = extremes(label, np.inf, -np.inf, past)
    assert is_feasible
    assert lowest <= miss <= highest
    place = np.random.default_rng(seed).random()
    for width in (1.0, 1e3, 3e4, 2e5):
        window = label - place * width, label + (1.0 - place) * width
        is_feasible, lower, upper = extremes(label, *window, windows)
        assert is_feasible
        assert lower <= miss <= upper
        rounding = 1e-9 * (highest - lowest)
        for other in np.linspace(*window, 5):
            other_is_feasible, own_lower, own_upper = extremes(other, np.inf, -np.inf, past)
            if other_is_feasible:
                is_feasible, lower, upper = extremes(other, *window, windows)
                assert is_feasible
                assert lower <= own_lower + rounding
                assert own_upper <= upper + rounding


@pytest.mark.parametrize("thinned", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_extremes_in_a_window_are_concave_and_converge_to_the_extremes_of_its_labels(
    seed: int, thinned: bool
) -> None:
    past, label, _ = flight(seed, 1)
    windows = past._replace(thinned=thinned)
    widths = (3e4, 300.0, 0.03)
    excess = []
    for width in widths:
        labels: NDArray[np.float64] = np.linspace(label - width / 2, label + width / 2, 9)
        found = [extremes(each, labels[0], labels[-1], windows) for each in labels]
        upper = np.array([each[2] for each in found if each[0]])
        rounding = 1e-9 * np.abs(upper).max()
        assert (np.diff(upper, n=2) <= rounding).all()
        lower = np.array([each[1] for each in found if each[0]])
        assert (np.diff(lower, n=2) >= -rounding).all()
        alone = extremes(label, np.inf, -np.inf, past)
        excess.append(extremes(label, labels[0], labels[-1], windows)[2] - alone[2])
    # The segments of (13c) at the ends of a stretch do not shrink with the window.
    assert -1e-9 <= excess[2] <= (3e-3 if thinned else 1e-3) * excess[0]
