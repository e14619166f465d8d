"""The last control as an answer to all outputs, and what no strategy can guarantee.

Theorems 2 and 4 of `docs/guaranteed-rendezvous.md`: a guarantee if u(T - 1) is computed from all
outputs, and a lower bound of the guarantee of every strategy.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, combinations_with_replacement

import numpy as np

from infoset.rendezvous._arrays import Floats, Places
from infoset.rendezvous.reachability.conic import NoSolutionError
from infoset.rendezvous.reachability.guaranteed import (
    NoRobustPlanError,
    PlanVariables,
    is_broken,
    row_sizes,
)
from infoset.rendezvous.reachability.outputs import (
    AffinePlan,
    ErrorSet,
    OutputProblem,
    PathRows,
    Ranges,
)
from infoset.rendezvous.reachability.sparse_program import (
    Affine,
    InfeasibleProgramError,
    SparseProgram,
    variable_sum,
)

_SPARES = (1e-7, 1e-6, 1e-5)
"""As in `guaranteed`: margins of the constraints against the solver's errors, the smallest first,
because a margin makes the guarantee larger."""
_SINGULAR = 1e-12
"""Determinant of a basis, with columns of length one, below which the columns are dependent to
rounding: they do not define a vertex. Relative singular values and residuals below it are zero."""
_OUTSIDE = 1e-9
"""A basic solution with an entry below zero by less than this counts as a vertex: one more point
does not make a guarantee wrong, a missing one would."""
_SAME = 1e-12
"""Difference of entries up to which two bases give one vertex: rounding."""
_EQUAL_OUTPUTS = 1e-12
"""Difference of outputs up to which they are equal, relative to the largest sum of the absolute
terms over all errors: rounding."""


class LateConstraintError(ValueError):
    """A constraint of the path depends on a last control that answers all outputs."""

    def __init__(self) -> None:
        super().__init__(
            "constraints of the path depend on the last control, and do not follow from its limits "
            "and the guarantee"
        )


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Vertices of the set M of multipliers of Theorem 4, with limits of the last control.

    `weights`, shape (v, 2 k), are the multipliers of the rows goal and -goal; `costs`, shape (v,),
    the sums U . (s+ + s-), the part of the distance that the last control can remove.
    """

    weights: Floats
    costs: Floats


def multipliers(problem: OutputProblem) -> Multipliers:
    """Return the vertices of M = {mu, s >= 0: sum mu = 1, sum mu_i B' a_i = s+ - s-}.

    a_i are the rows of the goal and their opposites, B the matrix of the last control, whose
    unlimited components have no s. All bases are tried: at most C(2 k + 2 m, m + 1) of them.
    """
    rows = np.vstack([problem.goal, -problem.goal])
    pulls = rows @ problem.control[-1]
    limits = problem.limits[-1]
    limited = np.flatnonzero(np.isfinite(limits))
    unit = np.eye(problem.controls)[limited]

    # Columns are divided by the largest pull of each component, and s by it too.
    scale = np.abs(pulls).max(axis=0)
    scale[scale == 0.0] = 1.0
    # Columns of mu, s+ and s-.
    balance = np.vstack([pulls / scale, -unit, unit])
    is_weight = np.arange(len(balance)) < len(rows)
    columns = _independent(np.column_stack([is_weight, balance]))
    solutions = _basic_solutions(columns)

    scaled = solutions[:, len(rows) :].reshape(len(solutions), 2, len(limited)).sum(axis=1)
    costs = scaled @ (scale[limited] * limits[limited])
    return Multipliers(solutions[:, : len(rows)], costs)


def _independent(columns: Floats) -> Floats:
    """Return columns in coordinates of their span after the sum of weights, shape (c, 1 + rank)."""
    _, sizes, basis = np.linalg.svd(columns[:, 1:], full_matrices=False)
    # Relative to 1 at least: entries of the columns are at most 1 in size.
    rank = int((sizes > _SINGULAR * sizes.max(initial=1.0)).sum())
    return np.column_stack([columns[:, 0], columns[:, 1:] @ basis[:rank].T])


