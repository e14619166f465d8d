"""Minimum energy with a bound on the control, |u| <= u_max at all times, for arcs that share free
values.

An arc k is a linear motion from a given state. Its control has to have the effect e_k = d_k + L_k z
at its end, where the free values z (a common meeting, velocities at flybys) are shared by the arcs.
Minimised is

    sum_k w_k 1/2 int |u_k|^2 dt    with |u_k(t)| <= u_max.

The maximum principle gives u_k = s_k min(1, u_max / |s_k|) with s_k(t) = B' Phi(T_k, t)' lambda_k:
the control of minimum energy, cut to the bound. The costates maximise the dual, a concave function
of finite dimension,

    D = sum_k w_k (lambda_k . d_k - int h(|s_k|) dt)    over    sum_k w_k L_k' lambda_k = 0,

with h(r) = r^2 / 2 up to u_max and u_max r - u_max^2 / 2 beyond it. Every D is below the cost of
every control, so the difference from the cost that is found proves how good it is.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, qr
from scipy.sparse import block_array, csc_matrix, vstack

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.piecewise import integral_of_size
from infoset.rendezvous.relative_motion import LinearMotion

GAP = 1e-8
"""Maximum difference of the cost from its lower bound, and maximum error of an effect, relative:
visits are printed with nine digits."""
_NODES, _WEIGHTS = (rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(12))
_PARTS = 4
"""Parts of a panel of a radian, at whose ends and nodes it is seen whether the control reaches the
bound.
"""
_EXACT = 1e-11
"""Error of the effects, relative, at which no more rounds are needed."""
_MAX_ROUNDS = 12
"""Rounds of new switching times; the error is squared in each. Five were enough in 285 random
cases.
"""
_MAX_STEPS = 200
"""Newton steps in a round. With them, 285 of 289 random bounds, from 3e-5 above the smallest
possible one, relative, were solved; the other four were within 1e-4 of it."""
_SHORTEST = 1e-9
"""Shortest part of a Newton step."""
_SETTLED = 1e-13
"""Error of the effect, relative, at which a round ends: rounding of the sums."""
_FARTHEST = 1e12
"""Size of the efforts, relative to the goals, beyond which none is tried: they grow as the reserve
of the bound falls, and with so small a reserve the control is not found to any digit."""
_ROUNDED = 1e-11
"""Decrease of the value by a Newton step, relative, below which it is not compared any more."""
_DAMPING = 1e-13
"""Added to the curvature, relative: it is singular if all of a control is at the bound and keeps
its direction.
"""
_BISECTIONS = 50
"""They find a switching time to the rounding of times."""
_RULE_TOLERANCE = 1e-12
"""Error of the effect in an interval, relative to that of the bound in the arc: a hundred of them
are below `GAP`.
"""
_MAX_HALVINGS = 40
"""Halvings of an interval at most: its length is then near the rounding of times."""
_RULE_ERROR = 1e-4
"""More than the error of the rule for int |s| dt where s passes near zero: 2e-5 of it in the
published encounter.
"""
_LEAST_PARTS = 16
"""Parts of a panel in the cone program of the smallest bound: with them it is 1e-7 exact in the
published encounter.
"""
_CONES = 6000
"""Number of times up to which the cone program of the smallest bound is refined; it is solved in a
second.
"""


class BoundTooSmallError(ValueError):
    """No control keeps the bound."""


@dataclass(frozen=True, eq=False)
class Arc:
    """A linear motion between two times, and what its control has to change.

    Parameters
    ----------
    motion : LinearMotion
        Motion without a control.
    start_s, end_s : float
        Start and end, s.
    missing : ndarray, shape (c,)
        d: effect of the control on the first c components at the end, m and m/s, if the free values
        are zero.
    slope : ndarray, shape (c, f)
        L: its change with the free values.
    weight : float
        w > 0: weight of the energy.
    """

    motion: LinearMotion
    start_s: float
    end_s: float
    missing: Floats
    slope: Floats
    weight: float = 1.0

    def breaks(self) -> Floats:
        """Return times from start to end between which the motion turns by about a radian at most,
        s.
        """
        return self.motion.breaks(self.start_s, self.end_s)

    def effects(self, time_s: Floats) -> Floats:
        """Return the effect of a unit control for a second on the first c components, shape (k, c,
        3).
        """
        to_end = self.motion.transition(time_s, np.full(time_s.shape, self.end_s))
        return np.asarray(to_end[:, : len(self.missing), 3:])

    def whitener(self) -> Floats:
        """Return L^-1 S^-1, shape (c, c), with S the units and L L' the Gramian in them.

        Raises
        ------
        ValueError
            If the Gramian is singular in floating point.
        """
        count = len(self.missing)
        scale = np.ones(count)
        scale[:3] = self.end_s - self.start_s
        gramian = self.motion.gramian(self.start_s, self.end_s)[:count, :count] / np.outer(
            scale, scale
        )
        try:
            lower = np.linalg.cholesky(gramian)
        except np.linalg.LinAlgError:
            raise ValueError(
                f"the Gramian from {self.start_s:g} s to {self.end_s:g} s is singular; check times "
                "and units"
            ) from None
        return np.asarray(np.linalg.solve(lower, np.diag(1.0 / scale)))


@dataclass(frozen=True, eq=False)
class BoundedFlight:
    """A flight of minimum energy with |u| <= `max_m_s2`: from `start_state`, with the `costate`
    (6,) at its end.

    `edges_s` are times, s, from start to end, between which the control is smooth and the rule is
    exact.
    """

    motion: LinearMotion
    start_s: float
    end_s: float
    start_state: Floats
    costate: Floats
    max_m_s2: float
    edges_s: Floats

    def costates(self, time_s: ArrayLike) -> Floats:
        """Return Phi(T, t)' lambda (m/s^3, m/s^2), shape (..., 6)."""
        times = np.asarray(time_s, dtype=np.float64)
        to_end = self.motion.transition(times, np.full(times.shape, self.end_s))
        return np.asarray(np.einsum("...ba,b->...a", to_end, self.costate))

    def control(self, time_s: ArrayLike) -> Floats:
        """Return u(t), m/s^2, shape (..., 3)."""
        return saturated(self.costates(time_s)[..., 3:], self.max_m_s2)

    def times(self, count: int) -> Floats:
        """Return `count` >= 2 equally spaced times, s, both ends included."""
        return np.linspace(self.start_s, self.end_s, count)

    def breaks(self) -> Floats:
        """Return times, s, between which the control is smooth and turns by about a radian at
        most.
        """
        return self.edges_s

    def state(self, time_s: ArrayLike) -> Floats:
        """Return the states, m and m/s, shape (..., 6), by Gauss and Legendre's rule between breaks
        and times.
        """
        times = np.asarray(time_s, dtype=np.float64)
        grid = np.union1d(self.edges_s, times)
        nodes, weights = _rule(grid)
        last = np.repeat(grid[1:], len(_NODES))
        effects = self.motion.transition(nodes, last)[:, :, 3:]
        changes = np.einsum("kab,kb->ka", effects, weights[:, None] * self.control(nodes))
        changes = changes.reshape(len(grid) - 1, len(_NODES), 6).sum(axis=1)
        transitions = self.motion.transition(grid[:-1], grid[1:])
        states = np.empty((len(grid), 6))
        states[0] = self.start_state
        for index in range(len(grid) - 1):
            states[index + 1] = transitions[index] @ states[index] + changes[index]
        return np.asarray(states[np.searchsorted(grid, times)])


