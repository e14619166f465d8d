"""Barseghyan and Stepanyan (2008), section 3, at the rate of their text and at that of their arithmetic.

Numbers are in the paper's axes, problems and solutions in Hill's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from experiments.common.hill_axes import from_paper, to_paper
from rendezvous.pareto import (
    Component,
    Core,
    Craft,
    Encounter,
    EncounterSolution,
    analyse_coalitions,
    distances,
    solve_encounter,
)
from rendezvous.relative_motion import ClohessyWiltshire

Floats = NDArray[np.float64]

NINE_DIGITS = 1e-9
STARTS = (
    (0.0, 60.0, 80.0, -1.2328, -4.1115, 0.0369),
    (40.0, -50.0, 60.0, -9.0613, 7.6229, 0.065),
    (-10.0, -80.0, -30.0, -4.9545, -7.2583, -0.0841),
)
PLANE = (Component.Z, Component.X)
"""The paper's z and y, alpha and beta."""


def solved(rate: float, free: tuple[Component, ...] = PLANE) -> EncounterSolution:
    motion = ClohessyWiltshire(rate)
    craft = tuple(Craft(str(number), from_paper(start), motion) for number, start in enumerate(STARTS, 1))
    return solve_encounter(Encounter(craft, 30.0, free, np.zeros(6)))


def both_to_paper(matrix: Floats) -> Floats:
    """Convert rows and columns of a symmetric matrix."""
    return to_paper(to_paper(matrix).T)


@dataclass(frozen=True)
class Published:
    """Numbers of the acceptance file; control coefficients of (1, t, cos, sin) a component."""

    matrix: tuple[float, float]
    ideal_cost: tuple[float, ...]
    ideals: tuple[tuple[float, float], ...]
    meeting: tuple[float, float]
    cost: tuple[float, ...]
    norm: float


# fmt: off
STATED = Published(
    (0.00044433382734868196, 0.00044485026472908484),
    (0.7901642781355673, 8.534913129850537, 5.9364085496591095),
    (
        (80.55360965382751, -1.174016541433578),
        (60.97519838200814, 67.41878755620706),
        (-31.261759751178044, -187.01493562363027),
    ),
    (36.755682761552535, -40.25672153628559),
    (2.3220013947895253, 13.953153416863753, 17.573235512747196),
    18.58690436675526,
)
# fmt: on
# Positions and velocities by rate, craft and time, interleaved (x, x', y, y', z, z'); at the ends they are the data's.
# fmt: off
FLIGHTS: dict[tuple[float, int, float], tuple[float, ...]] = {
    (0.00117689, 0, 10.0): (-5.344378630577603, 0.013521524754778191, 15.802417722794061, -4.449052881135596,
     68.95260571078214, -1.9219780916348208),
    (0.00117689, 0, 20.0): (-2.604342491850879, 0.39745986646977705, -23.332482073659392, -3.0920805193045364,
     48.04908805571231, -1.9342791900586358),
    (0.00117689, 1, 10.0): (-10.276450851110589, -1.7409093476457942, -13.264853633331455, 0.465885893979185,
     54.26264396869938, -1.0330847498586664),
    (0.00117689, 1, 20.0): (-9.397173511124777, 1.206018561096732, -25.514061461941964, -2.1407908378752687,
     42.92639184401269, -1.0547533862436296),
    (0.00117689, 2, 10.0): (-29.945201357854685, 0.39287627880331577, -101.65627844448937, 1.7964780831553515,
     -13.066901424629432, 2.966931895642457),
    (0.00117689, 2, 20.0): (-14.118265907336237, 2.1477246717852667, -66.38858359020409, 4.155996128237325,
     19.26189163345096, 2.9949678196780387),
}
# fmt: on
# The printed table of positions, five digits.
PRINTED = {
    (0, 10.0): (-5.34422, 15.8021, 68.9528),
    (0, 20.0): (-2.60426, -23.3328, 48.0493),
    (1, 10.0): (-10.2766, -13.265, 54.2627),
    (1, 20.0): (-9.39724, -25.5143, 42.9265),
    (2, 10.0): (-29.9452, -101.657, -13.0669),
    (2, 20.0): (-14.1183, -66.3889, 19.262),
}
# Control coefficients of (1, t, cos w t, sin w t), craft by component.
# fmt: off
CONTROLS = {
    0.00117689: (
        (
            (28.97559229502432, 0.02658503612149108, -28.795500256000594, -30.35945853732769),
            (15.059485095741646, 0.0, -15.179729268663845, 14.397750128000297),
            (0.0, 0.0, -0.293092263348778, 16.535823627156713),
        ),
        (
            (78.63548264570474, 0.12425149452554692, -77.69553691182203, -142.68351805886527),
            (70.38408830366299, 0.0, -71.34175902943264, 38.847768455911016),
            (0.0, 0.0, -0.16353852529358787, 9.143980237751709),
        ),
        (
            (-113.16010667337771, 0.11581942452631913, 113.8810623774689, -128.74570475763178),
            (65.60761811572259, 0.0, -64.37285237881589, -56.94053118873445),
            (0.0, 0.0, 0.45619024274255504, -25.679819425596676),
        ),
    ),
}
# fmt: on


