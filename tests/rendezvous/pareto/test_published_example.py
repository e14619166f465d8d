"""Barseghyan and Stepanyan (2008), section 3, at the rate of their text and at that of their
arithmetic.

Numbers are in the paper's axes, problems and solutions in Hill's.
"""

from __future__ import annotations

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import from_paper, to_paper
from infoset.rendezvous.pareto import (
    Component,
    Core,
    Craft,
    Encounter,
    EncounterSolution,
    analyse_coalitions,
    distances,
    solve_encounter,
)
from infoset.rendezvous.relative_motion import ClohessyWiltshire

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
    craft = tuple(
        Craft(str(number), from_paper(start), motion) for number, start in enumerate(STARTS, 1)
    )
    return solve_encounter(Encounter(craft, 30.0, free, np.zeros(6)))


def both_to_paper(matrix: Floats) -> Floats:
    """Convert rows and columns of a symmetric matrix."""
    return to_paper(to_paper(matrix).T)


# Positions and velocities by rate, craft and time, interleaved (x, x', y, y', z, z'); at the ends
# they are the data's. fmt: off
FLIGHTS: dict[tuple[float, int, float], tuple[float, ...]] = {
    (0.00117689, 0, 10.0): (
        -5.344378630577603,
        0.013521524754778191,
        15.802417722794061,
        -4.449052881135596,
        68.95260571078214,
        -1.9219780916348208,
    ),
    (0.00117689, 0, 20.0): (
        -2.604342491850879,
        0.39745986646977705,
        -23.332482073659392,
        -3.0920805193045364,
        48.04908805571231,
        -1.9342791900586358,
    ),
    (0.00117689, 1, 10.0): (
        -10.276450851110589,
        -1.7409093476457942,
        -13.264853633331455,
        0.465885893979185,
        54.26264396869938,
        -1.0330847498586664,
    ),
    (0.00117689, 1, 20.0): (
        -9.397173511124777,
        1.206018561096732,
        -25.514061461941964,
        -2.1407908378752687,
        42.92639184401269,
        -1.0547533862436296,
    ),
    (0.00117689, 2, 10.0): (
        -29.945201357854685,
        0.39287627880331577,
        -101.65627844448937,
        1.7964780831553515,
        -13.066901424629432,
        2.966931895642457,
    ),
    (0.00117689, 2, 20.0): (
        -14.118265907336237,
        2.1477246717852667,
        -66.38858359020409,
        4.155996128237325,
        19.26189163345096,
        2.9949678196780387,
    ),
}
# fmt: on


def test_costs_ideals_and_meeting() -> None:
    solution = solved(0.001176)
    for cost in solution.costs:
        matrix = [0.00044433382734868196, 0.00044485026472908484]
        np.testing.assert_allclose(np.diag(cost.matrix), matrix, rtol=NINE_DIGITS)
        assert abs(cost.matrix[0, 1]) < 1e-18
    beta, alpha = -40.25672153628559, 36.755682761552535
    for found, expected in (
        (
            [each.ideal_cost_squared for each in solution.costs],
            [0.79016427813556, 8.5349131298505, 5.9364085496591],
        ),
        (solution.ideals[0], [80.55360965382751, -1.174016541433578]),
        (solution.ideals[1], [60.97519838200814, 67.41878755620706]),
        (solution.ideals[2], [-31.261759751178044, -187.01493562363027]),
        (solution.point, [alpha, beta]),
        (solution.cost_squared(), [2.3220013947895253, 13.953153416863753, 17.573235512747196]),
        (solution.group_loss(), 18.58690436675526),
        (to_paper(solution.meeting_state()), [0.0, beta, alpha, 0.0, 0.0, 0.0]),
    ):
        np.testing.assert_allclose(found, expected, rtol=NINE_DIGITS)


@pytest.mark.parametrize(("rate", "craft", "time"), FLIGHTS)
def test_flights(rate: float, craft: int, time: float) -> None:
    state = to_paper(solved(rate).plan(craft).state(time))
    np.testing.assert_allclose(
        state[[0, 3, 1, 4, 2, 5]], FLIGHTS[rate, craft, time], rtol=NINE_DIGITS
    )


def test_a_free_position() -> None:
    solution = solved(0.001176, (Component.X, Component.Y, Component.Z))
    position = [-66.65262761541355, -40.25745249455223, 36.755682761552535]
    np.testing.assert_allclose(to_paper(solution.point), position, rtol=NINE_DIGITS)
    np.testing.assert_allclose(
        solution.cost_squared(),
        [3.1155874056460897, 10.406777978846758, 14.401611908995068],
        rtol=NINE_DIGITS,
    )
    np.testing.assert_allclose(
        [each.ideal_cost_squared for each in solution.costs],
        [0.6135294694527276, 4.675869285891647, 2.5834535211007577],
        rtol=NINE_DIGITS,
    )
    expected = np.diag([0.00044451817606285535, 0.00044485026472908484, 0.00044433382734868196])
    expected[0, 1] = expected[1, 0] = -4.878532025781595e-09
    np.testing.assert_allclose(
        both_to_paper(solution.costs[0].matrix), expected, rtol=NINE_DIGITS, atol=1e-18
    )


def test_coalitions() -> None:
    # Theory: c(12), c(13), c(23) and the Shapley value of the paper's case.
    solution = solved(0.001176)
    found = analyse_coalitions(solution)
    by_members = {each.members: each for each in found.coalitions}
    assert by_members[0, 1].excess == pytest.approx(1.131663922, rel=NINE_DIGITS)
    assert by_members[0, 2].excess == pytest.approx(10.45954394, rel=NINE_DIGITS)
    assert by_members[1, 2].excess == pytest.approx(16.28914869, rel=NINE_DIGITS)
    np.testing.assert_allclose(
        found.shapley, [2.697786535, 5.612588912, 10.27652892], rtol=NINE_DIGITS
    )
    assert found.core is Core.EMPTY
    between = distances(solution)
    for pair in ((0, 1), (0, 2), (1, 2)):
        assert by_members[pair].excess == pytest.approx(between[pair] ** 2 / 2.0, rel=1e-13)
    assert by_members[0, 1, 2].regret == pytest.approx(0.0, abs=1e-13)
