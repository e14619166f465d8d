"""Observers of linear systems: sets of states that agree with measurements and bounded errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset.arrays import Flags, Floats, Integers, some
from infoset.geometry._set_arguments import bound_values, finite_values
from infoset.geometry.convex_polygons import ConvexPolygons
from infoset.geometry.polytope import Polytope
from infoset.geometry.zonotope import Zonotope
from infoset.limits import COUNT, Limits, real_values, shown
from infoset.observer.cover import Cover, Detection
from infoset.observer.estimate import MAX_POLYTOPE_STATES, MAX_RECORD, Estimate, Inconsistency
from infoset.observer.sets import Motion, Polygons, Polytopes, Set, Sets, polytope_of, sizes_of
from infoset.observer.steps import Strips
from infoset.observer.window import WINDOW, Windows

Known = TypeVar("Known")


class LinearObserver:
    """Exact sets of the states of x+ = A x + B u + c + w, y = C x + v, with w in W and v in V.

    Two states: polygons, compiled, batched over runs. One, three and four states: polytopes, each
    run after the other. A polytope of more than `max_facets` facets is replaced by a larger one
    with fewer, so that the time of a step is bounded. Five and more states: a zonotope that
    contains the set is carried, and linear programs over the last `window` steps give the bounds of
    an estimate, when they are read. `Estimate.reduced` and `excess_widths` give the effect.

    Parameters
    ----------
    state_matrix : array_like, shape (n, n) or (K, n, n)
        A, or A of each step.
    output_matrix : array_like, shape (q, n) or (K, q, n)
        C.
    initial : ConvexPolygons, Polytope or Zonotope
        Set of the state at step 0, before its measurement; for two states also one polygon for each
        run, shape (B,).
    noise : array_like, ConvexPolygons, Polytope or Zonotope, or a sequence of such sets
        V, or V of each step. An array has half-widths of a box V, shape () or (q,), or of each
        step, shape (K, q).
    disturbance : ConvexPolygons, Polytope or Zonotope, a sequence of such sets, or array_like
        W, or W of each step; without it (optional) the point 0. An array has half-widths of a box
        W, shape (n,), or of each step, shape (K, n).
    input_matrix : array_like, shape (n, p) or (K, n, p), optional
        B.
    offset : array_like, shape (n,) or (K, n), optional
        c.
    runs : int, optional
        Number B of runs. Without it there is one run, and its arrays have no axis of runs.
    max_facets : int or None, optional
        Maximum number of facets of a polytope after a measurement, at least 2n; it then has at most
        700 vertices. More facets give smaller sets and take longer. None keeps the sets exact; a
        set of more than 5000 vertices is then an ArithmeticError. Not used for two and for more
        than four states.
    window : int or None, optional
        Number of steps of the linear programs of five and more states. None is the whole record:
        bounds are then exact, and their time grows with the record. Not used for fewer states.
    wrong_measurements : int, optional
        Maximum number q of wrong measurements of a run, at most 3: their errors are arbitrary. A
        measurement is all that one call of `update` gives; the default is that all errors are in V.
    measurement_classes : int or None, optional
        Number G of classes into which the measurements of a run are dealt, at least q + 2. Each run
        then has R = C(G, q) sets, at most 64, which leave q classes out. None is 2 q + 2.

    Raises
    ------
    TypeError, ValueError
        If a set or a number has a wrong type, shapes do not agree, a number is not finite, or a set
        is empty.

    Notes
    -----
    The computed sets contain the exact ones. Without reduction they are larger by a few ulp (two
    states), by 1e-11 of the coordinates (polytopes) or by 1e-7 of the widths (programs), so that
    errors exactly at their bounds do not lose the true state. Polygons of more than 512 vertices
    are reduced outward.

    A bound of five and more states is a sum that is an upper bound for all multipliers of the
    measurements; the solver (HiGHS) only proposes the multipliers, so that its tolerances enlarge a
    bound and never make it wrong. Where it fails, the carried zonotope gives the bound. One program
    proves in the same way that no state is possible: a contradiction that the zonotope does not
    show is found if `inconsistency`, `is_empty` or a bound is read within `window` steps.

    Examples
    --------
    >>> observer = LinearObserver(
    ...     [[1, 1], [0, 1]],
    ...     [[1, 0]],
    ...     Zonotope.box([0, -1], [0, 1]),
    ...     noise=0.1,
    ...     disturbance=Zonotope([0, 0], [[0, 0.05]]),
    ... )
    >>> observer.predict()
    >>> observer.update([0.5])
    >>> observer.estimate().lower.round(3), observer.estimate().upper.round(3)
    (array([0.4 , 0.35]), array([0.6 , 0.65]))
    """

    def __init__(  # noqa: PLR0913  # the parts of a linear system
        self,
        state_matrix: ArrayLike,
        output_matrix: ArrayLike,
        initial: Set,
        *,
        noise: ArrayLike | Set | Sequence[Set],
        disturbance: ArrayLike | Set | Sequence[Set] | None = None,
        input_matrix: ArrayLike | None = None,
        offset: ArrayLike | None = None,
        runs: int | None = None,
        max_facets: int | None = 36,
        window: int | None = WINDOW,
        wrong_measurements: int = 0,
        measurement_classes: int | None = None,
    ) -> None:
        shape = real_values("state_matrix", state_matrix).shape
        self.states = n = shape[-1] if shape else 0
        COUNT.need("the number of states", n)
        self._a = _by_step("state_matrix", state_matrix, n, n)
        self._c = _by_step("output_matrix", output_matrix, "q", n)
        self._b = np.zeros((n, 0))
        if input_matrix is not None:
            self._b = _by_step("input_matrix", input_matrix, n, "p")
        self._offset = np.zeros(n)
        if offset is not None:
            self._offset = _by_step("offset", offset, n)
        self.outputs = self._c.shape[-2]
        self.inputs = self._b.shape[-1]

        if runs is not None:
            COUNT.need("runs", runs)
        if max_facets is not None and n <= MAX_POLYTOPE_STATES:
            Limits(minimum=2 * n, whole=True).need("max_facets", max_facets)
        if window is not None:
            COUNT.need("window", window)
        self.max_facets = max_facets
        self.window = window
        self._single = runs is None
        self._runs = runs or 1
        self._cover = Cover.of(wrong_measurements, measurement_classes)
        self._measured = np.zeros(self._runs, dtype=np.int64)
        self._disturbance = _disturbances(disturbance, n)
        self._replaced = dict[int, Set]()
        _need_set("initial", initial, n, (self._runs,) if runs else ())
        self._noise = _noises(noise, self.outputs)
        self._initial = initial

        self.step = 0
        self._sets = self._first_sets()
        self._events = list[Motion | Strips]()
        self._count = 0
        sets = self._runs * self._cover.members
        self._empty = _Emptied(
            np.full(sets, -1),
            np.zeros(sets, dtype=np.int64),
            np.zeros(sets),
        )

    def _first_sets(self) -> Sets:
        """Return the sets of step 0, before its measurement."""
        initial = self._initial
        sets = self._runs * self._cover.members
        if self.states == 2:
            # Of a batch, the polygon of each run is repeated for the members of the run.
            if isinstance(initial, ConvexPolygons) and initial.shape:
                initial = ConvexPolygons.unchecked(
                    self._cover.repeated(initial.vertices), self._cover.repeated(initial.counts)
                )
            return Polygons.of(initial, sets)
        if self.states > MAX_POLYTOPE_STATES:
            return Windows.of(initial, sets, self.window)
        sizes = np.max([sizes_of(each) for each in self._disturbance.values], axis=0)
        return Polytopes.of(initial, sets, self.max_facets, sizes)

    @property
    def _may_be_reduced(self) -> bool:
        """Whether the sets may be larger than the exact ones, whose widths then need the record."""
        if self.states > MAX_POLYTOPE_STATES:
            return self.window is not None
        # Reductions of polygons, the sets of two states, are not recorded.
        return self.states != 2 and self.max_facets is not None

    def predict(self, inputs: ArrayLike | None = None, *, disturbance: Set | None = None) -> None:
        """Move the sets to the next step.

        Parameters
        ----------
        inputs : array_like, shape (p,) or (B, p), or a number for one input, optional
            u between this step and the next one; without it zero.
        disturbance : ConvexPolygons, Polytope or Zonotope, optional
            W of this step, in place of W of the observer. `smooth` uses it too.

        Raises
        ------
        TypeError, ValueError
            If the inputs have another shape or are not finite, the disturbance is not such a set of
            n coordinates, or a matrix or a disturbance for this step is missing.
        ArithmeticError
            If a polytope has more than 5000 vertices and no `max_facets`.
        """
        if disturbance is not None:
            _need_set("disturbance", disturbance, self.states)
            self._replaced[self.step] = disturbance
        motion = self._motion(self.step, inputs)
        self._sets = self._sets.predicted(motion)
        self._note(motion)
        self.step += 1

    def update(self, measurement: ArrayLike | Sequence[Any] | None) -> None:
        """Cut the sets by the measurement of this step.

        Parameters
        ----------
        measurement : array_like, shape (q,) or (B, q), or a number for one output
            y; NaN or None is a missing measurement. None in place of the array means that all are
            missing. With `wrong_measurements` all of y counts as one measurement, whose number is
            the number of measurements of this run before it, without those that are missing.

        Raises
        ------
        ValueError
            If it has another shape, or is infinite, or the noise of this step is missing.
        """
        values = np.full(self.outputs, np.nan) if measurement is None else _with_nan(measurement)
        y = self._rows("measurement", values, self.outputs, missing=True)
        matrix = self._at(self._c, "output_matrix", self.step)
        noise = self._noise.at("noise", self.step)
        if self._cover.members > 1:
            # A run without any measured output has no measurement to count.
            is_missing = np.isnan(y)
            y = self._cover.used(y, self._measured)
            self._measured += ~is_missing.all(axis=1) if some(is_missing) else 1
        for sets, strips in noise.strips(matrix, y):
            self._cut(sets, strips)

    def cut(
        self, normals: ArrayLike, lower: ArrayLike = -np.inf, upper: ArrayLike = np.inf
    ) -> None:
        """Cut the sets of this step by strips, other constraints on the states.

        Parameters
        ----------
        normals : array_like, shape (n,) or (r, n)
            Normals of the strips lower <= normals x <= upper.
        lower, upper : array_like, shape (), (r,) or (B, r), optional
            Ends, which may be infinite.

        Raises
        ------
        ValueError
            If the shapes do not agree, a normal is not finite, or an end is NaN.

        Notes
        -----
        `Inconsistency.output` is the row of `normals` if these strips make the set empty.
        """
        rows = finite_values(
            "normals", np.atleast_2d(real_values("normals", normals)), "r", self.states
        )
        shapes: list[tuple[int, ...]] = [(), (len(rows),)]
        if not self._single:
            shapes.append((self._runs, len(rows)))
        ends = []
        for name, values in (("lower", lower), ("upper", upper)):
            end = bound_values(name, values, *shapes)
            of_runs = np.array(np.broadcast_to(end, (self._runs, len(rows))))
            ends.append(self._cover.repeated(of_runs))
        sizes = [np.where(np.isinf(end), 0.0, np.abs(end)) for end in ends]
        strips = Strips(rows, ends[0], ends[1], np.maximum(*sizes))
        self._cut(np.ones(len(ends[0]), dtype=bool), strips)

    def _cut(self, sets: Flags, strips: Strips) -> None:
        """Cut some of the sets by strips, of which those with NaN ends do not exist."""
        exists = sets[:, None] & ~np.isnan(strips.lower)
        lower = np.where(exists, strips.lower, -np.inf)
        upper = np.where(exists, strips.upper, np.inf)
        strips = Strips(strips.normals, lower, upper, np.where(exists, strips.terms, 0.0))

        excess = np.zeros(strips.lower.shape)
        before = self._sets.is_known_empty
        self._sets = self._sets.cut(strips, excess)
        self._note(strips)
        lost = np.flatnonzero(self._sets.is_known_empty & ~before)
        if len(lost):
            self._empty.step[lost] = self.step
            self._empty.output[lost] = excess[lost].argmax(axis=1)
            self._empty.excess[lost] = excess[lost].max(axis=1)

    def _note(self, event: Motion | Strips) -> None:
        """Keep a step or a measurement, of sets that may be reduced, for their exact widths.

        A record of more than `MAX_RECORD` is discarded as a whole.
        """
        self._count += 1
        if self._may_be_reduced and self._count <= MAX_RECORD:
            self._events.append(event)
        else:
            # A new list: earlier estimates keep the old one.
            self._events = []

    def estimate(self) -> Estimate:
        """Return the present sets."""
        return Estimate(
            self.step,
            self._sets,
            self._single,
            self._cover.members,
            self.states,
            self._initial,
            self._events,
            self._count,
        )

    @property
    def inconsistency(self) -> Inconsistency:
        """Where the measurements contradict the model; with `wrong_measurements`, where the last
        set of a run became empty: more than q measurements are wrong, or the model is.

        For five and more states, programs over the last steps are solved.
        """
        empty = self._located()
        last = self._cover.last_emptied(empty.step, empty.excess)
        return Inconsistency(*(np.asarray(self._of_runs(part[last])) for part in empty))

    @property
    def detection(self) -> Detection:
        """What is proved about wrong measurements, with `wrong_measurements`.

        For five and more states, programs over the last steps are solved.
        """
        found = self._cover.detection(self._located().step)
        return Detection(
            np.asarray(self._of_runs(found.step)),
            self._of_runs(found.refuted),
            self._of_runs(found.suspected),
        )

    def _located(self) -> _Emptied:
        """Return where each set became empty; of windows it is computed and noted first."""
        empty = self._empty
        if isinstance(self._sets, Windows):
            for number in np.flatnonzero(empty.step == -1):
                where = self._sets.members[number].located()
                if where is not None:
                    empty.step[number] = where.step
                    empty.output[number] = where.output
                    empty.excess[number] = where.excess
        return empty

    def _of_runs(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return an array with an axis of runs without this axis for a single run."""
        return values[0] if self._single else values

    def run(
        self, measurements: ArrayLike | Sequence[Any], inputs: ArrayLike | None = None
    ) -> list[Estimate]:
        """Process the measurements of several steps; return the estimate after each of them.

        The first measurement is of the current step: there is no step before it. A second call must
        begin after `predict`.

        Parameters
        ----------
        measurements : array_like, shape (N, q) or (N, B, q)
            y of this step and of the next steps; NaN and None as in `update`.
        inputs : array_like, shape (N, p) or (N, B, p), optional
            u after each measurement; one row less is enough.

        Raises
        ------
        ValueError
            As `predict` and `update`, or if there are too few inputs.
        """
        rows: Sequence[Any] | Floats
        if isinstance(measurements, list | tuple) and any(row is None for row in measurements):
            rows = measurements
        else:
            rows = np.atleast_1d(real_values("measurements", _with_nan(measurements)))
        series = _series(inputs, len(rows) - 1)

        estimates = []
        for k, measurement in enumerate(rows):
            if k > 0:
                self.predict(series[k - 1])
            self.update(measurement)
            estimates.append(self.estimate())
        return estimates

    def smooth(
        self, estimates: Sequence[Estimate], inputs: ArrayLike | None = None
    ) -> list[Estimate]:
        """Return the sets of earlier states given also the later measurements.

        The exact backward pass: a state is possible if it is in its own estimate and leads, for
        some disturbance, to a possible state of the next step. For five and more states, the
        programs of a step also have the measurements of the next `window` steps.

        Parameters
        ----------
        estimates : sequence of Estimate
            Estimates of successive steps, as `run` returns them. The last one is returned
            unchanged.
        inputs : array_like, shape (N, p) or (N, B, p), optional
            u after each of them; the last one is not used.

        Raises
        ------
        ValueError
            If the steps are not successive, or there are too few inputs.
        """
        if any(after.step != before.step + 1 for before, after in pairwise(estimates)):
            raise ValueError("estimates must belong to successive steps")
        smoothed = list(estimates)
        rows = _series(inputs, len(smoothed) - 1)
        for i in range(len(smoothed) - 2, -1, -1):
            step = smoothed[i].step
            motion = self._motion(step, rows[i])
            sets = smoothed[i].sets.preimage_cut(smoothed[i + 1].sets, motion)
            # With the record of the last estimate, because the set agrees with all of it.
            smoothed[i] = replace(smoothed[-1], step=step, sets=sets)
        return smoothed

    def _motion(self, step: int, inputs: ArrayLike | None) -> Motion:
        """Return the motion from a step to the next one."""
        matrix = self._at(self._a, "state_matrix", step)
        # Shape (1, n), the same for all runs.
        offset = self._at(self._offset, "offset", step, 1)[None]
        w = self._replaced.get(step)
        if w is None:
            w = self._disturbance.at("disturbance", step)
        if inputs is None:
            return Motion(matrix, offset, np.abs(offset), w)

        u = self._rows("inputs", inputs, self.inputs)
        if len(u) > 1:  # one row is that of all sets
            u = self._cover.repeated(u)
        b = self._at(self._b, "input_matrix", step)
        shifts = u @ b.T + offset
        terms = np.abs(u) @ np.abs(b).T + np.abs(offset)
        return Motion(matrix, shifts, terms, w)

    def _rows(self, name: str, values: ArrayLike, size: int, *, missing: bool = False) -> Floats:
        """Return measurements or inputs of all runs, shape (B, size)."""
        rows = real_values(name, values)
        if size == 1 and not rows.ndim:
            rows = rows[None]
        shapes = [(size,)] if self._single else [(size,), (self._runs, size)]
        if rows.shape not in shapes:
            raise ValueError(
                f"{name} must have the shape {' or '.join(map(str, shapes))}: got {rows.shape}"
            )
        if np.isinf(rows).any() or (not missing and np.isnan(rows).any()):
            wanted = "finite or NaN" if missing else "finite"
            raise ValueError(f"{name} must be {wanted}: got {shown(values)}")
        return np.broadcast_to(rows, (self._runs, size))

    def _at(self, values: Floats, name: str, step: int, rank: int = 2) -> Floats:
        """Return a matrix or a vector of a step."""
        if values.ndim == rank:
            return values
        if step >= len(values):
            raise ValueError(f"{name} has {len(values)} steps, none for step {step}")
        return np.asarray(values[step])