def _basic_solutions(columns: Floats) -> Floats:
    """Return all vertices of {x >= 0: columns' x = (1, 0, ..., 0)}, shape (v, c)."""
    count, size = columns.shape
    bases = np.array(list(combinations(range(count), size)))
    matrices = columns[bases].transpose(0, 2, 1)
    lengths = np.linalg.norm(matrices, axis=1)
    lengths[lengths == 0.0] = 1.0
    regular = np.abs(np.linalg.det(matrices / lengths[:, None, :])) > _SINGULAR

    ends = np.zeros((int(regular.sum()), size, 1))
    ends[:, 0] = 1.0
    entries = np.linalg.solve(matrices[regular], ends)[..., 0]
    inside = entries.min(axis=1) >= -_OUTSIDE
    solutions = np.zeros((int(inside.sum()), count))
    np.put_along_axis(solutions, bases[regular][inside], np.maximum(entries[inside], 0.0), axis=1)

    distinct = np.zeros((0, count))
    for solution in solutions:
        if not (np.abs(distinct - solution).max(axis=1, initial=0.0) <= _SAME).any():
            distinct = np.vstack([distinct, solution])
    return distinct


@dataclass(frozen=True, eq=False)
class _Vertex:
    """A vertex of M: a_i of its positive multipliers times them, shape (r, n), and its cost.

    `weights`, shape (k,), are the sums of the multipliers of a row of the goal and its opposite.
    """

    normals: Floats
    cost: float
    weights: Floats

    @property
    def direction(self) -> Floats:
        """The sum d of mu_i a_i, shape (n,)."""
        return np.asarray(self.normals.sum(axis=0))


def _vertices(problem: OutputProblem, *, one_of_two: bool) -> list[_Vertex]:
    """Return the vertices of M; only one of two opposite ones if `one_of_two`."""
    found = multipliers(problem)
    rows = np.vstack([problem.goal, -problem.goal])
    half = len(problem.goal)
    vertices = []
    kept = np.zeros((0, len(rows)))
    for weights, cost in zip(found.weights, found.costs, strict=True):
        # The multipliers of goal and of -goal change places.
        opposite = np.concatenate([weights[half:], weights[:half]])
        is_known = (np.abs(kept - opposite).max(axis=1, initial=0.0) <= _SAME).any()
        if one_of_two and is_known:
            continue
        kept = np.vstack([kept, weights])
        positive = np.flatnonzero(weights)
        normals = weights[positive, None] * rows[positive]
        vertices.append(_Vertex(normals, float(cost), weights[:half] + weights[half:]))
    return vertices


@dataclass(frozen=True, eq=False)
class AnsweredPlan:
    """Affine controls up to u(T - 2), and u(T - 1) as the best answer to all outputs (Theorem 4).

    The last control minimises the maximum of |x(T) - target| over all states that agree with the
    outputs. This set must be exact: with a larger set only the guarantee of an affine plan holds.
    `guided_flight` computes the control.

    Parameters
    ----------
    plan : AffinePlan
        The controls up to u(T - 2); its last control is zero.
    multipliers : tuple of ndarray, shapes (r - 1, T, q)
        Multipliers of equal outputs, costates, for each vertex of M that has r positive weights, in
        the order of `multipliers`; for only the first of two opposite vertices if the start is a
        zonotope. Any values give a valid guarantee.
    """

    plan: AffinePlan
    multipliers: tuple[Floats, ...]

    @cached_property
    def guarantee(self) -> float:
        """The maximum of |x(T) - target| over all errors, in units of the goal, by weak duality."""
        plan = self.plan
        problem = plan.problem
        errors = problem.errors
        apart = plan.nominal_states[-1] - problem.aim
        worst = 0.0
        both = errors.vertices is None
        vertices = _vertices(problem, one_of_two=both)
        for vertex, given in zip(vertices, self.multipliers, strict=True):
            effects = problem.effects_on(problem.periods, vertex.direction)
            # All multipliers add up to the effect of the outputs on d . x(T): the last one follows.
            last = np.einsum("tm,tsmq->sq", effects, plan.gains) - given.sum(axis=0)
            spread = 0.0
            for normal, multiplier in zip(vertex.normals, [*given, last], strict=True):
                along = normal @ problem.free_states[-1]
                along = along + np.einsum("sq,sqz->z", multiplier, problem.pure_outputs)
                spread += float(errors.maxima(along))
            middle = float(vertex.direction @ apart)
            if both:
                middle = abs(middle)
            worst = max(worst, middle + spread - vertex.cost)
        return worst


