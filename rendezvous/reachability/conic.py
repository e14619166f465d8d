"""Linear, quadratic and second-order cone programs, whose solutions are checked before they are returned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import clarabel
import numpy as np
from scipy.optimize import linprog
from scipy.sparse import csc_matrix, issparse, vstack

from infoset.polytope import HIGHS
from rendezvous._arrays import Floats

_GAP = 1e-10
_BROKEN, APART = 1e-9, 1e-8
"""The maximum violation of a constraint, and the maximum duality gap, of an answer; both relative."""
_FREE_FROM = {"equations": 0, "cone": 1}
"""The first multiplier of a constraint whose sign is free; the first of a cone is at least the norm of the others."""
STEADY: dict[str, float] = {"static_regularization_constant": 1e-7}
"""Regularisation for programs with cones: with the solver's default, 1e-8, the last iterations often diverge."""
_SETTINGS: tuple[dict[str, float], ...] = (
    {},
    STEADY,
    {**STEADY, "equilibrate_enable": False},
    *({"static_regularization_constant": shift, "equilibrate_enable": False} for shift in (1e-8, 3e-8, 1e-6)),
    *({"static_regularization_constant": shift} for shift in (1e-9, 1e-5, 1e-4)),
    {"static_regularization_constant": 1e-11, "dynamic_regularization_eps": 1e-15},
    {"max_step_fraction": 0.9, "iterative_refinement_max_iter": 50},
)
"""Settings that are tried in order. The defaults solve nearly all programs; for the rest no setting is always best."""