class _Emptied(NamedTuple):
    """The arrays of an `Inconsistency` for each set, shape (B R,)."""

    step: Integers
    output: Integers
    excess: Floats


@dataclass(frozen=True)
class _Schedule(Generic[Known]):
    """A value for all steps, or a value for each step."""

    values: tuple[Known, ...]
    varies: bool

    def at(self, name: str, step: int) -> Known:
        """Return the value of a step; `name` is its name in messages."""
        if not self.varies:
            return self.values[0]
        if step >= len(self.values):
            raise ValueError(f"{name} has {len(self.values)} steps, none for step {step}")
        return self.values[step]


@dataclass(frozen=True, eq=False)
class _Noise:
    """The set V: a polytope, or without one the box -half <= v <= half."""

    half: Floats
    polytope: Polytope | None = None

    @classmethod
    def of_set(cls, noise: Set, outputs: int) -> _Noise:
        """Return the noise in a set."""
        _need_set("noise", noise, outputs)
        return cls(np.zeros(0), polytope_of(noise))

    def strips(self, matrix: Floats, y: Floats) -> list[tuple[Flags, Strips]]:
        """Return the strips of C x = y - v for groups of runs.

        The same outputs are measured in the runs of a group; others are NaN. A strip with NaN ends
        does not exist. A box is one group, because its outputs have strips of their own. For a
        polytope, whose projection depends on the measured outputs, there is a group for each choice
        of them, and runs without any measured output are in no group.
        """
        if self.polytope is None:
            strips = Strips(matrix, y - self.half, y + self.half, np.abs(y) + self.half)
            return [(np.ones(len(y), dtype=bool), strips)]

        known = ~np.isnan(y)
        groups = []
        for pattern in np.unique(known, axis=0):
            if not pattern.any():
                continue
            # V of the measured outputs alone.
            errors = self.polytope
            if not pattern.all():
                errors = errors.project(np.flatnonzero(pattern).tolist())
            # rows v <= upper with v = y - C x: a lower end of rows C x. Elements of `y` in runs of
            # other groups may be NaN: their strips do not exist.
            rows, upper = errors.constraints()
            heights = y[:, pattern] @ rows.T
            terms = np.abs(np.nan_to_num(y[:, pattern])) @ np.abs(rows).T + np.abs(upper)
            no_end = np.full_like(heights, np.inf)
            strips = Strips(rows @ matrix[pattern], heights - upper, no_end, terms)
            groups.append(((known == pattern).all(axis=1), strips))
        return groups


