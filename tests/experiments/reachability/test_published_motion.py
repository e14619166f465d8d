"""The nonlinear columns of Shorikov and Goranov (2021): a circular orbit of radius 90 km.

Everything is in the paper's axes: x against the motion, y outward.
"""

from __future__ import annotations

import re
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import linprog

from benchmarks import published_radius
from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import from_paper, to_paper
from infoset.experiments.common.input_file import load_problem
from infoset.experiments.common.printed_numbers import NumberComparison, NumberVerdict, read_paper
from infoset.experiments.reachability.published import PROBLEM, printed_tables, published_motion
from infoset.experiments.reproduced_numbers import reproduce_paper
from infoset.rendezvous.reachability import minimum_energy, solve

RENDEZVOUS = load_problem(PROBLEM)
TABLES = printed_tables()
START = np.array([2650.0, -2540.0, 2120.0, -3.0, 2.0, 3.0])
PERIOD_S, PUSH_M_S2, RADIUS_M = 180.0, 0.15, 90e3
RATE_RAD_S = float(np.sqrt(3.986004418e14 / (1e7 * (1.0 - 0.1**2)) ** 3) * 1.1**2)
"""Rate at perigee: semi-major axis 10 000 km, eccentricity 0.1."""
ROUNDING = np.array([0.05, 0.05, 0.05, 0.005, 0.005, 0.005])
CONTROL_ROUNDING = 0.5e-4
CHANGE = 1e-3
"""Of a control, for derivatives; the states are linear in it to 1e-5 m."""


def nonlinear(controls: Floats) -> Floats:
    """Integrate (1) of the paper with e = 0, mu = w^2 R^3, by a method other than that of the
    package.
    """
    states = []
    state = START
    for push in PUSH_M_S2 * controls:

        def slope(_time: float, at: Floats, push: Floats = push) -> Floats:
            x, y, z, *velocity = at
            gravity = RATE_RAD_S**2 * RADIUS_M**3 / (x**2 + (RADIUS_M + y) ** 2 + z**2) ** 1.5
            force = [
                2 * RATE_RAD_S * velocity[1] + RATE_RAD_S**2 * x - gravity * x,
                -2 * RATE_RAD_S * velocity[0]
                + RATE_RAD_S**2 * (RADIUS_M + y)
                - gravity * (RADIUS_M + y),
                -gravity * z,
            ]
            return np.concatenate([velocity, force + push])

        state = solve_ivp(slope, (0.0, PERIOD_S), state, method="LSODA", rtol=1e-11, atol=1e-9).y[
            :, -1
        ]
        states.append(state)
    return np.array(states)


def linear(controls: Floats) -> Floats:
    return to_paper(RENDEZVOUS.problem.run(from_paper(controls)[None])[0])[1:]


@cache
def states(number: int) -> tuple[Floats, Floats]:
    """Return both columns of the printed controls, shape (2, 4, 6), and their derivatives, shape
    (12, 2, 4, 6).
    """
    controls = TABLES[number - 1].controls
    middle = np.array([linear(controls), nonlinear(controls)])
    moved = (controls + CHANGE * step.reshape(4, 3) for step in np.eye(12))
    return middle, np.array(
        [(np.array([linear(each), nonlinear(each)]) - middle) / CHANGE for each in moved]
    )


@pytest.fixture(scope="module")
def numbers() -> dict[tuple[int, str], NumberComparison]:
    """Verdicts by table and name without unit."""
    found = reproduce_paper(read_paper("reachability"), lambda _done: None)
    return {
        (int(each.number.source[-1]), each.number.name.partition(" (")[0]): each for each in found
    }


