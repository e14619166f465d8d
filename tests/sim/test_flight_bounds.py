"""Bounds of all motions of a model, against random motions by another integrator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from infoset import AngleSensor, InitialSet, Model, StateBox
from infoset.arrays import Floats
from infoset.guidance import Thruster
from infoset.sim import Scenario, Sun, simulate
from infoset.sim.flight_bounds import FlightBounds, flight_bounds
from infoset.sim.gravity import on_board_model, with_gravity
from infoset.sim.kepler import sun_and_orbit
from infoset.sim.scenario import of_model

EARTH_M3_S2 = 3.986004418e14


def flown(
    start: Floats, impulse_m_s: Floats, at_s: float, push_m_s2: Floats, sun: Sun, times_s: Floats
) -> Floats:
    """Position and velocity of spacecraft and object, shape (4, axes, N): one impulse, and a
    constant acceleration.
    """
    axes = start.shape[1]
    toward, along = (direction[-axes:] for direction in sun_and_orbit(sun))

    def rates(_: float, state: Floats) -> Floats:
        own, own_speed, there, speed = state.reshape(4, axes)
        pulls = [
            -sun.gravitational_parameter_m3_s2 * at / np.linalg.norm(at) ** 3 for at in (own, there)
        ]
        return np.concatenate([own_speed, pulls[0], speed, pulls[1] + push_m_s2])

    own = -sun.distance_m * toward
    orbit = np.sqrt(sun.gravitational_parameter_m3_s2 / sun.distance_m) * along
    state = np.concatenate([own, orbit, own + start[0], orbit + start[1]])
    parts: list[Floats] = []
    for times in (times_s[times_s <= at_s], times_s[times_s > at_s]):
        span = (0.0 if not parts else at_s, max(float(times.max(initial=0.0)), at_s))
        solution = solve_ivp(rates, span, state, "DOP853", dense_output=True, rtol=1e-13, atol=1e-6)
        parts.append(solution.sol(times))
        state = solution.y[:, -1] + np.concatenate(
            [np.zeros(axes), impulse_m_s, np.zeros(2 * axes)]
        )
    return np.concatenate(parts, axis=1).reshape(4, axes, -1)


def shares(states: Floats, flight: FlightBounds) -> Floats:
    """The maximum shares of the bounds that a motion reaches, before its arrival."""
    own, own_speed, there, speed = states[:, :, (states[2] - states[0])[-1] >= 0.0]
    place = there - own
    velocity = speed - own_speed
    n = place.shape[1]
    part = np.linspace(0.0, 1.0, 201)[:, None, None]
    nearest = np.linalg.norm(own + part * place, axis=1).min(axis=0)
    fastest = np.maximum(np.linalg.norm(own_speed, axis=0), np.linalg.norm(speed, axis=0))
    return np.array(
        [
            (np.abs(place) / flight.offset_m[:, :n]).max(),
            (np.abs(velocity) / flight.velocity_m_s[:, :n]).max(),
            (np.linalg.norm(place, axis=0) / flight.distance_m[:n]).max(),
            (np.linalg.norm(velocity, axis=0) / flight.speed_m_s[:n]).max(),
            (flight.nearest_m[:n] / nearest).max(),
            (fastest / flight.fastest_m_s[:n]).max(),
            (flight.closing_speed_m_s / -velocity[-1]).max(),
        ]
    )


@pytest.mark.parametrize(
    ("sun", "range_m", "speed_m_s"),
    [
        (Sun(EARTH_M3_S2, 7e6, np.radians(100.0)), 2e6, 9e3),
        (Sun(EARTH_M3_S2, 4.2e7, 0.5, 0.3), 3e7, 6e3),
        (Sun(EARTH_M3_S2, 1.1e8, 0.1), 1e8, 2e4),
        (Sun(1.327e20, 1.5e11, 1.0), 6e6, 6e4),
    ],
)
def test_no_motion_leaves_the_bounds_of_a_flight(
    sun: Sun, range_m: float, speed_m_s: float
) -> None:
    wide = 2e-3 * range_m
    fast = 2e-3 * speed_m_s
    push_m_s2 = 1e-6 * speed_m_s**2 / range_m
    box = StateBox(
        (-wide, 0.5 * wide),
        (range_m - wide, range_m + wide),
        (-fast, 2.0 * fast),
        (-speed_m_s - fast, -speed_m_s + fast),
        *(((-wide, wide), (-fast, fast)) if sun.elevation_rad else (None, None)),
    )
    lateral = len(box.axes)
    flight = flight_bounds(box, (push_m_s2,) * lateral, sun, fast)
    boxes = [box.axis(name) for name in box.axes]
    ends = [
        [*(each.z_m for each in boxes), box.x_m],
        [*(each.vz_m_s for each in boxes), box.vx_m_s],
    ]
    minimum, maximum = np.moveaxis(np.array(ends), 2, 0)
    random = np.random.default_rng(1)
    most = np.zeros(7)
    for _ in range(40):
        share = random.uniform(size=minimum.shape)
        start = minimum + (maximum - minimum) * np.where(
            random.uniform(size=minimum.shape) < 0.7, share.round(), share
        )
        direction = random.normal(size=lateral)
        impulse = np.append(fast * direction / np.linalg.norm(direction), 0.0)
        push = np.append(random.choice([-1.0, 1.0], lateral) * push_m_s2, 0.0)
        at_s = float(random.uniform() * flight.times_s[-1])
        most = np.maximum(
            most, shares(flown(start, impulse, at_s, push, sun, flight.times_s), flight)
        )
    assert (most <= 1.0 + 1e-9).all()
    assert (most > 0.9).all()  # the bounds are not far from what happens


def near_earth(base: Scenario) -> Scenario:
    """A target that starts 29 000 km from the Earth, 10 million km from the spacecraft."""
    box = StateBox((-1e6, 1e6), (9.999e9, 1.0001e10), (-10.0, 10.0), (-30_010.0, -29_990.0))
    from infoset.experiments import load_scenario

    base = load_scenario("asteroid-1997")
    model = replace(
        base.set_model,
        closing_speed_m_s=3e4,
        step_s=1000.0,
        bounds=box,
        angle_sensor=AngleSensor(1000.0, 5e-6, 5e-6, 1e10),
        range_threshold_m=1e6,
        sections=15,
        fewest_sections=3,
        model=Model.GUARANTEED,
        initial_set=InitialSet.BOX,
        disturbance_m_s2=0.0,
    )
    return replace(
        base,
        sun=Sun(EARTH_M3_S2, 1.002e10, np.radians(0.12)),
        nominal_range_m=1e10,
        dispersion=box,
        **of_model(model),
        range_sensor=None,
        thruster=Thruster(500.0, 0.1, 50.0),
    )


def test_a_target_near_the_earth_is_refused_with_the_range(asteroid: Scenario) -> None:
    """Its gravity is 0.47 m/s^2 there."""
    with pytest.raises(
        ValueError, match=r"may change the closing speed by .* at a range of 1e\+07 km"
    ):
        simulate(near_earth(asteroid), 2)
    far = replace(near_earth(asteroid), sun=Sun(EARTH_M3_S2, 1.3e10, np.radians(20.0)))
    results = simulate(far, 10)
    assert results.truth_kept.all()
    assert results.phi_held.all()


def test_gravity_reaches_its_bound_where_the_line_of_sight_has_the_worst_angle(
    asteroid: Scenario,
) -> None:
    """The component across the line of sight of the difference of gravity is 1.5 G r at 45
    degrees.
    """
    box = StateBox((0.0, 0.0), (6e6, 6e6), (0.0, 0.0), (-58e3, -58e3))
    model = replace(asteroid.set_model, bounds=box, disturbance_m_s2=0.0)
    bound = with_gravity(model, Sun(1.324948e20, 150e9, 0.25 * np.pi), 0.0).gravity_m_s2
    assert bound == pytest.approx(1.5 * 1.324948e20 / 150e9**3 * 6e6, rel=3e-3)
    assert on_board_model(replace(asteroid, sun=None)).gravity_m_s2 == 0.0