def answered_plan(problem: OutputProblem, window: int | None = None) -> AnsweredPlan:
    """Return the plan with the smallest guarantee if the last control answers all outputs.

    `window` and the errors are as for `affine_plan`, and errors proportional to the controls are
    bounded at the caps of the problem, such as the caps of an affine plan. Constraints of the path
    enter the linear program only when they are broken. Those that depend on the last control are
    not in it: they must follow from its limits and from the guarantee.

    Raises
    ------
    LateConstraintError
        If a constraint of the path that depends on the last control does not follow.
    NoRobustPlanError
        If no plan satisfies the constraints for all errors.
    NoSolutionError
        If the program was not solved.
    """
    rows = problem.rows
    acting = (rows.times == problem.periods - 1) & rows.controls.any(axis=1)
    late = acting | (rows.times == problem.periods)
    early = rows.chosen(~late)
    for spare in _SPARES:
        entered = ~problem.is_on_path[~late]
        while True:
            found = _solved(problem, window, early.chosen(entered), spare)
            broken = is_broken(found.plan.ranges_of(early), early)
            if not (broken & ~entered).any():
                break
            entered = entered | broken
        # Constraints in the program that are still broken need a larger margin.
        if broken.any():
            continue
        if not _follow(found, rows.chosen(late)):
            raise LateConstraintError
        return found
    raise NoSolutionError("the solver's plan breaks constraints, also with a margin of 1e-5")


def _follow(found: AnsweredPlan, rows: PathRows) -> bool:
    """Whether constraints hold for every last control within its limits, and the guarantee."""
    problem = found.plan.problem
    last = problem.periods - 1
    before = rows.chosen(rows.times == last)
    # A control that does not act may be unlimited, and 0 times infinity is no number.
    limits = np.where(before.controls == 0.0, 0.0, problem.limits[-1])
    push = (np.abs(before.controls) * limits).sum(axis=1)
    states = found.plan.ranges_of(before._replace(controls=np.zeros_like(before.controls)))
    with_push = Ranges(states.lower - push, states.upper + push)

    # A normal a = goal' c has |a . (x(T) - target)| <= guarantee sum |c_i|.
    at_end = rows.chosen(rows.times > last)
    shares = np.linalg.lstsq(problem.goal.T, at_end.states.T, rcond=None)[0].T
    apart = np.abs(shares @ problem.goal - at_end.states).max(axis=1, initial=0.0)
    is_bounded = apart <= _SINGULAR * np.abs(at_end.states).max(axis=1, initial=0.0)
    spread = np.where(is_bounded, found.guarantee * np.abs(shares).sum(axis=1), np.inf)
    middle = at_end.states @ problem.aim
    end = Ranges(middle - spread, middle + spread)
    return not (is_broken(with_push, before).any() or is_broken(end, at_end).any())


def _solved(
    problem: OutputProblem, window: int | None, rows: PathRows, spare: float
) -> AnsweredPlan:
    """Return the plan of the least guarantee that keeps `rows`, by one linear program (Theorem 4).

    Each vertex of M limits the guarantee; of a vertex and its opposite, one does so with both signs
    if the errors are symmetric (`both`).
    """
    program = SparseProgram()
    plan = PlanVariables(program, problem, window, problem.periods - 1)
    guarantee = program.variables(1)
    less_guarantee = variable_sum(guarantee, -np.ones((1, 1)))
    both = problem.errors.vertices is None
    columns = []
    for vertex in _vertices(problem, one_of_two=both):
        row = plan.row(problem.periods, vertex.direction, np.zeros(problem.controls))
        given = program.variables(len(vertex.normals) - 1, *problem.pure_outputs.shape[:2])
        columns.append(given)
        total = _maximum(program, plan, vertex, row.errors, given)
        apart = row.middle.plus(Affine(np.array([-vertex.direction @ problem.aim])))
        rest = total.plus(less_guarantee).plus(Affine(np.array([-vertex.cost])))
        program.keep(apart.plus(rest))
        if both:
            program.keep(apart.times(-1.0).plus(rest))

    plan.keep_rows(rows, spare * row_sizes(problem, rows))
    try:
        point = program.minimise(variable_sum(guarantee, np.ones((1, 1))))
    except InfeasibleProgramError as error:
        raise NoRobustPlanError("no plan keeps the constraints for all errors") from error
    return AnsweredPlan(plan.plan(point), tuple(point[given] for given in columns))


