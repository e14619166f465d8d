"""Motion about an elliptic orbit against differences of Kepler's motion in 50 digits."""

from __future__ import annotations

import itertools

import mpmath as mp
import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.rendezvous.relative_motion import EllipticOrbit, TschaunerHempel

Vector = list[mp.mpf]

EPSILON = 2.0**-53
STEP = mp.mpf(10) ** -16
"""A deviation of this size in a central difference has a relative error of about 1e-32."""


def cross(a: Vector, b: Vector) -> Vector:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def norm(a: Vector) -> mp.mpf:
    return mp.sqrt(mp.fdot(a, a))


def plus(a: Vector, b: Vector, factor: int = 1) -> Vector:
    return [x + factor * y for x, y in zip(a, b, strict=True)]


def coasted(r: Vector, v: Vector, time: mp.mpf) -> tuple[Vector, Vector]:
    """Kepler's motion along an ellipse with mu = 1."""
    radius = norm(r)
    along = mp.fdot(r, v)
    axis = 1 / (2 / radius - mp.fdot(v, v))
    cosine = 1 - radius / axis
    sine = along / mp.sqrt(axis)
    e = mp.sqrt(cosine**2 + sine**2)
    first = mp.atan2(sine, cosine)
    mean = first - sine + time / axis**1.5
    low = mean - 1
    high = mean + 1
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (middle, high) if middle - e * mp.sin(middle) < mean else (low, middle)
    last = mp.findroot(
        lambda x: x - e * mp.sin(x) - mean, (low, high), solver="anderson", tol=mp.mpf(10) ** -90
    )
    passed = last - first
    later = axis * (1 - cosine * mp.cos(passed) + sine * mp.sin(passed))
    f = 1 - axis / radius * (1 - mp.cos(passed))
    g = time + axis**1.5 * (mp.sin(passed) - passed)
    f_rate = -mp.sqrt(axis) / (later * radius) * mp.sin(passed)
    g_rate = 1 - axis / later * (1 - mp.cos(passed))
    position = [f * x + g * y for x, y in zip(r, v, strict=True)]
    return position, [f_rate * x + g_rate * y for x, y in zip(r, v, strict=True)]


def hill_axes(r: Vector, v: Vector) -> tuple[list[Vector], Vector]:
    """Radial, along-track and normal axes, and their angular velocity."""
    momentum = cross(r, v)
    x = [each / norm(r) for each in r]
    z = [each / norm(momentum) for each in momentum]
    return [x, cross(z, x), z], [each / norm(r) ** 2 for each in momentum]


def at_anomaly(eccentricity: float, anomaly: float) -> tuple[Vector, Vector]:
    """A state on an ellipse of semi-major axis 1, mu = 1."""
    e = mp.mpf(eccentricity)
    nu = mp.mpf(anomaly)
    latus_rectum = 1 - e * e
    radius = latus_rectum / (1 + e * mp.cos(nu))
    speed = 1 / mp.sqrt(latus_rectum)
    zero = mp.mpf(0)
    return [radius * mp.cos(nu), radius * mp.sin(nu), zero], [
        -speed * mp.sin(nu),
        speed * (e + mp.cos(nu)),
        zero,
    ]


def exact_transition(
    eccentricity: float, anomaly: float, start: float, end: float, columns_from: int = 0
) -> Floats:
    """Columns of the transition between two times after the anomaly, from `columns_from` on.

    They are central differences of Kepler's motion.
    """
    r, v = coasted(*at_anomaly(eccentricity, anomaly), mp.mpf(start))
    axes, turning = hill_axes(r, v)
    r_end, v_end = coasted(r, v, mp.mpf(end) - mp.mpf(start))
    axes_end, turning_end = hill_axes(r_end, v_end)
    columns = []
    for component in range(columns_from, 6):
        axis = axes[component % 3]
        shift = [STEP * each for each in axis]
        zero = [mp.mpf(0)] * 3
        dr, dv = (shift, cross(turning, shift)) if component < 3 else (zero, shift)
        ahead, behind = (
            coasted(plus(r, dr, s), plus(v, dv, s), mp.mpf(end) - mp.mpf(start)) for s in (1, -1)
        )
        apart = plus(ahead[0], behind[0], -1)
        speed = plus(plus(ahead[1], behind[1], -1), cross(turning_end, apart), -1)
        columns.append(
            [mp.fdot(each, part) / (2 * STEP) for part in (apart, speed) for each in axes_end]
        )
    return np.array(columns, dtype=float).T


