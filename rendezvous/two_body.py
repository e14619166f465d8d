"""Motion under the gravity of one point: osculating elements, and coasting along any conic."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats

_STRAIGHT = 1e-15
"""Square of the transverse speed, relative to the square of the speed, up to which a motion is
straight. Up to the escape speed the perigee is then within 1e-15 of the distance, its rounding."""
_NEARLY_PARABOLIC = 2e-8
"""Size of the binding (distance by semi-major axis) below which the time to the perigee is computed
as for a parabola. The relative error is then up to 1.5 times the binding; the formulas for ellipses
and hyperbolas have up to 8e-16 over the binding (measured). Here both are equal, 4e-8: any other
value has a greater maximum error."""
_RADIAL = 1e-6
"""Perigee, relative to the semi-major axis, up to which an orbit is a fall through the centre.
Chosen: far above the rounding of a perigee, some 1e-15, and far below the radius of a planet."""
_STUMPFF_SERIES = np.array(
    [[(-1) ** k / math.factorial(order + 2 * k) for order in (2, 3)] for k in range(10)]
)
"""Coefficients of Stumpff's c_2 and c_3, the columns, up to the power 9: the next term is at most
1 / 22! for arguments up to 1.
"""
_MAX_ROUNDS = 200
"""Maximum number of rounds for the anomaly: Newton's method needs about 10, and bisection 60."""
_ANOMALY_ROUNDING = 4e-16
"""Newton step, relative to the anomaly, at which it is exact to rounding: two roundings."""


@dataclass(frozen=True)
class OrbitalElements:
    """Elements of an ellipse or a hyperbola, and the true anomaly.

    The semi-major axis of a hyperbola is negative. `raan_rad` is the right ascension of the
    ascending node.

    Raises
    ------
    ValueError
        If the semi-major axis and the eccentricity belong to neither an ellipse nor a hyperbola, or
        the true anomaly is beyond the asymptotes.
    """

    semi_major_axis_m: float
    eccentricity: float
    inclination_rad: float
    raan_rad: float
    argument_of_perigee_rad: float
    true_anomaly_rad: float

    def __post_init__(self) -> None:
        is_ellipse = self.semi_major_axis_m > 0.0 and 0.0 <= self.eccentricity < 1.0
        is_hyperbola = self.semi_major_axis_m < 0.0 and self.eccentricity > 1.0
        if not (is_ellipse or is_hyperbola):
            raise ValueError(
                "an ellipse has a semi-major axis above 0 and an eccentricity from 0 to below 1, "
                "a hyperbola a semi-major axis below 0 and an eccentricity above 1, not "
                f"{self.semi_major_axis_m:g} m and {self.eccentricity:g}; give a parabola by "
                "position and velocity"
            )

        if not 1.0 + self.eccentricity * math.cos(self.true_anomaly_rad) > 0.0:
            raise ValueError(
                f"a hyperbola of eccentricity {self.eccentricity:g} has true anomalies up to "
                f"{math.degrees(math.acos(-1.0 / self.eccentricity)):.6g} deg, not "
                f"{math.degrees(self.true_anomaly_rad):g} deg"
            )

    def state(self, gravitational_parameter_m3_s2: float) -> tuple[Floats, Floats]:
        """Return position (m) and velocity (m/s), (3,), in the inertial frame of the elements."""
        latus_rectum = self.semi_major_axis_m * (1.0 - self.eccentricity**2)
        cosine = np.cos(self.true_anomaly_rad)
        sine = np.sin(self.true_anomaly_rad)
        radius = latus_rectum / (1.0 + self.eccentricity * cosine)
        speed = np.sqrt(gravitational_parameter_m3_s2 / latus_rectum)

        cn = np.cos(self.raan_rad)
        sn = np.sin(self.raan_rad)
        ci = np.cos(self.inclination_rad)
        si = np.sin(self.inclination_rad)
        cp = np.cos(self.argument_of_perigee_rad)
        sp = np.sin(self.argument_of_perigee_rad)
        # In the plane, ahead is a quarter of a turn from the direction of the perigee.
        toward_perigee = np.array([cn * cp - sn * ci * sp, sn * cp + cn * ci * sp, si * sp])
        ahead = np.array([-cn * sp - sn * ci * cp, -sn * sp + cn * ci * cp, si * cp])
        position = radius * (cosine * toward_perigee + sine * ahead)
        velocity = speed * (-sine * toward_perigee + (self.eccentricity + cosine) * ahead)
        return position, velocity