def _noises(noise: ArrayLike | Set | Sequence[Set], outputs: int) -> _Schedule[_Noise]:
    """Return V, or V of each step."""
    sets = _sets_of(noise)
    if sets is not None:
        noises = tuple(_Noise.of_set(each, outputs) for each in sets)
        return _Schedule(noises, isinstance(noise, Sequence))

    values: Any = noise
    half = finite_values("noise", values, "...")
    is_possible = half.shape in ((), (outputs,)) or half.shape[1:] == (outputs,)
    if not is_possible or not half.size or (half < 0.0).any():
        raise ValueError(
            f"noise must be half-widths of at least 0, a number or of shape ({outputs},) or (K, "
            f"{outputs}): got {shown(noise)}"
        )
    steps = len(half) if half.ndim == 2 else 1
    rows = np.broadcast_to(half, (steps, outputs))
    return _Schedule(tuple(map(_Noise, rows)), half.ndim == 2)


def _disturbances(
    disturbance: ArrayLike | Set | Sequence[Set] | None, states: int
) -> _Schedule[Set]:
    """Return W, or W of each step."""
    if disturbance is None:
        return _Schedule((Zonotope(np.zeros(states), []),), varies=False)
    sets = _sets_of(disturbance)
    if sets is not None:
        for each in sets:
            _need_set("disturbance", each, states)
        return _Schedule(sets, isinstance(disturbance, Sequence))

    if not isinstance(disturbance, Sequence | np.ndarray):
        # Raises a TypeError that names the classes of sets.
        _need_set("disturbance", disturbance, states)
    values: Any = disturbance
    half = finite_values("disturbance", values, "...")
    is_possible = half.shape == (states,) or half.shape[1:] == (states,)
    if not is_possible or not half.size or (half < 0.0).any():
        raise ValueError(
            f"disturbance must be a set, or half-widths of at least 0 of shape ({states},) or (K, "
            f"{states}): got {shown(disturbance)}"
        )
    boxes = tuple(Zonotope.box(-row, row) for row in np.atleast_2d(half))
    return _Schedule(boxes, half.ndim == 2)