def radius_at(eccentricity: float, anomaly: float, time: float) -> float:
    return float(norm(coasted(*at_anomaly(eccentricity, anomaly), mp.mpf(time))[0]))


def tolerance(eccentricity: float, anomaly: float, duration: float) -> float:
    """Relative error of a transition that rounding explains, for any order of operations.

    The constants of the motion have the factor 1 / (1 - e^2), and 100 roundings of them are
    allowed. An end of the interval is shifted by the rounding of the time, which is multiplied by
    the rate of the motion there, r^(-3/2).
    """
    radius = min(radius_at(eccentricity, anomaly, time) for time in (0.0, duration))
    return float(EPSILON * (100.0 / (1.0 - eccentricity**2) + 8.0 * (1.0 + duration) / radius**1.5))


def far_apart(found: Floats, exact: Floats, weight: Floats) -> float:
    return float(np.abs((found - exact) * weight).max() / np.abs(exact * weight).max())


@pytest.mark.parametrize(
    "spans",
    [
        # A difference of large terms, and the rounding of the two anomalies, left 7 digits of
        # these.
        (1e-7, 1e-5),
        (1e-4, 1e-2),
        (0.01, 1.0),
        (1.0, 6.0),
        (6.0, 16.0),
    ],
)
@pytest.mark.parametrize("eccentricity", [0.0, 0.1, 0.5, 0.9, 0.95, 0.99, 0.999, 0.9999])
def test_transitions_are_exact_except_for_rounding(
    eccentricity: float, spans: tuple[float, float]
) -> None:
    # Products of panels in the same variables are wrong by 2e-11 at 0.95 and 3e-9 at 0.99.
    random = np.random.default_rng([int(1e4 * eccentricity), int(1e7 * spans[0])])
    anomaly = float(random.uniform(-3.1, 3.1))
    duration = float(random.uniform(*spans))
    with mp.workdps(50):
        exact = exact_transition(eccentricity, anomaly, 0.0, duration)
        allowed = tolerance(eccentricity, anomaly, duration)

    found = TschaunerHempel(EllipticOrbit(1.0, eccentricity, anomaly)).transition(0.0, duration)

    scale = np.array([duration] * 3 + [1.0] * 3)
    assert far_apart(found, exact, scale[None, :] / scale[:, None]) < allowed


@pytest.mark.parametrize("duration", [1e-6, 0.3, 5.0, 40.0])
@pytest.mark.parametrize("eccentricity", [0.0, 0.6, 0.99])
def test_backward_transition_is_the_inverse_of_the_forward_transition(
    eccentricity: float, duration: float
) -> None:
    with mp.workdps(50):
        of_each = tolerance(eccentricity, 0.4, duration)
    motion = TschaunerHempel(EllipticOrbit(1.0, eccentricity, 0.4))

    forward = motion.transition(0.0, duration)
    back = motion.transition(duration, 0.0)

    # Each of the two has the error of a transition, which the other one multiplies.
    size = float(np.linalg.norm(forward) * np.linalg.norm(back))
    np.testing.assert_allclose(back @ forward, np.eye(6), rtol=0.0, atol=2.0 * of_each * size)


@pytest.mark.parametrize(
    ("eccentricity", "anomaly", "duration"),
    [
        (0.0, 0.3, 4.0),
        (0.3, 2.0, 9.0),
        (0.6, 1.0, 0.01),
        (0.99, -2.8, 3.0),  # through perigee
        (0.99, 2.5, 6.0),  # through apogee
        (0.999, -1.0, 7.0),  # more than a revolution
    ],
)
def test_gramians_and_held_controls_are_integrals_of_exact_transitions(
    eccentricity: float, anomaly: float, duration: float
) -> None:
    motion = TschaunerHempel(EllipticOrbit(1.0, eccentricity, anomaly))
    begin_rad, end_rad = (
        float(each) for each in motion.orbit.eccentric_anomaly(np.array([0.0, duration]))
    )
    times = motion.orbit.time_of_eccentric(np.linspace(begin_rad, end_rad, 9))
    times[0] = 0.0
    times[-1] = duration
    nodes, weights = np.polynomial.legendre.leggauss(10)
    gramian = np.zeros((6, 6))
    held = np.zeros((6, 3))
    with mp.workdps(50):
        for begin, end in itertools.pairwise(times):
            # Gauss points of the eccentric anomaly, in which the integrand has distant poles.
            first, last = motion.orbit.eccentric_anomaly(np.array([begin, end]))
            anomalies = first + 0.5 * (last - first) * (1.0 + nodes)
            rates = 1.0 - eccentricity * np.cos(anomalies)
            places = motion.orbit.time_of_eccentric(anomalies)
            for place, weight in zip(places, 0.5 * (last - first) * weights * rates, strict=True):
                effect = exact_transition(
                    eccentricity, anomaly, float(place), duration, columns_from=3
                )
                gramian += weight * effect @ effect.T
                held += weight * effect

    found = motion.segment(0.0, duration)

    # The reference has times with errors of 1e-16 / (1 - e), and sums of 80 terms.
    allowed = 1000.0 * EPSILON / (1.0 - eccentricity)
    spread = np.sqrt(np.diag(gramian))
    np.testing.assert_allclose(
        found.gramian / np.outer(spread, spread), gramian / np.outer(spread, spread), atol=allowed
    )
    assert far_apart(found.held, held, np.ones((6, 3))) < allowed