def semi_major_axis_m(
    position_m: Floats, velocity_m_s: Floats, gravitational_parameter_m3_s2: float
) -> float:
    """Return the osculating semi-major axis, m.

    It is negative for a hyperbola and infinite for a parabola.
    """
    inverse = (
        2.0 / np.linalg.norm(position_m)
        - velocity_m_s @ velocity_m_s / gravitational_parameter_m3_s2
    )
    return float(1.0 / inverse) if inverse != 0.0 else float("inf")


class ConicShape(NamedTuple):
    """Eccentricity and true anomaly of an osculating orbit.

    The anomaly is from -pi to pi; a circle has any.
    """

    eccentricity: float
    true_anomaly_rad: float


def conic_shape(
    position_m: Floats, velocity_m_s: Floats, gravitational_parameter_m3_s2: float
) -> ConicShape:
    """Return the osculating eccentricity and true anomaly of a state.

    With the semi-latus rectum p and the radial speed v: e cos f = p / r - 1, and e sin f =
    v (p / mu)^(1/2).
    """
    radius = np.linalg.norm(position_m)
    momentum = np.cross(position_m, velocity_m_s)
    latus_rectum = momentum @ momentum / gravitational_parameter_m3_s2
    radial_speed = position_m @ velocity_m_s / radius

    e_cosine = latus_rectum / radius - 1.0
    e_sine = radial_speed * np.sqrt(latus_rectum / gravitational_parameter_m3_s2)
    return ConicShape(float(np.hypot(e_cosine, e_sine)), float(np.arctan2(e_sine, e_cosine)))


def perigee_m(
    position_m: Floats, velocity_m_s: Floats, gravitational_parameter_m3_s2: float
) -> float:
    """Return the minimum distance from the planet's centre on the osculating orbit, m.

    It is zero for a radial fall.
    """
    along = float(position_m @ velocity_m_s)
    squares = float((position_m @ position_m) * (velocity_m_s @ velocity_m_s))
    momentum_squared = squares - along * along

    latus_rectum = max(0.0, momentum_squared) / gravitational_parameter_m3_s2
    axis = semi_major_axis_m(position_m, velocity_m_s, gravitational_parameter_m3_s2)
    return latus_rectum / (1.0 + math.sqrt(max(0.0, 1.0 - latus_rectum / axis)))


def orbit_fault(
    position_m: Floats, velocity_m_s: Floats, mu_m3_s2: float, planet_radius_m: float
) -> str | None:
    """Return the reason why the orbit of a state is not a closed orbit outside the planet, or None.

    The orbit is not an ellipse, is a fall through the centre, or its perigee is not above the
    surface.
    """
    if not position_m.any():
        return "the position is the centre of the planet"
    axis = semi_major_axis_m(position_m, velocity_m_s, mu_m3_s2)
    if not 0.0 < axis < math.inf:
        return (
            "the orbit is a parabola or a hyperbola: the velocity is not below the escape velocity"
        )

    perigee = perigee_m(position_m, velocity_m_s, mu_m3_s2)
    if perigee <= _RADIAL * axis:
        return "the orbit is a fall along a line through the planet's centre"
    if perigee <= planet_radius_m:
        return (
            f"the orbit meets the planet: its perigee is {perigee / 1e3:.6g} km from the centre, "
            f"and the planet's radius is {planet_radius_m / 1e3:.6g} km"
        )
    return None


class _Start(NamedTuple):
    """States in units in which their distance and the gravitational parameter are one.

    `unit_s` is the unit of time. `binding` is the distance divided by the semi-major axis: positive
    for an ellipse, zero for a parabola, negative for a hyperbola. `outward` is the radial speed,
    and `transverse_squared` the square of the transverse speed.
    """

    unit_s: Floats
    binding: Floats
    outward: Floats
    transverse_squared: Floats


def closest_approach_m(
    position_m: Floats,
    velocity_m_s: Floats,
    gravitational_parameter_m3_s2: float,
    duration_s: float,
) -> float:
    """Return the minimum distance from the planet's centre, m, while a craft coasts.

    `duration_s` is not negative, and may be infinite.
    """
    start = _scaled_start(position_m, velocity_m_s, gravitational_parameter_m3_s2)
    if _to_perigee(start) * start.unit_s < duration_s:
        return perigee_m(position_m, velocity_m_s, gravitational_parameter_m3_s2)

    # Between two perigees the distance is smallest at one of the ends. A flight without an end has
    # only its start: it is a parabola or a hyperbola after its perigee.
    start_m = float(np.linalg.norm(position_m))
    if not math.isfinite(duration_s):
        return start_m
    state = np.concatenate([position_m, velocity_m_s])
    end = coast(state, duration_s, gravitational_parameter_m3_s2)
    return min(start_m, float(np.linalg.norm(end[:3])))