def test_costs_ideals_and_meeting() -> None:
    solution, expected = solved(0.001176), STATED
    for cost in solution.costs:
        np.testing.assert_allclose(np.diag(cost.matrix), expected.matrix, rtol=NINE_DIGITS)
        assert abs(cost.matrix[0, 1]) < 1e-18
    np.testing.assert_allclose(
        [each.ideal_cost_squared for each in solution.costs], expected.ideal_cost, rtol=NINE_DIGITS
    )
    np.testing.assert_allclose(solution.ideals, expected.ideals, rtol=NINE_DIGITS)
    np.testing.assert_allclose(solution.point, expected.meeting, rtol=NINE_DIGITS)
    np.testing.assert_allclose(solution.cost_squared(), expected.cost, rtol=NINE_DIGITS)
    np.testing.assert_allclose(solution.group_loss(), expected.norm, rtol=NINE_DIGITS)
    meeting = to_paper(solution.meeting_state())
    np.testing.assert_allclose(
        meeting, [0.0, expected.meeting[1], expected.meeting[0], 0.0, 0.0, 0.0], rtol=NINE_DIGITS
    )


@pytest.mark.parametrize(("rate", "craft", "time"), FLIGHTS)
def test_flights(rate: float, craft: int, time: float) -> None:
    state = to_paper(solved(rate).plan(craft).state(time))
    np.testing.assert_allclose(state[[0, 3, 1, 4, 2, 5]], FLIGHTS[rate, craft, time], rtol=NINE_DIGITS)


@pytest.mark.parametrize(("craft", "time"), PRINTED)
def test_printed_positions(craft: int, time: float) -> None:
    # Their last digits are rounded from arithmetic that loses some.
    state = to_paper(solved(0.00117689).plan(craft).state(time))
    np.testing.assert_allclose(state[:3], PRINTED[craft, time], rtol=3e-5, atol=4e-4)


@pytest.mark.parametrize("rate", CONTROLS)
def test_controls_as_trigonometric_sums(rate: float) -> None:
    # The coefficients cancel to the control: their own error, 1e-15 of 100, bounds what can be compared.
    solution, times = solved(rate), np.linspace(0.0, 30.0, 13)
    basis = np.stack([np.ones(13), times, np.cos(rate * times), np.sin(rate * times)])
    for craft, components in enumerate(CONTROLS[rate]):
        expected = (np.array(components) @ basis).T
        np.testing.assert_allclose(to_paper(solution.plan(craft).control(times)), expected, rtol=0.0, atol=1e-9)


def test_a_free_position() -> None:
    solution = solved(0.001176, (Component.X, Component.Y, Component.Z))
    position = [-66.65262761541355, -40.25745249455223, 36.755682761552535]
    np.testing.assert_allclose(to_paper(solution.point), position, rtol=NINE_DIGITS)
    np.testing.assert_allclose(
        solution.cost_squared(), [3.1155874056460897, 10.406777978846758, 14.401611908995068], rtol=NINE_DIGITS
    )
    np.testing.assert_allclose(
        [each.ideal_cost_squared for each in solution.costs],
        [0.6135294694527276, 4.675869285891647, 2.5834535211007577],
        rtol=NINE_DIGITS,
    )
    expected = np.diag([0.00044451817606285535, 0.00044485026472908484, 0.00044433382734868196])
    expected[0, 1] = expected[1, 0] = -4.878532025781595e-09
    np.testing.assert_allclose(both_to_paper(solution.costs[0].matrix), expected, rtol=NINE_DIGITS, atol=1e-18)


def test_coalitions() -> None:
    # Theory: c(12), c(13), c(23) and the Shapley value of the paper's case.
    solution = solved(0.001176)
    found = analyse_coalitions(solution)
    by_members = {each.members: each for each in found.coalitions}
    assert by_members[0, 1].excess == pytest.approx(1.131663922, rel=NINE_DIGITS)
    assert by_members[0, 2].excess == pytest.approx(10.45954394, rel=NINE_DIGITS)
    assert by_members[1, 2].excess == pytest.approx(16.28914869, rel=NINE_DIGITS)
    np.testing.assert_allclose(found.shapley, [2.697786535, 5.612588912, 10.27652892], rtol=NINE_DIGITS)
    assert found.core is Core.EMPTY
    between = distances(solution)
    for pair in ((0, 1), (0, 2), (1, 2)):
        assert by_members[pair].excess == pytest.approx(between[pair] ** 2 / 2.0, rel=1e-13)
    assert by_members[0, 1, 2].regret == pytest.approx(0.0, abs=1e-13)