def random_interval(seed: int) -> tuple[TschaunerHempel, float]:
    random = np.random.default_rng(seed)
    orbit = EllipticOrbit(
        1e-3, 1.0 - 10.0 ** random.uniform(-4.0, -2.0), random.uniform(-np.pi, np.pi)
    )
    return TschaunerHempel(orbit), float(
        random.uniform(0.05, 2.5) * 2.0 * np.pi / orbit.mean_motion_rad_s
    )


def test_orbits_of_a_large_eccentricity_have_finite_gramians() -> None:
    # 37 of 80 such cases were refused by products of panels.
    for seed in range(80):
        motion, duration_s = random_interval(seed)
        assert np.isfinite(motion.segment(0.0, duration_s).gramian).all(), seed


@pytest.mark.parametrize("seed", range(6))
def test_gramian_is_the_sum_over_two_parts(seed: int) -> None:
    motion, duration_s = random_interval(seed)
    middle_s = 0.4 * duration_s
    whole = motion.gramian(0.0, duration_s)
    latter = motion.segment(middle_s, duration_s)

    joined = (
        latter.transition @ motion.gramian(0.0, middle_s) @ latter.transition.T + latter.gramian
    )

    # The rounding of the middle time, 4e-15 rad, is multiplied by (1 - e)^(-3/2), at most 1e6, at
    # perigee.
    spread = np.sqrt(np.diag(whole))
    np.testing.assert_allclose(
        joined / np.outer(spread, spread), whole / np.outer(spread, spread), atol=1e-8
    )


def test_interval_with_too_many_panels_is_refused() -> None:
    motion = TschaunerHempel(EllipticOrbit(1.0, 0.5))
    with pytest.raises(
        ValueError, match=r"from 2 s to 500000 s has 5e\+05 panels .* at most 200000 are"
    ):
        motion.segment([0.0, 2.0], [1.0, 5e5])
    # The message has times, not anomalies.
    slow = TschaunerHempel(EllipticOrbit(0.1, 0.5))
    with pytest.raises(ValueError, match=r"from 20 s to 5e\+06 s has 5e\+05 panels"):
        slow.breaks(20.0, 5e6)
    # Poles at cos E = 1 / e are acosh(1 / 0.999) = 0.0447 from the real axis: panels are shorter
    # than a radian.
    with pytest.raises(ValueError, match=r"from 2 s to 100000 s has 2\.24e\+06 panels"):
        TschaunerHempel(EllipticOrbit(1.0, 0.999)).breaks(2.0, 1e5)


def test_empty_array_of_intervals_gives_empty_arrays_of_matrices() -> None:
    found = TschaunerHempel(EllipticOrbit(1.0, 0.5)).segment(np.empty((0, 2)), np.empty((0, 2)))
    assert (found.transition.shape, found.held.shape) == ((0, 2, 6, 6), (0, 2, 6, 3))


def test_interval_of_many_revolutions_has_a_finite_gramian() -> None:
    # 1000 radians were refused from e = 0.9 on.
    motion = TschaunerHempel(EllipticOrbit(1.0, 0.9, 0.3))
    assert np.isfinite(motion.segment(0.0, 1000.0).gramian).all()


def test_eccentricity_above_the_maximum_is_refused() -> None:
    with pytest.raises(
        ValueError, match=r"the eccentricity must be at most 0\.999999, found 0\.9999999"
    ):
        TschaunerHempel(EllipticOrbit(1.0, 0.9999999))
