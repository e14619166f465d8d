"""Peak control and total impulse of a flight, and whether a bound on the control can be met."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from rendezvous._arrays import Floats, Integers
from rendezvous.pareto.solution import Plan
from rendezvous.piecewise import NODES, chebyshev_halves, max_control, resolve

_IMPULSE = 1e-10
_INTEGRAL, _DIRECTION, _GAP = 1e-10, 1e-9, 1e-6
_MAX_STEPS = 60
_AT_ONCE = 20_000
_POINTS, _WEIGHTS = (rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(NODES))
_AT_POINTS = chebvander(_POINTS, NODES - 1)
_HALVES = chebyshev_halves(NODES)
_MIN_SHARE = 1e-3
_OUTSIDE = float(1.0 - _POINTS[-1])
_MAX_HALVINGS = 45


class NotCertifiedError(ValueError):
    """The minimum peak control was not computed to its tolerance."""


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

    `peak_m_s2` is the maximum |u| of the minimum-energy control, `min_peak_m_s2` a lower bound of that of any
    control, to 1e-6.
    """

    feasibility: Feasibility
    peak_m_s2: float
    min_peak_m_s2: float


def peak_control(plan: Plan) -> float:
    """Return the maximum |u| of a `plan`, m/s^2."""
    return max_control(plan.control, plan.breaks())


def total_impulse(plan: Plan) -> float:
    """Return int |u| dt of a `plan`, m/s, to 1e-9, relative."""
    half_s, coefficients = resolve(plan.control, plan.breaks())
    return integrate_size(coefficients, half_s, _IMPULSE).value


def check_bound(plan: Plan, max_m_s2: float, common: int = 6) -> BoundCheck:
    """Compare a `plan` with a bound u_max on the control; `common` components, 6 or 3 (an intercept), must be met.

    IMPOSSIBLE is certain: the bound is below a lower bound of every control's peak. A bound less than 1e-6 above that
    counts as possible.

    Raises
    ------
    NotCertifiedError
        If the minimum peak is not computed to 1e-6.
    """
    peak, minimum = peak_control(plan), min_peak(plan, common)
    if peak <= max_m_s2:
        return BoundCheck(Feasibility.WITHIN, peak, minimum)
    possible = minimum <= max_m_s2
    return BoundCheck(Feasibility.ANOTHER_CONTROL if possible else Feasibility.IMPOSSIBLE, peak, minimum)


def min_peak(plan: Plan, common: int = 6) -> float:
    """Return a lower bound, m/s^2, of the peak |u| of every control with the effect of a `plan` on `common` components.

    A control exists whose peak is at most 1e-6 above it, relative. The common components are 6, or 3 for an intercept.

    Raises
    ------
    NotCertifiedError
        If this precision is not reached.

    Notes
    -----
    Krasovskii's problem of moments, by duality: the maximum l'e / int |B' Phi(T, t)' l| dt over directions l, where e
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
    for _ in range(_MAX_STEPS):
        slope, bend = effect.derivatives(here)
        rest = goal - slope / here.value
        if others.shape[1] == 0 or float(np.linalg.norm(rest)) * here.value * effect.maximum <= 0.3 * _GAP:
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
    minimum, most = here.value + here.error, here.value - here.error
    upper = (1.0 + (missed + effect.maximum * here.direction_error) * effect.maximum) / most
    if not upper * minimum - 1.0 <= _GAP:
        raise NotCertifiedError(
            f"craft {plan.craft.name!r}: the minimum control that reaches the meeting is between "
            f"{length / minimum:.6g} and {length * upper:.6g} m/s^2; it is not known to {_GAP:g}. "
            "Remove the bound on the control, or change the duration"
        )
    return length / minimum


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

        half, flat = resolve(effect, plan.breaks())
        coefficients = flat.reshape(len(half), NODES, common, 3)
        # Whitened again as represented: the rounding of the Gramian grows with its condition number.
        at_nodes = np.einsum("kj,pjai->pkai", _AT_POINTS, coefficients)
        square = np.einsum("p,k,pkai,pkbi->ab", half, _WEIGHTS, at_nodes, at_nodes)
        again = np.linalg.inv(np.linalg.cholesky(square))
        goal = again @ (whiten @ (gramian @ plan.costate)[:common])
        return cls(np.einsum("ab,pjbi->pjai", again, coefficients), half, goal)

    @cached_property
    def maximum(self) -> float:
        """A bound on |E(t)|: the norm of the sums of the magnitudes of its coefficients."""
        return float(np.sqrt((np.abs(self.coefficients).sum(axis=1) ** 2).sum(axis=(1, 2)).max()))

    def size_of(self, direction: Floats) -> SizeIntegral:
        """Int |E' l| dt of a direction l."""
        vectors = np.einsum("pjai,a->pji", self.coefficients, direction)
        return integrate_size(vectors, self.half_s, _INTEGRAL, _DIRECTION / self.maximum)

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