def _maximum(
    program: SparseProgram, plan: PlanVariables, vertex: _Vertex, errors: Affine, given: Places
) -> Affine:
    """Return the maximum over the errors z_i of a vertex that have equal outputs.

    `errors` is the dependence of d . x(T) on the errors. The multipliers of the equal outputs are
    `given` for all normals but the last one, and add up to the effect of the outputs on d . x(T).
    """
    problem = plan.problem
    free = vertex.normals @ problem.free_states[-1]
    outputs = problem.pure_outputs.reshape(-1, problem.errors.size).T

    total = Affine(np.zeros(1))
    last = errors.plus(Affine(-free[:-1].sum(axis=0)))
    for along, columns in zip(free[:-1], given, strict=True):
        one = Affine(along).plus(variable_sum(columns.ravel(), outputs))
        total = total.plus(program.maxima(problem.errors, one).above)
        last = last.plus(variable_sum(columns.ravel(), -outputs))
    return total.plus(program.maxima(problem.errors, last).above)


def last_answer(problem: OutputProblem) -> AffinePlan:
    """Return the best control of a problem of one period without a path.

    Its output is not used: the start is what outputs leave open. The maximum of |x(T) - target|
    over the start and the errors is a maximum of affine functions of the control, and is computed
    at all points where m + 1 of them or of the limits are equal. No solver is used.
    """
    resting = AffinePlan(
        problem,
        np.zeros((1, problem.controls)),
        np.zeros((1, 1, problem.controls, problem.output.shape[1])),
    )
    count = len(problem.goal)
    rows = PathRows(
        np.ones(count, dtype=np.int64),
        problem.goal,
        np.zeros((count, problem.controls)),
        np.full(count, -np.inf),
        np.full(count, np.inf),
    )
    ranges = resting.ranges_of(rows)
    aim = problem.goal @ problem.aim
    heights = np.concatenate([ranges.upper - aim, aim - ranges.lower])
    pulls = np.vstack([problem.goal, -problem.goal]) @ problem.control[0]

    # Rows of (u, tau): heights + pulls u <= tau, and the limits.
    limits = problem.limits[0]
    limited = np.flatnonzero(np.isfinite(limits))
    unit = np.eye(problem.controls)[limited]
    sides = np.vstack([pulls, unit, -unit])
    has_value = np.arange(len(sides)) < len(pulls)
    matrix = np.column_stack([sides, -1.0 * has_value])
    ends = np.concatenate([-heights, limits[limited], limits[limited]])
    # A row may be repeated: fewer rows decide if a control has no effect.
    bases = np.array(list(combinations_with_replacement(range(len(ends)), problem.controls + 1)))
    # The last component of a point is tau, which is computed again below.
    points = (np.linalg.pinv(matrix[bases]) @ ends[bases][..., None])[:, :-1, 0]

    # Points outside the limits are no optima; cut to them they are candidates as any other.
    controls = np.clip(points, -limits, limits)
    # Of all candidates the best is kept, so that one that is no vertex does no harm.
    worst = (heights + controls @ pulls.T).max(axis=1)
    return replace(resting, nominal=controls[[np.argmin(worst)]])


@dataclass(frozen=True, eq=False)
class MirrorBound:
    """A lower bound of the guarantee of every strategy (Theorem 2), with the errors that prove it.

    `value` is the bound, in units of the goal. `errors`, shape (r, size), are errors z_i of the
    problem with the `normals` alpha_i, shape (r, n): errors +-z_i are possible, and lead to equal
    outputs up to the time `last`.
    """

    value: float
    errors: Floats
    normals: Floats
    last: int


def information_radius(problem: OutputProblem) -> MirrorBound:
    """Return the bound (3) for k = T - 1: the radius of what outputs leave open at the end.

    It holds without limits of the controls too. The largest |E z| in the norm of the goal of errors
    z that all outputs do not show; one linear program for each row of the goal. A polytope as start
    is treated as in `lower_bound`.
    """
    certain = _certain(problem)
    bounds = _bounds_of_rows(certain, problem.periods - 1)
    return max(bounds, key=lambda bound: bound.value)


