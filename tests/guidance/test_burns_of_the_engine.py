"""Burns of an engine: their duration, their limits, and what they correct."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from infoset.guidance import Thruster
from infoset.guidance.authority import correctable_m

ENGINE = Thruster(20.0, 0.0, thrust_N=10.0, mass_kg=500.0)
EXHAUST_M_S = 2200.0
"""Speed of the exhaust of a hydrazine thruster."""


def test_the_neglected_decrease_of_the_mass_moves_the_centroid_of_the_thrust_by_millimetres() -> (
    None
):
    """The rocket equation: t = (m v_e / F)(1 - exp(-u / v_e)), centroid t/2 + t u / (12 v_e)."""
    u_m_s = 1.0
    flow_kg_s = 10.0 / EXHAUST_M_S
    burn_s = 500.0 / flow_kg_s * (1.0 - math.exp(-u_m_s / EXHAUST_M_S))
    assert burn_s == pytest.approx(49.98864, abs=5e-6)

    moment, _ = quad(lambda t: t * 10.0 / (500.0 - flow_kg_s * t), 0.0, burn_s)
    assert moment / u_m_s - 0.5 * burn_s == pytest.approx(1.8935e-3, abs=5e-8)

    # The displacement of the program and of the rocket differ by u^2 t / (6 v_e).
    assert ENGINE.burn_s(u_m_s) == 50.0
    neglected_m = 0.5 * ENGINE.burn_s(u_m_s) * u_m_s - moment
    assert neglected_m == pytest.approx(u_m_s**2 * burn_s / (6.0 * EXHAUST_M_S), rel=1e-3)
    assert neglected_m == pytest.approx(3.8e-3, abs=5e-5)


def test_the_default_maximum_is_a_burn_of_a_step() -> None:
    assert ENGINE.limited_to(60.0).max_impulse_m_s == pytest.approx(1.2)
    inexact = replace(ENGINE, execution_error_relative=0.02)
    assert inexact.limited_to(60.0).longest_burn_s == pytest.approx(60.0)
    smaller = replace(inexact, max_impulse_m_s=0.7)
    assert smaller.limited_to(60.0) is smaller


def test_a_burn_longer_than_a_step_is_refused_with_both_remedies() -> None:
    with pytest.raises(ValueError, match=r"a burn of 1\.2 m/s lasts up to 60 s, a step 10 s") as no:
        replace(ENGINE, max_impulse_m_s=1.2).limited_to(10.0)
    assert "step_s of at least 60, or a max_impulse_m_s of at most 0.2:" in str(no.value)


def test_the_advice_about_a_long_burn_is_rounded_so_that_it_can_be_followed() -> None:
    engine = Thruster(20.0, 0.0, 1.0, thrust_N=3.0, mass_kg=20.0, execution_error_relative=0.07)
    # 1.07 * 20 / 3 = 7.1333... s; 2 s * 0.15 / 1.07 = 0.28037... m/s.
    with pytest.raises(ValueError, match=r"step_s of at least 7\.134, or .* at most 0\.2803:"):
        engine.limited_to(2.0)
    assert engine.limited_to(7.134) is engine
    smaller = replace(engine, max_impulse_m_s=0.2803)
    assert smaller.limited_to(2.0) is smaller


def test_a_minimum_impulse_above_a_burn_of_a_step_is_refused() -> None:
    with pytest.raises(ValueError, match=r"min_impulse_m_s must not exceed max_impulse_m_s, 0\.2:"):
        replace(ENGINE, min_impulse_m_s=0.5).limited_to(10.0)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"thrust_N": 10.0}, "mass_kg is missing"),
        ({"mass_kg": 500.0}, "thrust_N is missing"),
        ({}, "max_impulse_m_s is missing: set it, or set thrust_N and mass_kg"),
    ],
)
def test_an_incomplete_engine_is_refused(keys: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Thruster(20.0, 0.0, **keys)


def test_a_burn_changes_the_miss_as_much_as_the_impulse_that_it_replaces() -> None:
    impulses = np.array([[0.3, -1.0, 0.0], [0.1, 0.5, 0.0]])
    to_go_s = 120.0
    burns = ENGINE.as_burns(impulses, to_go_s)
    durations_s = np.hypot(*burns) / 0.02
    assert burns * (to_go_s - 0.5 * durations_s) == pytest.approx(impulses * to_go_s, rel=1e-12)
    # No burn changes the miss by more than one that lasts until the arrival: a tau^2 / 2.
    assert ENGINE.as_burns(np.array([[1.3]]), to_go_s).item() == pytest.approx(2.6)
    plain = Thruster(20.0, 0.0, 2.0)
    assert plain.as_burns(impulses, to_go_s) is impulses


@pytest.mark.parametrize("budget_m_s", [0.5, 1.3, 5.0])
def test_burns_correct_what_the_best_sizes_correct(budget_m_s: float) -> None:
    """Against all sizes on a grid of a tenth of the maximum impulse."""
    engine = replace(ENGINE, max_impulse_m_s=1.0)
    times_s = np.array([0.0, 60.0, 120.0, 180.0])
    sizes = np.linspace(0.0, 1.0, 11)
    best_m = 0.0
    for burns in product(sizes, repeat=len(times_s)):
        given = np.array(burns)
        if given.sum() <= budget_m_s + 1e-9:
            corrected_m = given * (300.0 - times_s - 0.5 * given / 0.02)
            best_m = max(best_m, float(corrected_m.sum()))
    found_m = correctable_m(times_s, engine, np.array(budget_m_s), np.array(300.0))
    assert float(found_m) == pytest.approx(best_m, rel=1e-12)
