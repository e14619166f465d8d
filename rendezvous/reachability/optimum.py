"""The minimum terminal norm of a block, and the set of all controls that attain it."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace

import numpy as np

from infoset.rendezvous._arrays import Flags, Floats, Places
from infoset.rendezvous.reachability.admissible import Lifted, deep_point, lift, min_relaxation
from infoset.rendezvous.reachability.conic import (
    ATTEMPTS,
    MAX_GAP,
    MAX_VIOLATION,
    ConeProgram,
    NoSolutionError,
    SolverSettings,
)
from infoset.rendezvous.reachability.problem import StateBlock
from infoset.rendezvous.reachability.relative_interior import null_space_basis, relative_interior

_KEPT = 1e-9
"""Violation of a constraint, relative to its size, up to which it counts as satisfied: the maximum
violation that `MAX_VIOLATION` allows a solution."""
_ACTIVE = 1e-9
"""Multiplier, relative to the largest one, above which its row is tight for every optimal control.
Chosen: optimal controls do not change from 1e-10 to 1e-8 in published and random problems."""
_PRESSED = 1e-7
"""Pressure on the bound of a thrust in a ball, relative to the largest multiplier, above which the
thrust is the same in every optimal control: the error of multipliers in a program with cones
(`CONE_TOLERANCE`)."""
_MIN_PRESSURE = 1e-300
"""Pressure up to which a bound holds nothing, also if all multipliers are zero: near the smallest
double, so that it decides in no other case."""
_CLOSE = 1e-12
"""Relative gap between the norm and its lower bound at which the search stops: the maximum gap of a
small norm (`_ABSOLUTE`)."""
_ZERO = 1e-11
"""Norm, relative to the effect of the controls, below which it counts as zero, unless its lower
bound is above rounding: ten times the gap of a small norm (`_ABSOLUTE`)."""
_ABSOLUTE = 1e-12
"""Maximum gap between a small norm and its lower bound, relative to the effect of the controls; the
thorough tests compare with forty digits at this precision."""
_ROUNDINGS = 8.0
"""Roundings of the sum of absolute terms that the error of a lower bound may have. Chosen: controls
of published problems are the same from 2 to 32 (measured)."""
_ULP = float(np.finfo(float).eps)
"""Relative rounding of a double."""
_RANK = 1e-13
"""Relative singular value below which equations count as dependent. Chosen: optimal controls do not
change from 1e-14 to 1e-11 in published and random problems."""
_ROUNDS = (*ATTEMPTS, *ATTEMPTS[:2])
"""Settings of the solver in the rounds of the search; most searches end after the first. The first
two are tried again, because each round starts from the norm found by the one before."""
_REACH = 1e4
"""Maximum change of a control in a round, in units of the norm found. Constraints that are farther
away are left out of the program. Chosen: from 1e3 to 1e5 results change by 1e-7 at most, the
tolerance of the programs."""
_MAX_NAMES = 4
"""Maximum number of conflicting constraints that a message names; chosen: they fit two lines."""


class EmptyTubeError(ValueError):
    """No control satisfies the constraints.

    `time` is the first time t such that no control satisfies all constraints up to t, and `names`
    lists constraints that conflict there. `relaxation` is the minimum relaxation of all constraints
    on states, as a fraction of their bounds, with which all can be satisfied.
    """

    def __init__(self, time: int, relaxation: float, names: tuple[str, ...]) -> None:
        super().__init__(
            f"no control keeps the constraints: they conflict at t = {time} ({', '.join(names)}); "
            f"a solution exists if all are relaxed by {100.0 * relaxation:.3g} % of their bounds"
        )
        self.time = time
        self.relaxation = relaxation
        self.names = names


@dataclass(frozen=True, eq=False)
class BlockOptimum:
    """The minimum terminal norm of a `block`, whose constraints may be relaxed by rounding.

    `terminal`, shape (n,), is the terminal state of minimum norm, divided by the bounds. It is
    unique, and exactly zero if zero is `reached`. `optimal` contains all optimal controls, in
    coordinates z of their affine hull; thrust in a ball remains a constraint. `centre`, shape (d,),
    is a point z far from the boundary of this set.
    """

    block: StateBlock
    terminal: Floats
    reached: bool
    optimal: Lifted
    centre: Floats

    @property
    def miss(self) -> float:
        """The minimum norm of the block's terminal state, in the units of the problem."""
        return float(np.linalg.norm(self.terminal * self.block.scale))


