"""Pursuit-evasion games that are linear, solved nearly in closed form: free space, loss of mass, a circular orbit.

In each the pursuer hastens and the evader delays the time at which they meet; both thrust fully all the time. It is the
game of Wang's slides (Bauman University), after Shen and Casalino, Journal of Guidance, Control, and Dynamics 41(8),
2018, p. 1823, with gravity left out or linear: in free space lambda_v = (t_f - t) lambda_r, and both hold their
direction. The answers are not from there; the orbital game is checked against them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from rendezvous.relative_motion import ClohessyWiltshire

Floats = NDArray[np.float64]

_PARTS = 512
_MOST_DOUBLINGS = 80
_TURNED = 1e-8
_REAL, _POLISHING = 1e-7, 3
_MOST_NEWTON = 60


@dataclass(frozen=True)
class Thruster:
    """Thrust of a craft in free space.

    Parameters
    ----------
    thrust_n, mass_kg : float
    exhaust_speed_m_s : float
        Specific impulse times standard gravity.

    Raises
    ------
    ValueError
        If the thrust is negative, or mass or exhaust speed is not positive.
    """

    thrust_n: float
    mass_kg: float
    exhaust_speed_m_s: float

    def __post_init__(self) -> None:
        """Refuse what is no thruster."""
        if not (self.thrust_n >= 0.0 and self.mass_kg > 0.0 and self.exhaust_speed_m_s > 0.0):
            raise ValueError("thrust must not be negative, mass and exhaust speed must be positive")

    def travel_m(self, time_s: float) -> float:
        """Return how far full thrust along a line carries it.

        Parameters
        ----------
        time_s : float
            Below the time at which all the mass would be burnt.

        Returns
        -------
        float

        Raises
        ------
        ValueError
            If all the mass would be burnt by then.

        Notes
        -----
        c [t - (tau - t) ln(tau / (tau - t))] with tau the time that all its mass would last; a series where t / tau is
        small, for there the difference loses its digits.
        """
        if self.thrust_n == 0.0:
            return 0.0
        share = self.thrust_n * time_s / (self.mass_kg * self.exhaust_speed_m_s)
        if not share < 1.0:
            raise ValueError(f"all the mass is burnt before {time_s:g} s")
        if share < 0.05:
            part = sum(share**k / (k * (k - 1.0)) for k in range(2, 16))
        else:
            part = share + (1.0 - share) * math.log1p(-share)
        return self.exhaust_speed_m_s * time_s * part / share if share > 0.0 else 0.0


@dataclass(frozen=True)
class LinearCapture:
    """When and where along a linear game ends.

    Parameters
    ----------
    time_s : float
    direction : ndarray, shape (3,)
        nu, in the axes of the given positions.
    """

    time_s: float
    direction: Floats


def free_space_capture(
    position_m: Floats, velocity_m_s: Floats, pursuer_m_s2: float, evader_m_s2: float
) -> LinearCapture | None:
    """Solve the game of two constant accelerations without gravity.

    Parameters
    ----------
    position_m, velocity_m_s : ndarray, shape (3,)
        The evader's, relative to the pursuer.
    pursuer_m_s2, evader_m_s2 : float
        Greatest accelerations.

    Returns
    -------
    LinearCapture or None
        None where the evader gets away: its acceleration is not the lesser.

    Raises
    ------
    ValueError
        If position or velocity are not three finite numbers, or the position is zero.

    Notes
    -----
    The first root of |r + v t| = (a_P - a_E) t^2 / 2, of degree four; nu is along r + v t.
    """
    position, velocity = _relative(position_m, velocity_m_s)
    advantage = pursuer_m_s2 - evader_m_s2
    if not advantage > 0.0:
        return None
    # In units in which the distance and the advantage are one, so that the roots are of order one or more.
    length = float(np.linalg.norm(position))
    time = math.sqrt(length / advantage)
    r, v = position / length, velocity * (time / length)
    quartic = np.array([0.25, 0.0, -float(v @ v), -2.0 * float(r @ v), -1.0])
    roots = np.roots(quartic)
    at = min(float(root.real) for root in roots if root.real > 0.0 and abs(root.imag) < _REAL * abs(root))
    for _ in range(_POLISHING):
        slope = float(np.polyval(np.polyder(quartic), at))
        at -= float(np.polyval(quartic, at)) / slope if slope != 0.0 else 0.0
    return LinearCapture(at * time, _unit(r + v * at))


def mass_loss_capture(
    position_m: Floats, velocity_m_s: Floats, pursuer: Thruster, evader: Thruster
) -> LinearCapture | None:
    """Solve the game in free space with masses that fall as they burn.

    Parameters
    ----------
    position_m, velocity_m_s : ndarray, shape (3,)
        The evader's, relative to the pursuer.
    pursuer, evader : Thruster

    Returns
    -------
    LinearCapture or None
        None where there is no capture before a craft has burnt all its mass.

    Raises
    ------
    ValueError
        If position or velocity are not three finite numbers, or the position is zero.

    Notes
    -----
    The first root of |r + v t| = S_P(t) - S_E(t), S the travel of full thrust.
    """
    position, velocity = _relative(position_m, velocity_m_s)
    lasts = [each.mass_kg * each.exhaust_speed_m_s / each.thrust_n for each in (pursuer, evader) if each.thrust_n > 0.0]
    if not lasts:
        return None

    def gap(t: float) -> float:
        return float(np.linalg.norm(position + velocity * t)) - pursuer.travel_m(t) + evader.travel_m(t)

    end = min(lasts) * (1.0 - 1e-12)
    at = _first_fall(gap, end) if math.isfinite(end) else _first_fall_doubling(gap, position, pursuer)
    return None if at is None else LinearCapture(at, _unit(position + velocity * at))


def circular_orbit_capture(
    position_m: Floats,
    velocity_m_s: Floats,
    pursuer_m_s2: float,
    evader_m_s2: float,
    rate_rad_s: float,
    *,
    longest_s: float | None = None,
) -> LinearCapture | None:
    """Solve the game of two constant accelerations about a circular orbit (Hill's frame).

    Parameters
    ----------
    position_m, velocity_m_s : ndarray, shape (3,)
        The evader's, relative to the pursuer: radial, along the motion, normal.
    pursuer_m_s2, evader_m_s2 : float
        Greatest accelerations.
    rate_rad_s : float
        Mean motion.
    longest_s : float or None, optional
        None looks for 50 revolutions.

    Returns
    -------
    LinearCapture or None
        None where there is no capture by then.

    Raises
    ------
    ValueError
        If position or velocity are not three finite numbers, or the position is zero.

    Notes
    -----
    The first root of l(T) = max over |nu| <= 1 of nu . (Phi x)_r - (a_P - a_E) int |Phi_rv(T - t)^T nu| dt: a concave
    function of nu, hence one maximum. The evader's greatest distance at T, as the two reachable sets are alike.
    Quadrature of Gauss and Legendre, eight points a twentieth of a revolution.
    """
    position, velocity = _relative(position_m, velocity_m_s)
    advantage = pursuer_m_s2 - evader_m_s2
    if not advantage > 0.0:
        return None
    motion = ClohessyWiltshire(rate_rad_s)
    end = 100.0 * np.pi / rate_rad_s if longest_s is None else longest_s
    state = np.concatenate([position, velocity])

    def best(t: float) -> tuple[float, Floats]:
        return _greatest_distance(motion, state, advantage, t)

    at = _first_fall(lambda t: best(t)[0] if t > 0.0 else float(np.linalg.norm(position)), end)
    return None if at is None else LinearCapture(at, best(at)[1])


def _greatest_distance(
    motion: ClohessyWiltshire, state: Floats, advantage: float, time_s: float
) -> tuple[float, Floats]:
    """Return the greatest of nu . x - a int |M nu| over the unit ball, and where: zero where it is negative.

    Newton's method on the sphere with a line search. What is maximised is concave and homogeneous, so that a maximum
    that is positive is the only one, and on the sphere.
    """
    there = (motion.transition(0.0, time_s) @ state)[:3]
    panels = max(1, math.ceil(20.0 * motion.rate_rad_s * time_s / (2.0 * np.pi)))
    points, weights = np.polynomial.legendre.leggauss(8)
    width = time_s / panels
    times = (np.arange(panels)[:, None] + 0.5 * (1.0 + points)).ravel() * width
    effects = motion.transition(0.0, times)[:, :3, 3:]
    shares = advantage * 0.5 * width * np.tile(weights, panels)

    def value(nu: Floats) -> float:
        return float(nu @ there - shares @ np.linalg.norm(nu @ effects, axis=1))

    nu = _unit(there)
    now = value(nu)
    for _ in range(_MOST_NEWTON):
        along = nu @ effects
        size = np.linalg.norm(along, axis=1)
        unit = along / size[:, None]
        gradient = there - np.einsum("k,kij,kj->i", shares, effects, unit)
        flat = effects - np.einsum("kij,kj,kl->kil", effects, unit, unit)
        hessian = -np.einsum("k,kij,klj->il", shares / size, flat, effects)
        plane = np.linalg.svd(nu[None, :])[2][1:]
        slope = plane @ gradient
        curve = plane @ hessian @ plane.T - max(now, 0.0) * np.eye(2)
        step = -np.linalg.solve(curve, slope) @ plane
        stride = 1.0
        while stride > 1e-8:
            trial = _unit(nu + stride * step)
            reached = value(trial)
            if reached >= now:
                break
            stride *= 0.5
        else:
            break
        nu, now = trial, reached
        # The distance errs as the square of what is left.
        if stride * float(np.linalg.norm(step)) < _TURNED:
            break
    return now, nu


def _first_fall(gap: Callable[[float], float], end: float) -> float | None:
    """Return the first time at which a function that begins positive has fallen to zero, looked for at many times."""
    before = 0.0
    # Denser toward the start, where short games end.
    for at in end * np.linspace(0.0, 1.0, _PARTS + 1)[1:] ** 2:
        if gap(float(at)) <= 0.0:
            return _first_root(gap, float(at), before)
        before = float(at)
    return None


def _first_fall_doubling(gap: Callable[[float], float], position: Floats, pursuer: Thruster) -> float | None:
    """Look twice as far each time: masses that stay have no end of their own."""
    end = math.sqrt(float(np.linalg.norm(position)) * pursuer.mass_kg / max(pursuer.thrust_n, 1e-300))
    for _ in range(_MOST_DOUBLINGS):
        found = _first_fall(gap, end)
        if found is not None:
            return found
        end *= 2.0
    return None


def _first_root(gap: Callable[[float], float], high: float, low: float) -> float:
    """Return the root between a time where a function is positive and one where it is not."""
    if gap(low) <= 0.0:
        low *= 0.5
    return float(brentq(gap, low, high, xtol=1e-12 * high, rtol=8.9e-16))


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