def test_the_motion_as_published_is_equation_1_with_a_radius_of_90_km() -> None:
    controls = TABLES[0].controls
    motion = published_motion(RENDEZVOUS.truth.orbit)
    found = motion.fly(
        RENDEZVOUS.problem.initial, PUSH_M_S2 * from_paper(controls)[None], PERIOD_S
    )[0, 1:]
    np.testing.assert_allclose(to_paper(found), nonlinear(controls), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(("number", "misprints"), [(1, [(2, 1), (3, 1)]), (3, [(4, 6)])])
def test_a_control_gives_the_nonlinear_column(
    number: int, misprints: list[tuple[int, int]], numbers: dict[tuple[int, str], NumberComparison]
) -> None:
    """Table 1: the control of minimum energy; table 3: the printed controls, with the effect of
    their rounding.
    """
    if number == 1:
        computed = nonlinear(to_paper(minimum_energy(solve(RENDEZVOUS.problem).optimal)))
        rounding = np.tile(ROUNDING, (4, 1))
    else:
        (_, computed), changes = states(number)
        rounding = ROUNDING + CONTROL_ROUNDING * np.abs(changes[:, 1]).sum(axis=0)
    off = np.abs(computed - TABLES[number - 1].nonlinear) > rounding
    assert [(t + 1, component + 1) for t, component in np.argwhere(off)] == misprints
    for t, component in np.ndindex(4, 6):
        expected = NumberVerdict.MISPRINT if off[t, component] else NumberVerdict.EXPLAINED
        assert numbers[number, f"nonlinear x{component + 1}({t + 1})"].verdict is expected


def test_nonlinear_less_linear_states_of_table_2_agree_with_the_model(
    numbers: dict[tuple[int, str], NumberComparison],
) -> None:
    """The difference hardly depends on the control, of which four printed numbers are misprints."""
    computed, _ = states(2)
    table = TABLES[1]
    off = computed[1] - computed[0] - (table.nonlinear - table.linear)
    assert (np.abs(off[:, 3:]) <= 0.011).all()
    assert (np.abs(off[:, :3]) <= 0.32).all()
    assert (np.abs(off) <= 2.0 * ROUNDING).sum() >= 20
    # Without the model the differences are as large as the printed ones.
    assert np.abs(table.nonlinear - table.linear).max() > 50.0
    found = [
        numbers[2, f"nonlinear x{component + 1}({t + 1})"].verdict
        for t, component in np.ndindex(4, 6)
    ]
    assert found == [NumberVerdict.EXPLAINED] * 24


@pytest.mark.parametrize(
    ("number", "column", "t", "component"), [(1, 1, 2, 1), (1, 1, 3, 1), (3, 0, 2, 3), (3, 1, 4, 6)]
)
def test_misprints_follow_from_the_other_numbers(
    number: int,
    column: int,
    t: int,
    component: int,
    numbers: dict[tuple[int, str], NumberComparison],
) -> None:
    """Minimum and maximum value over all controls that round to the printed ones and lead to the
    other positions.
    """
    table = TABLES[number - 1]
    middle, changes = states(number)
    printed = np.array([table.linear, table.nonlinear])
    fixed = np.reshape([each.corrected is None for each in table.numbers[12:60]], printed.shape)
    fixed[:, :, 3:] = False
    # Three linear positions are printed with two decimals.
    rounding = np.where(np.round(printed, 1) == printed, 0.05, 0.005)[fixed]
    rows = changes[:, fixed].T
    room = (printed - middle)[fixed]
    ends = []
    for sign in (1.0, -1.0):
        answer = linprog(
            sign * changes[:, column, t - 1, component - 1],
            A_ub=np.vstack([rows, -rows]),
            b_ub=np.concatenate([room + rounding, rounding - room]),
            bounds=(-CONTROL_ROUNDING, CONTROL_ROUNDING),
        )
        assert answer.success
        ends.append(middle[column, t - 1, component - 1] + sign * answer.fun)
    found = numbers[number, f"{('linear', 'nonlinear')[column]} x{component}({t})"]
    assert found.verdict is NumberVerdict.MISPRINT
    assert found.number.corrected is not None
    decimals = len(found.number.corrected.partition(".")[2])
    assert {f"{end:.{decimals}f}" for end in ends} == {found.number.corrected}
    assert found.number.corrected != found.number.printed


def test_the_fit_of_the_radius(capsys: pytest.CaptureFixture[str]) -> None:
    published_radius.main()
    found = re.match(r"radius (\S+) \+- (\S+) km from (\d+) differences", capsys.readouterr().out)
    assert found is not None
    radius_km = float(found[1])
    error_km = float(found[2])
    kept = int(found[3])
    assert abs(radius_km - 90.0) < 2.0 * error_km < 0.2
    assert kept == 70