@dataclass(frozen=True, eq=False)
class SizeIntegral:
    """The integral of |w| over panels, with a bound on its error, and its nodes.

    A node has a panel, a position in it (-1 to 1), a weight (s) and a vector w. `direction_error` (s) is a bound on the
    error of the integral of w / |w| at these nodes.
    """

    value: float
    error: float
    panel: Integers
    position: Floats
    weight: Floats
    vector: Floats
    direction_error: float


def integrate_size(coefficients: Floats, half_s: Floats, tolerance: float, direction: float = np.inf) -> SizeIntegral:
    """Integrate the magnitude of a vector w that is a polynomial of degree 11 on each panel.

    `coefficients`, shape (P, 12, 3), are those of Chebyshev polynomials, `half_s`, shape (P,), half the lengths of
    panels. Tolerances are relative: `tolerance` of the integral of |w|, `direction` of the integral of w / |w|, to the
    time.

    Gauss and Legendre's rule of 12 nodes on an interval and on its two halves; if they differ by more than the
    interval's share of the tolerance the halves are treated in the same way. |w| has a corner and w / |w| a jump where
    w passes through zero: intervals become short only there.
    """
    total_s = 2.0 * float(half_s.sum())
    panel = np.arange(len(half_s))
    middle, size = np.zeros(len(half_s)), np.ones(len(half_s))
    scale: float | None = None
    value = error = direction_error = 0.0
    accepted: list[tuple[Integers, Floats, Floats, Floats]] = []
    for level in range(_MAX_HALVINGS + 1):
        length = half_s[panel] * size
        vectors = _AT_POINTS @ coefficients
        sizes, units = _polar(vectors)
        whole, turned = length * (sizes @ _WEIGHTS), length[:, None] * np.einsum("k,nki->ni", _WEIGHTS, units)
        if scale is None:
            scale = float(whole.sum())
            if scale == 0.0:
                return SizeIntegral(0.0, 0.0, panel[:0], middle[:0], middle[:0], np.zeros((0, 3)), 0.0)
        halves = [half @ coefficients for half in _HALVES]
        halved = np.stack([_AT_POINTS @ half for half in halves], axis=1)
        sizes, units = _polar(halved)
        parts = 0.5 * length * np.einsum("k,nhk->n", _WEIGHTS, sizes)
        apart = np.abs(parts - whole)
        turn = 0.5 * length[:, None] * np.einsum("k,nhki->ni", _WEIGHTS, units) - turned
        bent = np.linalg.norm(turn, axis=1)
        share = np.maximum(2.0 * length / total_s, _MIN_SHARE)
        # The rules miss a turn between the last node and the end: its effect is bounded and added to the error.
        unseen = 0.5 * length[:, None] * _turned_at_ends(halves, sizes, units)
        apart, bent = apart + unseen[:, 0], bent + unseen[:, 1]
        done = (apart <= tolerance * scale * share) & (bent <= direction * total_s * share)
        if level == _MAX_HALVINGS:
            done[:] = True
        value += float(parts[done].sum())
        error += float(apart[done].sum())
        direction_error += float(bent[done].sum())
        offsets = np.concatenate([0.5 * (_POINTS - 1.0), 0.5 * (_POINTS + 1.0)])
        positions = middle[done, None] + size[done, None] * offsets
        weights = 0.5 * length[done, None] * np.tile(_WEIGHTS, 2)
        accepted.append(
            (np.repeat(panel[done], 2 * NODES), positions.ravel(), weights.ravel(), halved[done].reshape(-1, 3))
        )
        if done.all():
            break
        left = ~done
        coefficients = np.concatenate([half[left] for half in halves])
        middle = np.concatenate([middle[left] - 0.5 * size[left], middle[left] + 0.5 * size[left]])
        panel, size = np.tile(panel[left], 2), np.tile(0.5 * size[left], 2)
    nodes = [np.concatenate(part) for part in zip(*accepted, strict=True)]
    return SizeIntegral(value, error, nodes[0], nodes[1], nodes[2], nodes[3], direction_error)


def _turned_at_ends(halves: list[Floats], sizes: Floats, units: Floats) -> Floats:
    """Bound the changes of |w| and w / |w| between the last nodes and the ends of halves of length 2, shape (n, 2)."""
    bounds = np.zeros((len(sizes), 2))
    for index, half in enumerate(halves):
        for sign, node in ((-1.0, 0), (1.0, -1)):
            size, unit = _polar(sign ** np.arange(NODES) @ half)
            turned = (unit * units[:, index, node]).sum(axis=1) < 0.5
            bounds[:, 0] += np.where(turned, 2.0 * _OUTSIDE * np.maximum(size, sizes[:, index, node]), 0.0)
            bounds[:, 1] += np.where(turned, 2.0 * _OUTSIDE, 0.0)
    return bounds


def _polar(vectors: Floats) -> tuple[Floats, Floats]:
    """Magnitudes and directions; the direction of zero is zero."""
    sizes = np.sqrt((vectors**2).sum(axis=-1))
    return sizes, vectors / np.where(sizes > 0.0, sizes, 1.0)[..., None]
