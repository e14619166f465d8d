"""Linear, quadratic and second-order cone programs, whose solutions are checked by duality."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import clarabel
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_matrix, issparse, vstack

from infoset.geometry.polytope import HIGHS
from infoset.rendezvous._arrays import Floats

MAX_VIOLATION = 1e-9
"""Maximum violation of a constraint by a solution, relative to the bounds: ten times the tolerance
of the solvers."""
MAX_GAP = 1e-8
"""Maximum duality gap of a solution, relative: the misses and costs of a report are printed with
fewer digits."""
CONE_TOLERANCE = 1e-7
"""Maximum violation and duality gap in a program with cones, where the solver does not always reach
the other two."""
_SOLVER_TOLERANCE = 1e-10
"""Tolerance at which Clarabel stops, relative: a tenth of `MAX_VIOLATION`."""
_SIZE_FACTOR = 2.0
"""Assumed maximum size of a solution, in sizes of the point that the solver found. The lower bound
by weak duality contains it (`violation_and_gap`). Chosen: with 16 the same programs are solved
(measured in test_conic and test_routes)."""


class SolverSettings(NamedTuple):
    """Settings of Clarabel's linear systems: regularisation, and rescaling of the rows of cones."""

    regularisation: float
    rescales_cones: bool


ATTEMPTS = (SolverSettings(3e-8, False), SolverSettings(1e-8, False), SolverSettings(3e-8, True))
"""Settings that are tried in turn until a solution passes the check.

Rounding, and so the machine, decides in which programs with cones the last iterations fail, and
each setting fails in other programs. Of 300 random problems, half of them at the edge of
feasibility, the first setting alone leaves up to three without a solution, and all settings leave
one. With rescaling, the solver's default, some gaps are 3e-2 in place of 1e-7, because rows are in
units of their limits already: it is tried last. The order of the other two is chosen. Programs
without cones are always rescaled."""


