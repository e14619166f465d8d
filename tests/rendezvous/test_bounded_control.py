"""Minimum energy with a bound, against closed forms, cone programs and an integrator."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise

import clarabel
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import minimize
from scipy.sparse import block_diag, csc_matrix, hstack

from infoset.arrays import Floats
from infoset.rendezvous.bounded_control import (
    Arc,
    BoundedFlight,
    BoundTooSmallError,
    least_bound,
    saturated,
    solve_bounded,
)
from infoset.rendezvous.piecewise import max_control
from infoset.rendezvous.relative_motion import (
    ClohessyWiltshire,
    EllipticOrbit,
    LinearMotion,
    TschaunerHempel,
)

Check = Callable[[int], None]

STRAIGHT = ClohessyWiltshire(1e-9)
"""So slow an orbit that the motion is a straight line."""
DISTANCE_M, DURATION_S = 10.0, 100.0
TO_REST = Arc(
    STRAIGHT, 0.0, DURATION_S, np.array([DISTANCE_M, 0.0, 0.0, 0.0, 0.0, 0.0]), np.zeros((6, 0))
)
TO_PASS = Arc(STRAIGHT, 0.0, DURATION_S, np.array([DISTANCE_M, 0.0, 0.0]), np.zeros((3, 0)))


@pytest.mark.parametrize("bound", [0.0059, 0.005, 0.00401])
def test_control_from_rest_to_rest_is_linear_and_cut_to_the_bound(bound: float) -> None:
    # u = a (T / 2 - t) cut to the bound, which it leaves at T / 2 +- h: d = bound (T^2 / 4 - h^2 /
    # 3).
    h = np.sqrt(3.0 * (DURATION_S**2 / 4.0 - DISTANCE_M / bound))
    energy = bound**2 * (DURATION_S - 4.0 * h / 3.0)

    optimum = solve_bounded([TO_REST], bound)

    assert optimum.energies[0] == pytest.approx(energy, rel=1e-9)
    flight = BoundedFlight(
        STRAIGHT, 0.0, DURATION_S, np.zeros(6), optimum.costates[0], bound, optimum.edges_s[0]
    )
    for time_s in (DURATION_S / 2.0 - h, DURATION_S / 2.0 + h):
        assert np.abs(flight.breaks() - time_s).min() < 1e-5 * DURATION_S
    x_m_s2 = flight.control(np.array([0.0, 50.0, 100.0]))[:, 0]
    np.testing.assert_allclose(x_m_s2, [bound, 0.0, -bound], atol=1e-9)
    np.testing.assert_allclose(flight.state(np.array([100.0]))[0], TO_REST.missing, atol=1e-7)


@pytest.mark.parametrize(("arc", "least"), [(TO_REST, 4.0e-3), (TO_PASS, 2.0e-3)])
def test_smallest_bound_on_a_line_agrees_with_the_closed_form(arc: Arc, least: float) -> None:
    # Full thrust to the middle and full braking: 4 d / T^2; full thrust all the time: 2 d / T^2.
    found = least_bound([arc])

    assert least * (1.0 - 1e-6) <= found.value_m_s2 <= least * (1.0 + 1e-12)
    assert found.shares.tolist() == [1.0]
    assert solve_bounded([arc], 1.001 * least).energies[0] <= (1.001 * least) ** 2 * DURATION_S
    with pytest.raises(BoundTooSmallError, match="no control keeps the bound"):
        solve_bounded([arc], 0.999 * least)


def test_smallest_bound_is_zero_if_the_effect_is_zero() -> None:
    assert least_bound([Arc(STRAIGHT, 0.0, 1.0, np.zeros(6), np.zeros((6, 0)))]).value_m_s2 == 0.0


def some_arcs(seed: int) -> list[Arc]:
    """One to three random arcs that share up to three free values."""
    random = np.random.default_rng(seed)
    rate = 1.1e-3
    elliptic = EllipticOrbit(
        rate, float(random.uniform(0.05, 0.6)), float(random.uniform(0.0, 6.0))
    )
    motion: LinearMotion = (
        ClohessyWiltshire(rate) if random.random() < 0.7 else TschaunerHempel(elliptic)
    )
    duration_s = 10.0 ** random.uniform(-1.5, 0.9) / rate
    count = 6 if random.random() < 0.7 else 3
    scale = np.array([duration_s] * 3 + [1.0] * 3)[:count]
    slope = (
        np.eye(count)[:, : int(random.integers(0, 4))]
        if count == 6
        else np.eye(3)[:, : int(random.integers(0, 3))]
    )
    return [
        Arc(
            motion,
            float(random.uniform(0.0, 0.4)) * duration_s,
            duration_s,
            random.normal(size=count) * scale,
            slope,
            float(10.0 ** random.uniform(-0.5, 0.5)),
        )
        for _ in range(int(random.integers(1, 4)))
    ]


def peak_without(arcs: list[Arc]) -> float:
    """Largest control of minimum energy without a bound."""
    optimum = solve_bounded(arcs, 1e9)
    return max(map(peak_of, arcs, optimum.costates, [1e9] * len(arcs), optimum.edges_s))


def peak_of(arc: Arc, costate: Floats, bound: float, edges_s: Floats) -> float:
    flight = BoundedFlight(arc.motion, arc.start_s, arc.end_s, np.zeros(6), costate, bound, edges_s)
    return max_control(flight.control, flight.breaks())


def held_program(arcs: list[Arc], bound: float, intervals: int) -> float:
    """Minimum weighted energy of controls that are held in equal intervals, by Clarabel."""
    quadratic = []
    responses = []
    slopes = []
    goals = []
    for arc in arcs:
        grid = np.linspace(arc.start_s, arc.end_s, intervals + 1)
        nodes, weights = np.polynomial.legendre.leggauss(6)
        half = 0.5 * np.diff(grid)
        times = (grid[:-1] + half)[:, None] + half[:, None] * nodes
        effects = arc.effects(times.ravel()).reshape(intervals, len(nodes), len(arc.missing), 3)
        held = np.einsum("kn,knai->aki", half[:, None] * weights, effects)
        scale = np.array([arc.end_s - arc.start_s] * 3 + [1.0] * 3)[: len(arc.missing)] * (
            arc.end_s - arc.start_s
        )
        # Controls in units of the bound.
        responses.append(held.reshape(len(arc.missing), -1) * bound / scale[:, None])
        goals.append(arc.missing / scale)
        slopes.append(arc.slope / scale[:, None])
        quadratic.append(np.full(3 * intervals, arc.weight * 2.0 * half[0] * bound**2))
    free = arcs[0].slope.shape[1]
    unit = sum(float(each.sum()) for each in quadratic)
    diagonal = np.concatenate([*quadratic, np.zeros(free)]) / unit
    # Free values are as large as the goals; in units of one they are unbounded.
    columns = np.concatenate(slopes)
    size = np.maximum(np.abs(columns).max(axis=0, initial=0.0), 1e-300)
    equations = hstack([block_diag(responses), csc_matrix(-columns / size)]).toarray()
    # Orthonormal rows: the equations of a short arc are nearly dependent.
    left, values, rows = np.linalg.svd(equations, full_matrices=False)
    levels = left.T @ np.concatenate(goals) / values
    count = intervals * len(arcs)
    cones = np.zeros((4 * count, 3 * count + free))
    for row in range(3):
        cones[4 * np.arange(count) + 1 + row, 3 * np.arange(count) + row] = -1.0
    ends = np.concatenate([levels, np.tile([1.0, 0.0, 0.0, 0.0], count)])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    settings.max_threads = 1
    kinds = [clarabel.ZeroConeT(len(levels)), *[clarabel.SecondOrderConeT(4)] * count]
    matrix = csc_matrix(np.diag(2.0 * diagonal))
    constraints = csc_matrix(np.vstack([rows, cones]))
    solution = clarabel.DefaultSolver(
        matrix, np.zeros(len(diagonal)), constraints, ends, kinds, settings
    ).solve()
    assert str(solution.status) in ("Solved", "AlmostSolved")
    return float(solution.obj_val) * unit


def check_one(seed: int) -> None:
    """Compare the solution for a random bound with an integration and a cone program."""
    random = np.random.default_rng(seed)
    arcs = some_arcs(seed)
    peak = peak_without(arcs)
    least = least_bound(arcs).value_m_s2
    assert least <= peak * (1.0 + 1e-9)
    if least > 0.99 * peak:
        return
    bound = float(least + random.uniform(0.05, 0.95) * (peak - least))
    optimum = solve_bounded(arcs, bound)

    for arc, costate, edges_s, energy in zip(
        arcs, optimum.costates, optimum.edges_s, optimum.energies, strict=True
    ):
        flown_energy, miss = flown(arc, costate, bound, edges_s, optimum.free)
        assert miss < 1e-7
        assert flown_energy == pytest.approx(energy, rel=1e-7)
        assert peak_of(arc, costate, bound, edges_s) <= bound * (1.0 + 1e-8)
    cost = float(np.array([arc.weight for arc in arcs]) @ optimum.energies)
    held = held_program(arcs, bound, 150)
    # Held controls are some of all controls, so none costs less; and the best of them are near the
    # best of all.
    assert cost * (1.0 - 1e-6) <= held
    assert held <= cost * 1.01


def flown(
    arc: Arc, costate: Floats, bound: float, edges_s: Floats, free: Floats
) -> tuple[float, float]:
    """The energy and the miss, in units of the goal, by an integration (DOP853)."""

    def rates(time_s: float, state: Floats) -> Floats:
        to_end = arc.motion.transition(np.array([time_s]), np.array([arc.end_s]))[0]
        control = saturated((to_end.T @ costate)[3:], bound)
        forced = arc.motion.dynamics(time_s) @ state[:6]
        forced[3:] += control
        return np.concatenate([forced, [control @ control]])

    state = np.zeros(7)
    unit = np.array([arc.end_s - arc.start_s] * 3 + [1.0] * 3)
    speed = bound * (arc.end_s - arc.start_s)
    atol = np.concatenate([1e-12 * unit * speed, [1e-12 * bound * speed]])
    for start, end in pairwise(edges_s):
        state = solve_ivp(rates, (start, end), state, method="DOP853", rtol=1e-11, atol=atol).y[
            :, -1
        ]
    count = len(arc.missing)
    miss = (state[:count] - arc.missing - arc.slope @ free) / (unit[:count] * speed)
    return float(state[6]), float(np.abs(miss).max())


def test_random_arcs_agree_with_cone_programs_and_an_integrator(
    check_seeds: Callable[[Check, Iterable[int]], None],
) -> None:
    check_seeds(check_one, range(5))


@pytest.mark.thorough
def test_more_random_arcs_agree_with_cone_programs_and_an_integrator(
    check_seeds: Callable[[Check, Iterable[int]], None],
) -> None:
    check_seeds(check_one, range(100, 250))


@pytest.mark.parametrize("seed", range(6))
def test_bound_is_solved_just_above_the_smallest_bound_and_refused_below(seed: int) -> None:
    arcs = some_arcs(seed)
    least = least_bound(arcs).value_m_s2

    optimum = solve_bounded(arcs, 1.001 * least)

    for arc, costate, edges_s in zip(arcs, optimum.costates, optimum.edges_s, strict=True):
        assert flown(arc, costate, 1.001 * least, edges_s, optimum.free)[1] < 1e-6
    with pytest.raises(BoundTooSmallError):
        solve_bounded(arcs, 0.999 * least)


def test_smallest_bound_over_140_revolutions_is_near_the_peak_of_a_control() -> None:
    motion = ClohessyWiltshire(0.0011)
    duration_s = 818181.8
    n = 0.0011
    state = np.array([1042.875, -544.668, -206.956, 0.348, 0.814, 0.248])
    missing = -motion.transition(0.0, duration_s) @ state
    arc = Arc(motion, 0.0, duration_s, missing, np.zeros((6, 0)))
    # A control that is held over 5000 intervals: in the direction of the multipliers of least
    # squares, then corrected.
    count = 5000
    grid = np.linspace(0.0, duration_s, count + 1)
    scale = np.array([duration_s] * 3 + [1.0] * 3)
    # Hill's equations, x radially outward; the exponential of the system with its input as further
    # states.
    rates = np.zeros((9, 9))
    rates[:3, 3:6] = rates[3:6, 6:] = np.eye(3)
    rates[3, [0, 4]], rates[4, 3], rates[5, 2] = [3.0 * n**2, 2.0 * n], -2.0 * n, -(n**2)
    held = motion.transition(grid[1:], np.full(count, grid[-1])) @ expm(rates * grid[1])[:6, 6:]
    rows = (held / scale[:, None]).transpose(1, 0, 2).reshape(6, -1)
    wanted = missing / scale
    white = np.linalg.svd(rows, full_matrices=False)
    goal = white[0].T @ wanted / white[1]

    def negative(direction: Floats) -> float:
        sizes = np.linalg.norm((direction @ white[2]).reshape(count, 3), axis=1)
        return float(sizes.sum() / (direction @ goal))

    best = minimize(negative, goal / np.linalg.norm(goal), method="BFGS", options={"gtol": 1e-12}).x
    vectors = (best @ white[2]).reshape(count, 3)
    controls = (vectors / np.linalg.norm(vectors, axis=1)[:, None] / negative(best)).ravel()
    controls = controls + white[2].T @ (goal - white[2] @ controls)
    np.testing.assert_allclose(rows @ controls, wanted, atol=1e-9 * np.abs(wanted).max())
    peak = float(np.linalg.norm(controls.reshape(count, 3), axis=1).max())

    least = least_bound([arc]).value_m_s2

    assert least <= peak <= 1.001 * least
    assert solve_bounded([arc], 1.05 * least).energies[0] > 0.0
