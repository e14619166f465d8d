"""How hard a flight drives its thruster: peak, total impulse, and whether a bound on the control can be met."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from rendezvous.greatest_control import greatest_control
from rendezvous.pareto.plan import Plan

Floats = NDArray[np.float64]

_NODES, _WEIGHTS = (each.astype(np.float64) for each in np.polynomial.legendre.leggauss(12))
_AGREEMENT = 1e-11
_MOST_PANELS = 4096
_MARGIN = 1e-6


class Feasibility(Enum):
    """Whether a meeting can be flown with |u| <= u_max."""

    WITHIN = "within"
    """The minimum-energy control stays within the bound."""
    ANOTHER_CONTROL = "another-control"
    """It does not, but another control does."""
    IMPOSSIBLE = "impossible"
    """No control does."""


@dataclass(frozen=True)
class BoundCheck:
    """A meeting held against a bound on the control.

    Parameters
    ----------
    feasibility : Feasibility
    peak_m_s2 : float
        Greatest |u| of the minimum-energy control.
    least_peak_m_s2 : float
        The least greatest |u| that any control needs for this meeting.
    """

    feasibility: Feasibility
    peak_m_s2: float
    least_peak_m_s2: float


def peak_control(plan: Plan) -> float:
    """Return the greatest |u| of a flight, m/s^2.

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    float
    """
    return greatest_control(plan.control, plan.craft.start_s, plan.meeting_s)


def total_impulse(plan: Plan) -> float:
    """Return int |u| dt of a flight, m/s.

    Parameters
    ----------
    plan : Plan

    Returns
    -------
    float

    Notes
    -----
    Gauss and Legendre's rule on panels that double until two answers agree to 1e-11; where |u| touches zero it has a
    corner, and the answer is within 1e-7.
    """
    panels, before = 4, np.inf
    while True:
        times, weights = _rule(plan, panels)
        impulse = float(weights @ np.linalg.norm(plan.control(times), axis=1))
        if abs(impulse - before) <= _AGREEMENT * impulse or panels >= _MOST_PANELS:
            return impulse
        panels, before = 2 * panels, impulse


def check_bound(plan: Plan, greatest_m_s2: float, common: int = 6) -> BoundCheck:
    """Hold a flight against a bound on the control.

    Parameters
    ----------
    plan : Plan
    greatest_m_s2 : float
        u_max, positive.
    common : int
        How many components of the terminal state must be met: 6, or 3 for an intercept.

    Returns
    -------
    BoundCheck

    Raises
    ------
    ValueError
        If the bound is not positive and finite.
    """
    if not (np.isfinite(greatest_m_s2) and greatest_m_s2 > 0.0):
        raise ValueError(f"the bound on the control must be positive and finite, found {greatest_m_s2!r} m/s^2")
    peak, least = peak_control(plan), least_peak(plan, common)
    if peak <= greatest_m_s2:
        return BoundCheck(Feasibility.WITHIN, peak, least)
    possible = least <= greatest_m_s2 * (1.0 + _MARGIN)
    return BoundCheck(Feasibility.ANOTHER_CONTROL if possible else Feasibility.IMPOSSIBLE, peak, least)


def least_peak(plan: Plan, common: int = 6) -> float:
    """Return the least greatest |u| with which a flight can do what it does, m/s^2.

    Parameters
    ----------
    plan : Plan
        Its effect counts, not how it is reached.
    common : int
        How many components of the terminal state must be met: 6, or 3 for an intercept.

    Returns
    -------
    float
        A lower bound of every control's peak, and within 1e-6 of the least.

    Notes
    -----
    Duality: the greatest l'e / int |B' Phi(T, t)' l| dt over directions l, where e is what the control must achieve.
    Every l gives a valid lower bound, so a search that stops early errs on the cautious side only. Krasovskii's problem
    of moments, in scaled coordinates, by BFGS.
    """
    start, end = plan.craft.start_s, plan.meeting_s
    motion = plan.craft.motion
    times, weights = _rule(plan, 16)
    effect = motion.transition(times, np.full(times.shape, end)) @ motion.input_map(times)
    scale = np.ones(common)
    scale[:3] = end - start
    effect = effect[:, :common] / scale[:, None]
    gramian = np.einsum("k,kai,kbi->ab", weights, effect, effect)
    achieved = np.einsum("k,kai,ki->a", weights, effect, plan.control(times))
    if not achieved.any():
        return 0.0
    # In coordinates of the Gramian's root, about the minimum-energy direction: l = base + others y, l'e = 1.
    lower = np.linalg.cholesky(gramian)
    effect = np.einsum("ab,kbi->kai", np.linalg.inv(lower), effect)
    goal = np.linalg.solve(lower, achieved)
    base = goal / (goal @ goal)
    others = np.linalg.svd(goal[None, :])[2][1:].T

    def size(shift: Floats) -> tuple[float, Floats]:
        primer = np.einsum("kai,a->ki", effect, base + others @ shift)
        norms = np.sqrt((primer**2).sum(axis=1) + tiny)
        slope = np.einsum("k,kai,ki->a", weights / norms, effect, primer)
        return float(weights @ norms) / unit, others.T @ slope / unit

    primer = np.einsum("kai,a->ki", effect, base)
    tiny = 1e-24 * float((primer**2).sum(axis=1).max())
    unit = float(weights @ np.linalg.norm(primer, axis=1))
    if not others.size:
        return 1.0 / unit
    span = float(np.linalg.norm(base))
    found = minimize(
        lambda y: (size(span * y)[0], span * size(span * y)[1]),
        np.zeros(others.shape[1]),
        jac=True,
        method="BFGS",
        options={"gtol": 1e-9},
    )
    return 1.0 / (unit * min(size(span * found.x)[0], 1.0))


def _rule(plan: Plan, panels: int) -> tuple[Floats, Floats]:
    """Nodes and weights over the flight."""
    half = 0.5 * (plan.meeting_s - plan.craft.start_s) / panels
    middles = plan.craft.start_s + half * (2.0 * np.arange(panels) + 1.0)
    return (middles[:, None] + half * _NODES).ravel(), np.tile(half * _WEIGHTS, panels)
