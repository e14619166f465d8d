"""Motion, random numbers and bounds of engagements in space: the plane and symmetries."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest

from infoset import Model, SetModel
from infoset.arrays import Floats
from infoset.sim import Manoeuvre, Scenario, Sun, Target
from infoset.sim.draws import Draws, draw
from infoset.sim.gravity import max_impulses_m_s, on_board_model, with_gravity
from infoset.sim.kepler import KeplerMotion, sun_and_orbit
from infoset.sim.scenario import corners
from infoset.sim.target import acceleration_m_s2
from tests.space import in_space

SUN = Sun(1.324948e20, 150e9, np.pi / 2)
BATCH = 20


@pytest.fixture(scope="module")
def spatial(asteroid: Scenario) -> Scenario:
    """The paper's engagement with its numbers in both axes."""
    return in_space(asteroid)


@pytest.fixture(scope="module")
def starts(spatial: Scenario) -> Draws:
    """Random starts in space."""
    return draw(spatial, range(BATCH), 5)


def flown(
    position: Floats, velocity: Floats, sun: Sun | None, impulses: Floats, pushes: Floats
) -> list[Floats]:
    """Everything that a flight to its closest approach shows; impulses and pushes have shape (C,
    B).
    """
    motion = KeplerMotion(position, velocity, sun)
    shown = [motion.arrival_s()]
    for step in range(210):
        if step % 17 == 3:
            motion.fire(impulses * (-1.0) ** step)
        push = pushes * (-1.0) ** step if step % 20 == 0 else None
        passage = motion.advance(0.5, push)
        shown += [motion.position_m.T, motion.velocity_m_s.T, *astuple(passage)]
        if (motion.position_m[:, -1] > 0.0).all():
            shown += astuple(motion.sight())
    return shown


def along(values: Floats, axes: list[int]) -> Floats:
    """Axes of an array (axes, B) in another order; an array (B,) as it is."""
    return values if values.ndim == 1 else values[axes[: len(values)]]


@pytest.mark.parametrize(
    "sun", [None, SUN, *(replace(SUN, direction_rad=angle) for angle in (0.0, -0.6, 2.5, np.pi))]
)
def test_the_plane_is_a_special_case_bit_for_bit(sun: Sun | None, starts: Draws) -> None:
    lateral = np.linspace(-3.0, 3.0, BATCH) * np.ones((2, 1))
    lateral[0] = 0.0
    position = starts.position_m.copy()
    velocity = starts.velocity_m_s.copy()
    position[:, 0] = velocity[:, 0] = 0.0
    in_plane = flown(position[:, 1:], velocity[:, 1:], sun, lateral[1:], lateral[1:])
    for planar, spatial in zip(
        in_plane, flown(position, velocity, sun, lateral, lateral), strict=True
    ):
        if spatial.ndim == 1:
            np.testing.assert_array_equal(spatial, planar)
        else:
            np.testing.assert_array_equal(spatial[0], 0.0)
            np.testing.assert_array_equal(spatial[1:], planar)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_exchanging_the_lateral_axes_exchanges_the_motion_bit_for_bit(
    sign: float, starts: Draws
) -> None:
    along_z = replace(SUN, direction_rad=sign * 0.5 * np.pi)
    along_y = replace(SUN, direction_rad=0.0, elevation_rad=sign * 0.5 * np.pi)
    lateral = np.random.default_rng(1).uniform(-5.0, 5.0, (2, BATCH))
    one = flown(starts.position_m, starts.velocity_m_s, along_z, lateral, 0.1 * lateral)
    swapped = [starts.position_m[:, [1, 0, 2]], starts.velocity_m_s[:, [1, 0, 2]]]
    other = flown(swapped[0], swapped[1], along_y, lateral[::-1], 0.1 * lateral[::-1])
    for here, there in zip(one, other, strict=True):
        np.testing.assert_array_equal(here, along(there, [1, 0, 2]))


