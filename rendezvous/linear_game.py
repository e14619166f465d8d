"""Pursuit-evasion games with linear dynamics, solved nearly in closed form: free space, loss of mass, a circular orbit.

The pursuer minimises and the evader maximises the time of capture; both use full thrust. It is the game of Wang's
slides (Bauman University), after Shen and Casalino, Journal of Guidance, Control, and Dynamics 41(8), 2018, p. 1823,
with gravity omitted or linear: in free space lambda_v = (t_f - t) lambda_r, and both thrust in a constant direction.
The solutions are not from these sources; tests compare the orbital game with them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from rendezvous._arrays import Floats
from rendezvous.relative_motion import ClohessyWiltshire

CONTACT = 1e-12
"""A gap is contact if it is at most this share of the lengths that it is the difference of."""

_MIN_STEP = 1e-14
_MAX_STEPS, _MAX_CLOSING_STEPS = 200_000, 50
_BEYOND_DRY = 1e-12
_MAX_NEWTON, _OPTIMAL = 60, 1e-11
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_GRADES = 0.25 ** np.arange(11)
_MAX_VELOCITY_GAIN = math.sqrt(50.0)
"""Bound of |Phi_vv| in Hill's equations: in plane its Frobenius norm squared is 9 c^2 - 24 c + 17, c = cos nt."""


class LinearGameError(RuntimeError):
    """The first contact of a linear game was not computed to its tolerance."""


@dataclass(frozen=True)
class Thruster:
    """Constant thrust of a craft in free space; mass is that at the start of the game.

    `exhaust_speed_m_s` is the specific impulse times standard gravity.

    Raises
    ------
    ValueError
        If the thrust is negative, or mass or exhaust speed is not positive. The methods raise ValueError if all the
        mass is burnt before `time_s`.
    """

    thrust_n: float
    mass_kg: float
    exhaust_speed_m_s: float

    def __post_init__(self) -> None:
        if not (self.thrust_n >= 0.0 and self.mass_kg > 0.0 and self.exhaust_speed_m_s > 0.0):
            raise ValueError("thrust must not be negative, mass and exhaust speed must be positive")

    def travel_m(self, time_s: float) -> float:
        """Return the distance covered from rest by full thrust along a line.

        c [t - (tau - t) ln(tau / (tau - t))], tau = m c / T; a series where t / tau is small, as the difference cancels
        there.
        """
        share = self._burnt(time_s)
        if share < 0.05:
            part = sum(share ** (k - 2) / (k * (k - 1.0)) for k in range(2, 16))
        else:
            part = (share + (1.0 - share) * math.log1p(-share)) / share**2
        return self.thrust_n / self.mass_kg * time_s * time_s * part

    def speed_m_s(self, time_s: float) -> float:
        """Return the speed reached from rest by full thrust along a line."""
        share = self._burnt(time_s)
        return self.thrust_n / self.mass_kg * time_s * (-math.log1p(-share) / share if share > 0.0 else 1.0)

    def acceleration_m_s2(self, time_s: float) -> float:
        """Return the acceleration of full thrust."""
        return self.thrust_n / self.mass_kg / (1.0 - self._burnt(time_s))

    @property
    def lasts_s(self) -> float:
        """Time tau = m c / T at which all the mass is burnt; infinite without thrust or with an infinite c."""
        return self.mass_kg * self.exhaust_speed_m_s / self.thrust_n if self.thrust_n > 0.0 else math.inf

    def _burnt(self, time_s: float) -> float:
        share = self.thrust_n * time_s / (self.mass_kg * self.exhaust_speed_m_s)
        if not share < 1.0:
            raise ValueError(f"all the mass is burnt before {time_s:g} s")
        return share


@dataclass(frozen=True)
class LinearCapture:
    """Capture in a linear game.

    `time_s` is that of the first zero of the gap, and `direction`, shape (3,), is nu, in the axes of the positions.
    `is_grazing` says that the gap comes within the tolerance of zero, but not clearly below it.

    Notes
    -----
    The gap is the maximum distance that the evader can keep at a time. The search begins at t = 0. Value, slope and a
    bound of the curvature give a lower bound of the gap; a step ends before that bound is zero, so that no contact is
    missed, however short. The tolerance is `CONTACT` times the lengths in the gap: distance and travels. A gap above
    twice the tolerance is no contact. A contact is grazing if the gap, extrapolated at its rate, does not fall below
    minus the tolerance: errors of that size in the data decide whether there is a capture. The time is accurate to
    1e-12, relative, and to the rounding of the gap over its rate; that of a grazing contact to the square root of
    `CONTACT`.
    """

    time_s: float
    direction: Floats
    is_grazing: bool = False


