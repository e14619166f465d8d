"""Peak control and total impulse of a flight, and whether a bound on the control can be met."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray

from rendezvous.greatest_control import greatest_control
from rendezvous.pareto._sizes import AT_POINTS, WEIGHTS, SizeIntegral, integrate_size
from rendezvous.pareto.plan import Plan
from rendezvous.piecewise import NODES, resolve

Floats = NDArray[np.float64]

_IMPULSE = 1e-10
_INTEGRAL, _DIRECTION, _GAP = 1e-10, 1e-9, 1e-6
_MOST_STEPS = 60
_AT_ONCE = 20_000


class NotCertifiedError(ValueError):
    """The least peak control was not computed to its tolerance."""


class Feasibility(Enum):
    """Whether a meeting is possible with |u| <= u_max."""

    WITHIN = "within"
    """The minimum-energy control stays within the bound."""
    ANOTHER_CONTROL = "another-control"
    """It does not, but another control does."""
    IMPOSSIBLE = "impossible"
    """No control does."""


@dataclass(frozen=True)
class BoundCheck:
    """The control of a meeting compared with a bound.

    Parameters
    ----------
    feasibility : Feasibility
        The verdict.
    peak_m_s2, least_peak_m_s2 : float
        Greatest |u| of the minimum-energy control, and a lower bound of that of any control, to 1e-6.
    """

    feasibility: Feasibility
    peak_m_s2: float
    least_peak_m_s2: float


def peak_control(plan: Plan) -> float:
    """Return the greatest |u| of a `plan`, m/s^2."""
    return greatest_control(plan.control, plan.breaks())


def total_impulse(plan: Plan) -> float:
    """Return int |u| dt of a `plan`, m/s, to 1e-9, relative."""
    control = resolve(plan.control, plan.breaks())
    return integrate_size(control.coefficients, 0.5 * (control.ends_s - control.starts_s), _IMPULSE).value


def check_bound(plan: Plan, greatest_m_s2: float, common: int = 6) -> BoundCheck:
    """Compare a `plan` with a bound u_max on the control; `common` components, 6 or 3 (an intercept), must be met.

    Raises
    ------
    ValueError
        If the bound is not positive and finite.
    NotCertifiedError
        If the least peak is not computed to 1e-6.

    Notes
    -----
    IMPOSSIBLE is certain: the bound is below a lower bound of every control's peak. A bound less than 1e-6 above that
    counts as possible.
    """
    if not (np.isfinite(greatest_m_s2) and greatest_m_s2 > 0.0):
        raise ValueError(f"the bound on the control must be positive and finite, found {greatest_m_s2!r} m/s^2")
    peak, least = peak_control(plan), least_peak(plan, common)
    if peak <= greatest_m_s2:
        return BoundCheck(Feasibility.WITHIN, peak, least)
    possible = least <= greatest_m_s2
    return BoundCheck(Feasibility.ANOTHER_CONTROL if possible else Feasibility.IMPOSSIBLE, peak, least)


def least_peak(plan: Plan, common: int = 6) -> float:
    """Return a lower bound, m/s^2, of the peak |u| of every control with the effect of a `plan` on `common` components.

    A control exists whose peak is at most 1e-6 above it, relative. The common components are 6, or 3 for an intercept.

    Raises
    ------
    NotCertifiedError
        If this precision is not reached.

    Notes
    -----
    Krasovskii's problem of moments, by duality: the greatest l'e / int |B' Phi(T, t)' l| dt over directions l, where e
    is the required effect of the control. The effect of the control is whitened by the Gramian, int E E' dt = 1, and e
    is of unit length; Newton's method minimises I(l) = int |E' l| dt on l'e = 1. At its end two bounds are evaluated:

    * every l gives a lower bound, 1 / I(l), lowered by the error of the integral;
    * u = w / (|w| I) + E' r, w = E' l, achieves e if r = e - int E w / |w| dt / I, and |u| <= 1 / I + |r| max |E|.
    """
    effect = _Effect.of(plan, common)
    goal = effect.goal
    length = float(np.linalg.norm(goal))
    if length == 0.0:
        return 0.0
    goal = goal / length
    others = np.linalg.svd(goal[None, :])[2][1:].T
    direction = goal
    here = effect.size_of(direction)
    for _ in range(_MOST_STEPS):
        slope, bend = effect.derivatives(here)
        rest = goal - slope / here.value
        if others.shape[1] == 0 or float(np.linalg.norm(rest)) * here.value * effect.greatest <= 0.3 * _GAP:
            break
        flat, bent = others.T @ slope, others.T @ bend @ others
        # No step is longer than l: if w has one direction at all times, the Hessian is zero at first.
        stiff = max(float(np.linalg.norm(flat) - np.linalg.eigvalsh(bent)[0]), 1e-14 * float(np.trace(bent)))
        step = -others @ np.linalg.solve(bent + stiff * np.eye(len(bent)), flat)
        there, share = effect.size_of(direction + step), 1.0
        while there.value > here.value - 0.1 * share * float(-slope @ step) and share > 1e-6:
            share *= 0.5
            there = effect.size_of(direction + share * step)
        if there.value >= here.value:
            break
        direction, here = direction + share * step, there
    missed = float(np.linalg.norm(goal - effect.derivatives(here)[0] / here.value)) * here.value
    least, most = here.value + here.error, here.value - here.error
    upper = (1.0 + (missed + effect.greatest * here.direction_error) * effect.greatest) / most
    if not upper * least - 1.0 <= _GAP:
        raise NotCertifiedError(
            f"craft {plan.craft.name!r}: the least control that reaches the meeting is between {length / least:.6g} "
            f"and {length * upper:.6g} m/s^2; it is not known to {_GAP:g}. Remove the bound on the control, or change "
            "the duration"
        )
    return length / least


@dataclass(frozen=True, eq=False)
class _Effect:
    """E(t), the effect of a unit control at a time on the c common components, whitened: int E E' dt = 1.

    Chebyshev `coefficients`, shape (P, 12, c, 3), on panels of half-lengths `half_s`; `goal` is e, the required effect.
    """

    coefficients: Floats
    half_s: Floats
    goal: Floats

    @classmethod
    def of(cls, plan: Plan, common: int) -> _Effect:
        """The effect of a flight's control on the first components of the terminal state."""
        start, end, motion = plan.craft.start_s, plan.meeting_s, plan.craft.motion
        scale = np.ones(common)
        scale[:3] = end - start
        gramian = motion.gramian(start, end)
        whiten = np.linalg.inv(np.linalg.cholesky(gramian[:common, :common] / np.outer(scale, scale))) / scale

        def effect(times: Floats) -> Floats:
            return np.asarray((whiten @ plan.effects(times)[:, :common]).reshape(len(times), -1))

        pieces = resolve(effect, plan.breaks())
        half = 0.5 * (pieces.ends_s - pieces.starts_s)
        coefficients = pieces.coefficients.reshape(len(half), NODES, common, 3)
        # Whitened again as represented: the rounding of the Gramian grows with its condition number.
        at_nodes = np.einsum("kj,pjai->pkai", AT_POINTS, coefficients)
        square = np.einsum("p,k,pkai,pkbi->ab", half, WEIGHTS, at_nodes, at_nodes)
        again = np.linalg.inv(np.linalg.cholesky(square))
        goal = again @ (whiten @ (gramian @ plan.costate)[:common])
        return cls(np.einsum("ab,pjbi->pjai", again, coefficients), half, goal)

    @cached_property
    def greatest(self) -> float:
        """A bound on |E(t)|: the norm of the sums of the magnitudes of its coefficients."""
        return float(np.sqrt((np.abs(self.coefficients).sum(axis=1) ** 2).sum(axis=(1, 2)).max()))

    def size_of(self, direction: Floats) -> SizeIntegral:
        """Int |E' l| dt of a direction l."""
        vectors = np.einsum("pjai,a->pji", self.coefficients, direction)
        return integrate_size(vectors, self.half_s, _INTEGRAL, _DIRECTION / self.greatest)

    def derivatives(self, at: SizeIntegral) -> tuple[Floats, Floats]:
        """Gradient and matrix of second derivatives of the integral in l, shapes (c,) and (c, c)."""
        common = self.coefficients.shape[2]
        slope, bend = np.zeros(common), np.zeros((common, common))
        for first in range(0, len(at.weight), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            effect = np.einsum(
                "nj,njai->nai", chebvander(at.position[part], NODES - 1), self.coefficients[at.panel[part]]
            )
            sizes = np.linalg.norm(at.vector[part], axis=1)
            sizes = np.where(sizes > 0.0, sizes, np.inf)
            along = np.einsum("nai,ni->na", effect, at.vector[part] / sizes[:, None])
            weight = at.weight[part]
            slope += weight @ along
            bend += np.einsum("n,nai,nbi->ab", weight / sizes, effect, effect, optimize=True)
            bend -= (weight / sizes * along.T) @ along
        return slope, bend
