"""Bounds of a state over all motions that agree with a record.

Linear programs propose the bounds, and sums prove them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.optimize import linprog

from infoset.arrays import Floats, Integers
from infoset.engine.section_life import SUM_SLACK
from infoset.geometry.polytope import HIGHS
from infoset.geometry.tolerances import UNSURE
from infoset.geometry.zonotope import Zonotope
from infoset.observer.sets import Motion, Set, polytope_of, sizes_of

EPSILON = float(np.finfo(np.float64).eps)
"""Twice the maximum relative rounding error of an operation."""
BLOCK = 25
"""Number of stages after which the state becomes an unknown of the program, so that long programs
stay sparse. Chosen: more than two windows of 10 steps, which need no such unknown. With 10 to 50
stages, the times of programs of 41 and 400 steps differ by at most 20 %."""
_OPTIONS = HIGHS | {"presolve": False}
"""Options of HiGHS. Presolving finds nothing in dense rows: without it, programs of 20 states take
half the time.
"""
_NO_ROW = 128.0 * UNSURE
"""Largest entry of a row, relative to the sum of the sizes of the products in it, up to which the
row counts as the rounding of a row of zeros: 512 spacings of floats, chosen.
"""


@dataclass(frozen=True, eq=False)
class Stage:
    """A step of one run: the constraints of its state, and the motion to the next step.

    Parameters
    ----------
    step : int
        Number of the step.
    prior : ConvexPolygons, Polytope or Zonotope
        Set that contains the state, before the strips. In a program only that of the first stage is
        a constraint; the others give the sizes of the states.
    normals, lower, upper : ndarray, shapes (r, n), (r,), (r,)
        Strips lower <= normal . x <= upper of the measurements, enlarged by their rounding errors.
    outputs : ndarray of int, shape (r,)
        Number of the output of each strip.
    motion : Motion or None
        Motion to the next step, of this run; None at the last one.
    """

    step: int
    prior: Set
    normals: Floats
    lower: Floats
    upper: Floats
    outputs: Integers
    motion: Motion | None = None

    @classmethod
    def at_first(cls, step: int, prior: Set) -> Stage:
        """Return a stage without measurements."""
        no_normal = np.zeros((0, len(sizes_of(prior))))
        no_end = np.zeros(0)
        return cls(step, prior, no_normal, no_end, no_end, np.zeros(0, dtype=np.int64))

    @cached_property
    def sizes(self) -> Floats:
        """Maximum sizes of the coordinates of the prior, shape (n,)."""
        return sizes_of(self.prior)

    def with_strips(
        self, normals: Floats, lower: Floats, upper: Floats, outputs: Integers
    ) -> Stage:
        """Return the stage with more strips."""
        return replace(
            self,
            normals=np.vstack([self.normals, normals]),
            lower=np.concatenate([self.lower, lower]),
            upper=np.concatenate([self.upper, upper]),
            outputs=np.concatenate([self.outputs, outputs]),
        )

    def first_strips(self, count: int) -> Stage:
        """Return the stage with its first strips, and without a motion."""
        return replace(
            self,
            normals=self.normals[:count],
            lower=self.lower[:count],
            upper=self.upper[:count],
            outputs=self.outputs[:count],
            motion=None,
        )


class _Rows(NamedTuple):
    """Strips of a stage in the program: their numbers, and the largest entries of their rows.

    The rows are divided by these entries.
    """

    strips: Integers
    largest: Floats


class _State(NamedTuple):
    """A state as offset + matrix u, where u are the unknowns from number `first` on."""

    offset: Floats
    matrix: Floats
    first: int


class _Table:
    """A sparse matrix that is written in dense blocks."""

    def __init__(self) -> None:
        self.rows = 0
        self._values = list[Floats]()
        self._row = list[Integers]()
        self._column = list[Integers]()

    def add(self, block: Floats, first: int, *, below: bool = True) -> None:
        """Write a block from column `first` on, in new rows below the others.

        If not `below`, it is written in the last len(block) rows. Zeros are not stored.
        """
        if below:
            self.rows += len(block)
        top = self.rows - len(block)
        row, column = np.nonzero(block)
        self._values.append(block[row, column])
        self._row.append(row + top)
        self._column.append(column + first)

    def matrix(self, columns: int) -> sp.csr_array:
        """Return the matrix."""
        none = np.zeros(0)
        values = np.concatenate([none, *self._values])
        row = np.concatenate([none, *self._row]).astype(np.int64)
        column = np.concatenate([none, *self._column]).astype(np.int64)
        return sp.csr_array((values, (row, column)), shape=(self.rows, columns))


class Program:
    """The motions through successive stages: bounds of a state, and whether there is a motion.

    The unknowns are coefficients of the generators of the first prior and of the disturbances (of a
    polytope: of its vertices, with the sum 1), and the states of every `BLOCK`-th stage. The solver
    only proposes multipliers of the strips. The result is a sum that is an upper bound for all
    multipliers, so that no result depends on the tolerances of the solver.

    Parameters
    ----------
    stages : sequence of Stage
        Stages; all but the last one have a motion.
    at : int
        Number of the stage whose state is bounded.
    """

    def __init__(self, stages: Sequence[Stage], at: int) -> None:
        self._stages = stages
        self._at = at
        self._states = len(stages[0].sizes)

    def bound(self, direction: Floats) -> float:
        """Return an upper bound of direction . x; inf if the solver finds none, also if there is no
        motion.
        """
        lines = self._lines
        goal = np.zeros(len(lines.limits))
        cost = direction @ lines.state.matrix
        goal[lines.state.first : lines.state.first + len(cost)] = -cost
        length = float(np.abs(cost).max(initial=0.0))
        # No unknown changes direction . x: the sum needs no multipliers.
        if length == 0.0:
            return self._sum(direction, np.zeros(len(lines.levels)))

        # The solver minimises: the goal is minus direction . x, in units of its largest entry.
        optimum = linprog(
            goal / length, None, None, lines.rows, lines.levels, lines.limits, options=_OPTIONS
        )
        if optimum.status != 0:
            return math.inf
        return self._sum(direction, -length * optimum.eqlin.marginals)

    def is_infeasible(self) -> bool:
        """Whether no motion agrees with the strips, proved by multipliers; False if not proved.

        They are the multipliers of the program of the least enlargements of the strips.
        """
        lines = self._lines
        count = sum(len(rows.strips) for rows in lines.strips)
        if not count:
            return False

        # An enlargement of each strip to both sides; their sum is minimised.
        enlarged = sp.eye_array(len(lines.levels), count)
        rows = sp.hstack([lines.rows, enlarged, -enlarged]).tocsr()
        goal = np.append(np.zeros(len(lines.limits)), np.ones(2 * count))
        limits = np.vstack([lines.limits, np.tile([0.0, np.inf], (2 * count, 1))])
        optimum = linprog(goal, None, None, rows, lines.levels, limits, options=_OPTIONS)
        if optimum.status != 0 or optimum.fun <= 0.0:
            return False
        # If there is a motion, the sum is an upper bound of 0 . x, which is 0.
        return self._sum(np.zeros(self._states), -optimum.eqlin.marginals) < 0.0

    def _sum(self, direction: Floats, marginals: Floats) -> float:
        """Return an upper bound of direction . x for any multipliers, by weak duality.

        `marginals` are multipliers of the rows of the program. The sum goes from the last stage to
        the first one:

        - p . x is at most (p - C' m) . x + m . ends for multipliers m of strips C,
        - p . (A x + s + w) is at most (A' p) . x + p . s + the height of W along p.

        At the stage of the state, its direction is added to p, the `costate`.

        Notes
        -----
        Each step begins with the rounded p, so that the errors of its operations are added, and not
        propagated. With X >= |x|, u = EPSILON / 2 and sums of k products, whose error is at most
        k u sum |product| in any order, up to u^2:

        - a motion: p . s, A' p and the height of W, a zonotope of g generators, have (n + g) u
          |p| . (|A| X + |s| + sizes of W). The parts have (2 n + 2 g + 16) u of it.
        - the direction d: u (|A' p| + |d|) . X. The part has 4 u |d| . X.
        - r strips: r u |m| . (|C| X + |ends|), and u (|p| + |C' m|) . X of the subtraction. The
          part has (2 r + 8) u |m| . (|C| X + |ends|).
        - the first prior: (n + g) u |p| . X. The part has (2 n + 2 g + 16) u of it.

        `fsum` rounds once, u of all terms. What a part has more than its own error, at least 2 u of
        its terms, pays the shares of |A' p| . X, |p| . X and `fsum`, and the rounding of the part.
        """
        multipliers = self._multipliers(marginals)
        parts = list[float]()
        costate = np.zeros(self._states)
        for k in range(len(self._stages) - 1, -1, -1):
            stage = self._stages[k]
            # The motion of the last stage leads out of the program (`Window.before`).
            motion = stage.motion if k < len(self._stages) - 1 else None
            if motion is not None:
                parts += self._parts_of_motion(motion, stage.sizes, costate)
                costate = costate @ motion.matrix
            if k == self._at:
                costate = costate + direction
                # 4 u, see Notes.
                parts.append(2.0 * EPSILON * float(np.abs(direction) @ stage.sizes))

            used = multipliers[k] != 0.0
            m = multipliers[k][used]
            ends = np.where(m > 0.0, stage.upper[used], stage.lower[used])
            normals = stage.normals[used]
            costate = costate - m @ normals
            parts.append(float(m @ ends))
            terms = np.abs(normals) @ stage.sizes + np.abs(ends)
            # (2 r + 8) u, see Notes.
            parts.append((len(m) + 4) * EPSILON * float(np.abs(m) @ terms))

        first = self._stages[0]
        # (2 n + 2 g + 16) u, see Notes.
        rounding = SUM_SLACK + (self._states + _count(first.prior)) * EPSILON
        parts.append(height_of(first.prior, costate))
        parts.append(rounding * float(np.abs(costate) @ first.sizes))
        return math.fsum(parts)

    def _parts_of_motion(self, motion: Motion, sizes: Floats, costate: Floats) -> list[float]:
        """Return p . s, the height of W along p, and their rounding, for the costate p.

        `sizes` are the maximum sizes of the coordinates of the state before the motion.
        """
        terms = motion.sums_of_terms(sizes)
        # (2 n + 2 g + 16) u, see Notes of `_sum`.
        rounding = SUM_SLACK + (self._states + _count(motion.disturbance)) * EPSILON
        return [
            float(costate @ motion.shifts[0]),
            height_of(motion.disturbance, costate),
            rounding * float(np.abs(costate) @ terms),
        ]

    def _multipliers(self, marginals: Floats) -> list[Floats]:
        """Return the multipliers of the strips of each stage, shape (r,), from the marginals.

        The marginals are multipliers of the rows of the program. Strips that are not in the program
        get zero.
        """
        multipliers = []
        start = 0
        for stage, rows in zip(self._stages, self._lines.strips, strict=True):
            end = start + len(rows.strips)
            m = np.zeros(len(stage.normals))
            m[rows.strips] = marginals[start:end] / rows.largest
            multipliers.append(m)
            start = end
        return multipliers

    @cached_property
    def _lines(self) -> _Lines:
        return _lines_of(self._stages, self._at)


class _Lines(NamedTuple):
    """A linear program: rows u = levels, with limits of each unknown u.

    The first rows are the `strips` of each stage; `state` is the state that is bounded.
    """

    rows: sp.csr_array
    levels: Floats
    limits: Floats
    strips: list[_Rows]
    state: _State


class _Builder:
    """A linear program that is written stage by stage."""

    def __init__(self) -> None:
        self.unknowns = 0
        self._limits = list[Floats]()
        self._equations = _Table()
        self._levels = list[Floats]()
        self._strips = _Table()
        self._ends = list[Floats]()
        self._rows = list[_Rows]()

    def add_unknowns(self, count: int, least: float, most: float) -> int:
        """Add unknowns between two limits; return the number of the first one."""
        first = self.unknowns
        self.unknowns += count
        self._limits.append(np.tile([least, most], (count, 1)))
        return first

    def add_set(self, shape: Set) -> _Generators:
        """Add the coefficients of a point of a set as unknowns; return its generators."""
        added = _generators(shape)
        count = len(added.generators)
        first = self.add_unknowns(count, 0.0 if added.is_convex else -1.0, 1.0)
        if added.is_convex:
            self._equations.add(np.ones((1, count)), first)
            self._levels.append(np.ones(1))
        return added

    def renamed(self, state: _State, sizes: Floats) -> _State:
        """Return a state whose coordinates are unknowns, in units of its `sizes`, 1 for a zero."""
        units = np.where(sizes > 0.0, sizes, 1.0)
        first = self.add_unknowns(len(units), -np.inf, np.inf)
        self._equations.add(-state.matrix / units[:, None], state.first)
        self._equations.add(np.eye(len(units)), first, below=False)
        self._levels.append(state.offset / units)
        return _State(np.zeros(len(units)), np.diag(units), first)

    def add_strips(self, stage: Stage, state: _State) -> None:
        """Add the rows of the strips of a stage, each divided by its largest entry.

        Rows that are only rounding are left out.
        """
        matrix = stage.normals @ state.matrix
        largest = np.abs(matrix).max(axis=1, initial=0.0)
        # A row of rounding errors would be a constraint on unknowns that do not enter it.
        used = np.flatnonzero(largest > _NO_ROW * (np.abs(stage.normals) @ stage.sizes))
        rows = _Rows(used, largest[used])
        self._rows.append(rows)
        self._strips.add(matrix[used] / rows.largest[:, None], state.first)

        heights = stage.normals @ state.offset
        ends = np.column_stack([stage.lower, stage.upper]) - heights[:, None]
        self._ends.append(ends[used] / rows.largest[:, None])

    def lines(self, state: _State) -> _Lines:
        """Return the program: normal . x of a strip is an unknown within its ends."""
        count = self._strips.rows
        strips = [self._strips.matrix(self.unknowns), -sp.eye_array(count)]
        equations = [self._equations.matrix(self.unknowns), None]
        rows = sp.block_array([strips, equations])
        levels = np.concatenate([np.zeros(count), *self._levels])
        limits = np.vstack([*self._limits, *self._ends])
        return _Lines(rows.tocsr(), levels, limits, self._rows, state)


def _lines_of(stages: Sequence[Stage], at: int) -> _Lines:
    """Return the program of stages, with the state of one of them."""
    program = _Builder()
    first = program.add_set(stages[0].prior)
    state = _State(first.centre, first.generators.T, 0)
    bounded = state
    for k, stage in enumerate(stages):
        if k > 0 and k % BLOCK == 0:
            state = program.renamed(state, stage.sizes)
        if k == at:
            bounded = state
        program.add_strips(stage, state)

        if k < len(stages) - 1:
            motion = stage.motion
            assert motion is not None
            w = program.add_set(motion.disturbance)
            offset = motion.matrix @ state.offset + motion.shifts[0] + w.centre
            matrix = np.hstack([motion.matrix @ state.matrix, w.generators.T])
            state = _State(offset, matrix, state.first)
    return program.lines(bounded)


class _Generators(NamedTuple):
    """A set as the sums of a centre and of generators times coefficients."""

    generators: Floats
    """Shape (g, n)."""
    centre: Floats
    is_convex: bool
    """Whether the coefficients are at least 0, with the sum 1; if not, they are from -1 to 1."""


def _generators(shape: Set) -> _Generators:
    if isinstance(shape, Zonotope):
        return _Generators(shape.generators, shape.centre, is_convex=False)
    vertices = polytope_of(shape).vertices
    return _Generators(vertices, np.zeros(vertices.shape[1]), is_convex=True)


def _count(shape: Set) -> int:
    """Return the number of generators in the sum of `height_of`; 0 for a set of vertices."""
    return len(shape.generators) if isinstance(shape, Zonotope) else 0


def height_of(shape: Set, direction: Floats) -> float:
    """Return the maximum of direction . x over a set."""
    if isinstance(shape, Zonotope):
        return float(direction @ shape.centre + np.abs(shape.generators @ direction).sum())
    return float((polytope_of(shape).vertices @ direction).max())