@dataclass(frozen=True)
class _Gap:
    """The gap at one time: value, rate, the evader's direction, and the sum of the lengths whose difference it is."""

    value: float
    rate: float
    direction: Floats
    lengths: float


def free_space_capture(
    position_m: Floats, velocity_m_s: Floats, pursuer_m_s2: float, evader_m_s2: float
) -> LinearCapture | None:
    """Solve the game of two constant accelerations without gravity; None if the evader escapes.

    Position and velocity, shapes (3,), are the evader's, relative to the pursuer; the accelerations are the maximum
    values. The evader escapes if its acceleration is not the smaller one and the players are not on a collision course.

    The first root of |r + v t| = (a_P - a_E) t^2 / 2; nu is along r + v t.

    Raises
    ------
    ValueError
        If position or velocity are not three finite numbers, or the position is zero.
    """
    position, velocity = _relative(position_m, velocity_m_s)
    advantage = pursuer_m_s2 - evader_m_s2
    length, speed = float(np.linalg.norm(position)), float(np.linalg.norm(velocity))
    if advantage < 0.0 or (advantage == 0.0 and speed == 0.0):
        return None

    def gap(t: float) -> _Gap:
        distance, direction = _line_of_sight(position, velocity, t)
        gain = 0.5 * advantage * t * t
        return _Gap(distance - gain, float(direction @ velocity) - advantage * t, direction, length + speed * t + gain)

    # By then the pursuer has covered |r| + |v| t; without an advantage, the closest approach is over.
    root = math.sqrt(speed * speed + 2.0 * advantage * length)
    end = 1.001 * (speed + root) / advantage if advantage > 0.0 else 2.0 * length / speed
    return _first_contact(gap, lambda _from, _to: advantage, end)


def mass_loss_capture(
    position_m: Floats, velocity_m_s: Floats, pursuer: Thruster, evader: Thruster
) -> LinearCapture | None:
    """Solve the game in free space with the loss of mass; None if a craft has burnt all its mass before a capture.

    Position and velocity, shapes (3,), are the evader's, relative to the pursuer; the thrusters are as at t = 0.

    The first root of |r + v t| = S_P(t) - S_E(t), S the travel of full thrust. The distance is convex; the second
    derivative of the rest is bounded by S_P'' at the end of a step minus S_E'' at its start.

    Raises
    ------
    ValueError
        If position or velocity are not three finite numbers, or the position is zero.
    """
    position, velocity = _relative(position_m, velocity_m_s)
    last = min(pursuer.lasts_s, evader.lasts_s)
    if math.isinf(last):
        return free_space_capture(position, velocity, pursuer.acceleration_m_s2(0.0), evader.acceleration_m_s2(0.0))
    length, speed = float(np.linalg.norm(position)), float(np.linalg.norm(velocity))

    def gap(t: float) -> _Gap:
        distance, direction = _line_of_sight(position, velocity, t)
        gained, lost = pursuer.travel_m(t), evader.travel_m(t)
        rate = float(direction @ velocity) - pursuer.speed_m_s(t) + evader.speed_m_s(t)
        return _Gap(distance - gained + lost, rate, direction, length + speed * t + gained + lost)

    def bend(begin: float, end: float) -> float:
        return pursuer.acceleration_m_s2(end) - evader.acceleration_m_s2(begin)

    return _first_contact(gap, bend, last * (1.0 - _BEYOND_DRY), last)


def circular_orbit_capture(
    position_m: Floats,
    velocity_m_s: Floats,
    pursuer_m_s2: float,
    evader_m_s2: float,
    rate_rad_s: float,
    *,
    longest_s: float | None = None,
) -> LinearCapture | None:
    """Solve the game of two constant accelerations about a circular orbit (Hill's frame); None if there is no capture.

    Position and velocity, shapes (3,), are the evader's, relative to the pursuer: radial, along the motion, normal. The
    accelerations are the maximum ones, the rate is the mean motion. The search ends at `longest_s`, by default after
    50 revolutions; there is no capture if the evader's acceleration is not the smaller one.

    The first root of l(T) = max over |nu| <= 1 of nu . (Phi x)_r - (a_P - a_E) int |Phi_rv(T - t)^T nu| dt, a concave
    function of nu with one maximum: the evader's maximum distance at T, as both reachable sets have the same shape.
    With nu fixed it is a lower bound at other times, whose second derivative is at least -|x''| - (a_P - a_E) |Phi_vv|.

    Raises
    ------
    ValueError
        If position or velocity are not three finite numbers, the position is zero, or the mean motion is not positive.
    LinearGameError
        If the maximum distance is not computed to its tolerance.
    """
    position, velocity = _relative(position_m, velocity_m_s)
    if not rate_rad_s > 0.0:
        raise ValueError("the mean motion must be positive")
    advantage = pursuer_m_s2 - evader_m_s2
    if not advantage > 0.0:
        return None
    end = 100.0 * np.pi / rate_rad_s if longest_s is None else longest_s
    distance = _HillDistance(np.concatenate([position, velocity]), advantage, rate_rad_s, end)
    maximum = distance.max_bend()
    return _first_contact(distance, lambda _from, _to: maximum, end)


