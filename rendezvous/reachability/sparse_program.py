"""Large linear programs, assembled from blocks, with maxima over a set of errors as terms."""

from __future__ import annotations

from typing import NamedTuple

import clarabel
import numpy as np
from scipy.sparse import csr_array

from infoset.rendezvous._arrays import Floats, Places
from infoset.rendezvous.reachability.conic import ConeProgram, NoSolutionError, SolverSettings
from infoset.rendezvous.reachability.outputs import ErrorSet

_ATTEMPTS = tuple(SolverSettings(constant, False) for constant in (1e-7, 3e-8, 1e-6))
"""Settings of the solver, tried in turn until one of them solves the program.

Programs of plans have more degenerate rows than the others: with 3e-8 alone the factorisation fails
for approach-cone with feedback, with 1e-7 it fails in no program of the tests. The other two are
reserves, one smaller and one greater, for rounding that differs between machines; both are chosen.
In the 323 other programs of the tests of plans each of them alone is enough; 1e-6, which is last,
is less accurate in three (measured)."""
_SOLVED = (clarabel.SolverStatus.Solved, clarabel.SolverStatus.AlmostSolved)
"""Statuses with a point. One that is less accurate is used too: certificates do not depend on
it."""
_INFEASIBLE = (
    clarabel.SolverStatus.PrimalInfeasible,
    clarabel.SolverStatus.AlmostPrimalInfeasible,
)


class InfeasibleProgramError(ArithmeticError):
    """The solver found that no point satisfies the constraints, to its tolerance."""


class Term(NamedTuple):
    """matrix v[columns] of the variables v; the shapes are (c,) and (k, c)."""

    columns: Places
    matrix: Floats


class Affine(NamedTuple):
    """The k affine functions constant + the sum of the terms; `constant` has the shape (k,)."""

    constant: Floats
    terms: tuple[Term, ...] = ()

    def plus(self, other: Affine) -> Affine:
        """Return the sum of two functions."""
        return Affine(self.constant + other.constant, self.terms + other.terms)

    def times(self, factor: float) -> Affine:
        """Return the functions times a factor."""
        terms = tuple(Term(term.columns, factor * term.matrix) for term in self.terms)
        return Affine(factor * self.constant, terms)

    def rows(self, chosen: Places) -> Affine:
        """Return some of the functions."""
        terms = tuple(Term(term.columns, term.matrix[chosen]) for term in self.terms)
        return Affine(self.constant[chosen], terms)


def variable_sum(columns: Places, matrix: Floats) -> Affine:
    """Return matrix v[columns], without a constant."""
    return Affine(np.zeros(len(matrix)), (Term(columns, matrix),))


class _Block(NamedTuple):
    """Entries of k rows of a sparse matrix, and the limits of the rows."""

    rows: Places
    columns: Places
    values: Floats
    limits: Floats


class Maxima(NamedTuple):
    """Upper bounds of max g . z and of max -g . z over the errors z, attained at an optimum."""

    above: Affine
    below: Affine


