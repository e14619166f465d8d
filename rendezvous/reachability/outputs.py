"""Linear systems with bounded errors and measured outputs, and the certificate of an affine plan.

The assumptions (1), the purified outputs and the certificate of Theorem 1 of
`docs/guaranteed-rendezvous.md`. No solver is used here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from infoset.geometry.polytope import Polytope
from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous._arrays import Flags, Floats, Places


class PathRows(NamedTuple):
    """Constraints lower <= states x(t) + controls u(t) <= upper for all admissible errors.

    The shapes are (k,), (k, n), (k, m), (k,) and (k,); `times` are the instants t, and ends may be
    infinite. A row at the time T has no control.
    """

    times: Places
    states: Floats
    controls: Floats
    lower: Floats
    upper: Floats

    def chosen(self, rows: Places | Flags) -> PathRows:
        """Return some of the rows, by their numbers or by a flag for each row."""
        return PathRows(
            self.times[rows],
            self.states[rows],
            self.controls[rows],
            self.lower[rows],
            self.upper[rows],
        )


def joined(first: PathRows | None, second: PathRows) -> PathRows:
    """Return all rows of two."""
    if first is None:
        return second
    return PathRows(*(np.concatenate(pair) for pair in zip(first, second, strict=True)))


class ErrorSet(NamedTuple):
    """The set Z of all errors z: its first components are errors of the start, and |z_i| <= 1.

    If the start is a polytope, the bound 1 is replaced for its components z0: they are in the hull
    of `vertices`, shape (v, n), which is also {z0: normals z0 <= offsets}.
    """

    size: int
    vertices: Floats | None
    normals: Floats
    offsets: Floats

    @property
    def start_size(self) -> int:
        """Number of components in the polytope; 0 if Z is a box."""
        return int(self.normals.shape[1])

    @property
    def sizes(self) -> Floats:
        """The maximum of each |z_i|, shape (size,)."""
        sizes = np.ones(self.size)
        if self.vertices is not None:
            sizes[: self.start_size] = np.abs(self.vertices).max(axis=0)
        return sizes

    def maxima(self, rows: Floats) -> Floats:
        """Return max row . z over Z, shape (...), for `rows`, shape (..., size)."""
        heights = np.abs(rows[..., self.start_size :]).sum(axis=-1)
        if self.vertices is not None:
            heights = heights + (rows[..., : self.start_size] @ self.vertices.T).max(axis=-1)
        return np.asarray(heights)

    def size_of(self, points: Floats) -> float:
        """Return the least factor f >= 0 such that +-z / f is in Z for all z of `points`."""
        needed = np.abs(points[..., self.start_size :]).max(initial=0.0)
        along = np.abs(points[..., : self.start_size] @ self.normals.T)
        # Where an offset is zero, only points with normal . z0 = 0 are inside, whatever the factor.
        outside = (along > 0.0) & (self.offsets <= 0.0)
        if outside.any():
            return float(np.inf)
        shares = along[..., self.offsets > 0.0] / self.offsets[self.offsets > 0.0]
        return float(max(needed, shares.max(initial=0.0)))


class Ranges(NamedTuple):
    """Minimum `lower` and maximum `upper` of quantities over all errors, in their own units."""

    lower: Floats
    upper: Floats

    @property
    def largest(self) -> Floats:
        """The maximum absolute values, in their own units."""
        return np.maximum(np.abs(self.lower), np.abs(self.upper))


@dataclass(frozen=True, eq=False)
class OutputProblem:
    """x(t + 1) = A x + B (u + errors) + D w, y(t) = C x + V nu, with |w_i| <= 1 and |nu_i| <= 1.

    The control u(t) may depend on y(0), ..., y(t). The quantity to minimise is the maximum over all
    errors of |x(T) - target| in the norm max_i |goal_i . x|. Quantities are in any units.

    Parameters
    ----------
    transition : ndarray, shape (T, n, n)
        The matrices A(t).
    control : ndarray, shape (T, n, m)
        The matrices B(t); for impulses at the start of a period, A(t) (0, 1)'.
    output : ndarray, shape (T, q, n)
        The matrices C(t).
    noise : ndarray, shape (T, q, r)
        The matrices V(t), generators of the set of measurement errors; r = 0 for exact outputs.
    start : Zonotope or Polytope
        Set of x(0), bounded and not empty.
    goal : ndarray, shape (k, n)
        The matrix of the rows of the norm. A box has the rows e_i / (half-width i).
    target : ndarray, shape (n,), or None
        The state that x(T) should have; zero if None.
    disturbance : ndarray, shape (T, n, p), or None
        The matrices D(t), of all errors but those of the execution.
    execution_error : ndarray, shape (m,) or (T, m), or None
        Bound of the error of each control that does not depend on the control, in units of it.
    relative_error : ndarray, shape (m,), or None
        The error of a control u_j is at most execution_error_j + relative_error_j |u_j|.
    control_limits : ndarray, shape (T, m), or None
        |u_j(t)| <= control_limits[t, j], in units of the controls; they may be infinite.
    path : PathRows or None
        Further constraints.
    caps : ndarray, shape (T, m), or None
        Bounds of |u_j(t)|, in units of the controls, at which the errors proportional to a control
        are computed. They are constraints too. None leaves these errors out.
    """

    transition: Floats
    control: Floats
    output: Floats
    noise: Floats
    start: Zonotope | Polytope
    goal: Floats
    target: Floats | None = None
    disturbance: Floats | None = None
    execution_error: Floats | None = None
    relative_error: Floats | None = None
    control_limits: Floats | None = None
    path: PathRows | None = None
    caps: Floats | None = None

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

    @cached_property
    def centre(self) -> Floats:
        """A point of the start, from which predictions begin, shape (n,)."""
        if isinstance(self.start, Polytope):
            return np.asarray(self.start.vertices.mean(axis=0))
        return self.start.centre

    @cached_property
    def aim(self) -> Floats:
        """The target, a state, shape (n,)."""
        return np.zeros(self.states) if self.target is None else self.target

    @cached_property
    def limits(self) -> Floats:
        """Bounds of |u_j(t)| by the limits and the caps, in units of the controls, (T, m)."""
        bounds = np.full((self.periods, self.controls), np.inf)
        if self.control_limits is not None:
            bounds = np.minimum(bounds, self.control_limits)
        if self.caps is not None:
            bounds = np.minimum(bounds, self.caps)
        return bounds

    @cached_property
    def execution(self) -> Floats:
        """Bounds of the execution errors at the caps, in units of the controls, (T, m)."""
        bounds = np.zeros((self.periods, self.controls))
        if self.execution_error is not None:
            bounds = bounds + self.execution_error
        if self.relative_error is not None and self.caps is not None:
            bounds = bounds + self.relative_error * self.caps
        return bounds

    @cached_property
    def errors_of_period(self) -> Floats:
        """The effects of all errors in a period on the state at its end, shape (T, n, p + a).

        The a last errors are those of controls that have an error in some period.
        """
        execution = self.control * self.execution[:, None, :]
        acting = execution.any(axis=(0, 1))
        blocks = [execution[:, :, acting]]
        if self.disturbance is not None:
            blocks.insert(0, self.disturbance)
        return np.concatenate(blocks, axis=2)

    @cached_property
    def errors(self) -> ErrorSet:
        """The set of all errors: of the start, then of the periods, then of the measurements."""
        count = self.periods * (self.errors_of_period.shape[2] + self.noise.shape[2])
        if isinstance(self.start, Polytope):
            normals, offsets = self.start.constraints()
            heights = offsets - normals @ self.centre
            vertices = self.start.vertices - self.centre
            return ErrorSet(self.states + count, vertices, normals, heights)
        size = len(self.start.generators) + count
        return ErrorSet(size, None, np.zeros((0, 0)), np.zeros(0))

    @cached_property
    def start_columns(self) -> Floats:
        """The effects of all errors on x(0), shape (n, size)."""
        columns = np.zeros((self.states, self.errors.size))
        if isinstance(self.start, Polytope):
            # Errors of a start in a polytope are the state itself, from the centre.
            columns[:, : self.states] = np.eye(self.states)
        else:
            columns[:, : len(self.start.generators)] = self.start.generators.T
        return columns

    @cached_property
    def period_columns(self) -> Floats:
        """The effects of all errors in a period on the state at its end, shape (T, n, size)."""
        effects = self.errors_of_period
        count = effects.shape[2]
        first = self.errors.size - self.periods * (count + self.noise.shape[2])
        columns = np.zeros((self.periods, self.states, self.errors.size))
        for t in range(self.periods):
            columns[t, :, first + t * count : first + (t + 1) * count] = effects[t]
        return columns

    @cached_property
    def free_states(self) -> Floats:
        """E of x(t) - xhat(t) = E(t) z, shape (T + 1, n, size), whatever the controls are."""
        states = [self.start_columns]
        for t in range(self.periods):
            states.append(self.transition[t] @ states[t] + self.period_columns[t])
        return np.array(states)

    @cached_property
    def pure_outputs(self) -> Floats:
        """P of the purified outputs y(t) - C xhat(t) = P(t) z, shape (T, q, size)."""
        # There is no output at the time T.
        outputs = self.output @ self.free_states[:-1]
        count = self.noise.shape[2]
        first = self.errors.size - self.periods * count
        for t in range(self.periods):
            outputs[t, :, first + t * count : first + (t + 1) * count] += self.noise[t]
        return np.asarray(outputs)

    @cached_property
    def coasting(self) -> Floats:
        """States without control and without errors, shape (T + 1, n)."""
        states = [self.centre]
        for t in range(self.periods):
            states.append(self.transition[t] @ states[t])
        return np.array(states)

    @cached_property
    def rows(self) -> PathRows:
        """All constraints: the finite limits of the controls, then the path."""
        times, components = np.nonzero(np.isfinite(self.limits))
        ends = self.limits[times, components]
        limits = PathRows(
            times,
            np.zeros((len(times), self.states)),
            np.eye(self.controls)[components],
            -ends,
            ends,
        )
        return limits if self.path is None else joined(limits, self.path)

    @property
    def is_on_path(self) -> Flags:
        """Which of the rows are constraints of the path, and not limits of single controls."""
        count = 0 if self.path is None else len(self.path.times)
        total = len(self.rows.times)
        return np.arange(total) >= total - count

    def effects_on(self, time: int, row: Floats) -> Floats:
        """Return the effects of u(0), ..., u(time - 1) on row . x(time), shape (time, m)."""
        effects = np.zeros((time, self.controls))
        # Backward in time: row A(time - 1) ... A(t + 1) at the start of each step.
        costate = row
        for t in range(time - 1, -1, -1):
            effects[t] = costate @ self.control[t]
            costate = costate @ self.transition[t]
        return effects


@dataclass(frozen=True, eq=False)
class AffinePlan:
    """The strategy (2): u(t) = nominal(t) + sum over s <= t of gains[t, s] p(s).

    p(s) = y(s) - C xhat(s) are the purified outputs. All numbers are certificates: they follow
    from the gains by the closed-loop recursion and support functions, and are exact up to rounding,
    about 1e-13 of the largest of the terms that are added.

    Parameters
    ----------
    problem : OutputProblem
        The problem, whose errors and caps the certificates are for.
    nominal : ndarray, shape (T, m)
        Controls without errors, in units of the problem.
    gains : ndarray, shape (T, T, m, q)
        Matrices of the reactions to outputs, zero for s > t.
    """

    problem: OutputProblem
    nominal: Floats
    gains: Floats

    @cached_property
    def guarantee(self) -> float:
        """The maximum of |x(T) - target| over all errors, in units of the goal."""
        ranges = self._ranges(
            self.problem.goal @ (self.nominal_states[-1] - self.problem.aim),
            self.problem.goal @ self.state_columns[-1],
        )
        return float(ranges.largest.max())

    @cached_property
    def state_ranges(self) -> Ranges:
        """Ranges of all states, shape (T + 1, n)."""
        return self._ranges(self.nominal_states, self.state_columns)

    @cached_property
    def control_ranges(self) -> Ranges:
        """Ranges of all controls, without their errors, in units of the problem, shape (T, m)."""
        return self._ranges(self.nominal, self.control_columns)

    @cached_property
    def row_ranges(self) -> Ranges:
        """Ranges of the rows of the problem, shape (k,)."""
        return self.ranges_of(self.problem.rows)

    def ranges_of(self, rows: PathRows) -> Ranges:
        """Return the ranges of states x(t) + controls u(t) of some rows, shape (k,)."""
        middle = np.zeros(len(rows.times))
        columns = np.zeros((len(rows.times), self.problem.errors.size))
        for time in np.unique(rows.times):
            at_time = rows.times == time
            states = rows.states[at_time]
            middle[at_time] = states @ self.nominal_states[time]
            columns[at_time] = states @ self.state_columns[time]
            # A row at the time T has no control.
            if time < self.problem.periods:
                controls = rows.controls[at_time]
                middle[at_time] += controls @ self.nominal[time]
                columns[at_time] += controls @ self.control_columns[time]
        return self._ranges(middle, columns)

    @cached_property
    def excess(self) -> float:
        """The largest violation of a row, in units of the problem; at most 0 if all hold.

        It is minus infinity if there are no rows.
        """
        rows = self.problem.rows
        over = self.row_ranges.upper - rows.upper
        under = rows.lower - self.row_ranges.lower
        return float(np.maximum(over, under).max(initial=-np.inf))

    @cached_property
    def nominal_states(self) -> Floats:
        """States without errors, shape (T + 1, n)."""
        problem = self.problem
        states = [problem.centre]
        for t in range(problem.periods):
            states.append(problem.transition[t] @ states[t] + problem.control[t] @ self.nominal[t])
        return np.array(states)

    @cached_property
    def control_columns(self) -> Floats:
        """U of u(t) = nominal(t) + U(t) z, shape (T, m, size)."""
        periods, controls = self.nominal.shape
        outputs = self.problem.pure_outputs
        columns = np.zeros((periods, controls, outputs.shape[2]))
        for t in range(periods):
            for s in np.flatnonzero(self.gains[t].any(axis=(1, 2))):
                columns[t] += self.gains[t, s] @ outputs[s]
        return columns

    @cached_property
    def state_columns(self) -> Floats:
        """X of x(t) = nominal state + X(t) z, shape (T + 1, n, size)."""
        problem = self.problem
        states = [problem.start_columns]
        for t in range(problem.periods):
            moved = problem.transition[t] @ states[t] + problem.control[t] @ self.control_columns[t]
            states.append(moved + problem.period_columns[t])
        return np.array(states)

    def control(self, measured: ArrayLike, applied: ArrayLike) -> Floats:
        """Return the control u(t), shape (m,), in units of the problem.

        `measured`, shape (t + 1, q), are the outputs y(0), ..., y(t), and `applied`, shape (t, m),
        the controls before.
        """
        problem = self.problem
        outputs = np.asarray(measured, dtype=float)
        before = np.asarray(applied, dtype=float).reshape(-1, problem.controls)
        time = len(outputs) - 1

        control = self.nominal[time].copy()
        predicted = problem.centre
        for s in range(time + 1):
            control += self.gains[time, s] @ (outputs[s] - problem.output[s] @ predicted)
            if s < time:
                predicted = problem.transition[s] @ predicted + problem.control[s] @ before[s]
        return np.asarray(control)

    def under(self, problem: OutputProblem) -> AffinePlan:
        """Return the plan for a problem with other errors, of the same shapes."""
        return replace(self, problem=problem)

    def _ranges(self, middle: Floats, columns: Floats) -> Ranges:
        errors = self.problem.errors
        return Ranges(middle - errors.maxima(-columns), middle + errors.maxima(columns))