def flight_fault(
    position_m: Floats,
    velocity_m_s: Floats,
    mu_m3_s2: float,
    planet_radius_m: float,
    duration_s: float,
) -> str | None:
    """Return the reason why a craft cannot coast for a duration, along any conic, or None.

    It meets the planet, or starts at its centre.
    """
    if not position_m.any():
        return "the position is the centre of the planet"
    distance_m = closest_approach_m(position_m, velocity_m_s, mu_m3_s2, duration_s)
    if not distance_m > planet_radius_m:
        return (
            f"the orbit meets the planet during the flight: its distance from the centre falls to "
            f"{distance_m / 1e3:.6g} km, and the planet's radius is {planet_radius_m / 1e3:.6g} km"
        )
    return None


def coast(states: Floats, duration_s: ArrayLike, gravitational_parameter_m3_s2: float) -> Floats:
    """Return `states` (r, v), shape (..., 6), about the attracting point, after coasting.

    `duration_s` is finite, and may be negative. The method is Lagrange's f and g functions of the
    universal anomaly, which are the same for ellipses, parabolas and hyperbolas.

    Raises
    ------
    ValueError
        If a state is at the attracting point or not finite, or falls straight through the point in
        the duration.

    References
    ----------
    Battin, An Introduction to the Mathematics and Methods of Astrodynamics, AIAA 1999, section 4.5.
    """
    position = states[..., :3]
    velocity = states[..., 3:]
    start = _scaled_start(position, velocity, gravitational_parameter_m3_s2)
    duration = np.asarray(duration_s, dtype=np.float64) / start.unit_s
    direction = np.where(duration < 0.0, -1.0, 1.0)
    ahead = start._replace(outward=direction * start.outward)

    # The equation of energy, in the units of `_Start`.
    speed_squared = 2.0 - start.binding
    is_straight = start.transverse_squared <= _STRAIGHT * speed_squared
    if (is_straight & (_to_perigee(ahead) <= np.abs(duration))).any():
        raise ValueError(
            "a state falls straight into the attracting point; give it a transverse velocity"
        )

    anomaly = direction * _universal_anomaly(start.binding, ahead.outward, np.abs(duration))
    first, second, _ = _stumpff(start.binding * anomaly**2)
    advance = anomaly * first
    turn = anomaly**2 * second
    later = 1.0 + start.outward * advance + (1.0 - start.binding) * turn

    f = 1.0 - turn
    g = (advance + start.outward * turn) * start.unit_s
    f_rate = -advance / later / start.unit_s
    g_rate = 1.0 - turn / later
    return np.concatenate(
        [
            f[..., None] * position + g[..., None] * velocity,
            f_rate[..., None] * position + g_rate[..., None] * velocity,
        ],
        axis=-1,
    )