def block_optimum(block: StateBlock, *, relative: bool = False) -> BlockOptimum:
    """Return the minimum terminal norm of a block, and all controls that reach it.

    If `relative`, the norm is of states divided by their bounds; otherwise in the units of the
    problem. Constraints that no control keeps with a margin of 1e-9 of their bounds are relaxed
    until one does, by at most 2e-9. `EmptyTubeError` is raised if no control keeps them after a
    relaxation of 1e-9 (`admissible`).

    A cone program gives the terminal state, which is unique, and multipliers (see `min_norm`). A
    row with a positive multiplier is tight for every optimal control: with the terminal equations
    these give a face of the set of admissible controls, whose affine hull is found by linear
    programs through the solution.
    """
    block = admissible(block)
    lifted = lift(block)
    # States are divided by their bounds. A common factor of the weights changes no minimiser: the
    # largest weight is one.
    minimum = min_norm(lifted, np.ones(block.size) if relative else block.scale / block.scale.max())
    # The solution itself must not be outside by rounding.
    lifted = replace(lifted, limits=np.maximum(lifted.limits, lifted.rows @ minimum.point))

    terminal = np.zeros(block.size)
    if not minimum.reached:
        terminal = lifted.free[-1] + lifted.response[-1] @ minimum.point
    across = _same_for_all(lifted, minimum)
    face = lifted.where(lifted.response[-1], terminal - lifted.free[-1])
    face = face.where(across, across @ minimum.point)

    if lifted.ball:
        optimal = face.within(minimum.point, null_space_basis(face.equal))
        # Rows that depend on z only by rounding have no direction: for z of size 1, as controls are
        # in units of their bounds, they change by at most `_KEPT`.
        optimal = optimal.only(np.flatnonzero(np.linalg.norm(optimal.rows, axis=1) > _KEPT))
        centre, _ = deep_point(optimal)
        return BlockOptimum(block, terminal, minimum.reached, optimal, centre)
    hull = relative_interior(face.rows, face.limits, face.equal, face.levels, minimum.point)
    optimal = face.within(hull.point, hull.basis).only(hull.kept)
    return BlockOptimum(block, terminal, minimum.reached, optimal, hull.centre)


def _same_for_all(lifted: Lifted, minimum: MinimumNorm) -> Floats:
    """Return rows a, shape (k, p), of functions a . v with one value for all optimal controls.

    v are the variables of `lifted`. The functions are the constraints whose multiplier exceeds both
    their gap, which decides which of the two is zero, and `_ACTIVE`; and the components of thrusts
    in a ball that their bound holds (`_PRESSED`): on the sphere such a thrust is unique.
    """
    gaps = lifted.limits - lifted.rows @ minimum.point
    largest = max(
        float(minimum.multipliers.max(initial=0.0)),
        float(np.abs(minimum.pressures).max(initial=0.0)),
    )
    held = (minimum.multipliers > gaps) & (minimum.multipliers > _ACTIVE * largest)
    fixed = np.zeros(len(lifted.control_free), dtype=bool)
    if lifted.ball:
        pressed = np.linalg.norm(minimum.pressures.reshape(-1, lifted.ball), axis=1)
        fixed = np.repeat(pressed > max(_PRESSED * largest, _MIN_PRESSURE), lifted.ball)
    return np.vstack([lifted.rows[held], lifted.control_response[fixed]])


def block_reaches_zero(block: StateBlock) -> bool:
    """Return whether admissible controls lead a block to zero.

    One program decides whether the constraints have a solution; if they have, `_OptimumSearch`
    solves one or more cone programs. `NoSolutionError` is raised if neither such a control nor a
    positive lower bound was found.
    """
    relaxation, _ = min_relaxation(lift(block))
    if relaxation > _KEPT:
        return False
    # Zero is reached in any weights or in none.
    search = _OptimumSearch(lift(_relaxed(block, relaxation)), np.ones(block.size))
    search.solve()
    return not search.above_zero and search.result().reached


def admissible(block: StateBlock) -> StateBlock:
    """Return a block whose constraints can be satisfied: the block itself, or relaxed by rounding.

    If no control satisfies all constraints with a margin of 1e-9 of their sizes, the constraints
    are relaxed until one does. Raise `EmptyTubeError` if constraints must be relaxed by more than
    1e-9 to be feasible. The first time at which constraints conflict is found by bisection, with a
    linear program per step.
    """
    lifted = lift(block)
    relaxation, _ = min_relaxation(lifted)
    if relaxation <= _KEPT:
        return _relaxed(block, relaxation)

    def conflicts(time: int) -> bool:
        return min_relaxation(lifted.until(time))[0] > _KEPT

    # Constraints up to T conflict: if those up to T - 1 do not, the first time is T.
    first = 1 + bisect_left(range(1, block.periods), True, key=conflicts)
    _, point = min_relaxation(lifted.until(first))
    gaps = lifted.limits - lifted.rows @ point
    tight = (gaps < _KEPT) & (lifted.labels >= 0) & (lifted.moments <= first)
    names = dict.fromkeys(
        f"{block.names[label]} at t = {moment}"
        for label, moment in zip(lifted.labels[tight], lifted.moments[tight], strict=True)
    )
    raise EmptyTubeError(first, relaxation, tuple(names)[:_MAX_NAMES])