def test_a_mirrored_sun_mirrors_the_motion_bit_for_bit(starts: Draws) -> None:
    sun = replace(SUN, direction_rad=0.7, elevation_rad=0.4)
    lateral = np.random.default_rng(3).uniform(-5.0, 5.0, (2, BATCH))
    one = flown(starts.position_m, starts.velocity_m_s, sun, lateral, lateral)
    for signs, mirrored in (
        ((-1.0, 1.0, 1.0), replace(sun, elevation_rad=-0.4)),
        ((1.0, -1.0, 1.0), replace(sun, direction_rad=-0.7)),
        ((-1.0, -1.0, 1.0), replace(sun, direction_rad=-0.7, elevation_rad=-0.4)),
    ):
        flip = np.array(signs)
        push = flip[:2, None] * lateral
        other = flown(flip * starts.position_m, flip * starts.velocity_m_s, mirrored, push, push)
        for here, there in zip(one, other, strict=True):
            np.testing.assert_array_equal(
                here, there if there.ndim == 1 else flip[: len(there), None] * there
            )


def test_the_orbit_is_across_the_sun_and_toward_x() -> None:
    for direction, elevation in np.random.default_rng(4).uniform(-1.5, 1.5, (100, 2)):
        toward, orbit = sun_and_orbit(Sun(1.0, 1.0, 2.0 * direction, elevation))
        np.testing.assert_allclose(
            [toward @ toward, orbit @ orbit, toward @ orbit], [1.0, 1.0, 0.0], atol=4e-16
        )
        np.testing.assert_allclose(
            np.linalg.det(np.array([toward, orbit, [0.0, 0.0, 1.0]])), 0.0, atol=2e-16
        )
        assert orbit[2] > 0.0


def test_gravity_is_never_greater_than_its_bound(spatial: Scenario) -> None:
    """The true difference of gravity at 10 000 points of the box, for any direction of the Sun."""
    box = spatial.set_model.bounds
    impulses = max_impulses_m_s(spatial.set_model, spatial.thruster)
    # The minimum distance from the Sun, and thereby the bound, depends on its direction by less
    # than 1e-4.
    model = with_gravity(spatial.set_model, replace(SUN, direction_rad=0.0), impulses)
    minimum, maximum = corners(box)
    random = np.random.default_rng(6)
    states = minimum + (maximum - minimum) * random.uniform(size=(10_000, 6))
    moment = random.uniform(size=(10_000, 1)) * states[:, 2:3] / -states[:, 5:]
    place = (states[:, :3] + moment * states[:, 3:]).astype(np.longdouble)
    place[:, :2] += impulses * moment * random.uniform(-1.0, 1.0, (10_000, 2)) / np.sqrt(2.0)
    toward = random.normal(size=(10_000, 3)).astype(np.longdouble)
    toward[::2, 0] = 0.0  # in the plane of z
    toward[::4, [1, 2]] = np.sqrt(np.longdouble(0.5)) * np.sign(
        toward[::4, [1, 2]]
    )  # where the bound is sharp
    sun = SUN.distance_m * toward / np.sqrt((toward**2).sum(axis=1, keepdims=True))
    own = sun / SUN.distance_m**3
    there = (sun - place) / (((sun - place) ** 2).sum(axis=1, keepdims=True)) ** 1.5
    pull = SUN.gravitational_parameter_m3_s2 * np.abs(there - own)
    bounds = np.array([model.axis(name).gravity_m_s2 for name in model.axes])
    assert (pull[:, :2] <= bounds).all()
    assert pull[:, 1].max() > 0.85 * bounds[1]
    assert (100.0 * pull[:, 2] <= model.gravity_speed_change * model.closing_speed_m_s).all()