class SparseProgram:
    """Minimise a variable over affine functions that are at most zero, or zero."""

    def __init__(self) -> None:
        self._count = 0
        self._kept: list[_Block] = []
        self._met: list[_Block] = []

    def variables(self, *shape: int) -> Places:
        """Return the columns of new variables, of a shape."""
        size = int(np.prod(shape))
        columns = np.arange(self._count, self._count + size).reshape(shape)
        self._count += size
        return columns

    def keep(self, function: Affine) -> None:
        """Add function <= 0."""
        self._kept.append(_entries(function))

    def meet(self, function: Affine) -> None:
        """Add function = 0."""
        self._met.append(_entries(function))

    def maxima(self, errors: ErrorSet, rows: Affine) -> Maxima:
        """Return the maxima over all errors z of rows . z and of -rows . z (Theorem 1).

        `rows` has one function for each component of z. On a box the maximum is the sum of their
        absolute values, each of which is a new variable; on a polytope it is a linear program,
        replaced by its dual.
        """
        box = rows.rows(np.arange(errors.start_size, errors.size))
        # Functions without a variable need no new one: their sizes are known.
        varies = np.zeros(len(box.constant), dtype=bool)
        for term in box.terms:
            varies |= term.matrix.any(axis=1)
        fixed = np.abs(box.constant[~varies]).sum(keepdims=True)

        moving = box.rows(np.flatnonzero(varies))
        sizes = self.variables(len(moving.constant))
        less_sizes = variable_sum(sizes, -np.eye(len(sizes)))
        self.keep(moving.plus(less_sizes))
        self.keep(moving.times(-1.0).plus(less_sizes))
        total = variable_sum(sizes, np.ones((1, len(sizes)))).plus(Affine(fixed))
        if not errors.start_size:
            return Maxima(total, total)

        start = rows.rows(np.arange(errors.start_size))
        return Maxima(
            total.plus(self._maximum_on_polytope(errors, start)),
            total.plus(self._maximum_on_polytope(errors, start.times(-1.0))),
        )

    def _maximum_on_polytope(self, errors: ErrorSet, rows: Affine) -> Affine:
        """Return min offsets . l over l >= 0 with normals' l = rows."""
        multipliers = self.variables(len(errors.offsets))
        self.keep(variable_sum(multipliers, -np.eye(len(multipliers))))
        self.meet(rows.plus(variable_sum(multipliers, -errors.normals.T)))
        return variable_sum(multipliers, errors.offsets[None, :])

    def minimise(self, cost: Affine) -> Floats:
        """Return a point that minimises one function, to the tolerance of the solver.

        The point is not checked. Raise `InfeasibleProgramError` or `NoSolutionError`.
        """
        linear = np.zeros(self._count)
        for term in cost.terms:
            linear[term.columns] += term.matrix[0]
        program = ConeProgram(linear)
        program.meet(*self._stacked(self._met))
        program.keep(*self._stacked(self._kept))

        # A conflict that one setting finds is final: only other failures are tried again.
        for settings in _ATTEMPTS:
            solution = program.solver(settings).solve()
            if solution.status in _SOLVED:
                return np.array(solution.x)
            if solution.status in _INFEASIBLE:
                raise InfeasibleProgramError("the constraints of a linear program conflict")
        raise NoSolutionError(f"a linear program was not solved: {solution.status}")

    def _stacked(self, blocks: list[_Block]) -> tuple[csr_array, Floats]:
        """Return the rows of all blocks as one matrix, and their limits."""
        # Empty arrays come first: there may be no block.
        first = np.cumsum([0, *(len(block.limits) for block in blocks)])
        rows = [block.rows + start for block, start in zip(blocks, first[:-1], strict=True)]
        entries = (
            np.concatenate([np.zeros(0), *(block.values for block in blocks)]),
            (
                np.concatenate([np.zeros(0, dtype=np.int64), *rows]),
                np.concatenate([np.zeros(0, dtype=np.int64), *(block.columns for block in blocks)]),
            ),
        )
        limits = np.concatenate([np.zeros(0), *(block.limits for block in blocks)])
        return csr_array(entries, shape=(int(first[-1]), self._count)), limits


def _entries(function: Affine) -> _Block:
    """Return the block of function(v) <= 0 or = 0: its nonzero entries, and minus its constant."""
    rows = []
    columns = []
    values = []
    for term in function.terms:
        places = np.nonzero(term.matrix)
        rows.append(places[0])
        columns.append(term.columns[places[1]])
        values.append(term.matrix[places])
    return _Block(
        np.concatenate([np.zeros(0, dtype=np.int64), *rows]),
        np.concatenate([np.zeros(0, dtype=np.int64), *columns]),
        np.concatenate([np.zeros(0), *values]),
        -function.constant,
    )