class BoundedOptimum(NamedTuple):
    """Minimum of the energy of all arcs.

    `free`, shape (f,), are the free values, `costates` the costates (6,) at the ends of the arcs,
    `energies` their int |u|^2 dt, m^2/s^3, and `edges_s` times, s, between which their controls are
    smooth, both ends included.
    """

    free: Floats
    costates: tuple[Floats, ...]
    energies: Floats
    edges_s: tuple[Floats, ...]


class LeastBound(NamedTuple):
    """The smallest bound that can be kept.

    `value_m_s2` is a lower bound of it, about 1e-6 too small, relative; `shares`, shape (n,), says
    to what extent each arc determines it; their sum is 1.
    """

    value_m_s2: float
    shares: Floats


def saturated(wanted: Floats, max_m_s2: float) -> Floats:
    """Return vectors, shape (..., 3), shortened to the length `max_m_s2` where they are longer."""
    sizes = np.linalg.norm(wanted, axis=-1, keepdims=True)
    return np.asarray(wanted * np.minimum(1.0, max_m_s2 / np.maximum(sizes, max_m_s2)))


def power(sizes: Floats, max_m_s2: float) -> Floats:
    """Return h(r), m^2/s^4: the maximum of r |u| - |u|^2 / 2 over |u| <= `max_m_s2`."""
    cut = np.minimum(sizes, max_m_s2)
    return np.asarray(cut * (sizes - 0.5 * cut))


