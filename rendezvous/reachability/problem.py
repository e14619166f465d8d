"""Terminal control of a linear system in discrete time, and the independent blocks of a problem."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from infoset.rendezvous._arrays import Floats, Places
from infoset.rendezvous.reachability.conic import ConeProgram

MAX_PERIODS = 256
"""Maximum number of periods in a file. Chosen: with three controls the dense constraints of a
problem then take about 30 MB."""
_MAX_GROWTH = 1e10
"""Maximum growth of a deviation, relative to the bounds: its rounding, 1e-16 of it, is then 1e-6 of
the bounds."""
_MIN_ROOM = 1e-6
"""Half the size of a cube, relative to the bounds, that a set of controls must contain: far above
the 1e-9 by which programs may violate constraints."""
_START_ROUNDING = 1e-12
"""Rounding of a constraint at the initial state, relative to the size of its terms: a start on its
boundary, as with an apex at the origin, is admissible."""


class ThrustShape(Enum):
    """Meaning of the bounds on a control: for each component (box) or its Euclidean norm (ball)."""

    BOX = "box"
    BALL = "ball"


class InadmissibleStartError(ValueError):
    """The initial state violates constraints; `broken` contains their names and violations."""

    def __init__(self, broken: tuple[tuple[str, float], ...]) -> None:
        listed = ", ".join(f"{name} by {excess:.6g}" for name, excess in broken)
        super().__init__(f"the initial state is outside its constraints: {listed}")
        self.broken = broken


@dataclass(frozen=True, eq=False)
class ReachabilityProblem:
    """Minimise |x(T)| for x(t + 1) = A(t) x(t) + B(t) u(t) from x(0), and find all minimisers.

    Parameters
    ----------
    transition : ndarray, shape (T, n, n)
        A(t), of states in their own units; it may be singular.
    control : ndarray, shape (T, n, m)
        B(t).
    initial : ndarray, shape (n,)
        The state at t = 0.
    state_bounds : ndarray, shape (n,)
        |x_i(t)| <= state_bounds_i for t = 0..T, all positive. They are also the sizes to which
        deviations of states are relative.
    control_bounds : ndarray, shape (m,)
        |u_j| <= control_bounds_j for a box; for a ball they bound the Euclidean norm and must be
        equal.
    thrust : ThrustShape
        Meaning of `control_bounds`.
    normals : ndarray, shape (k, n)
        Further constraints on states: normals x(t) <= offsets(t); no normal is zero.
    offsets : ndarray, shape (T + 1, k)
        Offsets in the units of normals x; infinite at times without the constraint.
    constraint_names : tuple of str
        Names of these k constraints in messages.
    between : ndarray, shape (T, s, n, n + m) or None
        States within the periods, x = between[t, i] (x(t), u(t)), at which the constraints also
        apply.
    state_names : tuple of str
        Names of the states in messages.
    jump : ndarray, shape (n, m) or None
        Immediate effect of a control, for impulses at the start of a period: the constraints of
        time t also apply to x(t) + jump u(t), and B(t) = A(t) jump.
    control_normals : ndarray, shape (k, m)
        Further constraints on controls: control_normals u(t) <= control_offsets(t); no normal is
        zero.
    control_offsets : ndarray, shape (T, k)
        Offsets in the units of control_normals u; infinite at times without the constraint.

    Raises
    ------
    ValueError
        If bounds on thrust in a ball differ, the constraints on a control leave no room, or
        A(T-1)...A(0) multiplies deviations by over 1e10, relative to the bounds.
    InadmissibleStartError
        If x(0) breaks a constraint.
    """

    transition: Floats
    control: Floats
    initial: Floats
    state_bounds: Floats
    control_bounds: Floats
    thrust: ThrustShape = ThrustShape.BOX
    normals: Floats | None = None
    offsets: Floats | None = None
    constraint_names: tuple[str, ...] = ()
    between: Floats | None = None
    state_names: tuple[str, ...] = ()
    jump: Floats | None = None
    control_normals: Floats | None = None
    control_offsets: Floats | None = None

    def __post_init__(self) -> None:
        if self.thrust is ThrustShape.BALL and np.ptp(self.control_bounds) > 0.0:
            raise ValueError("for thrust in a ball the bounds on controls must be equal")
        self._check_controls()
        self._check_growth()
        self._check_start()

    def _check_controls(self) -> None:
        """Raise `ValueError` if a set of controls contains no cube of a small size."""
        normals, offsets = self.limits
        rows = normals * self.control_bounds
        # For controls divided by their bounds; a program finds the centre of the cube.
        half_cube = _MIN_ROOM * np.abs(rows).sum(axis=1)
        different, times = np.unique(offsets, axis=0, return_index=True)
        for ends, time in zip(different, times, strict=True):
            held = np.isfinite(ends)
            if not held.any():
                continue
            found = linprog(
                np.zeros(self.controls),
                A_ub=rows[held],
                b_ub=(ends - half_cube)[held],
                bounds=(_MIN_ROOM - 1.0, 1.0 - _MIN_ROOM),
                method="highs",
            )
            if found.status != 0 or not self._has_room_in_ball(
                rows[held], (ends - half_cube)[held]
            ):
                raise ValueError(f"the limits on the controls leave no room at t = {time}")

    def _has_room_in_ball(self, rows: Floats, limits: Floats) -> bool:
        """Whether some control with rows u <= limits is inside the ball; true for thrust in a box.

        Controls are divided by their bounds, and some satisfy the limits.
        """
        if self.thrust is ThrustShape.BOX:
            return True
        # The least norm of a centre; a corner of its cube is farther by half the diagonal.
        top = np.append(np.zeros(self.controls), 1.0)
        program = ConeProgram(top).keep(rows, limits)
        program.bound(np.eye(self.controls), np.zeros(self.controls), top)
        least = program.solve().point[-1]
        return bool(least + _MIN_ROOM * np.sqrt(self.controls) <= 1.0)

    def _check_growth(self) -> None:
        # Deviations as large as the bounds of the states.
        moved = np.diag(self.state_bounds)
        with np.errstate(over="ignore", invalid="ignore"):
            for matrix in self.transition:
                moved = matrix @ moved
            growth = float(np.abs(moved / self.state_bounds[:, None]).max())

        if not growth <= _MAX_GROWTH:
            raise ValueError(
                f"the linear model multiplies deviations by over {_MAX_GROWTH:g}, so rounding "
                "decides the result; use fewer or shorter periods, or a time-varying model in "
                "place of a frozen one"
            )

    def _check_start(self) -> None:
        # A bound is compared with the state itself, in which nothing was rounded.
        over = np.abs(self.initial) - self.state_bounds
        broken = [(self.state_name(i), float(over[i])) for i in np.flatnonzero(over > 0.0).tolist()]

        normals, offsets = self.further
        excess = normals @ self.initial - offsets[0]
        slack = _START_ROUNDING * np.abs(normals) @ self.state_bounds
        broken += [
            (self.name_of(k), float(excess[k])) for k in np.flatnonzero(excess > slack).tolist()
        ]

        if broken:
            raise InadmissibleStartError(tuple(broken))

    def name_of(self, constraint: int) -> str:
        """Return the name of a `constraint` beyond the bounds, by its index."""
        if not self.constraint_names:
            return f"constraint {constraint + 1}"
        return self.constraint_names[constraint]

    def state_name(self, state: int) -> str:
        """Return the name of a `state`, by its index."""
        return self.state_names[state] if self.state_names else f"state {state + 1}"

    @property
    def further(self) -> tuple[Floats, Floats]:
        """`normals` and `offsets`; arrays of k = 0 rows if they are None."""
        if self.normals is None or self.offsets is None:
            return np.zeros((0, self.states)), np.zeros((self.periods + 1, 0))
        return self.normals, self.offsets

    @property
    def limits(self) -> tuple[Floats, Floats]:
        """`control_normals` and `control_offsets`; arrays of k = 0 rows if they are None."""
        if self.control_normals is None or self.control_offsets is None:
            return np.zeros((0, self.controls)), np.zeros((self.periods, 0))
        return self.control_normals, self.control_offsets

    @cached_property
    def blocks(self) -> tuple[StateBlock, ...]:
        """The smallest independent parts of the problem, in the order of their first states.

        Together they contain all states, and all controls that affect a state.
        """
        # A graph of states and controls with an edge from i to j if a change of j affects i.
        n = self.states
        m = self.controls
        linked = np.zeros((n + m, n + m), dtype=bool)
        linked[:n, :n] = (self.transition != 0.0).any(axis=0)
        linked[:n, n:] = (self.control != 0.0).any(axis=0)
        if self.between is not None:
            linked[:n] |= (self.between != 0.0).any(axis=(0, 1))
        if self.jump is not None:
            linked[:n, n:] |= self.jump != 0.0
        for normal in self.further[0]:
            acting = np.flatnonzero(normal)
            linked[acting[0], acting] = True
        for normal in self.limits[0]:
            acting = n + np.flatnonzero(normal)
            linked[acting[0], acting] = True
        if self.thrust is ThrustShape.BALL:
            # A common bound couples all controls.
            linked[n, n:] = True

        labels = connected_components(csr_array(linked), directed=False)[1]
        order = list(dict.fromkeys(labels[:n].tolist()))
        return tuple(_block(self, np.flatnonzero(labels == label)) for label in order)

    @property
    def periods(self) -> int:
        """Number of periods T."""
        return int(self.transition.shape[0])

    @property
    def states(self) -> int:
        """Number of states n."""
        return int(self.transition.shape[1])

    @property
    def controls(self) -> int:
        """Number of controls m."""
        return int(self.control.shape[2])

    def run(self, controls: ArrayLike) -> Floats:
        """Return the states, shape (..., T + 1, n), under `controls`, shape (..., T, m)."""
        thrust = np.asarray(controls, dtype=float)
        states = [np.broadcast_to(self.initial, (*thrust.shape[:-2], self.states))]
        for t in range(self.periods):
            states.append(states[-1] @ self.transition[t].T + thrust[..., t, :] @ self.control[t].T)
        return np.stack(states, axis=-2)

    def excess(self, controls: ArrayLike) -> Floats:
        """Return the maximum violation of a constraint by `controls`, shape (..., T, m).

        It is relative to the bounds, and at most 0 if all constraints are satisfied.
        """
        thrust = np.asarray(controls, dtype=float)
        if self.thrust is ThrustShape.BALL:
            worst = np.linalg.norm(thrust, axis=-1).max(axis=-1) / self.control_bounds[0] - 1.0
        else:
            worst = (np.abs(thrust) / self.control_bounds).max(axis=(-1, -2)) - 1.0
        normals, offsets = self.limits
        beyond = (thrust @ normals.T - offsets) / (np.abs(normals) @ self.control_bounds)
        worst = np.maximum(worst, beyond.max(axis=(-1, -2), initial=-np.inf))

        states = self.run(thrust)
        worst = np.maximum(worst, self._state_excess(states, np.arange(self.periods + 1)))

        if self.jump is not None:
            after = states[..., :-1, :] + thrust @ self.jump.T
            worst = np.maximum(worst, self._state_excess(after, np.arange(self.periods)))

        if self.between is not None:
            both = np.concatenate([states[..., :-1, :], thrust], axis=-1)
            inner = np.einsum("tsij,...tj->...tsi", self.between, both)
            for instant in range(self.between.shape[1]):
                worst = np.maximum(
                    worst, self._state_excess(inner[..., instant, :], np.arange(self.periods))
                )
        return np.asarray(worst)

    def _state_excess(self, states: Floats, times: Places) -> Floats:
        """Return the maximum violation of a constraint by `states`, relative to the bounds.

        `states` have the shape (..., k, n), and the result (...); it is at most 0 if all hold.
        State i obeys the constraints of time times[i], shape (k,); states between the times t and
        t + 1 belong to time t.
        """
        worst = (np.abs(states) / self.state_bounds).max(axis=(-1, -2)) - 1.0
        normals, offsets = self.further
        beyond = (states @ normals.T - offsets[times]) / (np.abs(normals) @ self.state_bounds)
        return np.asarray(np.maximum(worst, beyond.max(axis=(-1, -2), initial=-np.inf)))

    def first(self, periods: int) -> ReachabilityProblem:
        """Return the problem that ends after the first `periods`, from 1 to T."""
        return self._part(0, periods, self.initial)

    def rest(self, start: int, state: ArrayLike) -> ReachabilityProblem:
        """Return the problem that begins at time `start`, from 0 to T - 1, in a `state`, (n,).

        `InadmissibleStartError` is raised if the state violates a constraint.
        """
        return self._part(start, self.periods, np.asarray(state, dtype=float))

    def _part(self, start: int, end: int, state: Floats) -> ReachabilityProblem:
        """Return the problem from time `start` to time `end`, with a state at `start`."""
        return replace(
            self,
            transition=self.transition[start:end],
            control=self.control[start:end],
            initial=state,
            offsets=None if self.offsets is None else self.offsets[start : end + 1],
            between=None if self.between is None else self.between[start:end],
            control_offsets=self.limits[1][start:end],
        )


@dataclass(frozen=True, eq=False)
class StateBlock:
    """An independent part of a problem, with states and controls divided by their bounds.

    `states` and `controls` are indices in the problem, and `scale`, shape (n,), the bounds on the
    states in their own units. The constraints on states, with the bounds first, are `normals` x(t)
    <= `offsets`(t), with normals of unit length, and have `names`, of shapes (k, n), (T + 1, k) and
    (k,). If `ball`, |u(t)| <= 1 in the Euclidean norm; otherwise for each component. `jump`,
    shape (n, m), is as in `ReachabilityProblem`. `control_normals` u(t) <= `control_offsets`(t),
    with normals of unit length, of shapes (l, m) and (T, l), are the constraints on controls beyond
    their bounds.
    """

    states: Places
    controls: Places
    scale: Floats
    transition: Floats
    control: Floats
    initial: Floats
    normals: Floats
    offsets: Floats
    names: tuple[str, ...]
    ball: bool
    between: Floats | None
    jump: Floats | None
    control_normals: Floats
    control_offsets: Floats

    @property
    def periods(self) -> int:
        """Number of periods T."""
        return len(self.transition)

    @property
    def size(self) -> int:
        """Number of states n."""
        return len(self.states)

    def first(self, periods: int) -> StateBlock:
        """Return the block that ends after the first `periods`."""
        return replace(
            self,
            transition=self.transition[:periods],
            control=self.control[:periods],
            offsets=self.offsets[: periods + 1],
            between=None if self.between is None else self.between[:periods],
            control_offsets=self.control_offsets[:periods],
        )

    def rest(self, start: int) -> StateBlock:
        """Return the block that begins at time `start`, from 0 to T - 1; `initial` is unchanged."""
        return replace(
            self,
            transition=self.transition[start:],
            control=self.control[start:],
            offsets=self.offsets[start:],
            between=None if self.between is None else self.between[start:],
            control_offsets=self.control_offsets[start:],
        )


def _block(problem: ReachabilityProblem, members: Places) -> StateBlock:
    """Return the block of some members: indices of states, and of controls after all states."""
    n = problem.states
    states = members[members < n]
    controls = members[members >= n] - n
    scale = problem.state_bounds[states]
    reach = problem.control_bounds[controls]

    square = np.ix_(states, states)
    oblong = np.ix_(states, controls)
    transition = np.array([matrix[square] for matrix in problem.transition])
    transition = transition / scale[:, None] * scale
    control = np.array([matrix[oblong] for matrix in problem.control])
    control = control / scale[:, None] * reach
    between = None
    if problem.between is not None:
        inner = problem.between[:, :, states][:, :, :, members]
        between = inner / scale[:, None] * np.concatenate([scale, reach])
    jump = None
    if problem.jump is not None:
        jump = problem.jump[oblong] / scale[:, None] * reach

    unit = np.eye(len(states))
    bounds = np.ones((problem.periods + 1, 2 * len(states)))
    normals, offsets = problem.further
    mine = np.flatnonzero(np.abs(normals[:, states]).max(axis=1, initial=0.0) > 0.0)
    rows = normals[np.ix_(mine, states)] * scale
    lengths = np.linalg.norm(rows, axis=1)
    names = [f"the bound on {problem.state_name(i)}" for i in states.tolist()] * 2
    names += [problem.name_of(k) for k in mine.tolist()]

    of_controls, limits = problem.limits
    acting = np.abs(of_controls[:, controls]).max(axis=1, initial=0.0) > 0.0
    control_rows = of_controls[np.ix_(acting, controls)] * reach
    control_lengths = np.linalg.norm(control_rows, axis=1)

    return StateBlock(
        states,
        controls,
        scale,
        transition,
        control,
        problem.initial[states] / scale,
        np.vstack([unit, -unit, rows / lengths[:, None]]),
        np.hstack([bounds, offsets[:, mine] / lengths]),
        tuple(names),
        problem.thrust is ThrustShape.BALL,
        between,
        jump,
        control_rows / control_lengths[:, None],
        limits[:, acting] / control_lengths,
    )
