"""The acceptance of the theory: two and three drifting targets, splines, and their misprinted
conditions.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from infoset.rendezvous.multipoint import (
    Meet,
    Nodes,
    TimeLimits,
    Tour,
    TourTarget,
    best_order,
    best_order_of_slots,
    best_times,
    solve_segments,
)
from infoset.rendezvous.relative_motion import TimeVaryingMotion
from tests.rendezvous.multipoint.conftest import Make
from tests.rendezvous.multipoint.dense import solve_dense

NINE_DIGITS = 1e-9

# fmt: off
THREE = {
    "ts": [1200.0, 2600.0, 4000.0],
    "I": 0.021142280110555873,
    "dIdt": [-7.836556601890862e-06, -7.232202376944674e-06, -3.2601679492735453e-06],
    "rho": [
        [64.5458097971146, 1734.9631531613948, 27.949808318481026],
        [129.00913664506174, 3910.983539171972, 87.2941398534269],
        [-38.24086853405902, 5392.6201012366055, 86.8628542558863],
    ],
    "V": [
        [0.08981117509738477, 1.2600180127739138, 0.03782670021100969],
        [0.3308297971586566, 0.5225939086045648, 0.040924068964837246],
        [1.0964860405340213, 1.4282735319111008, -0.0624820513636131],
    ],
    "D": [
        [2.4759014943738814e-05, 2.2274580356238328e-06, 1.3234613415145052e-07],
        [1.3547481759700994e-05, 5.574434859638284e-06, 4.0418253359316805e-08],
        [-3.5085088624465724e-08, 2.458164669985855e-06, 9.351306209300918e-08],
    ],
    "lam_r0": [-6.743502295309554e-07, 1.0260057565247972e-05, -2.9254206678821592e-08],
    "lam_V0": [-0.003951812093324485, 0.004022288312119501, 4.0432882155092384e-05],
    "t_opt": [1521.3233432870954, 3015.0416119664947, 4000.0],
    "I_opt": 0.01835844971766454,
    "I_rdv_last": 0.023815941208960852,
    "I_rdv_all": 0.03321098114186421,
    "I_rdv_last_opt": 0.02315574123,
}
# fmt: on


def test_flybys_at_given_times_have_the_known_costs(tours: Make) -> None:
    times = np.array(THREE["ts"])
    path = tours(len(times)).fly(range(len(times)), times)
    for found, key in (
        (path.cost, "I"),
        (path.time_gradient, "dIdt"),
        (path.nodes.arrive[:, :3], "rho"),
        (path.arrival_states[:, 3:], "V"),
        (path.jumps[:, :3], "D"),
        (path.costate_start[:3], "lam_r0"),
        (path.costate_start[3:], "lam_V0"),
    ):
        np.testing.assert_allclose(found, np.array(THREE[key]), rtol=NINE_DIGITS, err_msg=key)
    assert np.abs(path.jumps[:, 3:]).max() < 1e-12 * np.abs(path.costate_before[:, 3:]).max()


def test_rendezvous_at_given_times_have_the_known_costs(tours: Make) -> None:
    times = np.array(THREE["ts"])
    count = 3
    last = tours(count, [Meet.FLYBY] * (count - 1) + [Meet.RENDEZVOUS]).fly(range(count), times)
    assert last.cost == pytest.approx(THREE["I_rdv_last"], rel=NINE_DIGITS)
    every = tours(count, [Meet.RENDEZVOUS] * count).fly(range(count), times)
    assert every.cost == pytest.approx(THREE["I_rdv_all"], rel=NINE_DIGITS)


def test_best_times(tours: Make) -> None:
    times = np.array(THREE["ts"])
    count = 3
    limits = TimeLimits(latest_s=float(times[-1]))
    found = best_times(tours(count), range(count), limits, [times])
    np.testing.assert_allclose(found.time_s, np.array(THREE["t_opt"]), rtol=NINE_DIGITS)
    assert found.path.cost == pytest.approx(THREE["I_opt"], rel=NINE_DIGITS)
    last = tours(count, [Meet.FLYBY] * (count - 1) + [Meet.RENDEZVOUS])
    cost = best_times(last, range(count), limits, [times]).path.cost
    assert cost == pytest.approx(
        THREE["I_rdv_last_opt"], rel=5e-9
    )  # the theory prints 9 or 10 digits


def test_last_time_with_a_price_is_the_known_one(tours: Make) -> None:
    found = best_times(tours(2), (0, 1), TimeLimits(price_per_s=1e-6), [np.array([1500.0, 3000.0])])
    np.testing.assert_allclose(found.time_s, [2905.083078, 4690.157388], rtol=NINE_DIGITS)
    assert found.path.cost == pytest.approx(0.0008170807218, rel=NINE_DIGITS)
    assert found.objective == pytest.approx(found.path.cost + 1e-6 * found.time_s[-1], rel=1e-14)


def test_the_order_that_is_worst_at_the_given_times_is_best_at_its_own(tours: Make) -> None:
    tour = tours(3)
    times = np.array(THREE["ts"])
    at_slots = {order: tour.fly(order, times).cost for order in itertools.permutations(range(3))}
    assert max(at_slots, key=lambda order: at_slots[order]) == (2, 1, 0)
    assert at_slots[2, 1, 0] == pytest.approx(0.05442751, rel=1e-7)
    assert best_order_of_slots(tour, times).order == min(
        at_slots, key=lambda order: at_slots[order]
    )
    found = best_order(tour, TimeLimits(latest_s=4000.0))
    assert found.order == (2, 1, 0)
    assert found.objective == pytest.approx(0.008734876263, rel=NINE_DIGITS)


def double_integrator(
    positions: list[float], times: list[float]
) -> tuple[TimeVaryingMotion, Nodes]:
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    motion = TimeVaryingMotion(lambda at: np.broadcast_to(matrix, (len(at), 6, 6)))
    states = np.zeros((len(times), 6))
    states[:, 0] = positions
    at = np.array(times)
    return motion, Nodes(at, at, states, states, np.zeros(len(times), dtype=bool))


def test_path_in_free_space_is_a_cubic_spline() -> None:
    # Clamped at the start, natural at the end: nodes 1, -1, 2 at t = 1, 2, 3 from rest.
    motion, nodes = double_integrator([1.0, -1.0, 2.0], [1.0, 2.0, 3.0])
    path = solve_segments(motion, 0.0, np.zeros(6), nodes)
    assert path.cost == pytest.approx(534.0 / 13.0, rel=1e-12)
    np.testing.assert_allclose(
        path.jumps[:, 0], np.array([450.0, -366.0, 126.0]) / 13.0, rtol=1e-11
    )
    np.testing.assert_allclose(
        path.arrival_states[:, 3], np.array([-9.0, -3.0, 60.0]) / 13.0, rtol=1e-11
    )
    assert solve_dense(motion, 0.0, np.zeros(6), nodes)[0] == pytest.approx(534.0 / 13.0, rel=1e-11)


def test_out_and_back() -> None:
    # Out to 1 and back to 0 within T = 1: best t1 = 2 - sqrt 2, I = 1.5 (1 + sqrt 2)^4.
    motion, nodes = double_integrator([1.0, 0.0], [0.5, 1.0])
    tour = Tour(motion, (TourTarget("out"), TourTarget("back")), nodes.arrive, np.zeros(6))
    found = best_times(tour, (0, 1), TimeLimits(latest_s=1.0))
    assert found.time_s[0] == pytest.approx(2.0 - np.sqrt(2.0), rel=1e-9)
    assert found.path.cost == pytest.approx(1.5 * (1.0 + np.sqrt(2.0)) ** 4, rel=1e-11)


@pytest.mark.parametrize("angle", [4.493409457909, 11.06652863])
def test_path_is_found_if_the_papers_elimination_is_singular(tours: Make, angle: float) -> None:
    # n t1 at which R13(t1, t0) has no inverse; the segment solver and the dense system do not mind.
    first = angle / 1.13e-3
    times = np.array([first, first + 1700.0])
    tour = tours(2)
    path = tour.fly((0, 1), times)
    motion = tour.motion
    reach = motion.gramian(0.0, first) @ motion.transition(first, 0.0).T
    singular = np.linalg.svd(reach[:3, :3], compute_uv=False)
    assert singular[-1] < 1e-6 * singular[0]
    cost, velocities = solve_dense(motion, 0.0, np.zeros(6), path.nodes)
    assert cost == pytest.approx(path.cost, rel=1e-11)
    np.testing.assert_allclose(velocities, path.arrival_states[:, 3:], rtol=1e-9)
    # And the answer changes smoothly across the spot.
    around = [tour.fly((0, 1), times + shift).cost for shift in (-1e-3, 1e-3)]
    assert path.cost == pytest.approx(0.5 * sum(around), rel=1e-10)
    slope = float(path.time_gradient.sum())
    assert (around[1] - around[0]) / 2e-3 == pytest.approx(slope, rel=1e-5)
