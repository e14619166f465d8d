"""Linear, quadratic and second-order cone programs, whose solutions are checked by duality before
they are returned.
"""

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

MAX_VIOLATION, MAX_GAP, CONE_TOLERANCE = 1e-9, 1e-8, 1e-7
"""The maximum violation of a constraint, and the maximum duality gap, of a solution, relative. The
third is both in a program with cones, where the solver does not always do better."""
_TOLERANCE = 1e-10


class SolverSettings(NamedTuple):
    """How Clarabel solves its linear systems: their regularisation, and whether the rows of cones
    are rescaled.
    """

    regularisation: float
    rescales_cones: bool


ATTEMPTS = (SolverSettings(3e-8, False), SolverSettings(1e-8, False), SolverSettings(3e-8, True))
"""Settings that are tried in turn until a solution passes the check.

Rounding, and so the machine, decides in which programs with cones the last iterations fail; each
setting fails in others. Of 300 random problems, half of them at the edge of feasibility, the first
alone leaves up to three without a solution and all together one. With rescaling, the solver's
default, some gaps are 3e-2 in place of 1e-7: rows are in units of their limits already. Programs
without cones are always rescaled."""


class NoSolutionError(ArithmeticError):
    """The solver's answer does not satisfy the conditions of optimality."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """A solution of a program: the point, and the multipliers of its inequality rows (none
    negative).
    """

    point: Floats
    multipliers: Floats


class ConeProgram:
    """Minimise v . matrix v / 2 + cost . v over rows, equations and second-order cones.

    `cost` has shape (p,); `matrix`, shape (p, p), is positive semidefinite, and zero where it is
    None. Rows with fewer than p columns do not depend on the last variables.
    """

    def __init__(self, cost: Floats, matrix: Floats | None = None) -> None:
        self.cost = cost
        self._matrix = csc_matrix((len(cost), len(cost))) if matrix is None else csc_matrix(matrix)
        self._added: list[tuple[str, Floats, Floats, object]] = []
        self._whole: tuple[Floats, Floats] | None = None

    def keep(self, rows: Floats, limits: Floats) -> ConeProgram:
        """Add rows v <= limits; the rows of a program that is only checked may be a sparse
        array.
        """
        return self._add("rows", rows, limits, clarabel.NonnegativeConeT(len(limits)))

    def meet(self, rows: Floats, levels: Floats) -> ConeProgram:
        """Add rows v = levels."""
        return self._add("equations", rows, levels, clarabel.ZeroConeT(len(rows)))

    def bound(
        self, response: Floats, free: Floats, top: Floats, height: float = 0.0
    ) -> ConeProgram:
        """Add |free + response v| <= top . v + height."""
        block = np.vstack([-top[None, :], -self._widened(response)])
        return self._add(
            "cone", block, np.concatenate([[height], free]), clarabel.SecondOrderConeT(len(block))
        )

    @property
    def _has_cones(self) -> bool:
        return any(kind == "cone" for kind, *_ in self._added)

    def _add(self, kind: str, block: Floats, ends: Floats, cone: object) -> ConeProgram:
        if len(ends):
            self._added.append((kind, self._widened(block), ends, cone))
            self._whole = None
        return self

    def _widened(self, rows: Floats) -> Floats:
        missing = len(self.cost) - rows.shape[1]
        return np.hstack([rows, np.zeros((len(rows), missing))]) if missing else rows

    def solve(self) -> Optimum:
        """Return a solution, by an interior-point method (Clarabel); raise `NoSolutionError` as
        `checked` does.
        """
        for settings in ATTEMPTS[:-1]:
            try:
                return self.checked(*self.answer(settings))
            except NoSolutionError:
                continue
        return self.checked(*self.answer(ATTEMPTS[-1]))

    def vertex(self) -> Floats:
        """Return a solution of a linear program, shape (p,): a vertex of its feasible set.

        The simplex method (HiGHS) finds it, in rows scaled to a maximum entry of one. Raise
        `NoSolutionError` as `checked` does.
        """
        rows, limits = self._stacked("rows")
        equal, levels = self._stacked("equations")
        sizes = np.abs(rows).max(axis=1, initial=0.0)
        sizes[sizes == 0.0] = 1.0
        rows = rows / sizes[:, None]
        limits = limits / sizes
        equations = {"A_eq": equal, "b_eq": levels} if len(equal) else {}
        optimum = linprog(
            self.cost,
            A_ub=rows,
            b_ub=limits,
            bounds=(None, None),
            method="highs",
            options=HIGHS,
            **equations,
        )
        if optimum.status != 0:
            raise NoSolutionError(f"a linear program was not solved: {optimum.message}")
        scaled = ConeProgram(self.cost).meet(equal, levels).keep(rows, limits)
        multipliers = -np.concatenate([optimum.eqlin.marginals, optimum.ineqlin.marginals])
        return scaled.checked(np.asarray(optimum.x), multipliers).point

    def checked(
        self,
        point: Floats,
        multipliers: Floats,
        cost: Floats | None = None,
        max_gap: float = MAX_GAP,
    ) -> Optimum:
        """Return an answer of a solver as a solution: see `violation_and_gap` for the arguments.

        Raise `NoSolutionError` if a constraint is violated by more than 1e-9, or the duality gap is
        over `max_gap`. In a program with cones both may be 1e-7.
        """
        max_violation = MAX_VIOLATION
        if self._has_cones:
            max_violation = CONE_TOLERANCE
            max_gap = max(CONE_TOLERANCE, max_gap)
        violation, gap = self.violation_and_gap(point, multipliers, cost)
        if violation <= max_violation and gap > max_gap:
            gap = self.violation_and_gap(point, self._balanced(point, multipliers, cost), cost)[1]
        if not (violation <= max_violation and gap <= max_gap):
            raise NoSolutionError(
                f"a convex program was not solved to {max_gap:g}: relative gap {gap:.2g}, "
                f"constraints violated by {max(violation, 0.0):.2g}"
            )
        parts = [part for kind, part in self.parts(multipliers) if kind == "rows"]
        return Optimum(point, np.maximum(np.concatenate([np.zeros(0), *parts]), 0.0))

    def answer(self, chosen: SolverSettings = ATTEMPTS[0]) -> tuple[Floats, Floats]:
        """Return the solver's point, and its multipliers of all constraints in their order,
        unchecked.
        """
        solution = self.solver(chosen).solve()
        return np.array(solution.x), np.array(solution.z)

    def solver(self, chosen: SolverSettings = ATTEMPTS[0]) -> clarabel.DefaultSolver:
        """Return Clarabel's solver of the program."""
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _TOLERANCE
        settings.static_regularization_constant = chosen.regularisation
        settings.equilibrate_enable = chosen.rescales_cones or not self._has_cones
        settings.max_threads = 1
        upper = csc_matrix(np.triu(self._matrix.toarray())) if self._matrix.nnz else self._matrix
        rows, ends = self._all()
        cones = [cone for *_, cone in self._added]
        return clarabel.DefaultSolver(upper, self.cost, csc_matrix(rows), ends, cones, settings)

    def violation_and_gap(
        self, point: Floats, multipliers: Floats, cost: Floats | None = None
    ) -> tuple[float, float]:
        """Return the violation of the constraints at a point, and its duality gap; both relative.

        Multipliers, of all constraints in their order, are moved into the dual cone first. A `cost`
        is used in place of the program's. The gap is relative to the value, or to the change of the
        value that the allowed violation can cause. By weak duality no solution y is below - v .
        matrix v / 2 - multipliers . limits - |residual| . |y|; y is assumed to be at most twice as
        large as the point.
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
        size = 2.0 * max(1.0, float(np.abs(point).max(initial=0.0)))
        value = curved + float(linear @ point)
        bound = -curved - float(held @ ends) - size * float(np.abs(residual).sum())
        scale = max(1.0, abs(value), MAX_VIOLATION / MAX_GAP * float(np.abs(held).sum()))
        return violation, abs(value - bound) / scale

    def _balanced(self, point: Floats, multipliers: Floats, cost: Floats | None) -> Floats:
        """Return the multipliers with the smallest change that cancels the residual of the
        conditions of optimality.

        Only multipliers of free sign and those of active rows change. The residual counts times the
        size of the variables, so that one of the solver's tolerance can exceed the maximum gap; the
        change of the multipliers costs much less.
        """
        rows, ends = self._all()
        free = []
        for (kind, slack), (_, part) in zip(
            self.parts(ends - rows @ point), self.parts(multipliers), strict=True
        ):
            free.append(
                part > slack if kind == "rows" else np.arange(len(part)) >= (kind == "cone")
            )
        moving = np.concatenate(free)
        held = np.where(moving, multipliers, np.maximum(multipliers, 0.0))
        if moving.any():
            residual = self._matrix @ point + (self.cost if cost is None else cost) + rows.T @ held
            held[moving] -= np.linalg.lstsq(rows[moving].T, residual, rcond=None)[0]
        return np.asarray(held)

    def _all(self) -> tuple[Floats, Floats]:
        if self._whole is None:
            self._whole = self._stacked()
        return self._whole

    def _stacked(self, wanted: str | None = None) -> tuple[Floats, Floats]:
        chosen = [(block, ends) for kind, block, ends, _ in self._added if wanted in (None, kind)]
        blocks = [np.zeros((0, len(self.cost))), *(block for block, _ in chosen)]
        rows = (
            vstack(blocks, format="csr")
            if any(issparse(block) for block in blocks)
            else np.vstack(blocks)
        )
        return rows, np.concatenate([np.zeros(0), *(ends for _, ends in chosen)])

    def parts(self, values: Floats) -> Iterator[tuple[str, Floats]]:
        """Yield the values of each constraint added, with its kind."""
        start = 0
        for kind, _, ends, _ in self._added:
            yield kind, values[start : start + len(ends)]
            start += len(ends)