class NoSolutionError(ArithmeticError):
    """No solver returned a solution that satisfies the conditions of optimality."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """A solution of a program: the point, and the multipliers of its inequality rows (none negative)."""

    point: Floats
    multipliers: Floats


class ConeProgram:
    """Minimise v . matrix v / 2 + cost . v over rows, equations and second-order cones.

    `cost` has shape (p,); `matrix`, shape (p, p), is positive semidefinite, and zero where it is None. Rows with fewer
    than p columns do not depend on the last variables.
    """

    def __init__(self, cost: Floats, matrix: Floats | None = None) -> None:
        self.cost = cost
        self._matrix = csc_matrix((len(cost), len(cost))) if matrix is None else csc_matrix(matrix)
        self._added: list[tuple[str, Floats, Floats, object]] = []
        self._whole: tuple[Floats, Floats] | None = None

    def keep(self, rows: Floats, limits: Floats) -> ConeProgram:
        """Add rows v <= limits; the rows of a program that is only checked may be a sparse array."""
        return self._add("rows", rows, limits, clarabel.NonnegativeConeT(len(limits)))

    def meet(self, rows: Floats, levels: Floats) -> ConeProgram:
        """Add rows v = levels."""
        return self._add("equations", rows, levels, clarabel.ZeroConeT(len(rows)))

    def bound(self, response: Floats, free: Floats, top: Floats, height: float = 0.0) -> ConeProgram:
        """Add |free + response v| <= top . v + height."""
        block = np.vstack([-top[None, :], -self._widened(response)])
        return self._add("cone", block, np.concatenate([[height], free]), clarabel.SecondOrderConeT(len(block)))

    def _add(self, kind: str, block: Floats, ends: Floats, cone: object) -> ConeProgram:
        if len(ends):
            self._added.append((kind, self._widened(block), ends, cone))
            self._whole = None
        return self

    def _widened(self, rows: Floats) -> Floats:
        missing = len(self.cost) - rows.shape[1]
        return np.hstack([rows, np.zeros((len(rows), missing))]) if missing else rows

    def solve(self, max_gap: float = APART) -> Optimum:
        """Return a solution, by an interior-point method (Clarabel).

        Raise `NoSolutionError` if the answer fails the check of `need_solution` under all settings tried.
        """
        failed = NoSolutionError("a convex program was not solved")
        for point, multipliers in self.attempts():
            try:
                self.need_solution(point, multipliers, max_gap=max_gap)
            except NoSolutionError as error:
                failed = error
            else:
                return Optimum(point, self.of_rows(multipliers))
        raise failed

    def vertex(self) -> Floats:
        """Return a solution of a linear program, shape (p,): a vertex of its feasible set.

        The simplex method (HiGHS) finds it, in rows scaled to a maximum entry of one; its answer is checked. Where
        that fails, `solve` gives the point.
        """
        rows, limits = self._stacked("rows")
        equal, levels = self._stacked("equations")
        sizes = np.abs(rows).max(axis=1, initial=0.0)
        sizes[sizes == 0.0] = 1.0
        rows, limits = rows / sizes[:, None], limits / sizes
        scaled = ConeProgram(self.cost).meet(equal, levels).keep(rows, limits)
        equations = {"A_eq": equal, "b_eq": levels} if len(equal) else {}
        optimum = linprog(
            self.cost, A_ub=rows, b_ub=limits, bounds=(None, None), method="highs", options=HIGHS, **equations
        )
        if optimum.status == 0:
            point = np.asarray(optimum.x)
            try:
                scaled.need_solution(point, -np.concatenate([optimum.eqlin.marginals, optimum.ineqlin.marginals]))
            except NoSolutionError:
                pass
            else:
                return point
        return scaled.solve().point

    def need_solution(
        self, point: Floats, multipliers: Floats, cost: Floats | None = None, max_gap: float = APART
    ) -> None:
        """Check the conditions of optimality: see `broken_and_apart` for the arguments.

        Raise `NoSolutionError` if a constraint is broken by more than 1e-9, or the duality gap is over `max_gap`.
        """
        broken, apart = self.broken_and_apart(point, multipliers, cost)
        if broken <= _BROKEN and apart > max_gap:
            apart = self.broken_and_apart(point, self._balanced(point, multipliers, cost), cost)[1]
        if not (broken <= _BROKEN and apart <= max_gap):
            raise NoSolutionError(
                f"a convex program was not solved: the answer breaks a constraint by {max(broken, 0.0):.2g} and has a "
                f"duality gap of {apart:.2g}"
            )

    def attempts(self) -> Iterator[tuple[Floats, Floats]]:
        """Yield points and multipliers that the solver returns as solutions, unchecked."""
        for changes in _SETTINGS:
            solution = self.solver(**changes).solve()
            point, multipliers = np.array(solution.x), np.array(solution.z)
            if np.isfinite(point).all() and np.isfinite(multipliers).all():
                yield point, multipliers

    def solver(self, **changes: float) -> clarabel.DefaultSolver:
        """Return Clarabel's solver of the program, with some of its settings changed."""
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.presolve_enable = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = _GAP
        settings.max_threads = 1
        for name, value in changes.items():
            setattr(settings, name, value)
        upper = csc_matrix(np.triu(self._matrix.toarray())) if self._matrix.nnz else self._matrix
        rows, ends = self._all()
        cones = [cone for *_, cone in self._added]
        return clarabel.DefaultSolver(upper, self.cost, csc_matrix(rows), ends, cones, settings)

    def of_rows(self, multipliers: Floats) -> Floats:
        """Return the multipliers of inequality rows alone."""
        parts = [part for kind, part in self._parts(multipliers) if kind == "rows"]
        return np.asarray(np.maximum(np.concatenate([np.zeros(0), *parts]), 0.0), dtype=np.float64)

    def of_cones(self, multipliers: Floats) -> list[Floats]:
        """Return the multipliers of each second-order cone."""
        return [part for kind, part in self._parts(multipliers) if kind == "cone"]

    def broken_and_apart(self, point: Floats, multipliers: Floats, cost: Floats | None = None) -> tuple[float, float]:
        """Return the violation of the constraints at a point, and its duality gap; both relative.

        Multipliers, of all constraints in their order, are moved into the dual cone first. A `cost` is used in place of
        the program's. The gap is relative to the value, or to the change of the value that the allowed violation can
        cause. By weak duality no solution y is below - v . matrix v / 2 - multipliers . limits - |residual| . |y|; y is
        assumed to be at most twice as large as the point.
        """
        linear = self.cost if cost is None else cost
        rows, ends = self._all()
        dual, broken = [np.zeros(0)], 0.0
        for (kind, slack), (_, multiplier) in zip(
            self._parts(ends - rows @ point), self._parts(multipliers), strict=True
        ):
            part = multiplier.copy()
            if kind == "rows":
                broken = max(broken, float(-slack.min()))
                part = np.maximum(part, 0.0)
            elif kind == "equations":
                broken = max(broken, float(np.abs(slack).max()))
            else:
                broken = max(broken, float(np.linalg.norm(slack[1:]) - slack[0]))
                part[0] = max(part[0], float(np.linalg.norm(part[1:])))
            dual.append(part)
        held = np.concatenate(dual)
        turned = self._matrix @ point
        curved = 0.5 * float(point @ turned)
        residual = np.asarray(turned + linear + rows.T @ held, dtype=np.float64)
        size = 2.0 * max(1.0, float(np.abs(point).max(initial=0.0)))
        value = curved + float(linear @ point)
        bound = -curved - float(held @ ends) - size * float(np.abs(residual).sum())
        return broken, abs(value - bound) / max(1.0, abs(value), _BROKEN / APART * float(np.abs(held).sum()))

    def _balanced(self, point: Floats, multipliers: Floats, cost: Floats | None) -> Floats:
        """Return the multipliers with the smallest change that cancels the residual of the conditions of optimality.

        Only multipliers of free sign change. The residual counts times the size of the variables, so that one of the
        solver's tolerance can exceed the maximum gap; the change of the multipliers costs much less.
        """
        rows, _ = self._all()
        parts = self._parts(multipliers)
        free = np.concatenate([np.arange(len(part)) >= _FREE_FROM.get(kind, len(part)) for kind, part in parts])
        held = np.where(free, multipliers, np.maximum(multipliers, 0.0))
        if not free.any():
            return held
        residual = self._matrix @ point + (self.cost if cost is None else cost) + rows.T @ held
        held[free] -= np.linalg.lstsq(rows[free].T, residual, rcond=None)[0]
        return np.asarray(held)

    def _all(self) -> tuple[Floats, Floats]:
        if self._whole is None:
            self._whole = self._stacked()
        return self._whole

    def _stacked(self, wanted: str | None = None) -> tuple[Floats, Floats]:
        chosen = [(block, ends) for kind, block, ends, _ in self._added if wanted in (None, kind)]
        blocks = [np.zeros((0, len(self.cost))), *(block for block, _ in chosen)]
        rows = vstack(blocks, format="csr") if any(issparse(block) for block in blocks) else np.vstack(blocks)
        return rows, np.concatenate([np.zeros(0), *(ends for _, ends in chosen)])

    def _parts(self, values: Floats) -> Iterator[tuple[str, Floats]]:
        start = 0
        for kind, _, ends, _ in self._added:
            yield kind, values[start : start + len(ends)]
            start += len(ends)
