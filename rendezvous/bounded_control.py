"""Minimum energy with a bound on the control, |u| <= u_max, for arcs that share free values.

An arc k is a linear motion from a given state. Its control must have the effect e_k = d_k + L_k z
at its end, where the arcs share the free values z (a common meeting, velocities at flybys). The
minimised cost is

    sum_k w_k 1/2 int |u_k|^2 dt    with |u_k(t)| <= u_max.

The maximum principle gives u_k = s_k min(1, u_max / |s_k|) with s_k(t) = B' Phi(T_k, t)' lambda_k:
the control of minimum energy, cut to the bound. The costates maximise the dual, a concave function
of finite dimension,

    D = sum_k w_k (lambda_k . d_k - int h(|s_k|) dt)    over    sum_k w_k L_k' lambda_k = 0,

with h(r) = r^2 / 2 up to u_max and u_max r - u_max^2 / 2 beyond. Every value of D is a lower bound
of the cost of every control, so its difference from the cost that is found bounds the error of the
cost.
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
_RULE_NODES = 12
"""Number of nodes of Gauss and Legendre's rule in an interval. `piecewise` has as many on a panel
of a radian; intervals are at most a quarter of a panel (`_PARTS`), on which the rule integrates a
smooth control to rounding."""
_NODES, _WEIGHTS = (
    rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(_RULE_NODES)
)
_PARTS = 4
"""Number of equal parts of a panel of a radian. At the nodes of each part the control is compared
with the bound, to find its switching times. Two switches between neighbouring nodes, which are at
most 0.03 rad apart, are missed; the interval with them is then halved (`_resolved`)."""
_EXACT = 1e-11
"""Error of the effects, relative, at which no more rounds are needed: a thousandth of `GAP`."""
_MAX_ROUNDS = 12
"""Maximum number of rounds of new switching times; each round squares the error. Five were enough
in 285 random cases."""
_MAX_NEWTON_STEPS = 200
"""Maximum number of Newton steps in a round. With it, 285 of 289 random bounds, from 3e-5 above the
smallest possible bound, relative, were solved; the other four were within 1e-4 of it."""
_SHORTEST = 1e-9
"""Part of a Newton step down to which the step is halved: shorter steps change the value by its
rounding only."""
_SETTLED = 1e-13
"""Error of the effect, relative, at which a round ends: rounding of the sums."""
_FARTHEST = 1e12
"""Maximum size of the efforts, relative to the goals. Efforts grow as the reserve of the bound
decreases, and with so small a reserve no digit of the control is exact."""
_ROUNDED = 1e-11
"""Predicted decrease of the value by a Newton step, relative, up to which values are not compared:
their rounding would decide."""
_ARMIJO = 0.1
"""Part of the decrease of the linear model that a Newton step must attain (Armijo's rule). Chosen:
12 random arcs have the same energy from 1e-4 to 0.4 (measured)."""
_DAMPING = 1e-13
"""Part of the mean curvature that is added to the curvature of all directions. Without it the
curvature is singular if all of a control is at the bound and keeps its direction. Chosen: some 500
roundings of the curvature."""
_BISECTIONS = 50
"""Bisections of a switching time: its error is then below the rounding of times."""
_RULE_TOLERANCE = 1e-12
"""Error of the integral of the control over an interval, relative to the bound times the duration
of the arc: the sum of a hundred such errors is below `GAP`."""
_MAX_HALVINGS = 40
"""Maximum number of halvings of an interval: its length is then near the rounding of times."""
_RULE_ERROR = 1e-4
"""Bound of the relative error of the rule for int |s| dt where s passes near zero: the error is
2e-5 in the published encounter."""
_LEAST_PARTS = 16
"""Parts of a panel in the cone program of the smallest bound: the bound then has a relative error
of 1e-7 in the published encounter."""
_CONES = 6000
"""Number of times up to which the cone program of the smallest bound is refined: it is solved in a
second."""
_EXACT_INTEGRAL = 1e-9
"""Relative error of the integral in the smallest bound, as of `integral_of_size`."""


class BoundTooSmallError(ValueError):
    """No control satisfies the bound."""


@dataclass(frozen=True, eq=False)
class Arc:
    """A linear motion between two times, and the effect that its control must have.

    Parameters
    ----------
    motion : LinearMotion
        Motion without a control.
    start_s, end_s : float
        Start and end, s.
    missing : ndarray, shape (c,)
        d, the effect of the control on the first c components at the end, m and m/s, for free
        values of zero.
    slope : ndarray, shape (c, f)
        L, the change of the effect with the free values.
    weight : float
        w > 0, the weight of the energy.
    """

    motion: LinearMotion
    start_s: float
    end_s: float
    missing: Floats
    slope: Floats
    weight: float = 1.0

    def breaks(self) -> Floats:
        """Return times, s, from start to end; between two the motion turns by about a radian."""
        return self.motion.breaks(self.start_s, self.end_s)

    def effects(self, time_s: Floats) -> Floats:
        """Return the effect of a unit control for a second at times (k,), shape (k, c, 3).

        A control acts on the velocities, the last three columns of a transition.
        """
        to_end = self.motion.transition(time_s, np.full(time_s.shape, self.end_s))
        return np.asarray(to_end[:, : len(self.missing), 3:])

    def whitener(self) -> Floats:
        """Return C^-1 S^-1, shape (c, c), with S the units and C C' the Gramian in these units.

        The units are the duration for positions and 1 for velocities.

        Raises
        ------
        ValueError
            If the Gramian is singular in floating point.
        """
        count = len(self.missing)
        scale = np.ones(count)
        scale[:3] = self.end_s - self.start_s
        gramian = self.motion.gramian(self.start_s, self.end_s)[:count, :count]
        gramian = gramian / np.outer(scale, scale)

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
    """A flight of minimum energy with |u| <= `max_m_s2`.

    It starts in `start_state`, shape (6,), and has the `costate`, shape (6,), at its end. `edges_s`
    are times, s, from start to end, between which the control is smooth and the rule is exact.
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
        """Return times, s, between which the control is smooth and turns by at most a radian."""
        return self.edges_s

    def state(self, time_s: ArrayLike) -> Floats:
        """Return the states, m and m/s, shape (..., 6), at times from the start to the end.

        Gauss and Legendre's rule is applied between neighbours of all breaks and times.
        """
        times = np.asarray(time_s, dtype=np.float64)
        grid = np.union1d(self.edges_s, times)
        nodes, weights = _rule(grid)
        # Each node acts until the end of its own interval.
        last = np.repeat(grid[1:], len(_NODES))

        effects = self.motion.transition(nodes, last)[:, :, 3:]
        changes = np.einsum("kab,kb->ka", effects, weights[:, None] * self.control(nodes))
        changes = changes.reshape(len(grid) - 1, len(_NODES), 6).sum(axis=1)
        transitions = self.motion.transition(grid[:-1], grid[1:])

        states = np.empty((len(grid), 6))
        states[0] = self.start_state
        for index in range(len(grid) - 1):
            states[index + 1] = transitions[index] @ states[index] + changes[index]
        # All times are places of the grid.
        return np.asarray(states[np.searchsorted(grid, times)])


class BoundedOptimum(NamedTuple):
    """Minimum of the energy of all arcs.

    `free`, shape (f,), are the free values. For each arc, `costates` contains the costate (6,) at
    its end, `energies` int |u|^2 dt without the weight, m^2/s^3, and `edges_s` times, s, from start
    to end, between which its control is smooth.
    """

    free: Floats
    costates: tuple[Floats, ...]
    energies: Floats
    edges_s: tuple[Floats, ...]


class LeastBound(NamedTuple):
    """The smallest bound for which controls exist.

    `value_m_s2` is a lower bound of it, about 1e-6 too small, relative. `shares`, shape (n,), are
    the parts of the arcs in the integral that determines it; their sum is 1.
    """

    value_m_s2: float
    shares: Floats


def saturated(wanted: Floats, max_m_s2: float) -> Floats:
    """Return vectors, shape (..., 3), shortened to the length `max_m_s2` where they are longer."""
    sizes = np.linalg.norm(wanted, axis=-1, keepdims=True)
    return np.asarray(wanted * (max_m_s2 / np.maximum(sizes, max_m_s2)))


def power(sizes: Floats, max_m_s2: float) -> Floats:
    """Return h(r), m^2/s^4: the maximum of r |u| - |u|^2 / 2 over |u| <= `max_m_s2`."""
    cut = np.minimum(sizes, max_m_s2)
    return np.asarray(cut * (sizes - 0.5 * cut))


def solve_bounded(arcs: Sequence[Arc], max_m_s2: float) -> BoundedOptimum:
    """Return the minimum of the energy of `arcs` with |u| <= `max_m_s2`.

    Newton's method on the dual, in coordinates in which its curvature without the bound is the
    weight. Integrals are sums over Gauss and Legendre's nodes between the times at which a control
    reaches the bound. These switching times are computed again with the new costates until they
    settle. O(n^3) for n arcs.

    Raises
    ------
    BoundTooSmallError
        If no control satisfies the bound, or it is so close to the smallest possible bound that
        the search does not settle.
    """
    whiteners = [arc.whitener() for arc in arcs]
    dual = _Dual.of(arcs, whiteners, max_m_s2)
    point = np.zeros(dual.basis.shape[1])
    sampled = list(map(_sample, arcs, whiteners, [_parts_of(arc, _PARTS) for arc in arcs]))
    best = _Judged(np.zeros(0), np.zeros(0), np.inf, np.inf)
    chosen = None
    before = np.inf
    for _ in range(_MAX_ROUNDS):
        point = dual.minimise(sampled, point)
        costates = list(map(_costate, whiteners, dual.efforts(point)))
        edges = [
            _resolved(arc, costate, max_m_s2) for arc, costate in zip(arcs, costates, strict=True)
        ]
        sampled = list(map(_sample, arcs, whiteners, edges))

        # The point is of the old nodes, and is judged with those of its own switching times.
        judged = dual.judged(sampled, point)
        if judged.violation < best.violation:
            best = judged
            chosen = BoundedOptimum(judged.free, tuple(costates), judged.energies, tuple(edges))
        # Rounds end when the error is rounding, or is not halved.
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
    |s_k| dt. A cone program (Clarabel) with the integral as a sum finds the best costates; the
    result is their lower bound with the exact integral, whatever the solver found. The weights of
    the arcs do not matter. If all d_k are zero, the bound is 0 and the shares are equal.
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

    # Goals of length one: the tolerances of the solver are relative to one.
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
    total = float(integrals.sum()) * (1.0 + _EXACT_INTEGRAL)
    # Zero is a lower bound too, should the solver have found a worse one.
    return LeastBound(max(reached / total, 0.0), integrals / integrals.sum())


class _Samples(NamedTuple):
    """An arc at the nodes of Gauss and Legendre's rule.

    `effects`, shape (k, c, 3), are the whitened effects of a unit control at the nodes, and
    `weights`, shape (k,), the weights of the rule, s.
    """

    effects: Floats
    weights: Floats


class _Judged(NamedTuple):
    """Free values, energies (n,), and the relative errors of the effects and of the energies."""

    free: Floats
    energies: Floats
    violation: float
    gap: float


class _Expansion(NamedTuple):
    """A function of a point (p,): its value, gradient (p,) and second derivatives (p, p)."""

    value: float
    slope: Floats
    curvature: Floats


@dataclass(frozen=True, eq=False)
class _Dual:
    """The negative dual as a function of a point, shape (p,).

    The whitened efforts y of all arcs are `basis` @ point; the basis spans the efforts with sum w_k
    L_k' lambda_k = 0. `goals` and `slopes` are the whitened d_k and L_k, without the `weights` w_k.
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
        """Return the point of the smallest value, by Newton's method with halved steps (Armijo).

        It is the last point of the search also if that has not settled: `judged` finds the error.
        """
        value, slope, curvature = self._expand(sampled, point)
        # This norm is that of the slope without control, at the point zero.
        settled = _SETTLED * float(np.linalg.norm(self.basis.T @ self._weighted_goal()))

        for _ in range(_MAX_NEWTON_STEPS):
            if np.linalg.norm(slope) <= settled:
                break
            # 1e-300 keeps the damping positive if the curvature is zero.
            damping = _DAMPING * max(float(np.trace(curvature)) / max(len(point), 1), 1e-300)
            step = -np.linalg.solve(curvature + damping * np.eye(len(point)), slope)
            decrease = -float(slope @ step)
            compared = decrease > _ROUNDED * abs(value)

            length = 1.0
            trial = self._expand(sampled, point + step)
            while (
                compared
                and trial.value > value - _ARMIJO * length * decrease
                and length > _SHORTEST
            ):
                length *= 0.5
                trial = self._expand(sampled, point + length * step)

            # Beyond `_FARTHEST`, after the shortest step, or after one that was not compared.
            if not np.isfinite(trial.value):
                break
            # If the value changes by its rounding only, the slope has more digits: a step that does
            # not halve it (chosen) is rounding too.
            if not compared and not np.linalg.norm(trial.slope) < 0.5 * np.linalg.norm(slope):
                break
            point = point + length * step
            value, slope, curvature = trial
        return point

    def _weighted_goal(self) -> Floats:
        return np.concatenate(
            [weight * goal for weight, goal in zip(self.weights, self.goals, strict=True)]
        )

    def _expand(self, sampled: Sequence[_Samples], point: Floats) -> _Expansion:
        """Return the negative dual and its derivatives at a point.

        One of `sampled` belongs to each arc. The value is infinite for a point that is NaN or
        beyond `_FARTHEST` (the basis is orthonormal), so that Newton's step is halved.

        Raises
        ------
        BoundTooSmallError
            If the point proves that no control satisfies the bound.
        """
        if not np.linalg.norm(point) <= _FARTHEST * np.linalg.norm(np.concatenate(self.goals)):
            return _Expansion(np.inf, np.full(point.shape, np.inf), np.eye(len(point)))

        # gained = sum w y . d, most = sum w u_max int |s| dt: if gained > most, no bounded control
        # has the effects d (problem of moments).
        value = 0.0
        most = 0.0
        gained = 0.0
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
        return _Expansion(float(value), np.asarray(slope), np.asarray(curvature))

    def judged(self, sampled: Sequence[_Samples], point: Floats) -> _Judged:
        """Return the free values that fit the effects best, the energies, and the errors."""
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
            # Twice the dual: the cost is half of the energy.
            lower[index] = 2.0 * (effort @ goal - samples.weights @ power(sizes, self.max_m_s2))
            reached.append(_effect(samples, control) - goal)

        slopes = np.concatenate(self.slopes)
        # What free values z do not explain is an error: the effect may be d + L z for any z.
        missed = np.concatenate(reached)
        free = np.linalg.lstsq(slopes, missed, rcond=None)[0] if slopes.shape[1] else np.zeros(0)
        # 1e-300, here and below: goals of zero need no control, and keep the quotients defined.
        size = max(float(np.linalg.norm(np.concatenate(self.goals))), 1e-300)
        violation = float(np.linalg.norm(missed - slopes @ free)) / size
        energy = float(self.weights @ energies)
        gap = abs(energy - float(self.weights @ lower)) / max(energy, 1e-300)
        return _Judged(np.asarray(free), energies, violation, gap)


def _longest_goal(
    sampled: Sequence[_Samples], goals: Sequence[Floats], slopes: Sequence[Floats]
) -> list[Floats]:
    """Return efforts y that minimise the sum of int |s| dt, by a cone program.

    The constraints are sum y . goal = 1 and sum slopes' y = 0 over all arcs. The variables are the
    efforts, and upper bounds of |s| sqrt(length_s) at all nodes, which have no unit.
    """
    sizes = [len(goal) for goal in goals]
    length_s = max(float(samples.weights.sum()) for samples in sampled)
    blocks = []
    for samples, before in zip(sampled, np.cumsum([0, *sizes[:-1]]), strict=True):
        # Rows 0, 4, 8, ... are the heights of the cones, and the other rows s at the nodes.
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
    """Second derivatives of int h(|s|) dt by the whitened effort y, shape (c, c).

    `wanted`, shape (k, 3), is s = effects' y at the nodes, and `sizes`, shape (k,), is |s|. The
    second derivative of h is I inside the bound, and u_max (I - s s' / |s|^2) / |s| beyond it.
    """
    inside = sizes <= max_m_s2
    share = max_m_s2 / np.maximum(sizes, max_m_s2)
    matrix = np.einsum(
        "k,kai,kbi->ab", samples.weights * share, samples.effects, samples.effects, optimize=True
    )
    beyond = ~inside
    along = np.einsum("kai,ki->ka", samples.effects[beyond], wanted[beyond] / sizes[beyond, None])
    return np.asarray(matrix - (along.T * (samples.weights * share)[beyond]) @ along)


def _null_space(rows: Floats) -> Floats:
    """Orthonormal columns that independent rows, shape (f, p), map to zero: shape (p, p - f)."""
    if not len(rows):
        return np.eye(rows.shape[1])
    return np.asarray(qr(rows.T)[0][:, len(rows) :])


def _rule(edges_s: Floats) -> tuple[Floats, Floats]:
    """Nodes and weights, s, of Gauss and Legendre's rule between edges."""
    half = 0.5 * np.diff(edges_s)
    nodes = (edges_s[:-1] + half)[:, None] + half[:, None] * _NODES
    return nodes.ravel(), (half[:, None] * _WEIGHTS).ravel()


def _parts_of(arc: Arc, parts: int) -> Floats:
    """Ends of equal parts of each panel of an arc, s."""
    breaks = arc.breaks()
    places = np.linspace(0.0, len(breaks) - 1.0, parts * (len(breaks) - 1) + 1)
    return np.asarray(np.interp(places, np.arange(len(breaks)), breaks))


def _sample(arc: Arc, white: Floats, edges_s: Floats) -> _Samples:
    nodes, weights = _rule(edges_s)
    return _Samples(np.asarray(white @ arc.effects(nodes)), weights)


def _resolved(arc: Arc, costate: Floats, max_m_s2: float) -> Floats:
    """Ends of intervals, s, on which the rule is exact for the control of a costate.

    The initial intervals are parts of panels, cut where |s| = u_max. An interval is halved until
    its halves change the integral of the control by at most `_RULE_TOLERANCE`.
    """

    def wanted(times: Floats) -> Floats:
        effects = arc.motion.transition(times, np.full(times.shape, arc.end_s))[:, :, 3:]
        return np.asarray(np.einsum("kai,a->ki", effects, costate))

    even = _parts_of(arc, _PARTS)
    edges = np.union1d(even, _switches(wanted, _rule(even)[0], max_m_s2))
    # Intervals that are still to be checked; `kept` has all ends.
    low = edges[:-1]
    high = edges[1:]
    kept = [edges]
    for _ in range(_MAX_HALVINGS):
        middle = 0.5 * (low + high)
        whole = _mean(wanted, low, high, max_m_s2)
        first = _mean(wanted, low, middle, max_m_s2)
        second = _mean(wanted, middle, high, max_m_s2)
        halves = 0.5 * (first + second)
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
    """Times, s, at which |s| = u_max, by bisection between nodes inside and beyond the bound."""
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