class _HillDistance:
    """l(T), by Newton's method on the sphere from the direction at the previous time.

    The integral is by Gauss and Legendre's rule, on panels that shrink toward the times at which Phi_rv is singular:
    there |Phi_rv^T nu| can have a kink.
    """

    def __init__(self, state: Floats, advantage: float, rate: float, end: float) -> None:
        self._motion, self._state, self._advantage, self._rate = ClohessyWiltshire(rate), state, advantage, rate
        self._breaks = _graded_breaks(rate * end) / rate
        low, high = self._breaks[:-1], self._breaks[1:]
        self._effects, self._weights = self._nodes(low, high)
        self._nu = _unit(state[:3])

    def max_bend(self) -> float:
        """Bound |x''| + a |Phi_vv|: relative accelerations in Hill's frame are an ellipse and an oscillation."""
        (x, _, z, vx, vy, vz), n = self._state, self._rate
        in_plane, normal = math.hypot(3.0 * n * n * x + 2.0 * n * vy, n * vx), math.hypot(n * n * z, n * vz)
        return math.hypot(2.0 * in_plane, normal) + self._advantage * _MAX_VELOCITY_GAIN

    def _nodes(self, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        half = 0.5 * (high - low)
        times = (low[:, None] + half[:, None] * (1.0 + _POINTS)).ravel()
        effects = self._motion.transition(0.0, times)[:, :3, 3:]
        return effects, self._advantage * (half[:, None] * _WEIGHTS).ravel()

    def __call__(self, time_s: float) -> _Gap:
        """Return the maximum of nu . x - a int |M^T nu| over the unit sphere."""
        x = self._motion.transition(0.0, time_s) @ self._state
        if time_s == 0.0:
            length = float(np.linalg.norm(x[:3]))
            return _Gap(length, float(self._nu @ x[3:]), self._nu, length)
        whole = int(np.searchsorted(self._breaks, time_s)) - 1
        last = self._nodes(self._breaks[whole : whole + 1], np.array([time_s]))
        effects = np.concatenate([self._effects[: whole * len(_POINTS)], last[0]])
        weights = np.concatenate([self._weights[: whole * len(_POINTS)], last[1]])
        lengths = float(np.linalg.norm(x[:3]) + weights @ np.linalg.norm(effects, axis=(1, 2)))
        nu = self._maximised(x[:3], effects, weights, _OPTIMAL * lengths)
        size = _along(nu, effects)[1]
        size_now = float(np.linalg.norm(self._motion.transition(0.0, time_s)[:3, 3:].T @ nu))
        self._nu = nu
        value = float(nu @ x[:3] - weights @ size)
        return _Gap(value, float(nu @ x[3:]) - self._advantage * size_now, nu, lengths)

    def _maximised(self, there: Floats, effects: Floats, weights: Floats, tolerance: float) -> Floats:
        nu = self._nu
        products = (effects @ effects.transpose(0, 2, 1)).reshape(-1, 9)
        for _ in range(_MAX_NEWTON):
            along, size = _along(nu, effects)
            now = float(nu @ there - weights @ size)
            shares = weights / size
            drift = np.einsum("kij,kj->ki", effects, along)
            # Its length is a distance that the pursuer can reach: an upper bound.
            gradient = there - shares @ drift
            plane = np.linalg.svd(nu[None, :])[2][1:]
            slope = plane @ gradient
            if float(np.abs(slope).max()) <= tolerance:
                return nu
            hessian = np.einsum("k,ki,kj->ij", shares / size**2, drift, drift) - (shares @ products).reshape(3, 3)
            curve = plane @ hessian @ plane.T - max(now, 0.0) * np.eye(2)
            step = -np.linalg.solve(curve, slope) @ plane
            stride = 1.0
            while stride > 1e-12:
                trial = _unit(nu + stride * step)
                reached = float(trial @ there - weights @ _along(trial, effects)[1])
                if reached > now or (stride == 1.0 and reached >= now - 1e-3 * tolerance):
                    break
                stride *= 0.5
            else:
                break
            nu = trial
        raise LinearGameError(
            "the evader's maximum distance was not found to its tolerance: check the units of state and accelerations"
        )


def _along(nu: Floats, effects: Floats) -> tuple[Floats, Floats]:
    along = nu @ effects
    return along, np.maximum(np.sqrt(np.einsum("ki,ki->k", along, along)), 1e-300)


def _graded_breaks(angle: float) -> Floats:
    """Return ends of panels, 0 to an angle: finer toward where sin s = 0, or tan(s / 2) = 3 s / 8."""
    half_turns = np.pi * np.arange(math.ceil(angle / np.pi) + 1.0)
    others = [
        2.0 * float(brentq(lambda h: math.sin(h) - 0.75 * h * math.cos(h), k * np.pi + 0.5, (k + 0.5) * np.pi))
        for k in range(1, math.ceil(0.5 * angle / np.pi) + 1)
    ]
    singular = np.unique(np.concatenate([half_turns, others]))
    low, half = singular[:-1, None], 0.5 * np.diff(singular)[:, None]
    breaks = np.concatenate([singular, (low + half * _GRADES).ravel(), (low + half * (2.0 - _GRADES)).ravel()])
    breaks = np.unique(breaks)
    return np.append(breaks[breaks < angle], angle)


def _first_contact(
    gap: Callable[[float], _Gap], bend: Callable[[float, float], float], end: float, dry: float = math.inf
) -> LinearCapture | None:
    """Return the first contact up to `end`.

    From one time to a later one the gap is at least value + rate dt - bend dt^2 / 2. Steps end well before the time
    `dry` at which a craft has burnt its mass, where the bend is infinite.
    """
    t, window = 0.0, math.inf
    for _ in range(_MAX_STEPS):
        here = gap(t)
        if here.value <= 2.0 * CONTACT * here.lengths:
            return _contact(gap, bend, t, here, end)
        if t >= end:
            return None
        window = min(window, end - t, 0.5 * (dry - t))
        # Below the value by the tolerance, so that a grazing contact is not stepped over.
        step = min(window, _safe_step(here.value - CONTACT * here.lengths, here.rate, bend(t, t + window)))
        t, window = min(end, t + max(step, _MIN_STEP * t)), 2.0 * step
    raise LinearGameError("the gap is nearly zero for so long that the first contact cannot be determined")


def _contact(
    gap: Callable[[float], _Gap], bend: Callable[[float, float], float], t: float, here: _Gap, end: float
) -> LinearCapture:
    """Compute the zero from a time at which the gap is within its tolerance, and whether the contact is grazing."""
    contact_s, at_contact = t, here
    most = 2.0 * CONTACT * here.lengths
    for _ in range(_MAX_CLOSING_STEPS):
        if here.value <= 0.0 or here.value > most or t >= end:
            break
        step = _safe_step(here.value, here.rate, max(bend(t, t), 0.0))
        before, value = t, here.value
        t = min(end, t + max(step, _MIN_STEP * t))
        here = gap(t)
        if here.value <= 0.0:
            contact_s, at_contact = before + (t - before) * value / (value - here.value), here
    probe = contact_s - most / at_contact.rate if at_contact.rate < 0.0 else math.inf
    is_deep = probe <= end and gap(probe).value <= -0.5 * most
    return LinearCapture(contact_s, at_contact.direction, not is_deep)


def _safe_step(value: float, rate: float, bend: float) -> float:
    """Return the time for which value + rate dt - bend dt^2 / 2 is positive."""
    if bend <= 0.0:
        return -value / rate if rate < 0.0 else math.inf
    root = math.sqrt(rate * rate + 2.0 * bend * value)
    return (rate + root) / bend if rate > 0.0 else 2.0 * value / (root - rate)


def _line_of_sight(position: Floats, velocity: Floats, time_s: float) -> tuple[float, Floats]:
    """Return distance and direction without thrust; at zero distance the direction is that at the start."""
    relative = position + velocity * time_s
    distance = float(np.linalg.norm(relative))
    return distance, relative / distance if distance > 0.0 else _unit(position)


def _relative(position_m: Floats, velocity_m_s: Floats) -> tuple[Floats, Floats]:
    position, velocity = np.asarray(position_m, dtype=np.float64), np.asarray(velocity_m_s, dtype=np.float64)
    if position.shape != (3,) or velocity.shape != (3,):
        raise ValueError("position and velocity must have three components")
    if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
        raise ValueError("position and velocity must be finite")
    if not position.any():
        raise ValueError("pursuer and evader are at the same position")
    return position, velocity


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
