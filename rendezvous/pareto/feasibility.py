"""Peak control and total impulse of a flight, and whether a bound on the control can be met."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from scipy.optimize import minimize

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pareto.solution import Plan
from infoset.rendezvous.piecewise import NODES, chebyshev_halves, max_control, resolve

_TOLERANCE = 1e-10
_MIN_SHARE = 1e-3
_MAX_HALVINGS = 45
_PARTS = 8
"""Parts of a panel of a radian in which the best direction is searched."""
_POINTS, _WEIGHTS = (rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(NODES))
_AT_POINTS = chebvander(_POINTS, NODES - 1)
_HALVES = chebyshev_halves(NODES)


class Feasibility(Enum):
    """Whether a meeting is possible with |u| <= u_max."""

    WITHIN = "within"
    """The minimum-energy control stays within the bound."""
    ANOTHER_CONTROL = "another-control"
    """It does not, but another control can."""
    IMPOSSIBLE = "impossible"
    """No control does."""


@dataclass(frozen=True)
class BoundCheck:
    """The control of a meeting compared with a bound.

    `peak_m_s2` is the maximum |u| of the minimum-energy control, `min_peak_m_s2` a lower bound of that of any control.
    """

    feasibility: Feasibility
    peak_m_s2: float
    min_peak_m_s2: float


def peak_control(plan: Plan) -> float:
    """Return the maximum |u| of a `plan`, m/s^2."""
    return max_control(plan.control, plan.breaks())


def total_impulse(plan: Plan) -> float:
    """Return int |u| dt of a `plan`, m/s, to 1e-9, relative."""
    return _integral_of_size(plan.control, plan.breaks())


def check_bound(plan: Plan, max_m_s2: float, common: int = 6) -> BoundCheck:
    """Compare a `plan` with a bound u_max on the control; `common` components, 6 or 3 (an intercept), must be met.

    IMPOSSIBLE is certain: the bound is below a lower bound of every control's peak.
    """
    peak, minimum = peak_control(plan), min_peak(plan, common)
    if peak <= max_m_s2:
        return BoundCheck(Feasibility.WITHIN, peak, minimum)
    possible = minimum <= max_m_s2
    return BoundCheck(Feasibility.ANOTHER_CONTROL if possible else Feasibility.IMPOSSIBLE, peak, minimum)


def min_peak(plan: Plan, common: int = 6) -> float:
    """Return a lower bound, m/s^2, of the peak |u| of every control with the effect of a `plan` on `common` components.

    The common components are 6, or 3 for an intercept. In 80 random encounters it was at most 5e-6 below the
    smallest possible peak, relative.

    Krasovskii's problem of moments: the effect e of a control satisfies l'e <= max |u| int |E' l| dt for every
    direction l, where E(t) is the effect of a unit control, whitened by the Gramian. Quasi-Newton steps (BFGS) minimise
    the integral over directions with l'e = 1, by a fixed rule; the bound is that of the direction found.
    """
    start, end = plan.craft.start_s, plan.meeting_s
    scale = np.ones(common)
    scale[:3] = end - start
    gramian = plan.craft.motion.gramian(start, end)
    whiten = np.linalg.inv(np.linalg.cholesky(gramian[:common, :common] / np.outer(scale, scale))) / scale
    goal = whiten @ (gramian @ plan.costate)[:common]
    length = float(np.linalg.norm(goal))
    if length == 0.0:
        return 0.0
    goal /= length

    def effect(times: Floats) -> Floats:
        return np.asarray(whiten @ plan.effects(times)[:, :common])

    breaks = plan.breaks()
    edges = np.interp(
        np.linspace(0.0, len(breaks) - 1.0, _PARTS * (len(breaks) - 1) + 1), np.arange(len(breaks)), breaks
    )
    half = 0.5 * np.diff(edges)
    effects = effect(((edges[:-1] + half)[:, None] + half[:, None] * _POINTS).ravel())
    weights = (half[:, None] * _WEIGHTS).ravel()
    across = np.linalg.svd(goal[None, :])[2][1:].T

    def size(turn: Floats) -> tuple[float, Floats]:
        vectors = np.einsum("kai,a->ki", effects, goal + across @ turn)
        sizes = np.maximum(np.linalg.norm(vectors, axis=1), 1e-300)
        slope = np.einsum("k,kai,ki->a", weights / sizes, effects, vectors, optimize=True)
        return float(weights @ sizes), np.asarray(across.T @ slope)

    direction = goal + across @ minimize(size, np.zeros(common - 1), jac=True, method="BFGS").x
    longest = _integral_of_size(lambda times: np.einsum("kai,a->ki", effect(times), direction), breaks)
    return length / (longest * (1.0 + 1e-9))


def _integral_of_size(function: Callable[[Floats], Floats], breaks_s: Floats) -> float:
    """Integrate the magnitude of a vector, shape (k, 3) at k times, that is smooth between breaks, to 1e-9.

    It is a polynomial on each panel (`resolve`). Gauss and Legendre's rule of 12 nodes on an interval and on its two
    halves; where they differ by more than the interval's share of the tolerance, as at a corner of the magnitude where
    the vector passes through zero, the halves are treated in the same way.
    """
    half_s, coefficients = resolve(function, breaks_s)
    total, share = 0.0, np.maximum(half_s / half_s.sum(), _MIN_SHARE)
    scale: float | None = None
    for level in range(_MAX_HALVINGS + 1):
        halves = [half @ coefficients for half in _HALVES]
        whole, first, second = (
            half_s * (np.linalg.norm(_AT_POINTS @ each, axis=2) @ _WEIGHTS) for each in (coefficients, *halves)
        )
        parts = 0.5 * (first + second)
        scale = float(parts.sum()) if scale is None else scale
        left = (np.abs(parts - whole) > _TOLERANCE * scale * share) & (level < _MAX_HALVINGS)
        total += float(parts[~left].sum())
        coefficients = np.concatenate([half[left] for half in halves])
        half_s, share = np.tile(0.5 * half_s[left], 2), np.tile(np.maximum(0.5 * share[left], _MIN_SHARE), 2)
        if not left.any():
            break
    return total
