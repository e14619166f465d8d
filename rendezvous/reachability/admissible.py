"""The admissible controls of a block as one convex set, and convex programs over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from infoset.rendezvous._arrays import Floats, Places
from infoset.rendezvous.reachability.conic import MAX_GAP, ConeProgram, NoSolutionError, Optimum
from infoset.rendezvous.reachability.problem import StateBlock

_MAX_SHARP_VIOLATION = 3e-10
"""Maximum violation of a row by a point that was moved onto its active rows: a third of
`MAX_VIOLATION`, so that the step adds no violation of its own."""
_SHARP_RANK = 1e-12
"""Relative singular value below which active rows count as dependent: near rounding."""
_STILL = 1e-9
"""Change of a thrust in a direction, as a part of its bound, below which it counts as constant
there: the maximum violation of a constraint (`MAX_VIOLATION`)."""


class _Rows(NamedTuple):
    """Constraints rows v <= limits, of shapes (r, p) and (r,).

    `moments` and `labels`, shape (r,), are as in `Lifted`.
    """

    rows: Floats
    limits: Floats
    moments: Places
    labels: Places


@dataclass(frozen=True, eq=False)
class Lifted:
    """A convex set {v: rows v <= limits, equal v = levels} that parametrises states and controls.

    States are x(t) = free[t] + response[t] v, of shapes (T + 1, n) and (T + 1, n, p). Controls of
    all periods, beginning with the first period, are control_free + control_response v, of shapes
    (T m,) and (T m, p). Each of the r rows belongs to the time in `moments` and to the constraint
    of the block whose index is in `labels`; `labels` is -1 for a constraint on controls, and both
    are -1 for a bound on a control.

    For thrust in a ball, `ball` is the number m of controls of a period, and |u(t)| <= 1 is a
    further constraint. For a box it is 0, and the bounds are among the rows.
    """

    free: Floats
    response: Floats
    control_free: Floats
    control_response: Floats
    rows: Floats
    limits: Floats
    moments: Places
    labels: Places
    equal: Floats
    levels: Floats
    ball: int

    @property
    def size(self) -> int:
        """Number p of variables."""
        return int(self.rows.shape[1])

    def controls(self, point: Floats) -> Floats:
        """Return the controls of a point, shape (T m,)."""
        return np.asarray(self.control_free + self.control_response @ point)

    def until(self, time: int) -> Lifted:
        """Return the set without the constraints of later times; bounds on controls remain."""
        return self.only(np.flatnonzero(self.moments <= time))

    def only(self, kept: Places) -> Lifted:
        """Return the set with some of its rows."""
        return replace(
            self,
            rows=self.rows[kept],
            limits=self.limits[kept],
            moments=self.moments[kept],
            labels=self.labels[kept],
        )

    def where(self, equal: Floats, levels: Floats) -> Lifted:
        """Return the set with more equations."""
        return replace(
            self, equal=np.vstack([self.equal, equal]), levels=np.concatenate([self.levels, levels])
        )

    def within(self, point: Floats, basis: Floats) -> Lifted:
        """Return the set in coordinates z of v = point + basis z.

        The equations must hold for all z; they are left out.
        """
        return replace(
            self,
            free=self.free + self.response @ point,
            response=self.response @ basis,
            control_free=self.controls(point),
            control_response=self.control_response @ basis,
            rows=self.rows @ basis,
            limits=self.limits - self.rows @ point,
            equal=np.zeros((0, basis.shape[1])),
            levels=np.zeros(0),
        )


def lift(block: StateBlock) -> Lifted:
    """Return the admissible controls of a block, v = all its controls; O(T^2 n^2 m), dense."""
    periods = block.periods
    n = block.size
    m = len(block.controls)
    width = periods * m
    free = np.zeros((periods + 1, n))
    response = np.zeros((periods + 1, n, width))
    free[0] = block.initial

    for t in range(periods):
        free[t + 1] = block.transition[t] @ free[t]
        response[t + 1] = block.transition[t] @ response[t]
        response[t + 1][:, t * m : (t + 1) * m] += block.control[t]

    of_periods = _state_constraints(block, free, response)
    constraints = [each.end for each in of_periods]
    for each in of_periods:
        constraints += each.within
    return _lifted(block, free, response, constraints, np.zeros((0, width)), np.zeros(0))


def lift_with_states(block: StateBlock) -> Lifted:
    """Return the set of `lift` with v = all controls, then all states x(1)..x(T).

    With T periods, n states and m controls, v has p = T m + T n variables: u(0)..u(T-1), then
    x(1)..x(T). The T n equations x(t + 1) - A(t) x(t) - B(t) u(t) = 0 determine the states; the
    start is in the first levels. Rows on states are ordered by period, unlike in `lift`. The rows
    are sparse, which speeds up an interior-point method.
    """
    periods = block.periods
    n = block.size
    m = len(block.controls)
    width = periods * m
    total = width + periods * n

    free = np.zeros((periods + 1, n))
    response = np.zeros((periods + 1, n, total))
    free[0] = block.initial
    for t in range(1, periods + 1):
        response[t][:, width + (t - 1) * n : width + t * n] = np.eye(n)

    levels = np.zeros((periods, n))
    levels[0] = block.transition[0] @ block.initial

    constraints = []
    for each in _state_constraints(block, free, response):
        constraints += [each.end, *each.within]
    equal = _equations_of_motion(block, response)
    return _lifted(block, free, response, constraints, equal, levels.ravel())


def lift_from_any_start(block: StateBlock) -> Lifted:
    """Return the set of `lift_with_states` for all starts: v = all controls, then x(0)..x(T)."""
    periods = block.periods
    n = block.size
    width = periods * len(block.controls)
    free = np.zeros((periods + 1, n))
    states = np.eye((periods + 1) * n, width + (periods + 1) * n, width)
    response = states.reshape(periods + 1, n, -1)

    held = np.flatnonzero(np.isfinite(block.offsets[0]))
    rows = block.normals[held] @ response[0]
    constraints = [_Rows(rows, block.offsets[0, held], np.zeros(len(held), dtype=int), held)]
    for each in _state_constraints(block, free, response):
        constraints += [each.end, *each.within]
    equal = _equations_of_motion(block, response)
    return _lifted(block, free, response, constraints, equal, np.zeros(len(equal)))


def _equations_of_motion(block: StateBlock, response: Floats) -> Floats:
    """Return the rows x(t + 1) - A(t) x(t) - B(t) u(t), shape (T n, p), of states response[t] v.

    The controls are the first of the p variables v.
    """
    m = len(block.controls)
    equal = np.zeros_like(response[1:])
    for t in range(block.periods):
        equal[t] = response[t + 1] - block.transition[t] @ response[t]
        equal[t][:, t * m : (t + 1) * m] = -block.control[t]
    return np.asarray(equal.reshape(-1, response.shape[2]))


class _PeriodConstraints(NamedTuple):
    """Constraints on the states at the end of a period, and at each of the times within it.

    The time just after an impulse is one of the latter.
    """

    end: _Rows
    within: list[_Rows]


def _state_constraints(
    block: StateBlock, free: Floats, response: Floats
) -> list[_PeriodConstraints]:
    """Return the constraints of each period on the states free[t] + response[t] v."""
    n = block.size
    m = len(block.controls)
    result = []
    for t in range(block.periods):
        held = np.flatnonzero(np.isfinite(block.offsets[t + 1]))
        normals = block.normals[held]
        limits = block.offsets[t + 1, held] - normals @ free[t + 1]
        end = _Rows(normals @ response[t + 1], limits, np.full(len(held), t + 1), held)
        result.append(_PeriodConstraints(end, []))

        # States within period t obey the limits of time t, but depend on u(t). Their rows belong to
        # time t + 1, as `Lifted.until` expects.
        thrust = np.eye(m, response.shape[2], t * m)
        if block.jump is not None:
            # A constraint that impulses do not change has the same row at x(t) before the impulse,
            # which is the end of the period before.
            changed = (block.normals @ block.jump).any(axis=1)
            held = np.flatnonzero(np.isfinite(block.offsets[t]) & changed)
            normals = block.normals[held]
            limits = block.offsets[t, held] - normals @ free[t]
            rows = normals @ (response[t] + block.jump @ thrust)
            result[t].within.append(_Rows(rows, limits, np.full(len(held), t + 1), held))
        if block.between is None:
            continue

        held = np.flatnonzero(np.isfinite(block.offsets[t]))
        normals = block.normals[held]
        for inner in block.between[t]:
            limits = block.offsets[t, held] - normals @ inner[:, :n] @ free[t]
            rows = normals @ (inner[:, :n] @ response[t] + inner[:, n:] @ thrust)
            result[t].within.append(_Rows(rows, limits, np.full(len(held), t + 1), held))
    return result


def _lifted(
    block: StateBlock,
    free: Floats,
    response: Floats,
    constraints: list[_Rows],
    equal: Floats,
    levels: Floats,
) -> Lifted:
    """Return the set with the bounds on the controls, the first `width` of the p variables.

    In a box the bounds |v_i| <= 1 are rows, which have no time and no label: -1. In a ball they
    are no rows, and `ball` of the result stands for them. The list `constraints`, those on states,
    is extended.
    """
    width = block.periods * len(block.controls)
    unit = np.eye(width, response.shape[2])
    of_periods = unit.reshape(block.periods, len(block.controls), response.shape[2])
    for t, thrust in enumerate(of_periods):
        held = np.isfinite(block.control_offsets[t])
        rows = block.control_normals[held] @ thrust
        limits = block.control_offsets[t, held]
        constraints.append(_Rows(rows, limits, np.full(len(rows), t + 1), np.full(len(rows), -1)))
    if not block.ball:
        hard = np.full(2 * width, -1)
        bounds = _Rows(np.vstack([unit, -unit]), np.ones(2 * width), hard, hard)
        constraints = [*constraints, bounds]
    return Lifted(
        free=free,
        response=response,
        control_free=np.zeros(width),
        control_response=unit,
        rows=np.concatenate([each.rows for each in constraints]),
        limits=np.concatenate([each.limits for each in constraints]),
        moments=np.concatenate([each.moments for each in constraints]),
        labels=np.concatenate([each.labels for each in constraints]),
        equal=equal,
        levels=levels,
        ball=len(block.controls) if block.ball else 0,
    )


def joined(parts: Sequence[Lifted], controls: Sequence[Places], periods: int, total: int) -> Lifted:
    """Return the product of the sets of several blocks, with controls in the order of the problem.

    `controls` are the indices of each block's controls among the `total` controls of the problem;
    other controls are zero. States are in the order of the blocks, and labels are indices of each
    block's own constraints.
    """
    order = [t * total + int(j) for places in controls for t in range(periods) for j in places]
    control_free = np.zeros(periods * total)
    control_response = np.zeros((periods * total, sum(part.size for part in parts)))
    control_free[order] = np.concatenate([part.control_free for part in parts])
    control_response[order] = block_diag(*[part.control_response for part in parts])

    return Lifted(
        free=np.hstack([part.free for part in parts]),
        response=np.array(
            [block_diag(*[part.response[t] for part in parts]) for t in range(periods + 1)]
        ),
        control_free=control_free,
        control_response=control_response,
        rows=block_diag(*[part.rows for part in parts]),
        limits=np.concatenate([part.limits for part in parts]),
        moments=np.concatenate([part.moments for part in parts]),
        labels=np.concatenate([part.labels for part in parts]),
        equal=block_diag(*[part.equal for part in parts]),
        levels=np.concatenate([part.levels for part in parts]),
        ball=max(part.ball for part in parts),
    )


class _ThrustInAxes(NamedTuple):
    """The thrust of a period in the directions in which it depends on v, and in the others.

    In the former it is `free` + `response` v, of shapes (k,) and (k, p); in the latter it is
    constant, of length `constant`.
    """

    free: Floats
    response: Floats
    constant: float


def _in_own_axes(fixed: Floats, turned: Floats, unit: float = 1.0) -> _ThrustInAxes:
    """Return the thrust fixed + turned v by the directions in which v moves it and the others.

    Shapes are (m,) and (m, p). The bound of the thrust is `unit`; changes in the other directions
    are at most `_STILL` of it and are dropped. A cone that also contains these directions is the
    same set, but the interior-point method loses digits: gaps were 1e-7 in place of 1e-9, and
    rounding decided which programs were refused.
    """
    axes, movements, _ = np.linalg.svd(turned, full_matrices=False)
    moving = movements > _STILL * unit
    # Where v moves the thrust in all directions, axes of its own change nothing.
    if moving.sum() == len(fixed):
        return _ThrustInAxes(fixed, turned, 0.0)
    along = axes[:, moving].T
    free = along @ fixed
    return _ThrustInAxes(free, along @ turned, float(np.linalg.norm(fixed - along.T @ free)))


def with_thrust(program: ConeProgram, lifted: Lifted, *, deep: bool = False) -> ConeProgram:
    """Add |u(t)| <= 1 to a program, and return it; a program for thrust in a box is not changed.

    The first variables of the program are the variables of the set. If `deep`, the last variable is
    the radius of a ball that must also be inside.
    """
    if not (lifted.ball and lifted.size):
        return program
    frees = lifted.control_free.reshape(-1, lifted.ball)
    responses = lifted.control_response.reshape(-1, lifted.ball, lifted.size)
    for fixed, turned in zip(frees, responses, strict=True):
        # A thrust that does not depend on v is within its bound already.
        if np.linalg.norm(turned) <= _STILL:
            continue

        thrust = _in_own_axes(fixed, turned)
        if deep:
            top = np.zeros(len(program.cost))
            # A change of v by the radius moves the thrust by at most this norm times the radius.
            top[-1] = -np.linalg.norm(turned, ord=2)
            _bound_norm(program, thrust, top, 1.0)
        else:
            constant = thrust.constant
            # (1 - constant^2)^(1/2): what the constant part leaves of the bound.
            room = float(np.sqrt(max((1.0 - constant) * (1.0 + constant), 0.0)))
            program.bound(thrust.response, thrust.free, np.zeros(len(program.cost)), room)
    return program


def _bound_norm(
    program: ConeProgram, thrust: _ThrustInAxes, top: Floats, height: float = 0.0
) -> None:
    """Add |thrust| <= top . v + height to a program."""
    free = thrust.free
    response = thrust.response
    if thrust.constant > 0.0:
        free = np.append(free, thrust.constant)
        response = np.vstack([response, np.zeros(response.shape[1])])
    program.bound(response, free, top, height)


def min_relaxation(lifted: Lifted) -> tuple[float, Floats]:
    """Return the minimum relaxation of the constraints for a feasible point, and this point.

    All rows on states and all equations are relaxed, but no constraint on controls. The relaxation
    is at least -1, where the search stops, and not positive if the set is not empty. The relaxation
    of equations is not negative; without equations a negative relaxation is a margin.
    """
    soft = lifted.labels >= 0
    misfit = -np.ones((len(lifted.equal), 1))
    cost = np.zeros(lifted.size + 1)
    cost[-1] = 1.0

    rows = np.vstack(
        [
            np.column_stack([lifted.rows, -soft.astype(float)]),
            np.hstack([lifted.equal, misfit]),
            np.hstack([-lifted.equal, misfit]),
            -cost,
        ]
    )
    max_margin = 0.0 if len(lifted.equal) else 1.0
    limits = np.concatenate([lifted.limits, lifted.levels, -lifted.levels, [max_margin]])

    point = _solution(ConeProgram(cost).keep(rows, limits), lifted)
    return float(point[-1]), point[:-1]


def quadratic(lifted: Lifted, matrix: Floats, vector: Floats) -> Floats:
    """Minimise v . matrix v / 2 + vector . v, which is convex, over a set without equations."""
    if not lifted.size:
        return np.zeros(0)
    program = ConeProgram(vector, matrix).keep(lifted.rows, lifted.limits)
    return with_thrust(program, lifted).solve().point


def min_sum_of_norms(lifted: Lifted, scale: Floats, group: int) -> Floats:
    """Return the point of least sum over the periods of the norm of the `group` controls of each.

    The set has no equations: `lifted.equal` is not used. `scale`, shape (T m,), contains the units
    of the controls.
    """
    periods = len(lifted.control_free) // group
    tops = np.hstack([np.zeros((periods, lifted.size)), np.eye(periods)])
    program = with_thrust(ConeProgram(tops.sum(axis=0)).keep(lifted.rows, lifted.limits), lifted)
    return _with_norms_below(program, lifted, scale, tops).solve().point[: lifted.size]


def min_peak(lifted: Lifted, scale: Floats, group: int) -> tuple[float, Floats]:
    """Return the minimum common bound of all controls, and a point of the set that attains it.

    It bounds each component, or for thrust in a ball the norm of the `group` controls of a period.
    The set has no equations: `lifted.equal` is not used. `scale`, shape (T m,), contains the units
    of the controls.
    """
    cost = np.concatenate([np.zeros(lifted.size), [1.0]])
    program = ConeProgram(cost).keep(lifted.rows, lifted.limits)
    if lifted.ball:
        with_thrust(program, lifted)
        tops = np.repeat(cost[None, :], len(lifted.control_free) // group, axis=0)
        point = _with_norms_below(program, lifted, scale, tops).solve().point
    else:
        program.keep(*_absolute(lifted, scale, np.ones((len(scale), 1))))
        point = program.vertex()

    return float(point[-1]), point[:-1]


def min_l1(lifted: Lifted, scale: Floats) -> Floats:
    """Return the point of a set that minimises the sum of the absolute values of all controls.

    The set has no equations: `lifted.equal` is not used. `scale`, shape (T m,), contains the units
    of the controls.
    """
    rows, limits = _absolute(lifted, scale, np.eye(len(scale)))
    cost = np.concatenate([np.zeros(lifted.size), np.ones(len(scale))])

    wide = np.hstack([lifted.rows, np.zeros((len(lifted.rows), len(scale)))])
    program = ConeProgram(cost).keep(
        np.vstack([wide, rows]), np.concatenate([lifted.limits, limits])
    )
    return _solution(program, lifted)[: lifted.size]


def deep_point(lifted: Lifted) -> tuple[Floats, float]:
    """Return the centre and the radius of a large ball inside a set with thrust in a ball.

    The set has no equations (`lifted.equal` is not used), and the radius is at most 1.

    The effect of the radius on the thrust of a period is bounded by the norm of its response: the
    ball is inside, but may not be the largest.
    """
    if not lifted.size:
        return np.zeros(0), 0.0
    cost = np.concatenate([np.zeros(lifted.size), [-1.0]])
    rows = np.column_stack([lifted.rows, np.linalg.norm(lifted.rows, axis=1)])
    # The radius is at most 1 (chosen), so that the program is bounded where no row depends on v.
    program = ConeProgram(cost).keep(
        np.vstack([rows, -cost]), np.concatenate([lifted.limits, [1.0]])
    )

    optimum = with_thrust(program, lifted, deep=True).solve()
    return optimum.point[:-1], float(optimum.point[-1])


def _solution(program: ConeProgram, lifted: Lifted) -> Floats:
    if lifted.ball:
        return with_thrust(program, lifted).solve().point
    return program.vertex()


def _absolute(lifted: Lifted, scale: Floats, tops: Floats) -> tuple[Floats, Floats]:
    """Rows and limits of |controls| <= tops w, in the units of the controls.

    `tops` has the shape (T m, w). The variables w are after the variables of the set.
    """
    turned = scale[:, None] * lifted.control_response
    fixed = scale * lifted.control_free
    rows = np.vstack([np.hstack([turned, -tops]), np.hstack([-turned, -tops])])
    return rows, np.concatenate([-fixed, fixed])


def _with_norms_below(
    program: ConeProgram, lifted: Lifted, scale: Floats, tops: Floats
) -> ConeProgram:
    """Add |u(t)| <= tops[t] . v, in the units of the controls.

    `tops` has a row for each period, for all variables v of the program.
    """
    group = len(scale) // len(tops)

    for t, top in enumerate(tops):
        mine = slice(t * group, (t + 1) * group)
        fixed = scale[mine] * lifted.control_free[mine]
        turned = scale[mine, None] * lifted.control_response[mine]
        _bound_norm(program, _in_own_axes(fixed, turned, float(scale[mine].max())), top)
    return program


class Maximiser:
    """Maximise many linear functions over one set of controls, which is not empty.

    An interior-point method (Clarabel) reuses the factors that depend on the constraints only.
    Programs on which it fails are solved by the simplex method (HiGHS), or, for thrust in a ball,
    as programs of their own.
    """

    def __init__(self, lifted: Lifted) -> None:
        self._lifted = lifted
        self._program = self._with_cost(np.zeros(lifted.size))
        if lifted.size:
            self._solver = self._program.solver()

    def maximise(self, cost: Floats, max_gap: float = MAX_GAP) -> Floats:
        """Return a maximiser of a linear function, both of shape (p,), to a duality gap."""
        return self._solved(cost, max_gap).point

    def maximise_all(self, costs: Floats) -> Floats:
        """Return a maximiser of each function, both of shape (k, p)."""
        return np.array([self.maximise(cost) for cost in costs]).reshape(costs.shape)

    def maximise_sharply(self, cost: Floats) -> Floats:
        """Return a maximiser that is on its active rows to rounding.

        The solution takes the shortest step onto the rows whose multipliers are above their slacks:
        one more least-squares problem. For thrust in a ball it stays as it is, on the rows to the
        program's tolerance.
        """
        lifted = self._lifted
        optimum = self._solved(cost)
        if not lifted.size or lifted.ball:
            return optimum.point

        active = optimum.multipliers > lifted.limits - lifted.rows @ optimum.point
        held = np.vstack([lifted.equal, lifted.rows[active]])
        missing = np.concatenate([lifted.levels, lifted.limits[active]]) - held @ optimum.point
        moved = optimum.point + np.linalg.lstsq(held, missing, rcond=_SHARP_RANK)[0]

        violation = -float((lifted.limits - lifted.rows @ moved).min(initial=0.0))
        return moved if violation < _MAX_SHARP_VIOLATION else optimum.point

    def _with_cost(self, cost: Floats) -> ConeProgram:
        lifted = self._lifted
        program = (
            ConeProgram(cost).meet(lifted.equal, lifted.levels).keep(lifted.rows, lifted.limits)
        )
        return with_thrust(program, lifted)

    def _solved(self, cost: Floats, max_gap: float = MAX_GAP) -> Optimum:
        """Return the maximum of `cost`, by the solver that is kept for all costs.

        If its result is not accurate, a program of this cost alone is solved.
        """
        if not self._lifted.size:
            return Optimum(np.zeros(0), np.zeros(len(self._lifted.rows)))
        size = float(np.abs(cost).max())
        if size == 0.0:
            size = 1.0
        # Gaps are relative to a cost whose largest entry is one.
        down = -cost / size

        self._solver.update(q=down)
        solution = self._solver.solve()
        try:
            return self._program.checked(np.array(solution.x), np.array(solution.z), down, max_gap)
        except NoSolutionError:
            if self._lifted.ball:
                return self._with_cost(down).solve()
            # A vertex is on its active rows already: without multipliers `maximise_sharply` finds
            # no active row.
            return Optimum(self._with_cost(down).vertex(), np.zeros(len(self._lifted.rows)))