class NoSolutionError(ArithmeticError):
    """The solver's answer does not satisfy the conditions of optimality."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """A solution of a program: a point, and the multipliers of the inequality rows, at least 0."""

    point: Floats
    multipliers: Floats


class SolutionErrors(NamedTuple):
    """Violation of the constraints by a point, and its duality gap; both relative."""

    violation: float
    gap: float


class _Constraint(NamedTuple):
    """Slacks ends - rows v in a cone.

    `kind` is "rows" for slacks that are not negative, "equations" for zero, and "cone" for a
    second-order cone.
    """

    kind: str
    rows: Floats
    ends: Floats
    cone: object


class ConeProgram:
    """Minimise v . matrix v / 2 + cost . v over rows, equations and second-order cones.

    `cost` has shape (p,); `matrix`, shape (p, p), is positive semidefinite, and None for zero. Rows
    with fewer than p columns do not depend on the last variables.
    """

    def __init__(self, cost: Floats, matrix: Floats | None = None) -> None:
        self.cost = cost
        self._matrix = csc_matrix((len(cost), len(cost))) if matrix is None else csc_matrix(matrix)
        self._added: list[_Constraint] = []
        self._whole: tuple[Floats, Floats] | None = None

    def keep(self, rows: Floats, limits: Floats) -> ConeProgram:
        """Add rows v <= limits; rows may be a sparse array, with all columns."""
        return self._add("rows", rows, limits, clarabel.NonnegativeConeT(len(limits)))

    def meet(self, rows: Floats, levels: Floats) -> ConeProgram:
        """Add rows v = levels; rows may be a sparse array, with all columns."""
        return self._add("equations", rows, levels, clarabel.ZeroConeT(len(levels)))

    def bound(
        self, response: Floats, free: Floats, top: Floats, height: float = 0.0
    ) -> ConeProgram:
        """Add |free + response v| <= top . v + height."""
        # Slacks are ends - rows v: the height of the cone first, then the vector.
        block = np.vstack([-top[None, :], -self._widened(response)])
        ends = np.concatenate([[height], free])
        return self._add("cone", block, ends, clarabel.SecondOrderConeT(len(block)))

    @property
    def _has_cones(self) -> bool:
        return any(each.kind == "cone" for each in self._added)

    def _add(self, kind: str, rows: Floats, ends: Floats, cone: object) -> ConeProgram:
        if len(ends):
            self._added.append(_Constraint(kind, self._widened(rows), ends, cone))
            self._whole = None
        return self

    def _widened(self, rows: Floats) -> Floats:
        missing = len(self.cost) - rows.shape[1]
        if not missing:
            return rows
        return np.hstack([rows, np.zeros((len(rows), missing))])

    def solve(self) -> Optimum:
        """Return a solution by an interior-point method (Clarabel).

        Raise `NoSolutionError` as `checked` does.
        """
        for settings in ATTEMPTS[:-1]:
            try:
                return self.checked(*self.answer(settings))
            except NoSolutionError:
                continue
        return self.checked(*self.answer(ATTEMPTS[-1]))

    def vertex(self) -> Floats:
        """Return a solution of a linear program, shape (p,): a vertex of its feasible set.

        The program has no cones and no matrix. The simplex method (HiGHS) finds the solution, in
        rows scaled to a maximum entry of one. Raise
        `NoSolutionError` as `checked` does.
        """
        rows, limits = self._stacked("rows")
        equal, levels = self._stacked("equations")
        sizes = np.abs(rows).max(axis=1, initial=0.0)
        sizes[sizes == 0.0] = 1.0
        rows = rows / sizes[:, None]
        limits = limits / sizes

        optimum = linprog(
            self.cost,
            A_ub=rows,
            b_ub=limits,
            A_eq=equal if len(equal) else None,
            b_eq=levels if len(equal) else None,
            bounds=(None, None),
            method="highs",
            options=HIGHS,
        )
        if optimum.status != 0:
            raise NoSolutionError(f"a linear program was not solved: {optimum.message}")

        scaled = ConeProgram(self.cost).meet(equal, levels).keep(rows, limits)
        # Marginals are derivatives of the cost by the limits, and multipliers their opposites.
        multipliers = -np.concatenate([optimum.eqlin.marginals, optimum.ineqlin.marginals])
        return scaled.checked(np.asarray(optimum.x), multipliers).point

    def checked(
        self,
        point: Floats,
        multipliers: Floats,
        cost: Floats | None = None,
        max_gap: float = MAX_GAP,
    ) -> Optimum:
        """Return an answer of a solver as a solution, if it passes the check.

        The arguments are described in `violation_and_gap`. Raise `NoSolutionError` if a constraint
        is violated by more than 1e-9, or the duality gap is over `max_gap`. In a program with cones
        both may be 1e-7.
        """
        max_violation = MAX_VIOLATION
        if self._has_cones:
            max_violation = CONE_TOLERANCE
            max_gap = max(CONE_TOLERANCE, max_gap)

        violation, gap = self.violation_and_gap(point, multipliers, cost)
        if violation <= max_violation and gap > max_gap:
            # The point may be good enough, and only its multipliers not.
            balanced = self._balanced(point, multipliers, cost)
            _, gap = self.violation_and_gap(point, balanced, cost)
        if not (violation <= max_violation and gap <= max_gap):
            raise NoSolutionError(
                f"a convex program was not solved to {max_gap:g}: relative gap {gap:.2g}, "
                f"constraints violated by {violation:.2g}"
            )

        parts = [part for kind, part in self.parts(multipliers) if kind == "rows"]
        return Optimum(point, np.maximum(np.concatenate([np.zeros(0), *parts]), 0.0))

    def answer(self, chosen: SolverSettings = ATTEMPTS[0]) -> tuple[Floats, Floats]:
        """Return the point and the multipliers of all constraints from the solver, unchecked."""
        solution = self.solver(chosen).solve()
        return np.array(solution.x), np.array(solution.z)

    def solver(self, chosen: SolverSettings = ATTEMPTS[0]) -> clarabel.DefaultSolver:
        """Return Clarabel's solver of the program."""
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _SOLVER_TOLERANCE
        settings.static_regularization_constant = chosen.regularisation
        settings.equilibrate_enable = chosen.rescales_cones or not self._has_cones
        settings.max_threads = 1

        upper = csc_matrix(np.triu(self._matrix.toarray())) if self._matrix.nnz else self._matrix
        rows, ends = self._all()
        cones = [each.cone for each in self._added]
        return clarabel.DefaultSolver(upper, self.cost, csc_matrix(rows), ends, cones, settings)

    def violation_and_gap(
        self, point: Floats, multipliers: Floats, cost: Floats | None = None
    ) -> SolutionErrors:
        """Return the violation of the constraints at a point, and its duality gap.

        Multipliers, of all constraints in their order, are moved into the dual cone first. A `cost`
        replaces the cost of the program. The gap is relative to the largest of the value, the
        change of the value that the allowed violation can cause, and 1. By weak duality the value
        at a solution y is at least - v . matrix v / 2 - multipliers . limits - |residual| . |y|;
        the components of y are assumed to be at most twice the largest one of the point, or twice
        1.
        """
        linear = self.cost if cost is None else cost
        rows, ends = self._all()

        dual = [np.zeros(0)]
        violation = 0.0
        for (kind, slack), (_, multiplier) in zip(
            self.parts(ends - rows @ point), self.parts(multipliers), strict=True
        ):
            part = multiplier.copy()
            if kind == "rows":
                violation = max(violation, float(-slack.min()))
                part = np.maximum(part, 0.0)
            elif kind == "equations":
                violation = max(violation, float(np.abs(slack).max()))
            else:
                violation = max(violation, float(np.linalg.norm(slack[1:]) - slack[0]))
                part[0] = max(part[0], float(np.linalg.norm(part[1:])))
            dual.append(part)
        held = np.concatenate(dual)

        turned = self._matrix @ point
        curved = 0.5 * float(point @ turned)
        residual = np.asarray(turned + linear + rows.T @ held, dtype=np.float64)
        size = _SIZE_FACTOR * max(1.0, float(np.abs(point).max(initial=0.0)))
        value = curved + float(linear @ point)
        bound = -curved - float(held @ ends) - size * float(np.abs(residual).sum())
        scale = max(1.0, abs(value), MAX_VIOLATION / MAX_GAP * float(np.abs(held).sum()))
        return SolutionErrors(violation, abs(value - bound) / scale)

    def _balanced(self, point: Floats, multipliers: Floats, cost: Floats | None) -> Floats:
        """Return multipliers without a residual of the conditions of optimality, changed least.

        Multipliers of free sign and of active rows change. The gap contains the residual times the
        size of the variables, so that a residual of the solver's tolerance can exceed the maximum
        gap; the change of the multipliers costs much less.
        """
        linear = self.cost if cost is None else cost
        rows, ends = self._all()
        free = []
        for (kind, slack), (_, part) in zip(
            self.parts(ends - rows @ point), self.parts(multipliers), strict=True
        ):
            if kind == "rows":
                # A row is active if its multiplier is above its slack.
                free.append(part > slack)
            else:
                # The height of a cone follows from the vector, in `violation_and_gap`.
                first_free = 1 if kind == "cone" else 0
                free.append(np.arange(len(part)) >= first_free)
        moving = np.concatenate(free)

        held = np.where(moving, multipliers, np.maximum(multipliers, 0.0))
        if moving.any():
            residual = self._matrix @ point + linear + rows.T @ held
            held[moving] -= np.linalg.lstsq(rows[moving].T, residual, rcond=None)[0]
        return np.asarray(held)

    def _all(self) -> tuple[Floats, Floats]:
        if self._whole is None:
            self._whole = self._stacked()
        return self._whole

    def _stacked(self, wanted: str | None = None) -> tuple[Floats, Floats]:
        """Rows and ends of the constraints of a kind, or of all constraints."""
        chosen = [each for each in self._added if wanted in (None, each.kind)]
        blocks = [np.zeros((0, len(self.cost))), *(each.rows for each in chosen)]
        ends = np.concatenate([np.zeros(0), *(each.ends for each in chosen)])
        if any(issparse(block) for block in blocks):
            return vstack(blocks, format="csr"), ends
        return np.vstack(blocks), ends

    def parts(self, values: Floats) -> Iterator[tuple[str, Floats]]:
        """Yield the kind of each constraint, in the order added, and its part of some values."""
        start = 0
        for each in self._added:
            end = start + len(each.ends)
            yield each.kind, values[start:end]
            start = end
