"""Two-body motion of a pair of states, its closest approach, and the B-plane."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from infoset.arrays import Floats
from infoset.sim.approach import approach_axes, closest_approach_s, find_approach, propagate
from infoset.sim.kepler import KeplerMotion
from infoset.sim.results import b_plane

SUN, AU, DAY = 1.32712440018e20, 1.495978707e11, 86400.0
ECLIPTIC = np.array([0.0, 0.0, 1.0])
MEETING = np.array(
    [[1.04 * AU, 0.1 * AU, 0.0], [-2e3, 29e3, 2.5e3], [1.1e3, -0.7e3, 1.2e3], [2.6e3, 5e3, -1.5e3]],
    dtype=np.float64,
)
"""A pair of states at a close approach to the object, from the Sun."""


def kepler(position: Floats, velocity: Floats, time_s: float) -> list[mp.mpf]:
    """Position after a time, by universal variables with 40 digits."""
    with mp.workdps(40):
        place, speed = ([mp.mpf(float(x)) for x in vector] for vector in (position, velocity))
        distance = mp.norm(place)
        parameter = mp.mpf(SUN)
        time = mp.mpf(time_s)
        inverse_axis = 2 / distance - mp.fdot(speed, speed) / parameter
        radial = mp.fdot(place, speed) / mp.sqrt(parameter)

        def stumpff(chi: mp.mpf) -> tuple[mp.mpf, mp.mpf]:
            angle = mp.sqrt(inverse_axis) * chi
            return (1 - mp.cos(angle)) / angle**2, (angle - mp.sin(angle)) / angle**3

        def of_time(chi: mp.mpf) -> mp.mpf:
            c, s = stumpff(chi)
            cubic = (1 - inverse_axis * distance) * chi**3 * s
            return radial * chi**2 * c + cubic + distance * chi - mp.sqrt(parameter) * time

        chi = mp.findroot(of_time, mp.sqrt(parameter) * time * inverse_axis)
        c, s = stumpff(chi)
        f = 1 - chi**2 * c / distance
        g = time - chi**3 * s / mp.sqrt(parameter)
        return [f * x + g * v for x, v in zip(place, speed, strict=True)]


@pytest.mark.parametrize("days", [-10.0, 30.0])
def test_a_pair_moves_as_two_orbits_of_kepler(days: float) -> None:
    moved, _ = propagate(MEETING, SUN, days * DAY)
    craft, body = (
        kepler(MEETING[0] + place, MEETING[1] + speed, days * DAY)
        for place, speed in ((0, 0), (MEETING[2], MEETING[3]))
    )
    np.testing.assert_allclose(moved[0], np.array(craft, float), rtol=1e-11)
    relative = [float(one - other) for one, other in zip(body, craft, strict=True)]
    np.testing.assert_allclose(
        moved[2], relative, rtol=0.0, atol=1e-3
    )  # of some million kilometres


def test_transition_matrix_equals_finite_differences_and_is_symplectic() -> None:
    _, transition = propagate(MEETING, SUN, 20.0 * DAY)
    for component, step in enumerate([1e4] * 3 + [1e-2] * 3):
        ends = []
        for side in (-0.5, 0.5):
            changed = MEETING.copy()
            changed[2:].flat[component] += side * step
            ends.append(propagate(changed, SUN, 20.0 * DAY)[0][2:].ravel())
        difference = (ends[1] - ends[0]) / step
        scale = np.abs(transition).max(axis=1)
        np.testing.assert_allclose(difference / scale, transition[:, component] / scale, atol=1e-7)
    form = np.kron([[0.0, 1.0], [-1.0, 0.0]], np.eye(3))
    np.testing.assert_allclose(transition.T @ form @ transition, form, atol=1e-9)


def test_the_closest_approach_is_nearer_than_its_neighbours() -> None:
    before, _ = propagate(MEETING, SUN, -10.0 * DAY)
    time_s = closest_approach_s(before, SUN)
    at, *near = (propagate(before, SUN, time_s + later)[0] for later in (0.0, -0.01, 0.01))
    assert abs(at[2] @ at[3]) < 1e-6 * np.linalg.norm(at[2]) * np.linalg.norm(at[3])
    assert all(np.linalg.norm(each[2]) > np.linalg.norm(at[2]) for each in near)
    after, _ = propagate(before, SUN, time_s + 3600.0)
    assert closest_approach_s(after, SUN) == pytest.approx(-3600.0, abs=1e-6)


@pytest.mark.parametrize("seed", range(5))
def test_approach_axes_equal_published_definitions(seed: int) -> None:
    """T in the reference plane, as in GMAT: (S_y, -S_x, 0); R completes S, T, R, toward the
    south.
    """
    velocity = np.random.default_rng(seed).normal(size=3)
    t, r, s = approach_axes(velocity, ECLIPTIC)
    np.testing.assert_allclose(s, -velocity / np.linalg.norm(velocity))
    np.testing.assert_allclose(t, np.array([s[1], -s[0], 0.0]) / np.hypot(s[0], s[1]), atol=1e-15)
    np.testing.assert_allclose(np.cross(t, r), s, atol=1e-15)
    assert r[2] < 0.0


def test_b_points_from_the_object_to_the_spacecraft() -> None:
    """The position of the object across the approach is y = 3, z = 4; T is y, or z."""
    across = np.array([[3.0, 4.0]])
    assert b_plane(across, None).shape == (1, 0)
    np.testing.assert_allclose(b_plane(across, 0.0), [[-3.0, -4.0]])
    np.testing.assert_allclose(b_plane(across, 0.5 * np.pi), [[-4.0, 3.0]])


def test_b_without_gravity_is_the_part_of_the_position_across_the_velocity() -> None:
    random = np.random.default_rng(3)
    for _ in range(20):
        velocity = random.normal(size=3) * 1e4
        position = -3600.0 * velocity + random.normal(size=3) * 1e3
        states = np.array([np.zeros(3), np.zeros(3), position, velocity])
        turn = Rotation.random(random_state=random).as_matrix()
        found = find_approach(
            states,
            *(0.0, np.diag([1e6] * 3 + [1e-4] * 3)),
            turn[0],
            600.0,
        )
        offset = -(position - position @ velocity / (velocity @ velocity) * velocity)
        axes = approach_axes(velocity, turn[0])
        np.testing.assert_allclose(found.miss_m, axes[:2] @ offset, rtol=1e-8)
        # x and its rate have no correlation at the epoch; that at the start follows from the time
        # between.
        late = found.start_s
        assert found.covariance.matrix[2, 5] == pytest.approx(1e-4 * late, rel=1e-9)
        np.testing.assert_allclose(
            found.covariance.matrix[:3, :3], (1e6 + 1e-4 * late**2) * np.eye(3), atol=1e-3
        )


def test_the_simulated_motion_has_the_miss_of_the_states() -> None:
    """The spacecraft's orbit is not circular: the attracting body carries its velocity."""
    before, _ = propagate(MEETING, SUN, -10.0 * DAY)
    exact = np.zeros((6, 6))
    found = find_approach(before, SUN, exact, ECLIPTIC, 5.0 * DAY)
    motion = KeplerMotion(found.state[None, :3], found.state[None, 3:], found.sun)
    passed = False
    while not passed:
        passage = motion.advance(600.0)
        passed = bool(passage.passed[0])
    np.testing.assert_allclose(-passage.lateral_m[:, 0], found.miss_m, atol=0.01)
    assert passage.min_distance_m[0] > 1e3