def _sets_of(value: object) -> tuple[Set, ...] | None:
    """Return a set, or a sequence that contains one, as a tuple; None for anything else."""
    if isinstance(value, ConvexPolygons | Polytope | Zonotope):
        return (value,)
    if isinstance(value, list | tuple) and any(
        isinstance(each, ConvexPolygons | Polytope | Zonotope) for each in value
    ):
        return tuple(value)
    return None


def _with_nan(values: Any) -> Any:
    """Return measurements with NaN in place of None."""
    if values is None:
        return np.nan
    if isinstance(values, np.ndarray) and values.dtype == object:
        values = values.tolist()
    if isinstance(values, list | tuple):
        return [_with_nan(each) for each in values]
    return values


def _need_set(name: str, value: object, space: int, shape: tuple[int, ...] = ()) -> None:
    """Refuse an argument that is not a bounded, nonempty set of R^n, n = `space`.

    Batches of polygons may have a `shape`.
    """
    if not isinstance(value, ConvexPolygons | Polytope | Zonotope):
        raise TypeError(
            f"{name} must be a ConvexPolygons, a Polytope or a Zonotope: got {type(value).__name__}"
        )
    found = 2 if isinstance(value, ConvexPolygons) else value.space
    if found != space:
        raise ValueError(
            f"{name} must have {space} coordinates, one for each state or output: got {found}"
        )
    if isinstance(value, ConvexPolygons) and value.shape not in ((), shape):
        batch = f" or a batch of shape {shape}" if shape else ""
        raise ValueError(
            f"{name} must be a single polygon{batch}: got a batch of shape {value.shape}"
        )
    if not isinstance(value, Zonotope) and np.any(value.is_empty):
        raise ValueError(f"{name} must not be empty")
    if isinstance(value, Polytope) and not value.is_bounded:
        raise ValueError(f"{name} must be bounded: got {value!r}")


def _series(inputs: ArrayLike | None, steps: int) -> Sequence[ArrayLike | None] | Floats:
    """Return the inputs of at least a number of steps, each None if there are no inputs."""
    if inputs is None:
        return [None] * steps
    rows = real_values("inputs", inputs)
    if not rows.ndim or len(rows) < steps:
        raise ValueError(
            f"inputs must have a row for each of {steps} steps: got the shape {rows.shape}"
        )
    return rows


def _by_step(name: str, value: ArrayLike, *shape: str | int) -> Floats:
    """Return numbers of some shape, or of this shape for each step."""
    values = real_values(name, value)
    if values.ndim > len(shape):
        return finite_values(name, values, "K", *shape)
    return finite_values(name, values, *shape)
