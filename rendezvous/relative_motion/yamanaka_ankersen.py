"""Compiled kernels of Yamanaka and Ankersen's transition of motion about an elliptic orbit.

Tschauner and Hempel's variables are x = rho r and x' = dx / d nu with the true anomaly nu and rho =
1 + e cos nu:

    x'' = 3 x / rho + 2 y',  y'' = -2 x',  z'' = -z.

The motion has six constants, linear in the state (equation (82)), of which the state at any other
place is a linear function (84). The secular part contains k^2 (t - t_0), with t_0 the start of the
interval. The kernels compute the *change* of the state, from changes of sin nu, cos nu and rho that
are products with the sine of half the change of nu: over a short interval the large terms of (84)
would cancel, and digits would be lost.

References
----------
Yamanaka and Ankersen, "New state transition matrix for relative motion on an arbitrary elliptical
orbit", J. Guid. Control Dyn. 25 (2002) 60-66, whose x is y here, and whose z is -x.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._compile import allocation_free, compiled
from infoset.rendezvous.relative_motion.clohessy_wiltshire import angle_less_sine

KEPLER_STEPS = 2
"""Newton's steps for the anomaly between two times, from a guess with the rounding of both
anomalies. The first step leaves the square of this error; the second one matters only near the
maximum eccentricity."""
NODES, WEIGHTS = (rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(16))
"""Gauss and Legendre's rule of a panel, on [-1, 1].