def solve_bounded(arcs: Sequence[Arc], max_m_s2: float) -> BoundedOptimum:
    """Return the minimum of the energy of `arcs` with |u| <= `max_m_s2`.

    Newton's method on the dual, in coordinates in which its curvature without the bound is the
    weight. Integrals are sums over Gauss and Legendre's nodes between the times at which a control
    reaches the bound; these times are found again with the new costates until they settle. O(n^3)
    for n arcs.

    Raises
    ------
    BoundTooSmallError
        If no control keeps the bound, or it is so close to the smallest possible one that the
        search does not settle.
    """
    whiteners = [arc.whitener() for arc in arcs]
    dual = _Dual.of(arcs, whiteners, max_m_s2)
    point = np.zeros(dual.basis.shape[1])
    edges = [_parts_of(arc, _PARTS) for arc in arcs]
    best = _Judged(np.zeros(0), np.zeros(0), np.inf, np.inf)
    chosen = None
    before = np.inf
    for _ in range(_MAX_ROUNDS):
        sampled = [
            _sample(arc, white, times)
            for arc, white, times in zip(arcs, whiteners, edges, strict=True)
        ]
        point = dual.minimise(sampled, point)
        costates = [
            _costate(white, effort)
            for white, effort in zip(whiteners, dual.efforts(point), strict=True)
        ]
        edges = [
            _resolved(arc, costate, max_m_s2) for arc, costate in zip(arcs, costates, strict=True)
        ]
        sampled = [
            _sample(arc, white, times)
            for arc, white, times in zip(arcs, whiteners, edges, strict=True)
        ]
        judged = dual.judged(sampled, point)
        if judged.violation < best.violation:
            best = judged
            chosen = BoundedOptimum(judged.free, tuple(costates), judged.energies, tuple(edges))
        if judged.violation <= _EXACT or judged.violation > 0.5 * before:
            break
        before = judged.violation
    if chosen is None or best.violation > GAP or best.gap > GAP:
        raise BoundTooSmallError(
            f"the bound of {max_m_s2:g} m/s^2 is too close to the smallest possible one: effects "
            f"are exact to {best.violation:.1g} and energies to {best.gap:.1g}"
        )
    return chosen


