"""Relative motion against two-body motion of both craft in inertial axes, integrated by SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from infoset.arrays import Floats
from infoset.rendezvous.pursuit_evasion import orbital_axes
from infoset.rendezvous.reachability import NonlinearMotion
from infoset.rendezvous.relative_motion import (
    ClohessyWiltshire,
    EllipticOrbit,
    LinearMotion,
    TschaunerHempel,
    hill_state,
)
from infoset.rendezvous.two_body import OrbitalElements

MU = 3.986004418e14
ANGLES = (0.9, 2.1, 0.4)
"""Inclination, ascending node and argument of perigee of a reference orbit, rad: they do not affect
relative motion.
"""


def reference(axis_m: float, eccentricity: float, anomaly: float) -> Floats:
    return np.concatenate(OrbitalElements(axis_m, eccentricity, *ANGLES, anomaly).state(MU))


def flown(state: Floats, end_s: float) -> Floats:
    """Two-body motion by DOP853."""

    def rates(_: float, y: Floats) -> Floats:
        return np.concatenate([y[3:], -MU * y[:3] / np.linalg.norm(y[:3]) ** 3])

    return np.asarray(
        solve_ivp(rates, (0.0, end_s), state, method="DOP853", rtol=1e-13, atol=1e-6).y[:, -1]
    )


def axes_and_rate(chief: Floats) -> tuple[Floats, Floats]:
    """Hill's axes, as rows in inertial axes, and their angular velocity, inertial."""
    position = chief[:3]
    velocity = chief[3:]
    momentum = np.cross(position, velocity)
    x = position / np.linalg.norm(position)
    z = momentum / np.linalg.norm(momentum)
    return np.array([x, np.cross(z, x), z]), momentum / (position @ position)


def to_hill(craft: Floats, chief: Floats) -> Floats:
    axes, turning = axes_and_rate(chief)
    apart = craft - chief
    return np.concatenate([axes @ apart[:3], axes @ (apart[3:] - np.cross(turning, apart[:3]))])


def from_hill(relative: Floats, chief: Floats) -> Floats:
    axes, turning = axes_and_rate(chief)
    position = axes.T @ relative[:3]
    return np.asarray(
        chief + np.concatenate([position, axes.T @ relative[3:] + np.cross(turning, position)])
    )


def after(relative: Floats, chief: Floats, end_s: float) -> Floats:
    """The state in Hill's axes after both craft have coasted."""
    return to_hill(flown(from_hill(relative, chief), end_s), flown(chief, end_s))


def test_craft_behind_on_the_same_circular_orbit_has_negative_y() -> None:
    # 10 km behind: the chord is 10 km to first order, and all six components keep their values.
    axis, behind = 6778e3, 10e3
    chief = reference(axis, 0.0, 0.5)
    craft = reference(axis, 0.0, 0.5 - behind / axis)
    start = to_hill(craft, chief)
    later = to_hill(flown(craft, 5000.0), flown(chief, 5000.0))
    second_order = behind**2 / axis
    np.testing.assert_allclose(start, [0.0, -behind, 0.0, 0.0, 0.0, 0.0], atol=second_order)
    np.testing.assert_allclose(later, start, atol=1e-3)
    rate = float(np.sqrt(MU / axis**3))
    at_rest = np.array([0.0, -behind, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(
        ClohessyWiltshire(rate).transition(0.0, 5000.0) @ at_rest, at_rest, rtol=1e-12
    )
    # The axes in which a pursuit is drawn are the same.
    drawn = orbital_axes(chief[None, :3], chief[None, 3:])[0] @ (craft - chief)[:3]
    np.testing.assert_allclose(drawn, start[:3], atol=1e-8)


def test_state_in_hill_axes_has_the_rates_of_its_own_position() -> None:
    chief = reference(9000e3, 0.4, 1.0)
    craft = from_hill(np.array([120.0, -900.0, 70.0, 0.3, -0.2, 0.1]), chief)
    # Central differences of the position, whose third derivative is some 1e-9 m/s^3.
    later, earlier = (to_hill(flown(craft, t), flown(chief, t))[:3] for t in (1.0, -1.0))

    found = hill_state(craft.reshape(2, 3), chief.reshape(2, 3))

    np.testing.assert_allclose(found[:3], [120.0, -900.0, 70.0], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(found[3:], 0.5 * (later - earlier), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(("eccentricity", "anomaly"), [(0.0, 0.3), (0.1, 2.5), (0.6, -1.0)])
@pytest.mark.parametrize("component", range(6))
def test_linear_motions_are_two_body_motion_to_first_order(
    eccentricity: float, anomaly: float, component: int
) -> None:
    axis, end_s = 9000e3, 2500.0
    orbit = EllipticOrbit.of_size(axis, eccentricity, MU, anomaly)
    motion: LinearMotion = (
        TschaunerHempel(orbit) if eccentricity else ClohessyWiltshire(orbit.mean_motion_rad_s)
    )
    chief = reference(axis, eccentricity, anomaly)
    small = np.where(np.arange(6) == component, 50.0 if component < 3 else 0.05, 0.0)
    # The difference of opposite deviations has no second order.
    found = 0.5 * (after(small, chief, end_s) - after(-small, chief, end_s))
    expected = motion.transition(0.0, end_s) @ small
    scale = np.array([1.0] * 3 + [1.0 / end_s] * 3)
    np.testing.assert_allclose(
        found / scale, expected / scale, atol=1e-4 * float(np.abs(expected / scale).max())
    )


@pytest.mark.parametrize(("eccentricity", "anomaly"), [(0.0, 0.3), (0.1, 2.5)])
def test_nonlinear_motion_is_two_body_motion(eccentricity: float, anomaly: float) -> None:
    axis = 9000e3
    motion = NonlinearMotion(EllipticOrbit.of_size(axis, eccentricity, MU, anomaly), axis)
    relative = np.array([40e3, -70e3, 25e3, 30.0, -20.0, 15.0])
    found = motion.paths(0.0, relative, np.zeros(3), [1800.0])[0, 0]
    np.testing.assert_allclose(
        found, after(relative, reference(axis, eccentricity, anomaly), 1800.0), rtol=1e-7
    )