The nearest pole of the motion is at least the panel's length d away from the panel's middle. The
half-axes of the ellipse through the pole, whose foci are the ends of the panel, have a sum of (2 +
sqrt(5)) d / 2, so the error decreases as 4.24^(-2 n): 9e-21 for n = 16 nodes. With 12 nodes, 9e-16,
the order of the pole is noticeable."""


class Ellipse(NamedTuple):
    """Constants of an orbit: n, e, sqrt(1 - e^2), and k^2 = n / (1 - e^2)^(3/2)."""

    mean_motion_rad_s: float
    eccentricity: float
    root: float
    latus_rate_rad_s: float


class Place(NamedTuple):
    """A place on the orbit: E, r / a = 1 - e cos E, sine and cosine of half the true anomaly."""

    eccentric_rad: float
    distance: float
    half_sine: float
    half_cosine: float


class Leg(NamedTuple):
    """Motion from one place to another.

    `sine`, `cosine` and `rho` are sin nu, cos nu and rho at the first place; `sine_change` and
    `cosine_change` the changes of sin nu and cos nu; `turn_sine` and `turn_cosine` the sine and the
    cosine of the change of nu; `secular` is k^2 (t - t_0).
    """

    sine: float
    cosine: float
    rho: float
    sine_change: float
    cosine_change: float
    turn_sine: float
    turn_cosine: float
    secular: float


@compiled
def fill_transitions(
    ellipse: Ellipse, starts_rad: Floats, guesses_rad: Floats, durations_s: Floats, matrices: Floats
) -> None:
    """Fill transition matrices, shape (k, 6, 6), which are zero before.

    The intervals start at eccentric anomalies E, `starts_rad`. `guesses_rad` are the changes of E
    in the durations, exact except for the rounding of E.
    """
    for row in range(len(durations_s)):
        mean_rad = ellipse.mean_motion_rad_s * durations_s[row]
        start = place_at(ellipse, starts_rad[row])
        passed_rad = passed_anomaly(ellipse, start.eccentric_rad, guesses_rad[row], mean_rad)
        end = place_at(ellipse, start.eccentric_rad + passed_rad)
        leg = leg_between(ellipse, start, end, passed_rad, mean_rad)

        # A position r is x = rho r in scaled variables, and x' = -e sin(nu) r.
        rate = -ellipse.eccentricity * leg.sine
        fill_column(ellipse, leg, leg.rho, 0.0, rate, 0.0, matrices[row, :, 0])
        fill_column(ellipse, leg, 0.0, leg.rho, 0.0, rate, matrices[row, :, 1])
        fill_normal(ellipse, leg, leg.rho, rate, matrices[row, :, 2])
        fill_effect(ellipse, leg, matrices[row, :, 3:])


@compiled
def fill_integrals(
    ellipse: Ellipse,
    starts_rad: Floats,
    guesses_rad: Floats,
    durations_s: Floats,
    panel_rad: float,
    gramians: Floats,
    helds: Floats,
) -> None:
    """Fill Gramians, shape (k, 6, 6), and effects of held controls, shape (k, 6, 3).

    Both are zero before. The intervals are as in `fill_transitions`. The rule is applied to panels
    of eccentric anomaly of at most `panel_rad`.
    """
    effect = np.zeros((6, 3))
    for row in range(len(durations_s)):
        mean_rad = ellipse.mean_motion_rad_s * durations_s[row]
        passed_rad = passed_anomaly(ellipse, starts_rad[row], guesses_rad[row], mean_rad)
        end = place_at(ellipse, starts_rad[row] + passed_rad)
        panels = max(1, math.ceil(passed_rad / panel_rad))
        half_rad = 0.5 * passed_rad / panels

        for panel in range(panels):
            for node in range(len(NODES)):
                # Panels are counted from the end backward.
                to_go_rad = half_rad * (2 * panel + 1 + NODES[node])
                place = place_at(ellipse, end.eccentric_rad - to_go_rad)
                mean_to_go_rad = mean_anomaly(
                    ellipse, end.eccentric_rad - 0.5 * to_go_rad, to_go_rad
                )
                leg = leg_between(ellipse, place, end, to_go_rad, mean_to_go_rad)
                fill_effect(ellipse, leg, effect)
                # Kepler's equation: n dt = (r / a) dE.
                time_s = half_rad * WEIGHTS[node] * place.distance / ellipse.mean_motion_rad_s
                add_integrand(effect, time_s, gramians[row], helds[row])


@allocation_free
def place_at(ellipse: Ellipse, eccentric_rad: float) -> Place:
    """Return the place of an eccentric anomaly; nothing cancels at perigee."""
    e = ellipse.eccentricity
    sine = math.sin(0.5 * eccentric_rad)
    cosine = math.cos(0.5 * eccentric_rad)
    distance = 1.0 - e + 2.0 * e * sine * sine
    half_sine = math.sqrt((1.0 + e) / distance) * sine
    half_cosine = math.sqrt((1.0 - e) / distance) * cosine
    return Place(eccentric_rad, distance, half_sine, half_cosine)


@allocation_free
def mean_anomaly(ellipse: Ellipse, middle_rad: float, passed_rad: float) -> float:
    """Return the change of the mean anomaly for a change of the eccentric anomaly.

    Kepler's equation of a difference, with h half the change and E the anomaly at its middle: 2 h -
    2 e cos(E) sin(h), computed as 2 (h - sin h) + 2 (1 - e cos E) sin(h), in which nothing cancels
    if h is small.
    """
    half = 0.5 * passed_rad
    middle_sine = math.sin(0.5 * middle_rad)
    distance = 1.0 - ellipse.eccentricity + 2.0 * ellipse.eccentricity * middle_sine * middle_sine
    return 2.0 * angle_less_sine(half) + 2.0 * distance * math.sin(half)


@allocation_free
def passed_anomaly(ellipse: Ellipse, start_rad: float, guess_rad: float, mean_rad: float) -> float:
    """Return the change of the eccentric anomaly for a change of the mean anomaly, near a guess.

    Its error is relative to the change, not to the anomalies.
    """
    passed_rad = guess_rad
    for _ in range(KEPLER_STEPS):
        excess = mean_anomaly(ellipse, start_rad + 0.5 * passed_rad, passed_rad) - mean_rad
        passed_rad -= excess / place_at(ellipse, start_rad + passed_rad).distance
    return passed_rad


@allocation_free
def leg_between(
    ellipse: Ellipse, start: Place, end: Place, passed_rad: float, mean_rad: float
) -> Leg:
    """Return the leg between two places, for the changes of the eccentric and the mean anomaly.

    Half the change of nu has the sine sqrt(1 - e^2) sin(dE / 2) / sqrt(d_0 d_1) with d = r / a.
    """
    half_turn_sine = (
        ellipse.root * math.sin(0.5 * passed_rad) / math.sqrt(start.distance * end.distance)
    )
    half_turn_cosine = start.half_cosine * end.half_cosine + start.half_sine * end.half_sine

    middle_sine = start.half_sine * end.half_cosine + start.half_cosine * end.half_sine
    middle_cosine = start.half_cosine * end.half_cosine - start.half_sine * end.half_sine

    return Leg(
        sine=2.0 * start.half_sine * start.half_cosine,
        cosine=start.half_cosine * start.half_cosine - start.half_sine * start.half_sine,
        rho=ellipse.root * ellipse.root / start.distance,
        sine_change=2.0 * middle_cosine * half_turn_sine,
        cosine_change=-2.0 * middle_sine * half_turn_sine,
        turn_sine=2.0 * half_turn_sine * half_turn_cosine,
        turn_cosine=1.0 - 2.0 * half_turn_sine * half_turn_sine,
        secular=mean_rad / ellipse.root**3,
    )


@allocation_free
def fill_effect(ellipse: Ellipse, leg: Leg, effect: Floats) -> None:
    """Fill Phi B, shape (6, 3), which is zero before: a velocity v is x' = v / (k^2 rho)."""
    rate = 1.0 / (ellipse.latus_rate_rad_s * leg.rho)
    fill_column(ellipse, leg, 0.0, 0.0, rate, 0.0, effect[:, 0])
    fill_column(ellipse, leg, 0.0, 0.0, 0.0, rate, effect[:, 1])
    fill_normal(ellipse, leg, 0.0, rate, effect[:, 2])