def least_bound(arcs: Sequence[Arc]) -> LeastBound:
    """Return the smallest bound on |u| with which the `arcs` are possible, for any free values.

    Krasovskii's problem of moments: sum lambda_k . e_k <= u_max sum int |s_k| dt for all costates,
    so each costate with sum L_k' lambda_k = 0 gives the lower bound sum lambda_k . d_k / sum int
    |s_k| dt. A cone program (Clarabel) over the integral's sum finds the best costates; the bound
    is theirs with the exact integral.
    """
    whiteners = [arc.whitener() for arc in arcs]
    goals = [white @ arc.missing for arc, white in zip(arcs, whiteners, strict=True)]
    size = float(np.linalg.norm(np.concatenate(goals)))
    if size == 0.0:
        return LeastBound(0.0, np.full(len(arcs), 1.0 / len(arcs)))

    panels = sum(len(arc.breaks()) - 1 for arc in arcs)
    parts = int(np.clip(_CONES // (len(_NODES) * panels), 1, _LEAST_PARTS))
    sampled = [
        _sample(arc, white, _parts_of(arc, parts))
        for arc, white in zip(arcs, whiteners, strict=True)
    ]
    slopes = [white @ arc.slope for arc, white in zip(arcs, whiteners, strict=True)]
    efforts = _longest_goal(sampled, [goal / size for goal in goals], slopes)

    # Rounding leaves the efforts slightly outside the space in which they are bounds.
    across = _null_space(np.concatenate(slopes).T)
    ends = np.cumsum([len(goal) for goal in goals])[:-1]
    efforts = np.split(across @ (across.T @ np.concatenate(efforts)), ends)
    integrals = np.array(
        [
            _integral(arc, white.T @ effort)
            for arc, white, effort in zip(arcs, whiteners, efforts, strict=True)
        ]
    )
    reached = float(np.concatenate(efforts) @ np.concatenate(goals))
    total = float(integrals.sum()) * (1.0 + 1e-9)
    return LeastBound(max(reached / total, 0.0), integrals / integrals.sum())


class _Samples(NamedTuple):
    """An arc at the nodes of Gauss and Legendre's rule.

    `effects`, shape (k, c, 3), are the whitened effects of a unit control at the nodes; `weights`,
    shape (k,), are those of the rule, s.
    """

    effects: Floats
    weights: Floats


class _Judged(NamedTuple):
    """Free values, energies (n,), and the relative errors of the effects and of the energies."""

    free: Floats
    energies: Floats
    violation: float
    gap: float


@dataclass(frozen=True, eq=False)
class _Dual:
    """The negative dual as a function of a point, shape (p,): all whitened efforts y are `basis` @
    point.

    The basis spans the efforts with sum w_k L_k' lambda_k = 0.
    """

    basis: Floats
    goals: list[Floats]
    slopes: list[Floats]
    weights: Floats
    max_m_s2: float

    @classmethod
    def of(cls, arcs: Sequence[Arc], whiteners: Sequence[Floats], max_m_s2: float) -> _Dual:
        """Return the dual of some arcs."""
        goals = [white @ arc.missing for arc, white in zip(arcs, whiteners, strict=True)]
        slopes = [white @ arc.slope for arc, white in zip(arcs, whiteners, strict=True)]
        weights = np.array([arc.weight for arc in arcs])
        rows = np.concatenate(
            [weight * slope for weight, slope in zip(weights, slopes, strict=True)]
        )
        return cls(_null_space(rows.T), goals, slopes, weights, max_m_s2)

    def efforts(self, point: Floats) -> list[Floats]:
        """Return the whitened effort of each arc."""
        return np.split(self.basis @ point, np.cumsum([len(goal) for goal in self.goals])[:-1])

    def minimise(self, sampled: Sequence[_Samples], point: Floats) -> Floats:
        """Return the point of the smallest value, by Newton's method with halved steps (Armijo)."""
        value, slope, curvature = self._expand(sampled, point)
        settled = _SETTLED * float(np.linalg.norm(self.basis.T @ self._weighted_goal()))
        for _ in range(_MAX_STEPS):
            if np.linalg.norm(slope) <= settled:
                break
            damping = _DAMPING * max(float(np.trace(curvature)) / max(len(point), 1), 1e-300)
            step = -np.linalg.solve(curvature + damping * np.eye(len(point)), slope)
            decrease = -float(slope @ step)
            compared = decrease > _ROUNDED * abs(value)
            length = 1.0
            trial = self._expand(sampled, point + step)
            while compared and trial[0] > value - 0.1 * length * decrease and length > _SHORTEST:
                length *= 0.5
                trial = self._expand(sampled, point + length * step)
            if not np.isfinite(trial[0]):
                break
            # If the value changes by its rounding only, the slope has more digits.
            if not compared and not np.linalg.norm(trial[1]) < 0.5 * np.linalg.norm(slope):
                break
            point = point + length * step
            value, slope, curvature = trial
        return point

    def _weighted_goal(self) -> Floats:
        return np.concatenate(
            [weight * goal for weight, goal in zip(self.weights, self.goals, strict=True)]
        )

    def _expand(self, sampled: Sequence[_Samples], point: Floats) -> tuple[float, Floats, Floats]:
        """Return the negative dual, its gradient and its matrix of second derivatives.

        Raises
        ------
        BoundTooSmallError
            If the point proves that no control keeps the bound.
        """
        if not np.linalg.norm(point) <= _FARTHEST * np.linalg.norm(np.concatenate(self.goals)):
            return np.inf, np.full(point.shape, np.inf), np.eye(len(point))
        value, most, gained = 0.0, 0.0, 0.0
        slopes = []
        blocks = []
        for samples, effort, goal, weight in zip(
            sampled, self.efforts(point), self.goals, self.weights, strict=True
        ):
            wanted = np.einsum("kai,a->ki", samples.effects, effort)
            sizes = np.linalg.norm(wanted, axis=1)
            value += weight * (samples.weights @ power(sizes, self.max_m_s2) - effort @ goal)
            most += weight * self.max_m_s2 * (samples.weights @ sizes)
            gained += weight * float(effort @ goal)
            slopes.append(weight * (_effect(samples, saturated(wanted, self.max_m_s2)) - goal))
            blocks.append(weight * _curvature(samples, wanted, sizes, self.max_m_s2))
        if gained > most * (1.0 + _RULE_ERROR):
            raise BoundTooSmallError(f"no control keeps the bound of {self.max_m_s2:g} m/s^2")
        slope = self.basis.T @ np.concatenate(slopes)
        curvature = self.basis.T @ block_diag(*blocks) @ self.basis
        return float(value), np.asarray(slope), np.asarray(curvature)

    def judged(self, sampled: Sequence[_Samples], point: Floats) -> _Judged:
        """Return the free values that fit the effects best, the energies, and the errors of
        both.
        """
        energies = np.empty(len(sampled))
        lower = np.empty(len(sampled))
        reached = []
        for index, (samples, effort, goal) in enumerate(
            zip(sampled, self.efforts(point), self.goals, strict=True)
        ):
            wanted = np.einsum("kai,a->ki", samples.effects, effort)
            control = saturated(wanted, self.max_m_s2)
            sizes = np.linalg.norm(wanted, axis=1)
            energies[index] = samples.weights @ (control**2).sum(axis=1)
            lower[index] = 2.0 * (effort @ goal - samples.weights @ power(sizes, self.max_m_s2))
            reached.append(_effect(samples, control) - goal)

        slopes = np.concatenate(self.slopes)
        missed = np.concatenate(reached)
        free = np.linalg.lstsq(slopes, missed, rcond=None)[0] if slopes.shape[1] else np.zeros(0)
        size = max(float(np.linalg.norm(np.concatenate(self.goals))), 1e-300)
        violation = float(np.linalg.norm(missed - slopes @ free)) / size
        energy = float(self.weights @ energies)
        gap = abs(energy - float(self.weights @ lower)) / max(energy, 1e-300)
        return _Judged(np.asarray(free), energies, violation, gap)


def _longest_goal(
    sampled: Sequence[_Samples], goals: Sequence[Floats], slopes: Sequence[Floats]
) -> list[Floats]:
    """Efforts y of the smallest sum of int |s| dt with y . goal = 1 in all, and slopes' y = 0, by a
    cone program.
    """
    sizes = [len(goal) for goal in goals]
    length_s = max(float(samples.weights.sum()) for samples in sampled)
    blocks = []
    for samples, before in zip(sampled, np.cumsum([0, *sizes[:-1]]), strict=True):
        # Rows 0, 4, ..: the heights of the cones; the others: s at the nodes.
        rows = np.zeros((len(samples.weights), 4, sum(sizes)))
        rows[:, 1:, before : before + samples.effects.shape[1]] = samples.effects.transpose(0, 2, 1)
        blocks.append(csc_matrix(-np.sqrt(length_s) * rows.reshape(-1, sum(sizes))))
    count = sum(len(samples.weights) for samples in sampled)
    heights = csc_matrix(
        (-np.ones(count), (4 * np.arange(count), np.arange(count))), shape=(4 * count, count)
    )
    equations = np.concatenate([np.concatenate(goals)[None], np.concatenate(slopes).T])
    matrix = block_array([[csc_matrix(equations), None], [vstack(blocks), heights]], format="csc")
    ends = np.concatenate([[1.0], np.zeros(len(equations) - 1 + 4 * count)])
    cost = np.concatenate(
        [np.zeros(sum(sizes)), *(samples.weights / length_s for samples in sampled)]
    )
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    cones = [clarabel.ZeroConeT(len(equations)), *[clarabel.SecondOrderConeT(4)] * count]
    solution = clarabel.DefaultSolver(
        csc_matrix((len(cost), len(cost))), cost, matrix, ends, cones, settings
    ).solve()
    return np.split(np.array(solution.x)[: sum(sizes)], np.cumsum(sizes)[:-1])


def _effect(samples: _Samples, control: Floats) -> Floats:
    """Whitened effect, shape (c,), of a control, shape (k, 3)."""
    return np.asarray(
        np.einsum("k,kai,ki->a", samples.weights, samples.effects, control, optimize=True)
    )


def _curvature(samples: _Samples, wanted: Floats, sizes: Floats, max_m_s2: float) -> Floats:
    """Second derivatives of int h(|s|) dt, shape (c, c): I inside the bound, u_max (I - s s' /
    |s|^2) / |s| beyond.
    """
    inside = sizes <= max_m_s2
    share = np.where(inside, 1.0, max_m_s2 / np.maximum(sizes, max_m_s2))
    matrix = np.einsum(
        "k,kai,kbi->ab", samples.weights * share, samples.effects, samples.effects, optimize=True
    )
    beyond = ~inside
    along = np.einsum("kai,ki->ka", samples.effects[beyond], wanted[beyond] / sizes[beyond, None])
    return np.asarray(matrix - (along.T * (samples.weights * share)[beyond]) @ along)


def _null_space(rows: Floats) -> Floats:
    """Orthonormal columns that rows, shape (f, p), map to zero: shape (p, p - f)."""
    if not len(rows):
        return np.eye(rows.shape[1])
    return np.asarray(qr(rows.T)[0][:, len(rows) :])


def _rule(edges_s: Floats) -> tuple[Floats, Floats]:
    """Nodes and weights, s, of Gauss and Legendre's rule between edges."""
    half = 0.5 * np.diff(edges_s)
    nodes = (edges_s[:-1] + half)[:, None] + half[:, None] * _NODES
    return nodes.ravel(), (half[:, None] * _WEIGHTS).ravel()


def _parts_of(arc: Arc, parts: int) -> Floats:
    """Ends of so many parts of each panel of an arc, s."""
    breaks = arc.breaks()
    places = np.linspace(0.0, len(breaks) - 1.0, parts * (len(breaks) - 1) + 1)
    return np.asarray(np.interp(places, np.arange(len(breaks)), breaks))


def _sample(arc: Arc, white: Floats, edges_s: Floats) -> _Samples:
    nodes, weights = _rule(edges_s)
    return _Samples(np.asarray(white @ arc.effects(nodes)), weights)


def _resolved(arc: Arc, costate: Floats, max_m_s2: float) -> Floats:
    """Ends of intervals, s, on which the rule is exact for the control of a costate.

    They begin with parts of panels, cut where |s| = u_max. An interval is halved until its halves
    change the effect of the control by less than its share of `_RULE_TOLERANCE`.
    """

    def wanted(times: Floats) -> Floats:
        effects = arc.motion.transition(times, np.full(times.shape, arc.end_s))[:, :, 3:]
        return np.asarray(np.einsum("kai,a->ki", effects, costate))

    even = _parts_of(arc, _PARTS)
    edges = np.union1d(even, _switches(wanted, _rule(even)[0], max_m_s2))
    low = edges[:-1]
    high = edges[1:]
    kept = [edges]
    for _ in range(_MAX_HALVINGS):
        middle = 0.5 * (low + high)
        whole = _mean(wanted, low, high, max_m_s2)
        halves = 0.5 * (
            _mean(wanted, low, middle, max_m_s2) + _mean(wanted, middle, high, max_m_s2)
        )
        error = np.linalg.norm(whole - halves, axis=1) * (high - low)
        rough = error > _RULE_TOLERANCE * max_m_s2 * (arc.end_s - arc.start_s)
        if not rough.any():
            break
        kept.append(middle[rough])
        low = np.concatenate([low[rough], middle[rough]])
        high = np.concatenate([middle[rough], high[rough]])
    return np.unique(np.concatenate(kept))


def _mean(wanted: Callable[[Floats], Floats], low: Floats, high: Floats, max_m_s2: float) -> Floats:
    """Mean control on intervals, shape (k, 3), by the rule."""
    times = 0.5 * (low + high)[:, None] + 0.5 * (high - low)[:, None] * _NODES
    controls = saturated(wanted(times.ravel()), max_m_s2).reshape(*times.shape, 3)
    return np.asarray(np.einsum("n,kni->ki", 0.5 * _WEIGHTS, controls))


def _switches(wanted: Callable[[Floats], Floats], nodes_s: Floats, max_m_s2: float) -> Floats:
    """Times, s, at which |s| = u_max, by bisection between two nodes, one inside the bound and one
    beyond it.
    """
    beyond = np.linalg.norm(wanted(nodes_s), axis=1) > max_m_s2
    changes = np.flatnonzero(beyond[1:] != beyond[:-1])
    low = nodes_s[changes]
    high = nodes_s[changes + 1]
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        is_low = (np.linalg.norm(wanted(middle), axis=1) > max_m_s2) == beyond[changes]
        low = np.where(is_low, middle, low)
        high = np.where(is_low, high, middle)
    return np.asarray(0.5 * (low + high))


def _costate(white: Floats, effort: Floats) -> Floats:
    """Costate at the end of an arc, shape (6,); zero in components that are not prescribed."""
    costate = np.zeros(6)
    costate[: len(effort)] = white.T @ effort
    return costate


def _integral(arc: Arc, costate: Floats) -> float:
    """Return int |s| dt of a costate, shape (c,)."""
    return integral_of_size(
        lambda times: np.einsum("kai,a->ki", arc.effects(times), costate), arc.breaks()
    )
