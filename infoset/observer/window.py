"""Sets of five and more states: a carried zonotope, and linear programs over the last steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.engine.section_life import CUT_SLACK, SUM_SLACK
from infoset.geometry.zonotope import Zonotope
from infoset.geometry.zonotope_arrays import box_generators
from infoset.geometry.zonotope_outer import corrected_by_strips, fewer_generators
from infoset.observer.programs import EPSILON, Program, Stage
from infoset.observer.sets import Motion, Set, Sets, sizes_of
from infoset.observer.steps import Strips

ORDER = 5
"""Maximum number of generators of a carried zonotope for each state. More do not make it tighter:
on chains of masses, sets were wider with 30.
"""
WINDOW = 10
"""Steps of a program. For up to 20 states the widths are then within 6 % of the widths of the whole
record in random systems and chains of masses, and within 12 % in undamped masses between springs
(benchmarks/window_numbers.py)."""


class Contradiction(NamedTuple):
    """The first strip that leaves no possible state."""

    step: int
    output: int
    """Number of the strip in its step."""
    excess: float
    """Minimum enlargement of the strip with which a state is possible."""


@dataclass(frozen=True, eq=False)
class Window:
    """The set of one run at a step: the states that agree with the last steps.

    A smoothed set also agrees with later steps.

    Parameters
    ----------
    stages : tuple of Stage
        Successive steps.
    at : int
        Number of the stage whose state is described.
    carried : Zonotope
        A set that contains these states.
    length : int or None
        Maximum number of steps before the present one, and after it; None is no limit.
    is_whole : bool
        Whether the stages are the whole record.
    contradiction : Contradiction or None
        Where the set became empty, if a strip did not meet the carried zonotope or an earlier
        program showed it.
    """

    stages: tuple[Stage, ...]
    at: int
    carried: Zonotope
    length: int | None
    is_whole: bool = True
    contradiction: Contradiction | None = None

    @classmethod
    def of(cls, start: Set, length: int | None) -> Window:
        """Return the window at step 0, before its measurement."""
        carried = _zonotope_of(start).enlarged(SUM_SLACK * sizes_of(start))
        return cls((Stage.at_first(0, start),), 0, carried, length)

    @cached_property
    def program(self) -> Program:
        """The linear program over the stages."""
        return Program(self.stages, self.at)

    @cached_property
    def is_empty(self) -> bool:
        """Whether no state is possible: proved, by one linear program."""
        return self.contradiction is not None or self.program.is_infeasible()

    @property
    def is_known_empty(self) -> bool:
        """Whether it is known that no state is possible, without a new program."""
        return self.contradiction is not None or bool(vars(self).get("is_empty", False))

    @cached_property
    def _heights(self) -> dict[bytes, float]:
        return {}

    def support(self, direction: Floats) -> float:
        """Return an upper bound of direction . x; -inf for the empty set.

        A linear program is solved the first time, and before it the one of `is_empty`.
        """
        if self.is_empty:
            return -np.inf
        key = direction.tobytes()
        if key not in self._heights:
            top, _ = extent(self.carried, direction[None], sizes_of(self.carried))
            self._heights[key] = min(float(top[0]), self.program.bound(direction))
        return self._heights[key]

    def predicted(self, motion: Motion) -> Window:
        """Return the window at the next step, without its first stage if it is too long."""
        if self.is_known_empty:
            return self

        image = moved(self.carried, motion)
        last = replace(self.stages[-1], motion=motion)
        stages = (*self.stages[:-1], last, Stage.at_first(last.step + 1, image))
        too_many = self.length is not None and len(stages) > self.length + 1
        if too_many:
            stages = stages[1:]
        return Window(stages, len(stages) - 1, image, self.length, self.is_whole and not too_many)

    def cut(self, strips: Strips, run: int) -> Window:
        """Return the window after a measurement, the strips of a `run`."""
        exists = np.isfinite(strips.lower[run]) | np.isfinite(strips.upper[run])
        if self.is_known_empty or not exists.any():
            return self

        outputs = np.flatnonzero(exists)
        normals = strips.normals[outputs]
        sizes = sizes_of(self.carried)
        slack = CUT_SLACK * (np.abs(normals) @ sizes + strips.terms[run, outputs])
        lower = strips.lower[run, outputs] - slack
        upper = strips.upper[run, outputs] + slack

        stage = self.stages[-1]
        top, bottom = extent(self.carried, normals, sizes)
        excess = np.maximum(lower - top, bottom - upper)
        if (excess > 0.0).any():
            first = int(np.argmax(excess > 0.0))
            where = Contradiction(stage.step, int(outputs[first]), float(excess[first]))
            return replace(self, contradiction=where)

        cut = stage.with_strips(normals, lower, upper, outputs)
        # Where a strip goes beyond the zonotope, its end is moved to the zonotope.
        low = np.maximum(lower, bottom)
        high = np.minimum(upper, top)
        part = corrected_by_strips(self.carried.centre, self.carried.generators, normals, low, high)
        carried = Zonotope(*part)
        return replace(self, stages=(*self.stages[:-1], cut), carried=carried)

    def before(self, later: Window, motion: Motion) -> Window:
        """Return this set given also the measurements of a later set, of the next step."""
        if self.is_empty:
            return self
        # The programs of the estimates are enough: a program of a smoothed set finds the same.
        is_estimate = later.at == len(later.stages) - 1
        later_is_empty = later.is_empty if is_estimate else later.is_known_empty
        if later_is_empty:
            return replace(self, contradiction=later.located())

        after = later.stages[later.at :]
        left_out = self.length is not None and len(after) > self.length
        if left_out:
            after = after[: self.length]
        stages = (*self.stages[:-1], replace(self.stages[-1], motion=motion), *after)
        is_whole = self.is_whole and later.is_whole and not left_out
        return replace(self, stages=stages, is_whole=is_whole)

    def located(self) -> Contradiction | None:
        """Return the first strip after which no state is possible; None if the set is not empty.

        It is found by bisection, with a linear program for each division.
        """
        if self.contradiction is not None or not self.is_empty:
            return self.contradiction

        strips = [
            (k, row) for k, stage in enumerate(self.stages) for row in range(len(stage.normals))
        ]
        # The first `possible` strips leave a state, the first `impossible` ones leave none.
        possible = 0
        impossible = len(strips)
        while impossible - possible > 1:
            middle = (possible + impossible) // 2
            if self._up_to(*strips[middle - 1]).is_infeasible():
                impossible = middle
            else:
                possible = middle

        last, row = strips[impossible - 1]
        stage = self.stages[last]
        normal = stage.normals[row]
        program = self._up_to(last, row - 1)
        below = stage.lower[row] - program.bound(normal)
        above = -program.bound(-normal) - stage.upper[row]
        # A bound that the solver does not find is infinite, and gives no excess.
        excess = max(float(below), float(above), 0.0)
        return Contradiction(stage.step, int(stage.outputs[row]), excess)

    def _up_to(self, last: int, row: int) -> Program:
        """Return the program of the strips up to a row of a stage."""
        stage = self.stages[last].first_strips(row + 1)
        return Program((*self.stages[:last], stage), last)


def exact_hull(initial: Set, record: Sequence[Motion | Strips], run: int, step: int) -> Floats:
    """Return the minimum and the maximum of each state of a `run` at a `step`, shape (2, n).

    Linear programs over the whole record, which begins at step 0. All bounds are NaN if no state is
    possible, and so are bounds that the solver does not find.
    """
    window = Window.of(initial, None)
    for event in record:
        if isinstance(event, Motion):
            window = window.predicted(event.of_run(run))
        else:
            window = window.cut(event, run)
    n = len(window.carried.centre)
    if window.is_known_empty:
        return np.full((2, n), np.nan)

    # The record is whole: the number of a stage is its step.
    program = Program(window.stages, step)
    lower = [-program.bound(-unit) for unit in np.eye(n)]
    upper = [program.bound(unit) for unit in np.eye(n)]
    hull = np.array([lower, upper])
    return np.where(np.isinf(hull), np.nan, hull)


@dataclass(frozen=True, eq=False)
class Windows:
    """Sets of five and more states, a window for each run."""

    members: tuple[Window, ...]

    @classmethod
    def of(cls, start: Set, runs: int, length: int | None) -> Windows:
        """Return the same set for all runs."""
        return cls((Window.of(start, length),) * runs)

    @property
    def is_empty(self) -> Flags:
        """Whether each set is empty, shape (B,): a linear program each."""
        return np.array([member.is_empty for member in self.members])

    @property
    def is_known_empty(self) -> Flags:
        """Whether each set is known to be empty without new programs, shape (B,)."""
        return np.array([member.is_known_empty for member in self.members])

    @property
    def reduced(self) -> Flags:
        """Whether each set uses only a part of the record, shape (B,)."""
        return np.array([not member.is_whole for member in self.members])

    def predicted(self, motion: Motion) -> Windows:
        """Return the sets after a step."""
        members = [member.predicted(motion.of_run(run)) for run, member in enumerate(self.members)]
        return Windows(tuple(members))

    def cut(self, strips: Strips, excess: Floats) -> Windows:
        """Return the sets within the strips.

        `excess`, shape (B, r), receives the distance of a strip from the set that it leaves empty.
        """
        members = []
        for run, before in enumerate(self.members):
            member = before.cut(strips, run)
            found = member.contradiction
            if found is not None and before.contradiction is None:
                excess[run, found.output] = found.excess
            members.append(member)
        return Windows(tuple(members))

    def preimage_cut(self, later: Sets, motion: Motion) -> Windows:
        """Return the states that lead to a state of the later set for some disturbance."""
        assert isinstance(later, Windows)
        members = []
        for run, (member, after) in enumerate(zip(self.members, later.members, strict=True)):
            members.append(member.before(after, motion.of_run(run)))
        return Windows(tuple(members))

    def support(self, direction: Floats) -> Floats:
        """Return max direction . x of each set, shape (B,); -inf for the empty set."""
        return np.array([member.support(direction) for member in self.members])

    def chebyshev_centres(self) -> Floats:
        """Refuse with a ValueError: the facets are not known."""
        raise ValueError(
            "the largest ball of a set of 5 and more states is not known: use the bounds of the "
            "states"
        )


def moved(one: Zonotope, motion: Motion) -> Zonotope:
    """Return a zonotope that contains matrix x + shift + w for all x of a zonotope.

    It has at most `ORDER` n generators.
    """
    matrix = motion.matrix
    w = _zonotope_of(motion.disturbance)
    terms = motion.sums_of_terms(sizes_of(one))
    # Each coordinate is a sum of n products, and of the shift and w.
    slack = (SUM_SLACK + len(matrix) * EPSILON) * terms

    centre = matrix @ one.centre + motion.shifts[0] + w.centre
    generators = np.concatenate([one.generators @ matrix.T, w.generators, box_generators(slack)])
    return Zonotope(centre, fewer_generators(generators, ORDER * len(matrix)))


def extent(one: Zonotope, normals: Floats, sizes: Floats) -> tuple[Floats, Floats]:
    """Return the maximum and the minimum of each normal . x, rounded outward.

    `sizes`, shape (n,), bound the coordinates of the zonotope.
    """
    half = np.abs(normals @ one.generators.T).sum(axis=1)
    middle = normals @ one.centre
    terms = np.abs(normals) @ sizes
    # Sums of n products and of g sizes, and a few more operations, each rounded by EPSILON / 2.
    rounding = (sum(one.generators.shape) + 4) * EPSILON * terms
    return middle + half + rounding, middle - half - rounding


def _zonotope_of(shape: Set) -> Zonotope:
    """Return a zonotope, or the bounding box of another set."""
    if isinstance(shape, Zonotope):
        return shape
    points = shape.vertices.reshape(-1, shape.vertices.shape[-1])
    return Zonotope.box(points.min(axis=0), points.max(axis=0))