def test_bound_of_gravity_without_motion_along_y_equals_the_planar_bound(
    asteroid: Scenario, spatial: Scenario
) -> None:
    def idle(model: SetModel) -> SetModel:
        bounds = replace(model.bounds, y_m=(0.0, 0.0), vy_m_s=(0.0, 0.0))
        return replace(model, bounds=bounds, disturbance_y_m_s2=0.0)

    for sun in (None, SUN):
        planar = with_gravity(asteroid.set_model, sun, 900.0)
        alone = with_gravity(idle(spatial.set_model), sun, 900.0)
        assert alone.axis("z") == planar
        assert alone.speed_error == planar.speed_error
        both = with_gravity(spatial.set_model, sun, 900.0)
        assert both.axis("y").gravity_m_s2 == pytest.approx(both.gravity_m_s2, rel=1e-9)
        assert both.gravity_m_s2 >= planar.gravity_m_s2
    pointing = replace(spatial, thruster=replace(spatial.thruster, pointing_error_rad=0.01))
    assert on_board_model(pointing).pointing_error_rad == 0.01


def test_a_target_manoeuvres_along_each_axis_as_in_a_plane() -> None:
    random = np.random.default_rng(7)
    draws = random.uniform(-1.0, 1.0, (2, BATCH, 40))
    miss = random.normal(size=(2, BATCH))
    for manoeuvre in Manoeuvre:
        target = Target(manoeuvre, 0.3, 5.0, acceleration_y_m_s2=0.1)
        for step in (0, 7, 33):
            both = acceleration_m_s2(target, draws, step, 0.5, miss)
            for axis, most in ((0, 0.1), (1, 0.3)):
                planar = acceleration_m_s2(
                    Target(manoeuvre, most, 5.0), draws[[axis]], step, 0.5, miss[[axis]]
                )
                np.testing.assert_array_equal(both[[axis]], planar)
    same = acceleration_m_s2(Target(Manoeuvre.CONSTANT, 0.3), draws, 0, 0.5, miss)
    assert (np.abs(same) == 0.3).all()


@pytest.mark.parametrize("wide", [1.0, 100.0])
def test_the_acceleration_of_the_scaled_motion_is_within_its_bound(
    wide: float, spatial: Scenario
) -> None:
    """Gravity and the change of scale that it causes, for any direction of the Sun and a y axis of
    any width.
    """
    start = spatial.set_model.bounds
    box = replace(start, y_m=(-1e4 * wide, 1e4 * wide), vy_m_s=(-100.0 * wide, 100.0 * wide))
    quiet = replace(spatial.set_model, bounds=box, model=Model.GUARANTEED, disturbance_m_s2=0.0)
    minimum, maximum = corners(box)
    random = np.random.default_rng(12)
    worst = np.zeros(2)
    speed = quiet.closing_speed_m_s
    for number in range(12):
        diagonal = (0.25 * np.pi * random.choice([-3, -1, 1, 3]), 0.0)
        anywhere = (random.uniform(-np.pi, np.pi), np.arcsin(random.uniform(-1.0, 1.0)))
        direction, elevation = anywhere if number % 3 else diagonal
        sun = replace(SUN, direction_rad=direction, elevation_rad=elevation)
        share = random.uniform(size=(40, 6))
        states = minimum + (maximum - minimum) * np.where(
            random.uniform(size=(40, 6)) < 0.5, share.round(), share
        )
        motion = KeplerMotion(states[:, :3], states[:, 3:], sun)
        arrival_s = motion.arrival_s()
        scaled = []
        for second in range(80):
            scaled.append(motion.sight().slope * speed * (arrival_s - second))
            motion.advance(1.0)
        model = with_gravity(quiet, sun, 0.0)
        bounds = np.array([model.axis(name).acceleration_m_s2 for name in model.axes])
        worst = np.maximum(worst, np.abs(np.diff(scaled, 2, axis=0)).max(axis=(0, 2)) / bounds)
        assert (
            np.abs(motion.velocity_m_s[:, 2] - states[:, 5]).max()
            < model.gravity_speed_change * speed
        )
    assert (worst <= 1.0).all()
    assert worst[1] > 0.7