def _relaxed(block: StateBlock, relaxation: float) -> StateBlock:
    """Return a block with larger offsets: a control keeps all of them with the margin `_KEPT`."""
    margin = relaxation + _KEPT
    if margin <= 0.0:
        return block
    return replace(block, offsets=block.offsets + margin)


@dataclass(frozen=True, eq=False)
class MinimumNorm:
    """The controls of minimum terminal norm.

    `point`, shape (p,), contains the controls, divided by their bounds; `reached` is true if the
    norm is zero to rounding. `multipliers`, shape (r,), of all rows, are the negative derivatives
    of the norm by the limits. `pressures`, shape (p,), is the derivative by each control of the
    norm plus the rows on states times their multipliers: the bounds on controls balance it.
    """

    point: Floats
    reached: bool
    multipliers: Floats
    pressures: Floats


def min_norm(lifted: Lifted, weights: Floats) -> MinimumNorm:
    """Minimise |weights x(T)| over all controls of a block, a set without equations.

    The `weights`, shape (n,), are positive.

    Raise `NoSolutionError` if the norm found exceeds its lower bound by more than 1e-8, relative,
    and by more than 1e-12 of the effect of the controls, or if the controls violate a constraint by
    more than 1e-9.

    The cone program minimises t with |weights x(T)| <= t, not the square of the norm, whose
    multipliers vanish with it. A solver finds t to its tolerance times the size of the states; the
    program is therefore solved again about its own solution, in units of the norm found, until both
    bounds meet (iterative refinement).

    The lower bound comes from weak duality. For any direction d with |d| <= 1 and any multipliers l
    >= 0 of the constraints on states, |y| >= d . y, and d . y is at least d . free - l . limits -
    the norm of R' d + rows' l that is dual to the bound on the controls. It is a bound whether or
    not d and l are optimal. Before, d and l are moved to where R' d + rows' l vanishes for each
    control that is not at its bound, so that the error of the bound is of the order of the square
    of their errors.
    """
    search = _OptimumSearch(lifted, weights)
    search.solve()
    return search.result()


