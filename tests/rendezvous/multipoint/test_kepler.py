"""Visits under a point's gravity: the acceptance, and what the nonlinear problem itself says of the
answers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from infoset.arrays import Floats
from infoset.rendezvous.multipoint import (
    KeplerTour,
    Meet,
    NotSettledError,
    Path,
    TimeLimits,
    TourTarget,
    best_order,
    best_times,
)
from infoset.rendezvous.multipoint._shooting import propagate
from infoset.rendezvous.two_body import coast

START = np.array([1.0, 0.0, 0.0, 0.0, 1.0, 0.0])


def circular(radius: float, phase: float, inclination: float) -> Floats:
    """Inertial state on a circle, mu = 1."""
    speed, (c, s) = radius**-0.5, (np.cos(phase), np.sin(phase))
    tilt = np.array([1.0, np.cos(inclination), np.sin(inclination)])
    return np.concatenate(
        [radius * np.array([c, s, s]) * tilt, speed * np.array([-s, c, c]) * tilt]
    )


def tour(
    meets: Sequence[Meet] = (Meet.FLYBY, Meet.FLYBY), dwell: float = 0.0, scale: float = 1.0
) -> KeplerTour:
    """The theory's case; `scale` moves the targets farther from the chaser's orbit."""
    states = np.array(
        [
            circular(1.0 + 0.01 * scale, 0.02 * scale, 0.005 * scale),
            circular(1.0 + 0.02 * scale, 0.05 * scale, -0.01 * scale),
        ]
    )
    described = tuple(
        TourTarget(name, meet, dwell if meet is Meet.RENDEZVOUS else 0.0)
        for name, meet in zip("ab", meets, strict=True)
    )
    return KeplerTour(described, states, np.zeros(2), 1.0, START)


def rates(_time: float, values: Floats) -> Floats:
    """Derivatives of position, velocity and their costates with the control of the maximum
    principle.
    """
    r, velocity, by_position, by_velocity = np.split(values, 4)
    cube = np.linalg.norm(r) ** 3
    pull = by_velocity / cube - 3.0 * (r @ by_velocity) * r / (cube * (r @ r))
    return np.concatenate([velocity, by_velocity - r / cube, pull, -by_position])


def missed(path: Path) -> float:
    """How far a nonlinear flight with the path's costates, DOP853, ends from the nodes and from
    their costates.
    """
    worst = 0.0
    for index, (start, end) in enumerate(zip(path.starts_s, path.nodes.arrive_s, strict=True)):
        costate = path.costate_start if index == 0 else path.costate_after[index - 1]
        begin = np.concatenate([path.start_states[index], costate])
        found = solve_ivp(rates, (start, end), begin, method="DOP853", rtol=1e-12, atol=1e-15).y[
            :, -1
        ]
        wanted = 6 if path.nodes.rendezvous[index] else 3
        worst = max(worst, float(np.abs(found[:6] - path.nodes.arrive[index])[:wanted].max()))
        worst = max(
            worst,
            float(np.abs(found[6:] - path.costate_before[index]).max() / np.abs(costate).max()),
        )
    return worst


def test_the_theorys_case() -> None:
    path = tour().fly((0, 1), [2.0, 4.0])
    assert path.cost == pytest.approx(4.267529653e-5, rel=1e-9)
    assert missed(path) < 1e-9


@pytest.mark.parametrize("meets", [(Meet.FLYBY, Meet.RENDEZVOUS), (Meet.RENDEZVOUS, Meet.FLYBY)])
def test_rendezvous_and_stays(meets: tuple[Meet, Meet]) -> None:
    case = tour(meets, dwell=0.4)
    path = case.fly((0, 1), [2.0, 4.0])
    assert missed(path) < 1e-9
    inside = np.array([0.5, 1.9, 2.2, 3.0])
    states = path.state(inside)
    if meets[0] is Meet.RENDEZVOUS:
        np.testing.assert_allclose(
            states[2], case.target_states(np.array([0]), np.array([2.2]))[0], atol=1e-9
        )
        assert not path.control(inside)[2].any()


def test_time_gradient_is_the_difference_of_costs() -> None:
    case = tour((Meet.FLYBY, Meet.RENDEZVOUS))
    path = case.fly((0, 1), [2.0, 4.0])
    for index in range(2):
        step = np.zeros(2)
        step[index] = 1e-2
        costs = {
            factor: case.fly((0, 1), np.array([2.0, 4.0]) + factor * step).cost
            for factor in (-2, -1, 1, 2)
        }
        near = (costs[1] - costs[-1]) / 2e-2
        far = (costs[2] - costs[-2]) / 4e-2
        size = float(np.abs(path.time_gradient).max())
        assert (4.0 * near - far) / 3.0 == pytest.approx(
            path.time_gradient[index], rel=1e-6, abs=1e-6 * size
        )


@pytest.mark.parametrize("scale", [8.0, pytest.param(20.0, marks=pytest.mark.thorough)])
def test_targets_far_from_the_coasting_orbit(scale: float) -> None:
    path = tour(scale=scale).fly((0, 1), [2.0, 5.0])
    assert missed(path) < 1e-7


ALLOWED = 1e-10
"""Newton's method stops at residuals of 1e-11 of the distance; costates at the nodes are relative
to the largest.
"""


def test_flybys_shortly_one_after_another_are_met() -> None:
    # More than 100 times the gravity: steps of the coasting orbit missed by 1e-8 of the distance.
    states = np.array([circular(1.1, 0.1, 0.0), circular(0.9, 0.1, 0.05)])
    case = KeplerTour((TourTarget("a"), TourTarget("b")), states, np.zeros(2), 1.0, START)

    path = case.fly((0, 1), [0.05, 0.1])

    assert float(np.abs(path.control(np.linspace(0.0, 0.1, 11))).max()) > 100.0
    assert missed(path) < ALLOWED


def random_visits(seed: int) -> tuple[KeplerTour, Floats]:
    """One to three visits 0.003 to 0.2 rad apart, which need up to 500 times the gravity."""
    random = np.random.default_rng(seed)
    gap = 10.0 ** random.uniform(-2.5, -0.7)
    count = int(random.integers(1, 4))
    size = min(0.5 * 10.0 ** random.uniform(-1.0, 2.7) * gap**2, 0.4)
    states = np.array(
        [
            circular(
                1.0 + size * random.uniform(-1.0, 1.0),
                size * random.normal(),
                size * random.uniform(-1.0, 1.0),
            )
            for _ in range(count)
        ]
    )
    targets = tuple(
        TourTarget(str(at), Meet.FLYBY if random.random() < 0.6 else Meet.RENDEZVOUS)
        for at in range(count)
    )
    times = random.uniform(0.02, 0.3) + gap * np.arange(count)
    return KeplerTour(targets, states, np.zeros(count), 1.0, START), times


@pytest.mark.parametrize("seed", range(20))
def test_visits_with_a_large_control_are_met(seed: int) -> None:
    # 7 of 20 missed by more, up to 2e-7.
    case, times = random_visits(seed)
    assert missed(case.fly(range(len(times)), times)) < ALLOWED


def test_steps_follow_a_control_that_grows_from_zero() -> None:
    costate = np.array([-2000.0, 500.0, 0.0, 0.0, 0.0, 0.0])
    z = np.zeros((13, 1))
    z[:12, 0] = np.concatenate([START, costate])

    assert propagate(z, 0.05)

    found = solve_ivp(
        rates,
        (0.0, 0.05),
        np.concatenate([START, costate]),
        method="DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    size = np.repeat([1.0, 10.0, 2000.0, 100.0], 3)
    # Fifty steps of relative error 1e-13 at most.
    np.testing.assert_allclose(z[:12, 0] / size, found.y[:, -1] / size, rtol=0.0, atol=1e-11)


def test_a_flyer_goes_on_from_the_last_path() -> None:
    case = tour(scale=8.0)
    path = case.fly((0, 1), [2.0, 5.0])
    fly = case.flyer((0, 1))
    assert fly(np.array([2.0, 5.0])).cost == pytest.approx(path.cost, rel=1e-9)
    near = fly(np.array([2.01, 5.0]))
    assert near.cost == pytest.approx(path.cost + 0.01 * path.time_gradient[0], rel=2e-2)
    assert missed(near) < 1e-7


def relative_to_a_circle(x: float, y: float, x_rate: float, y_rate: float) -> Floats:
    """Inertial state of a craft near one at (1, 0, 0) on a circular orbit, from its state in Hill's
    axes.
    """
    return np.array([1.0 + x, y, 0.0, x_rate - y, 1.0 + x + y_rate, 0.0])


@pytest.mark.parametrize(
    "start",
    [
        relative_to_a_circle(
            0.2, 0.2, 0.1, 0.1
        ),  # a published rendezvous: a hyperbola, refused as no ellipse
        np.array([1.0, 0.0, 0.0, 0.0, np.sqrt(2.0), 0.0]),  # a parabola
        np.array([1.2, 0.1, 0.1, -2.0, 0.5, 0.0]),  # a hyperbola, inward
        np.array([1.1, 0.0, 0.0, -0.1, 0.0, 0.0]),  # straight down, to the centre after the flight
    ],
)
def test_a_chaser_may_start_on_any_conic(start: Floats) -> None:
    target = np.array([[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]])
    case = KeplerTour((TourTarget("station", Meet.RENDEZVOUS),), target, np.zeros(1), 1.0, start)

    path = case.fly((0,), [1.0])

    assert missed(path) < ALLOWED
    begin = np.concatenate([start, path.costate_start, [0.0]])
    flown = solve_ivp(with_energy, (0.0, 1.0), begin, method="DOP853", rtol=1e-12, atol=1e-14)
    assert path.cost == pytest.approx(flown.y[-1, -1], rel=1e-9)


def with_energy(time: float, values: Floats) -> Floats:
    return np.append(rates(time, values[:12]), 0.5 * values[9:12] @ values[9:12])


def test_targets_may_be_on_any_conic() -> None:
    # An escaping target, whose state is known at an epoch after the visit.
    state = np.array([0.9, -1.3, 0.1, 1.5, 0.4, -0.2])
    case = KeplerTour(
        (TourTarget("comet"),), coast(state, 3.0, 1.0)[None], np.array([3.5]), 1.0, START
    )

    path = case.fly((0,), [0.5])

    np.testing.assert_allclose(path.nodes.arrive[0], state, atol=1e-13)
    assert missed(path) < ALLOWED


def test_a_start_at_the_centre_is_refused() -> None:
    with pytest.raises(ValueError, match="at the attracting point"):
        KeplerTour((TourTarget("a"),), START[None], np.zeros(1), 1.0, np.zeros(6))


def test_unreachable_targets_are_refused_with_the_reason() -> None:
    # Straight across, through the centre.
    across = (TourTarget("a"),), np.array([circular(1.0, np.pi, 0.0)]), np.zeros(1), 1.0
    with pytest.raises(NotSettledError, match="give visits more time"):
        KeplerTour(*across, START).fly((0,), [0.02])


@given(st.floats(0.0, 0.9), st.floats(-30.0, 30.0), st.integers(0, 1000))
@settings(deadline=None)
def test_coasting_keeps_energy_and_momentum_and_comes_back(
    eccentricity: float, duration: float, seed: int
) -> None:
    random = np.random.default_rng(seed)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    speed = np.sqrt(1.0 + eccentricity)
    state = np.concatenate([axes[0], speed * (0.8 * axes[1] + 0.6 * axes[2])])
    moved = coast(state, duration, 1.0)
    momentum = np.cross(state[:3], state[3:])
    np.testing.assert_allclose(np.cross(moved[:3], moved[3:]), momentum, atol=1e-11)
    energy = 0.5 * state[3:] @ state[3:] - 1.0
    assert 0.5 * moved[3:] @ moved[3:] - 1.0 / np.linalg.norm(moved[:3]) == pytest.approx(
        energy, rel=1e-10
    )
    np.testing.assert_allclose(coast(moved, -duration, 1.0), state, atol=1e-8)


def test_best_order_with_a_price_of_time_alone_begins_at_the_guess() -> None:
    """Formerly a partial order had no times to start from, and was refused."""
    limits = TimeLimits(price_per_s=1e-6)
    guess = np.array([1.0, 2.0])

    found = best_order(tour(), limits, [guess])

    costs = [best_times(tour(), order, limits, [guess]).objective for order in ((0, 1), (1, 0))]
    assert found.order == ((0, 1), (1, 0))[int(np.argmin(costs))]
    # Both searches end at the same minimum, to their relative accuracy.
    assert found.objective == pytest.approx(min(costs), rel=1e-6)