def lower_bound(problem: OutputProblem) -> MirrorBound:
    """Return the best bound (3) for k = T - 2: the last control sees one more output.

    One linear program for each row of the goal, and at most one for each vertex of M (a few dozen).
    The bound is 0, without errors, if no vertex gives more. Errors proportional to the
    controls are left out, because a strategy may avoid them. For a start that is a polytope, the
    bound is for its part that is symmetric about the centre.
    """
    certain = _certain(problem)
    last = problem.periods - 2
    # Without the equations after `last` the errors of each normal are independent: upper bounds.
    tops = np.array([bound.value for bound in _bounds_of_rows(certain, last)])
    vertices = _vertices(certain, one_of_two=True)
    uppers = np.array([vertex.weights @ tops - vertex.cost for vertex in vertices])

    best = MirrorBound(0.0, np.zeros((0, problem.errors.size)), np.zeros((0, problem.states)), last)
    for number in np.argsort(-uppers):
        if uppers[number] <= best.value:
            break
        bound = _bound_of_vertex(certain, vertices[number], last)
        if bound.value > best.value:
            best = bound
    return best


def _certain(problem: OutputProblem) -> OutputProblem:
    """Return the problem with the errors that every strategy suffers."""
    return replace(problem, caps=None)


def _bounds_of_rows(problem: OutputProblem, last: int) -> list[MirrorBound]:
    """Return the bounds of single rows of the goal, without later controls."""
    bounds = []
    for row, weights in zip(problem.goal, np.eye(len(problem.goal)), strict=True):
        bounds.append(_bound_of_vertex(problem, _Vertex(row[None, :], 0.0, weights), last))
    return bounds


def _bound_of_vertex(problem: OutputProblem, vertex: _Vertex, last: int) -> MirrorBound:
    points = _certified(problem, vertex, _hidden_errors(problem, vertex, last), last)
    along = np.einsum("in,nz,iz->", vertex.normals, problem.free_states[-1], points)
    return MirrorBound(float(along) - vertex.cost, points, vertex.normals, last)


def _hidden_errors(problem: OutputProblem, vertex: _Vertex, last: int) -> Floats:
    """Return the solver's errors z_i, shape (r, size), of the largest bound of a vertex."""
    program = SparseProgram()
    errors = problem.errors
    points = program.variables(len(vertex.normals), errors.size)
    for point in points:
        _keep_inside(program, errors, point)
    hidden, later = _outputs(problem, last)
    for point in points:
        program.meet(variable_sum(point, hidden))
    for point in points[1:]:
        same = variable_sum(point, later).plus(variable_sum(points[0], -later))
        program.meet(same)

    # The program minimises: the sum of alpha_i E z_i has the opposite sign.
    gain = -(vertex.normals @ problem.free_states[-1]).reshape(1, -1)
    return program.minimise(variable_sum(points.ravel(), gain))[points]


def _keep_inside(program: SparseProgram, errors: ErrorSet, point: Places) -> None:
    """Add +-z in Z."""
    box = point[errors.start_size :]
    unit = np.eye(len(box))
    for sign in (1.0, -1.0):
        program.keep(variable_sum(box, sign * unit).plus(Affine(-np.ones(len(box)))))
        start = variable_sum(point[: errors.start_size], sign * errors.normals)
        program.keep(start.plus(Affine(-errors.offsets)))


def _outputs(problem: OutputProblem, last: int) -> tuple[Floats, Floats]:
    """Return P up to the time `last`, and P after it, both as matrices."""
    outputs = problem.pure_outputs
    size = outputs.shape[2]
    return outputs[: last + 1].reshape(-1, size), outputs[last + 1 :].reshape(-1, size)


def _certified(problem: OutputProblem, vertex: _Vertex, points: Floats, last: int) -> Floats:
    """Return errors that satisfy the conditions of Theorem 2, near the solver's `points`.

    The smallest change makes the outputs equal; a common factor moves all errors inside Z. Raise
    `NoSolutionError` if the outputs differ by more than 1e-12 of the sum of the largest terms.
    """
    hidden, later = _outputs(problem, last)
    count = len(vertex.normals)
    differences = np.eye(count)[1:] - np.eye(count)[:1]
    equations = np.vstack([np.kron(np.eye(count), hidden), np.kron(differences, later)])
    flat = points.ravel()
    # The second step removes the rounding of the first.
    for _ in range(2):
        flat = flat - np.linalg.lstsq(equations, equations @ flat, rcond=None)[0]
    flat = flat / max(1.0, problem.errors.size_of(flat.reshape(points.shape)))

    largest = np.tile(problem.errors.sizes, count)
    rounding = _EQUAL_OUTPUTS * (np.abs(equations) @ largest)
    if not (np.abs(equations @ flat) <= rounding).all():
        raise NoSolutionError("errors with equal outputs were not found to rounding")
    return np.asarray(flat.reshape(points.shape))