class _OptimumSearch:
    """Search for a point of minimum norm, with the best point and the best lower bound so far.

    `_free` + `_response` v is the weighted terminal state, and `_reach` a bound of its norm.
    `_soft` marks all rows but the bounds on controls, and `_lengths` are the changes of the rows by
    controls of size one.
    """

    def __init__(self, lifted: Lifted, weights: Floats) -> None:
        self._lifted = lifted
        self._free = weights * lifted.free[-1]
        self._response = weights[:, None] * lifted.response[-1]
        self._soft = lifted.moments >= 0
        self._lengths = np.abs(lifted.rows).sum(axis=1)
        self._reach = float(np.linalg.norm(np.abs(self._free) + np.abs(self._response).sum(axis=1)))

        self._point = np.zeros(lifted.size)
        self.value = self._merit = np.inf
        self.violation = 0.0
        self._bound = -np.inf
        self._error = 0.0
        self._direction = np.zeros(len(self._free))
        self._multipliers = np.zeros(len(lifted.rows))

    # `_point`, `value`, `violation` and `_merit` are written by `_offer_point` only, `_bound`,
    # `_error`, `_direction` and `_multipliers` by `_offer_bound` only.

    @property
    def above_zero(self) -> bool:
        """Whether the lower bound proves that zero is not reached."""
        return self._bound > self._error

    @property
    def at_zero(self) -> bool:
        """Whether the norm at the point is zero to rounding."""
        return self.value <= _ZERO * self._reach and not self.above_zero

    @property
    def _gap(self) -> float:
        """The gap between the norm and its lower bound, beyond rounding."""
        if self.at_zero:
            return 0.0
        return abs(self.value - max(self._bound, 0.0)) - self._error

    def solve(self) -> None:
        """Solve the cone program, and again about its own solution until the gap is small."""
        if not self._lifted.size:
            self.value = float(np.linalg.norm(self._free))
            self._offer_bound(self._free, self._multipliers)
            return
        scale = 1.0
        for settings in _ROUNDS:
            self._improve(scale, settings)
            if self._gap <= _CLOSE * self.value:
                return
            scale = min(scale, self.value)

    def result(self) -> MinimumNorm:
        """Return the solution; raise `NoSolutionError` if it is not accurate enough."""
        allowed = max(MAX_GAP * self.value, _ABSOLUTE * self._reach)
        if not (self._gap <= allowed and self.violation <= MAX_VIOLATION):
            raise NoSolutionError(
                f"the minimum terminal norm, {self.value:.2g}, was not solved to {MAX_GAP:g}: gap "
                f"{self._gap:.2g}, constraints violated by {self.violation:.2g}"
            )
        # If zero is inside the set of terminal states, no constraint is active.
        if self.at_zero and self._bound < -_ZERO * self._reach:
            return MinimumNorm(
                self._point, True, np.zeros(len(self._multipliers)), np.zeros(self._lifted.size)
            )

        residual = self._residual(self._direction, self._multipliers)
        multipliers = self._multipliers.copy()
        # The bounds of a box balance the residual.
        if not self._lifted.ball and self._lifted.size:
            hard = np.flatnonzero(~self._soft)
            multipliers[hard] = np.maximum(-self._lifted.rows[hard] @ residual, 0.0)
        return MinimumNorm(self._point, self.at_zero, multipliers, residual)

    def _improve(self, scale: float, settings: SolverSettings) -> None:
        """Solve the cone program about the point, in units of `scale`, and offer its solution."""
        program, kept = self._program(self._point, scale)
        inner, dual = program.answer(settings)
        if not (np.isfinite(inner).all() and np.isfinite(dual).all()):
            return

        parts = list(program.parts(dual))
        multipliers = np.zeros(len(self._multipliers))
        # The rows are the first constraint of the program, if there are any. Multipliers of the
        # limit `_REACH` are left out: any multipliers give a lower bound.
        multipliers[kept] = parts[0][1] if len(kept) else ()
        # The first cone is that of the norm: its slack is the state, behind a height.
        direction = -next(part for kind, part in parts if kind == "cone")[1:]
        point = self._point + scale * inner[:-1]
        self._offer_point(point)
        self._offer_bound(direction, multipliers)

        # A constraint is active if its multiplier is above its slack, in units of the program.
        active = np.flatnonzero(
            self._soft & (multipliers > (self._lifted.limits - self._lifted.rows @ point) / scale)
        )
        held = (
            self._norms(self._residual(direction, multipliers * self._soft))
            > (1.0 - self._norms(point)) / scale
        )
        self._offer_bound(*self._sharpened(direction, multipliers, active, held))

        # This is the solution to rounding if the active constraints are the right ones.
        polished = self._polished(point, active, held)
        self._offer_point(polished)
        state = self._free + self._response @ polished
        norm = float(np.linalg.norm(state))
        if norm > 0.0:
            self._offer_bound(*self._sharpened(state / norm, multipliers, active, held))

    def _program(self, start: Floats, scale: float) -> tuple[ConeProgram, Places]:
        """The cone program in v = start + scale z, and the rows in it: those that z can reach."""
        lifted = self._lifted
        size = lifted.size
        slack = (lifted.limits - lifted.rows @ start) / scale
        kept = np.flatnonzero(slack < _REACH * self._lengths)

        cost = np.zeros(size + 1)
        cost[-1] = 1.0
        program = ConeProgram(cost).keep(lifted.rows[kept], slack[kept])
        # In units of one the bounds of the controls are enough.
        if scale < 1.0:
            unit = np.eye(size)
            program.keep(np.vstack([unit, -unit]), np.full(2 * size, _REACH))
        program.bound(self._response, (self._free + self._response @ start) / scale, cost)
        if lifted.ball:
            self._bound_thrust(program, start, scale)
        return program, kept

    def _bound_thrust(self, program: ConeProgram, start: Floats, scale: float) -> None:
        """Add |start + scale z| <= 1 as |z|^2 <= 2 w with an affine w, accurate for any scale."""
        group = self._lifted.ball
        for first in range(0, self._lifted.size, group):
            mine = slice(first, first + group)
            room = 0.5 * (1.0 - float(start[mine] @ start[mine])) / scale
            # The constraint is start . z + scale |z|^2 / 2 <= room; with |z_i| <= _REACH its left
            # side is less than this.
            is_out_of_reach = room > group * _REACH + scale * group * _REACH**2
            if is_out_of_reach:
                continue

            # With w = (room - start . z) / size and b = (scale / size)^(1/2) z it is |b|^2 <= 2 w,
            # the cone |(b, (w - 1) / sqrt(2))| <= (w + 1) / sqrt(2).
            size = max(1.0, room)
            top = np.zeros(self._lifted.size + 1)
            top[mine] = -start[mine] / size
            block = np.zeros((group + 1, self._lifted.size + 1))
            block[:group, mine] = np.sqrt(scale / size) * np.eye(group)
            block[group] = np.sqrt(0.5) * top
            free = np.zeros(group + 1)
            free[group] = np.sqrt(0.5) * (room / size - 1.0)
            height = float(np.sqrt(0.5) * (room / size + 1.0))
            program.bound(block, free, np.sqrt(0.5) * top, height)

    def _residual(self, direction: Floats, multipliers: Floats) -> Floats:
        """R' d + rows' l."""
        return np.asarray(self._response.T @ direction + self._lifted.rows.T @ multipliers)

    def _offer_bound(self, direction: Floats, multipliers: Floats) -> None:
        """Use the lower bound of a direction and multipliers if it is the largest so far."""
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            return

        direction = direction / length
        multipliers = np.where(self._soft, np.maximum(multipliers, 0.0), 0.0) / length
        pressed = self._norms(self._residual(direction, multipliers))
        value = float(direction @ self._free - multipliers @ self._lifted.limits)
        bound = value - float(pressed.sum())
        if bound > self._bound:
            self._bound = bound
            self._error = self._rounding_of_bound(direction, multipliers)
            self._direction = direction
            self._multipliers = multipliers

    def _rounding_of_bound(self, direction: Floats, multipliers: Floats) -> float:
        """The rounding of a lower bound, from the absolute values of its terms."""
        turned = np.abs(direction)
        held = np.abs(self._lifted.rows).T @ multipliers
        parts = turned @ np.abs(self._free) + multipliers @ np.abs(self._lifted.limits)
        pressed = (np.abs(self._response).T @ turned + held).sum()
        return _ROUNDINGS * _ULP * float(parts + pressed + self._reach)

    def _offer_point(self, point: Floats) -> None:
        """Use a point if its norm, plus the gain by its violation, is the smallest so far."""
        outside = float((self._lifted.rows @ point - self._lifted.limits).max(initial=0.0))
        if self._lifted.ball:
            outside = max(outside, float(self._norms(point).max()) - 1.0)

        value = float(np.linalg.norm(self._free + self._response @ point))
        # A violation counts as this part of the largest possible norm.
        merit = value + outside * self._reach
        if merit < self._merit:
            self._point = point
            self.value = value
            self.violation = outside
            self._merit = merit

    def _sharpened(
        self, direction: Floats, multipliers: Floats, active: Places, held: Flags
    ) -> tuple[Floats, Floats]:
        """Move a direction and multipliers to where controls not at their bounds are stationary.

        `active` are the indices of active rows on states; `held` marks the groups of controls at
        their bounds: the thrusts of the periods in a ball, the components in a box.
        """
        moving = np.repeat(~held, self._lifted.ball or 1)
        system = np.hstack(
            [self._response[:, moving].T, self._lifted.rows[np.ix_(active, moving)].T]
        )
        both = np.concatenate([direction, multipliers[active]])
        both = both - np.linalg.lstsq(system, system @ both, rcond=_RANK)[0]
        sharp = np.zeros(len(multipliers))
        sharp[active] = both[len(direction) :]
        return both[: len(direction)], sharp

    def _polished(self, point: Floats, active: Places, held: Flags) -> Floats:
        """Return the controls of minimum norm on the active rows, with held controls at bounds.

        `active` and `held` are as in `_sharpened`.
        """
        lifted = self._lifted
        moving = np.repeat(~held, lifted.ball or 1)
        polished = point.copy()
        if not lifted.ball:
            # Held components of a box are at 1 or -1.
            polished[~moving] = np.sign(point[~moving])

        rows = lifted.rows[np.ix_(active, moving)]
        missing = lifted.limits[active] - lifted.rows[active] @ polished
        polished[moving] += np.linalg.lstsq(rows, missing, rcond=_RANK)[0]

        along = null_space_basis(rows)
        state = self._free + self._response @ polished
        polished[moving] -= (
            along @ np.linalg.lstsq(self._response[:, moving] @ along, state, rcond=_RANK)[0]
        )
        return polished

    def _norms(self, controls: Floats) -> Floats:
        """Norms of the groups of controls that have a common bound."""
        return np.asarray(np.linalg.norm(controls.reshape(-1, self._lifted.ball or 1), axis=1))
