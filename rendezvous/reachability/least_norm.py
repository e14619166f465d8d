"""The least norm of the terminal state, between a norm that is reached and a lower bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lstsq

from rendezvous.reachability.conic import ConeProgram, NoSolutionError
from rendezvous.reachability.lifted import Lifted

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Places = NDArray[np.int64]

_APART = 1e-8
"""How far the norm may be above its lower bound, relatively."""
_CLOSE = 1e-13
"""How near they are brought where rounding allows it."""
_ZERO = 1e-11
"""Norms below this part of what the controls can do count as zero, unless their lower bound is above rounding."""
_BROKEN = 1e-11
_ULP = float(np.finfo(float).eps)
_RANK = 1e-13
_ROUNDS = 6
_REACH = 1e4
_NEWTON_STEPS, _IDLE = 16, 5


@dataclass(frozen=True, eq=False)
class LeastNorm:
    """The controls of least terminal norm.

    Parameters
    ----------
    point : ndarray, shape (p,)
    value : float
        The norm; exactly zero where it is below rounding.
    bound : float
        No admissible controls have a norm below this.
    multipliers : ndarray, shape (r,)
        Of the rows, those of a box included; what the norm loses where a limit is relaxed.
    pressures : ndarray, shape (p,)
        What the norm loses where a control of a period is moved, on top of that: the bounds on controls hold it.
    """

    point: Floats
    value: float
    bound: float
    multipliers: Floats
    pressures: Floats

    @property
    def reached(self) -> bool:
        """Whether zero is reached."""
        return self.value == 0.0


def least_norm(lifted: Lifted, weights: Floats) -> LeastNorm:
    """Minimise |weights x(T)| over admissible controls.

    Parameters
    ----------
    lifted : Lifted
        All controls of a block, without equations.
    weights : ndarray, shape (n,)
        Positive.

    Returns
    -------
    LeastNorm

    Raises
    ------
    NoSolutionError
        If the norm found is not within 1e-8 of its lower bound, or its controls break a constraint.

    Notes
    -----
    The cone program: minimise t with |weights x(T)| <= t, not the square of the norm, whose multipliers vanish with
    it. A solver knows t to its tolerance times the size of the states; the program is therefore solved again about its
    own solution, in units of the norm found, until both bounds meet (iterative refinement).

    The lower bound is that of weak duality. For any direction d with |d| <= 1 and any multipliers l >= 0 of the
    constraints on states, |y| >= d . y, and d . y is not below d . free - l . limits - the norm of
    R' d + rows' l that is dual to the bound on the controls: a bound whether or not d and l are optimal. They are
    first moved to where R' d + rows' l vanishes for each control that is not at its bound, so that the bound is in
    error by the square of theirs only.
    """
    search = _Search(lifted, weights)
    search.solve()
    return search.result()


def reaches_zero(lifted: Lifted) -> bool:
    """Return whether admissible controls reach zero.

    Parameters
    ----------
    lifted : Lifted
        All controls of a block, without equations.

    Returns
    -------
    bool

    Raises
    ------
    NoSolutionError
        If neither a control that does was found nor a lower bound above zero.
    """
    search = _Search(lifted, np.ones(lifted.free.shape[1]))
    search.solve()
    return not search.above_zero and search.result().reached


class _Search:
    """The best point and the best lower bound so far."""

    def __init__(self, lifted: Lifted, weights: Floats) -> None:
        self._lifted = lifted
        self._free = weights * lifted.free[-1]
        self._response = weights[:, None] * lifted.response[-1]
        self._soft = lifted.moments >= 0
        self._size = lifted.size
        self._group = lifted.ball or 1
        self._point = np.zeros(self._size)
        self.value = float(np.linalg.norm(self._free))
        self._merit = np.inf
        self._bound, self._error = -np.inf, 0.0
        self._direction = np.zeros(len(self._free))
        self._multipliers = np.zeros(len(lifted.rows))
        reach = np.abs(self._free) + np.abs(self._response).sum(axis=1)
        self._lengths = np.abs(lifted.rows).sum(axis=1)
        self._reach = float(np.linalg.norm(reach))

    @property
    def at_zero(self) -> bool:
        """Whether the point cannot be told from one that reaches zero."""
        return self._outside(self._point) <= _BROKEN and self.value <= (
            _ZERO * self._reach if not self.above_zero else 32.0 * _ULP * self._reach
        )

    @property
    def _good(self) -> bool:
        return self.at_zero or self._merit <= _APART * self.value + self._error

    @property
    def above_zero(self) -> bool:
        """Whether the lower bound proves that zero is not reached."""
        return self._bound > self._error

    def solve(self) -> None:
        """Solve the cone program, once more about its solution where that is not good enough, and improve on it."""
        if not self._size:
            self._offer_point(self._point)
            self._offer_bound(self._free / max(self.value, 1e-300), self._multipliers)
            return
        scale = 1.0
        for _ in range(_ROUNDS):
            start, before = self._point, self._merit
            program, kept = self._program(start, scale)
            for inner, dual in program.attempts():
                multipliers = np.zeros(len(self._multipliers))
                multipliers[kept] = program.of_rows(dual)[: len(kept)]
                multipliers[~self._soft] = 0.0
                guess = start + scale * inner[:-1], -program.of_cones(dual)[0][1:], multipliers
                self._offer_point(guess[0])
                self._offer_bound(guess[1], guess[2])
                self._improve(*guess)
                if self._good:
                    return
                if self._merit < 0.5 * before:
                    break
            scale = min(scale, self.value)

    def result(self) -> LeastNorm:
        """Return what was found, if it is good enough."""
        if not self._good:
            raise NoSolutionError(
                f"the least terminal norm was not found: it is said to lie between {self._bound:.6g} and "
                f"{self.value:.6g} of the largest bound on a state"
            )
        value = 0.0 if self.at_zero else self.value
        residual = self._residual(self._direction, self._multipliers)
        if self.at_zero and self._bound < -_ZERO * self._reach:
            # Zero is not on the border of what is reached: nothing holds it.
            return LeastNorm(self._point, value, 0.0, np.zeros(len(self._multipliers)), np.zeros(self._size))
        multipliers = self._multipliers.copy()
        if not self._lifted.ball and self._size:
            # The rows of a box: what holds a control at its bound.
            hard = np.flatnonzero(~self._soft)
            multipliers[hard] = np.maximum(-self._lifted.rows[hard] @ residual, 0.0)
        return LeastNorm(self._point, value, min(self._bound, value), multipliers, residual)

    def _program(self, start: Floats, scale: float) -> tuple[ConeProgram, NDArray[np.int64]]:
        """The cone program in v = start + scale z, without the constraints that are out of z's reach."""
        lifted, size = self._lifted, self._size
        slack = (lifted.limits - lifted.rows @ start) / scale
        reach = _REACH if scale < 1.0 else np.inf
        kept = np.flatnonzero(slack < reach) if scale == 1.0 else np.flatnonzero(slack < reach * self._lengths)
        ends = slack[kept] if scale == 1.0 else np.maximum(slack[kept], 0.0)
        cost = np.zeros(size + 1)
        cost[-1] = 1.0
        program = ConeProgram(cost).keep(np.hstack([lifted.rows[kept], np.zeros((len(kept), 1))]), ends)
        if scale < 1.0:
            unit = np.eye(size, size + 1)
            program.keep(np.vstack([unit, -unit]), np.full(2 * size, _REACH))
        wide = np.hstack([self._response, np.zeros((len(self._free), 1))])
        program.bound(wide, (self._free + self._response @ start) / scale, cost)
        if lifted.ball:
            self._bound_thrust(program, start, scale, reach)
        return program, kept

    def _bound_thrust(self, program: ConeProgram, start: Floats, scale: float, reach: float) -> None:
        """|start + scale z| <= 1 as |z|^2 <= 2 w with an affine w, which keeps its digits for any scale."""
        group = self._lifted.ball
        for first in range(0, self._size, group):
            mine = slice(first, first + group)
            room = 0.5 * (1.0 - float(start[mine] @ start[mine])) / scale
            if room > group * reach + scale * group * reach**2:
                continue
            size = max(1.0, room)
            top = np.zeros(self._size + 1)
            top[mine] = -start[mine] / size
            block = np.zeros((group + 1, self._size + 1))
            block[:group, mine] = np.sqrt(scale / size) * np.eye(group)
            block[group] = np.sqrt(0.5) * top
            free = np.zeros(group + 1)
            free[group] = np.sqrt(0.5) * (room / size - 1.0)
            program.bound(block, free, np.sqrt(0.5) * top, float(np.sqrt(0.5) * (room / size + 1.0)))

    def _residual(self, direction: Floats, multipliers: Floats) -> Floats:
        """R' d + rows' l, of which the bounds on controls make the best."""
        return np.asarray(self._response.T @ direction + self._lifted.rows.T @ multipliers)

    def _offer_bound(self, direction: Floats, multipliers: Floats) -> None:
        length = float(np.linalg.norm(direction))
        if length == 0.0:
            return
        direction = direction / length
        multipliers = np.where(self._soft, np.maximum(multipliers, 0.0), 0.0) / length
        residual = self._residual(direction, multipliers)
        pressed = self._norms(residual)
        bound = float(direction @ self._free - multipliers @ self._lifted.limits) - float(pressed.sum())
        if bound > self._bound:
            turned, held = np.abs(direction), np.abs(self._lifted.rows).T @ multipliers
            parts = turned @ np.abs(self._free) + multipliers @ np.abs(self._lifted.limits)
            self._error = 8.0 * _ULP * float(parts + (np.abs(self._response).T @ turned + held).sum() + self._reach)
            self._bound, self._direction, self._multipliers = bound, direction, multipliers
            self._merit = self._merit_of(self._point)

    def _offer_point(self, point: Floats) -> None:
        merit = self._merit_of(point)
        if merit < self._merit or not np.isfinite(self._merit):
            self._point, self._merit = point, merit
            self.value = float(np.linalg.norm(self._free + self._response @ point))

    def _merit_of(self, point: Floats) -> float:
        value = float(np.linalg.norm(self._free + self._response @ point))
        outside = self._outside(point)
        # Breaking a constraint gains about as much; by more than rounding it is no solution, but a place to go on from.
        return abs(value - max(self._bound, 0.0)) + outside * self._reach + (1.0 if outside > _BROKEN else 0.0)

    def _outside(self, point: Floats) -> float:
        broken = float((self._lifted.rows @ point - self._lifted.limits - 32.0 * _ULP * self._lengths).max(initial=0.0))
        if self._lifted.ball and self._size:
            broken = max(broken, float(self._norms(point).max()) - 1.0)
        return broken

    def _improve(self, point: Floats, direction: Floats, multipliers: Floats) -> None:
        """Bring point and bound together: Newton's method on the conditions of optimality.

        A bound holds in the next step where its multiplier is above its slack (a primal-dual active set). The step,
        the direction y / |y| and the multipliers are unknown: a system that stays as good as it is where y is small.
        """
        pressed = self._norms(self._residual(direction, multipliers))
        idle = 0
        for _ in range(_NEWTON_STEPS):
            before = self._merit
            gaps = self._lifted.limits - self._lifted.rows @ point
            active = np.flatnonzero(self._soft & (multipliers > gaps))
            held = pressed > 1.0 - self._norms(point)
            self._offer_bound(*self._sharpened(direction, multipliers, active, held))
            step, turned, found, pressed = self._newton(point, active, held, pressed)
            point, multipliers = point + step, np.zeros(len(gaps))
            multipliers[active] = found
            self._offer_point(point)
            length = float(np.linalg.norm(turned))
            if not length > _RANK:
                return
            direction, multipliers, pressed = turned / length, multipliers / length, pressed / length
            self._offer_bound(direction, multipliers)
            idle = 0 if self._merit < before else idle + 1
            if self._merit <= _CLOSE * self.value or idle == _IDLE:
                return
            if idle > 1:
                point = self._slid(point, direction, multipliers, pressed, held)

    def _newton(
        self, point: Floats, active: Places, held: Flags, pressed: Floats
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Return a step, the terminal state after it in units of its norm before, and multipliers."""
        size, count, group = self._size, len(self._free), self._group
        normals = np.zeros((len(held), size))
        for which in range(len(held)):
            normals[which, which * group : (which + 1) * group] = point[which * group : (which + 1) * group]
        normals = normals[held]
        state = self._free + self._response @ point
        tied = np.vstack([self._response, self._lifted.rows[active], normals])
        system = np.zeros((size + len(tied),) * 2)
        if self._lifted.ball:
            system[:size, :size] = np.diag(np.repeat(np.where(held, np.maximum(pressed, 0.0), 0.0), group))
        system[:size, size:], system[size:, :size] = tied.T, tied
        system[size : size + count, size : size + count] = -max(float(np.linalg.norm(state)), 1e-300) * np.eye(count)
        missing = self._lifted.limits[active] - self._lifted.rows[active] @ point
        right = np.concatenate([np.zeros(size), -state, missing, 0.5 * (1.0 - (normals**2).sum(axis=1))])
        found = lstsq(system, right, cond=_RANK, lapack_driver="gelsy")[0]
        after = np.zeros(len(held))
        after[held] = found[size + count + len(active) :]
        return found[:size], found[size : size + count], found[size + count : size + count + len(active)], after

    def _slid(self, point: Floats, direction: Floats, multipliers: Floats, pressed: Floats, held: Flags) -> Floats:
        """Move down a slope that Newton's method took for none, to the first bound, whose multiplier becomes positive.

        There the norm falls by rounding for a step of an ulp, and by more than rounding for the whole way.
        """
        slope = np.where(np.repeat(held, self._group), 0.0, self._residual(direction, multipliers))
        steep = float(np.linalg.norm(slope))
        if steep == 0.0:
            return point
        way = -slope / steep
        rate, gaps = self._lifted.rows @ way, self._lifted.limits - self._lifted.rows @ point
        ahead = np.flatnonzero(self._soft & (rate > _RANK) & (multipliers == 0.0))
        lengths = np.maximum(gaps[ahead], 0.0) / rate[ahead]
        a, b = self._norms(way) ** 2, (way * point).reshape(-1, self._group).sum(axis=1)
        free = np.flatnonzero(~held & (a > _RANK**2))
        c = np.minimum(self._norms(point)[free] ** 2 - 1.0, 0.0)
        others = (np.sqrt(b[free] ** 2 - a[free] * c) - b[free]) / a[free]
        far = min(lengths.min(initial=np.inf), others.min(initial=np.inf))
        if not np.isfinite(far):
            return point
        multipliers[ahead[lengths <= far]] = steep
        pressed[free[others <= far]] = steep
        self._offer_point(point + far * way)
        return np.asarray(point + far * way)

    def _sharpened(self, direction: Floats, multipliers: Floats, active: Places, held: Flags) -> tuple[Floats, Floats]:
        """Move multipliers to where controls that are not at their bounds are stationary."""
        moving = np.repeat(~held, self._group)
        system = np.hstack([self._response[:, moving].T, self._lifted.rows[np.ix_(active, moving)].T])
        given = np.concatenate([direction, multipliers[active]])
        given = given - np.linalg.lstsq(system, system @ given, rcond=_RANK)[0]
        sharp = np.zeros(len(multipliers))
        length = max(float(np.linalg.norm(given[: len(direction)])), 1e-300)
        sharp[active] = given[len(direction) :] / length
        return given[: len(direction)] / length, sharp

    def _norms(self, controls: Floats) -> Floats:
        return np.asarray(np.linalg.norm(controls.reshape(-1, self._group), axis=1))
