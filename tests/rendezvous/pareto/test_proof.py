"""Independent proof: a discretised quadratic program, and integration under the computed
control.
"""

from __future__ import annotations

import clarabel
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.sparse import csc_matrix

from infoset.arrays import Floats
from infoset.rendezvous.pareto import Component, Craft, Encounter, Meeting, Plan, solve_encounter
from infoset.rendezvous.relative_motion import ClohessyWiltshire, EllipticOrbit, TschaunerHempel

NODES = 24


@st.composite
def encounters(draw: st.DrawFn) -> Encounter:
    rate = draw(st.sampled_from([1.13e-3, 7.3e-5, 0.02]))
    duration = draw(st.floats(0.02, 3.0)) / rate
    count = draw(st.integers(1, 4))
    seed = draw(st.integers(0, 2**32 - 1))
    random = np.random.default_rng(seed)
    meeting = draw(st.sampled_from(list(Meeting)))
    open_ = list(Component)[: 6 if meeting is Meeting.RENDEZVOUS else 3]
    free = draw(st.lists(st.sampled_from(open_), min_size=1, max_size=len(open_), unique=True))
    motion = ClohessyWiltshire(rate)
    scale = np.array([duration] * 3 + [1.0] * 3)
    craft = tuple(
        Craft(str(each), random.normal(size=6) * scale, motion, float(random.uniform(0.2, 3.0)))
        for each in range(count)
    )
    return Encounter(craft, duration, tuple(free), random.normal(size=6) * scale, meeting)


def quadratic_program(encounter: Encounter) -> tuple[Floats, Floats]:
    """The meeting and the costs J^2, by clarabel over controls at Gauss points and the free values.

    The transition comes from a plain matrix exponential, states are in units of the duration.
    """
    motion = encounter.craft[0].motion
    duration = encounter.meeting_s
    common = encounter.common
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    times = 0.5 * duration * (1.0 + nodes)
    weights = 0.5 * weights
    matrix = motion.dynamics(0.0)
    scale = np.array([duration] * 3 + [1.0] * 3)
    # Unknown are sqrt(weight) u a Gauss point times the duration, craft by craft, then the free
    # values.
    effect = np.concatenate(
        [
            (expm(matrix * (duration - time)) / scale[:, None])[:common, 3:] * np.sqrt(weight)
            for time, weight in zip(times, weights, strict=True)
        ],
        axis=1,
    )
    count = len(encounter.craft)
    size = 3 * NODES
    free = len(encounter.free)
    rows = np.zeros((count * common, count * size + free))
    right = np.zeros(count * common)
    opening = (encounter.opening / scale[:, None])[:common]
    for index, craft in enumerate(encounter.craft):
        own = slice(index * common, (index + 1) * common)
        rows[own, index * size : (index + 1) * size] = effect
        rows[own, count * size :] = -opening * scale[[each.value for each in encounter.free]]
        right[own] = ((encounter.base - expm(matrix * duration) @ craft.state) / scale)[:common]
    weight = np.concatenate([np.repeat(encounter.weights, size), np.zeros(free)])
    settings_ = clarabel.DefaultSettings()
    settings_.verbose = False
    settings_.tol_gap_abs = settings_.tol_gap_rel = settings_.tol_feas = 1e-13
    solver = clarabel.DefaultSolver(
        csc_matrix(np.diag(weight)),
        np.zeros(len(weight)),
        csc_matrix(rows),
        right,
        [clarabel.ZeroConeT(len(right))],
        settings_,
    )
    found = np.array(solver.solve().x)
    controls = found[: count * size].reshape(count, size)
    point = found[count * size :] * scale[[each.value for each in encounter.free]]
    return point, (controls**2).sum(axis=1) / duration


@given(encounters())
@settings(max_examples=40, deadline=None)
def test_a_discretised_quadratic_program_agrees(encounter: Encounter) -> None:
    solution = solve_encounter(encounter)
    point, costs = quadratic_program(encounter)
    scale = np.array([encounter.meeting_s] * 3 + [1.0] * 3)[[each.value for each in encounter.free]]
    size = 1.0 + float(np.abs(solution.ideals / scale).max())
    np.testing.assert_allclose(solution.point / scale, point / scale, rtol=0.0, atol=1e-8 * size)
    total = float(solution.cost_squared().max()) + 1e-3 * size**2 / encounter.meeting_s
    np.testing.assert_allclose(solution.cost_squared(), costs, rtol=0.0, atol=1e-8 * total)


@given(encounters())
@settings(max_examples=12, deadline=None)
def test_flying_the_control_ends_at_the_meeting(encounter: Encounter) -> None:
    solution = solve_encounter(encounter)
    scale = np.array([encounter.meeting_s] * 3 + [1.0] * 3)
    for index, craft in enumerate(encounter.craft):
        plan = solution.plan(index)

        def rates(time: float, values: Floats, craft: Craft = craft, plan: Plan = plan) -> Floats:
            control = plan.control(time)
            pushed = np.concatenate([np.zeros(3), control])
            moved = craft.motion.dynamics(time) @ values[:6] + pushed
            return np.append(moved, control @ control)

        begin = np.append(craft.state, 0.0)
        atol = 1e-12 * np.append(scale, 1.0)
        flown = solve_ivp(
            rates, (0.0, encounter.meeting_s), begin, method="DOP853", rtol=1e-12, atol=atol
        ).y[:, -1]
        common = encounter.common
        size = (
            float(
                np.abs(
                    np.concatenate([craft.state, solution.meeting_state()]) / np.tile(scale, 2)
                ).max()
            )
            + 1.0
        )
        missed = (flown[:6] - solution.meeting_state()) / scale
        assert np.abs(missed[:common]).max() < 1e-8 * size
        assert np.abs((flown[:6] - plan.state(encounter.meeting_s)) / scale).max() < 1e-8 * size
        assert flown[6] == pytest.approx(
            solution.cost_squared()[index], rel=1e-8, abs=1e-8 * size**2 / encounter.meeting_s
        )


def test_craft_with_their_own_starts_and_orbits_meet() -> None:
    orbit = EllipticOrbit(1.1e-3, 0.2, 0.5)
    craft = (
        Craft("long", np.array([500.0, 40.0, 10.0, 0.1, 0.0, 0.0]), TschaunerHempel(orbit)),
        Craft(
            "short", np.array([-300.0, 0.0, 0.0, 0.0, 0.2, 0.1]), TschaunerHempel(orbit), 2.0, 400.0
        ),
    )
    encounter = Encounter(craft, 1500.0, (Component.X, Component.Y, Component.Z), np.zeros(6))
    solution = solve_encounter(encounter)
    assert not solution.same_matrix
    for index in range(2):
        np.testing.assert_allclose(
            solution.plan(index).state(1500.0), solution.meeting_state(), atol=1e-8
        )
    # The weighted sum of excesses is smallest: its gradient vanishes.
    gradient = sum(
        each.craft.weight * each.matrix @ (solution.point - each.ideal) for each in solution.costs
    )
    assert (
        np.abs(gradient).max()
        < 1e-12 * np.abs(solution.costs[0].matrix @ solution.costs[0].ideal).max()
    )