@allocation_free
def fill_column(
    ellipse: Ellipse, leg: Leg, x: float, y: float, x_rate: float, y_rate: float, column: Floats
) -> None:
    """Fill position and velocity in the orbit's plane at the end of a leg, in a column of a matrix.

    `x`, `y` and their rates are the scaled state at the start.
    """
    e = ellipse.eccentricity
    rest = ellipse.root * ellipse.root
    sine = leg.sine
    cosine = leg.cosine
    rho = leg.rho
    s = rho * sine
    c = rho * cosine

    # (82): the constants, without the constant of y, which does not change the state.
    by_s = (
        -3.0 * sine * (1.0 + e * e / rho) * x + (c - 2.0 * e) * x_rate - sine * (rho + 1.0) * y_rate
    ) / rest
    by_c = (-3.0 * (cosine + e) * x - s * x_rate - (cosine * (rho + 1.0) + e) * y_rate) / rest
    drift = ((3.0 * rho - rest) * x + e * s * x_rate + rho * rho * y_rate) / rest

    # (84), as changes: of sin and cos nu, s = rho sin nu, c = rho cos nu, and of s' and c'.
    sine_end = sine + leg.sine_change
    cosine_end = cosine + leg.cosine_change
    rho_change = e * leg.cosine_change
    rho_end = rho + rho_change
    s_change = rho_end * leg.sine_change + sine * rho_change
    c_change = rho_end * leg.cosine_change + cosine * rho_change
    s_rate_change = c_change - e * (sine_end + sine) * leg.sine_change
    c_rate_change = -s_change - e * (sine_end * leg.cosine_change + cosine * leg.sine_change)
    s_end = rho_end * sine_end
    s_rate_end = rho_end * cosine_end - e * sine_end * sine_end
    drift_rate = s_rate_end * leg.secular + (leg.sine_change * rho - sine * rho_change) / (
        rho * rho_end
    )

    x_change = by_s * s_change + by_c * c_change - 3.0 * e * s_end * leg.secular * drift
    y_change = (
        by_s * (c_change + leg.cosine_change)
        - by_c * (s_change + leg.sine_change)
        - 3.0 * rho_end * rho_end * leg.secular * drift
    )
    x_rate_change = by_s * s_rate_change + by_c * c_rate_change - 3.0 * e * drift_rate * drift
    # Position and velocity of an axis are three rows apart. As y'' = -2 x', y' + 2 x is constant.
    fill_axis(ellipse, sine_end, rho_end, x + x_change, x_rate + x_rate_change, column[0::3])
    fill_axis(ellipse, sine_end, rho_end, y + y_change, y_rate - 2.0 * x_change, column[1::3])


@allocation_free
def fill_normal(ellipse: Ellipse, leg: Leg, z: float, z_rate: float, column: Floats) -> None:
    """Fill position and velocity along the orbit's normal at the end of a leg, in a column.

    `z` and its rate are the scaled state at the start.
    """
    z_end = z * leg.turn_cosine + z_rate * leg.turn_sine
    z_rate_end = z_rate * leg.turn_cosine - z * leg.turn_sine

    rho_end = leg.rho + ellipse.eccentricity * leg.cosine_change
    fill_axis(ellipse, leg.sine + leg.sine_change, rho_end, z_end, z_rate_end, column[2::3])


@allocation_free
def fill_axis(
    ellipse: Ellipse, sine: float, rho: float, scaled: float, scaled_rate: float, parts: Floats
) -> None:
    """Fill a position and its velocity, shape (2,), from their scaled values, sin nu and rho."""
    parts[0] = scaled / rho
    parts[1] = ellipse.latus_rate_rad_s * (ellipse.eccentricity * sine * scaled + rho * scaled_rate)


@allocation_free
def add_integrand(effect: Floats, time_s: float, gramian: Floats, held: Floats) -> None:
    """Add the integrands of the Gramian, (6, 6), and of the held control, (6, 3), times a time."""
    for first in range(6):
        for axis in range(3):
            held[first, axis] += time_s * effect[first, axis]
        for second in range(6):
            product = 0.0
            for axis in range(3):
                product += effect[first, axis] * effect[second, axis]
            gramian[first, second] += time_s * product