def _scaled_start(
    position: Floats, velocity: Floats, gravitational_parameter_m3_s2: float
) -> _Start:
    """Return states in their units; raise `ValueError` if they are at the point or not finite."""
    radius = np.linalg.norm(position, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit_s = np.sqrt(radius**3 / gravitational_parameter_m3_s2)
        speed = velocity * (unit_s / radius)[..., None]
        direction = position / radius[..., None]
    outward = (direction * speed).sum(axis=-1)
    transverse = speed - outward[..., None] * direction
    binding = 2.0 - (speed**2).sum(axis=-1)
    if not (np.isfinite(binding).all() and (unit_s > 0.0).all()):
        raise ValueError("a state is at the attracting point, or its numbers are too large")
    return _Start(unit_s, binding, outward, (transverse**2).sum(axis=-1))


def _to_perigee(start: _Start) -> Floats:
    """Time to the next perigee; zero at it, infinite after that of a parabola or a hyperbola."""
    binding = start.binding
    outward = start.outward
    transverse_squared = start.transverse_squared
    size = np.abs(binding)
    # Smaller sizes use the formula of a parabola, and are only kept from a division by zero.
    rate = np.maximum(size, _NEARLY_PARABOLIC) ** 1.5
    eccentricity = np.sqrt(np.maximum(1.0 - binding * transverse_squared, 0.0))
    # e sin E on an ellipse, e sinh H on a hyperbola.
    sine = outward * np.sqrt(size)

    # Times since the perigee, negative before it.
    on_ellipse = (np.arctan2(sine, 1.0 - binding) - sine) / rate
    on_hyperbola = (sine - np.arcsinh(sine / np.maximum(eccentricity, 1.0))) / rate
    on_parabola = 0.5 * outward * (transverse_squared + outward**2 / 3.0)
    since = np.where(binding > 0.0, on_ellipse, on_hyperbola)
    since = np.where(size < _NEARLY_PARABOLIC, on_parabola, since)
    return np.asarray(np.where(since <= 0.0, -since, _period(binding) - since))


def _period(binding: Floats) -> Floats:
    """Period of an ellipse; infinite on a parabola or a hyperbola."""
    with np.errstate(divide="ignore"):
        return np.asarray(2.0 * np.pi / np.maximum(binding, 0.0) ** 1.5)


def _universal_anomaly(binding: Floats, outward: Floats, duration: Floats) -> Floats:
    """Solve Kepler's equation for the universal anomaly, without whole revolutions.

    `duration` is not negative. Time increases with the anomaly; Newton's method works in a bracket,
    which is halved if a step leaves it.
    """
    period = _period(binding)
    rest = np.mod(duration, period)
    with np.errstate(divide="ignore"):
        revolution = 2.0 * np.pi / np.sqrt(np.maximum(binding, 0.0))
    low = np.zeros_like(rest)
    # On an ellipse the root is within a revolution; otherwise the bracket is doubled until it
    # contains the root, from 1, the anomaly of about a unit of time.
    high = np.where(np.isfinite(revolution), revolution, 1.0)
    while True:
        time, _ = _time_of(high, binding, outward)
        is_short = (binding <= 0.0) & (time < rest)
        if not is_short.any():
            break
        high = np.where(is_short, 2.0 * high, high)

    # For short times the anomaly is the time, because the distance is one at the start.
    anomaly = np.minimum(rest, high)
    for _ in range(_MAX_ROUNDS):
        time, radius = _time_of(anomaly, binding, outward)
        low = np.where(time <= rest, anomaly, low)
        high = np.where(time >= rest, anomaly, high)
        with np.errstate(divide="ignore", invalid="ignore"):
            ahead = anomaly - (time - rest) / radius
        is_inside = (ahead >= low) & (ahead <= high)
        ahead = np.where(is_inside, ahead, 0.5 * (low + high))
        is_settled = np.abs(ahead - anomaly) <= _ANOMALY_ROUNDING * anomaly
        anomaly = ahead
        if is_settled.all():
            break
    return np.asarray(anomaly)


def _time_of(anomaly: Floats, binding: Floats, outward: Floats) -> tuple[Floats, Floats]:
    """Return the time at a universal anomaly, and the distance, which is its derivative."""
    first, second, third = _stumpff(binding * anomaly**2)
    advance = anomaly * first
    turn = anomaly**2 * second
    time = advance + outward * turn + anomaly**3 * third
    distance = 1.0 + outward * advance + (1.0 - binding) * turn
    return time, distance


def _stumpff(square: Floats) -> tuple[Floats, Floats, Floats]:
    """Stumpff's functions c_1, c_2 and c_3: c_k(x) = 1 / k! - x / (k + 2)! + x^2 / (k + 4)! ...

    The series is used for abs(x) < 1, and closed forms elsewhere.
    """
    is_near = np.abs(square) < 1.0
    near = np.where(is_near, square, 0.0)
    second_near, third_near = np.polynomial.polynomial.polyval(near, _STUMPFF_SERIES)

    # 1 in place of near arguments, for which the closed forms lose digits and are not used.
    far = np.where(is_near, 1.0, np.abs(square))
    root = np.sqrt(far)
    on_ellipse = square > 0.0
    sine = np.where(on_ellipse, np.sin(root), np.sinh(root))
    half_sine = np.where(on_ellipse, np.sin(0.5 * root), np.sinh(0.5 * root))
    first = np.where(is_near, 1.0 - near * third_near, sine / root)
    second = np.where(is_near, second_near, 2.0 * half_sine**2 / far)
    # root - sin(root) on an ellipse, sinh(root) - root on a hyperbola.
    third = np.where(is_near, third_near, np.abs(root - sine) / (far * root))
    return first, second, third
