"""Independent proof on random problems: the paper's dense system, integration, finite
differences.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from infoset.arrays import Floats
from infoset.rendezvous.multipoint import Meet, Tour, TourTarget, solve_segments
from infoset.rendezvous.relative_motion import (
    ClohessyWiltshire,
    EllipticOrbit,
    LinearMotion,
    TschaunerHempel,
)
from tests.rendezvous.multipoint.dense import solve_dense

RATE = 1.13e-3
SEEDS = st.integers(0, 2**32 - 1)


MOTIONS: dict[str, Callable[[], LinearMotion]] = {
    "circular": lambda: ClohessyWiltshire(RATE),
    "elliptic": lambda: TschaunerHempel(EllipticOrbit(RATE, 0.3, 0.7)),
}


def some_tour(
    seed: int, motion: LinearMotion, *, dwell: bool = False, flybys: bool = False
) -> tuple[Tour, Floats]:
    """A random tour, and times."""
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 6))
    meets = [
        Meet.RENDEZVOUS if random.random() < 0.4 and not flybys else Meet.FLYBY
        for _ in range(count)
    ]
    targets = tuple(
        TourTarget(
            str(index),
            meet,
            float(random.uniform(50.0, 300.0)) if dwell and meet is Meet.RENDEZVOUS else 0.0,
        )
        for index, meet in enumerate(meets)
    )
    states = random.normal(size=(count, 6)) * np.array([500.0, 2000.0, 200.0, 0.3, 0.5, 0.2])
    gaps = random.uniform(300.0, 2500.0, size=count)
    stays = np.array([each.dwell_s for each in targets])
    times = 100.0 + np.cumsum(gaps) + np.concatenate([[0.0], np.cumsum(stays[:-1])])
    start = random.normal(size=6) * np.array([100.0, 100.0, 100.0, 0.1, 0.1, 0.1])
    return Tour(motion, targets, states, start, 100.0), times


def flown(tour: Tour, times: Floats) -> tuple[Floats, float]:
    """Maximum miss of the nodes in units of the segments, and the cost, by DOP853 under the
    computed control.
    """
    path = tour.fly(range(len(times)), times)
    worst, spent = 0.0, 0.0
    for index, (start, end) in enumerate(zip(path.starts_s, path.nodes.arrive_s, strict=True)):
        ahead = path.costate_before[index]

        def rates(time: float, values: Floats) -> Floats:
            # The costate comes along, integrated backward from its end beforehand: here forward
            # from its start.
            state = values[:6]
            costate = values[6:12]
            matrix = tour.motion.dynamics(time)
            control = costate[3:]
            moved = matrix @ state + np.append(np.zeros(3), control)
            return np.concatenate([moved, -matrix.T @ costate, [0.5 * control @ control]])

        scale = np.array([end - start] * 3 + [1.0] * 3)
        begin = np.concatenate(
            [path.start_states[index], path.costate(np.array([start]))[0], [0.0]]
        )
        found = solve_ivp(rates, (start, end), begin, method="DOP853", rtol=1e-12, atol=1e-18).y[
            :, -1
        ]
        wanted = 3 if not path.nodes.rendezvous[index] else 6
        size = np.abs(
            np.concatenate([path.start_states[index], path.arrival_states[index]])
            / np.tile(scale, 2)
        ).max()
        worst = max(
            worst,
            float(np.abs((found[:6] - path.nodes.arrive[index]) / scale)[:wanted].max() / size),
        )
        worst = max(
            worst, float(np.abs((found[:6] - path.arrival_states[index]) / scale).max() / size)
        )
        assert found[6:12] == pytest.approx(ahead, rel=1e-6, abs=1e-8 * float(np.abs(ahead).max()))
        spent += float(found[12])
    return np.array(worst), spent


@pytest.mark.parametrize("name", MOTIONS)
@given(SEEDS)
@settings(max_examples=4, deadline=None)
def test_flying_the_control_passes_the_nodes_at_the_cost(name: str, seed: int) -> None:
    tour, times = some_tour(seed, MOTIONS[name](), dwell=True)
    missed, spent = flown(tour, times)
    assert missed < 1e-8
    assert spent == pytest.approx(tour.fly(range(len(times)), times).cost, rel=1e-8)


@pytest.mark.parametrize("name", MOTIONS)
@given(SEEDS)
@settings(max_examples=2, deadline=None)
def test_time_gradient_is_the_difference_of_costs(name: str, seed: int) -> None:
    tour, times = some_tour(seed, MOTIONS[name](), dwell=True)
    order = range(len(times))
    path = tour.fly(order, times)
    size = float(np.abs(path.time_gradient).max())
    for index in range(len(times)):
        # Fourth order in the step: the truncation and the rounding are both below the 1e-6 asked
        # for.
        way = np.zeros(len(times))
        way[index] = step = 0.02 * float(np.diff(np.concatenate([[tour.start_s], times])).min())
        values = {
            factor: tour.fly(order, times + factor * way / 4.0).cost for factor in (-2, -1, 1, 2)
        }
        near = (values[1] - values[-1]) / (0.5 * step)
        far = (values[2] - values[-2]) / step
        assert (4.0 * near - far) / 3.0 == pytest.approx(
            path.time_gradient[index], rel=1e-6, abs=1e-6 * size
        )


@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_jumps_are_the_derivatives_of_the_cost_by_the_targets(seed: int) -> None:
    tour, times = some_tour(seed, ClohessyWiltshire(RATE))
    path = tour.fly(range(len(times)), times)
    for index in range(len(times)):
        for axis in range(6 if path.nodes.rendezvous[index] else 3):
            step = (10.0, 10.0, 10.0, 0.01, 0.01, 0.01)[axis]
            costs = []
            for side in (-1.0, 1.0):
                moved = path.nodes.arrive.copy()
                moved[index, axis] += side * step
                nodes = replace(path.nodes, arrive=moved, leave=moved)
                costs.append(
                    solve_segments(tour.motion, tour.start_s, tour.start_state, nodes).cost
                )
            # The cost is quadratic in a target's state: the central difference is exact.
            size = float(np.abs(path.jumps[:, axis]).max())
            assert (costs[1] - costs[0]) / (2.0 * step) == pytest.approx(
                path.jumps[index, axis], rel=1e-6, abs=1e-6 * size
            )


@pytest.mark.parametrize("name", ["circular", "elliptic"])
@given(SEEDS)
@settings(max_examples=10, deadline=None)
def test_path_agrees_with_the_papers_dense_system(name: str, seed: int) -> None:
    tour, times = some_tour(seed, MOTIONS[name](), flybys=True)
    path = tour.fly(range(len(times)), times)
    cost, velocities = solve_dense(tour.motion, tour.start_s, tour.start_state, path.nodes)
    assert cost == pytest.approx(path.cost, rel=1e-8)
    size = float(np.abs(velocities).max())
    np.testing.assert_allclose(velocities, path.arrival_states[:, 3:], rtol=0.0, atol=1e-7 * size)


def test_states_and_costates_along_a_path(tours: Callable[..., Tour]) -> None:
    meets = [Meet.FLYBY, Meet.RENDEZVOUS, Meet.FLYBY]
    stays = [0.0, 400.0, 0.0]
    tour = tours(3, meets, stays)
    path = tour.fly((0, 1, 2), [1200.0, 2600.0, 4000.0])
    staying = np.array([2600.0, 2700.0, 2999.0])
    target = tour.motion.transition(np.full(3, 2600.0), staying) @ path.nodes.arrive[1]
    np.testing.assert_allclose(path.state(staying), target, rtol=1e-12)
    assert not path.control(staying).any()
    mixed = np.array([3500.0, 0.0, 2800.0, 4000.0, 600.0, 1200.0])
    one_by_one = np.concatenate([path.state(mixed[each : each + 1]) for each in range(6)])
    np.testing.assert_allclose(path.state(mixed), one_by_one, rtol=1e-10, atol=1e-9)
    apart = np.abs(path.costate(np.array([0.0]))[0] - path.costate_start).reshape(2, 3).max(axis=1)
    assert (apart <= 1e-14 * np.abs(path.costate_start).reshape(2, 3).max(axis=1)).all()
    np.testing.assert_allclose(path.costate(mixed), path.along(mixed)[1], rtol=1e-9, atol=1e-20)
    np.testing.assert_allclose(
        path.state(np.array([4000.0]))[0], path.arrival_states[2], rtol=1e-10
    )
    # At the end of a path that ends in a flyby nothing pushes any more.
    assert np.abs(path.control(np.array([4000.0]))).max() < 1e-12
