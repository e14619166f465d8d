"""Passive safety: if the engines fail, the drift stays outside a ball about the target.

Theorem 8 of `docs/guaranteed-rendezvous.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Flags, Floats
from infoset.rendezvous.reachability.coasting import Coasting, CoastTube
from infoset.rendezvous.reachability.conic import NoSolutionError
from infoset.rendezvous.reachability.guaranteed import (
    MAX_ROUNDS,
    MIN_GAIN,
    NoRobustPlanError,
    PlanVariables,
    PlanWithRows,
    best_with_rows,
    is_broken,
    no_rows,
    plan_with_rows,
    row_sizes,
)
from infoset.rendezvous.reachability.motion import IMPULSE
from infoset.rendezvous.reachability.outputs import AffinePlan, OutputProblem, PathRows, joined
from infoset.rendezvous.reachability.sparse_program import (
    Affine,
    InfeasibleProgramError,
    SparseProgram,
    variable_sum,
)

_NORMAL_STEPS = 60
"""Steps towards the nearest point of a set; the last ones change a distance by less than 1 %."""
_MAX_CHECKS = 40
"""Maximum number of programs with the same normals: each one has more rows, larger
allowances or smaller caps. Chosen."""
_SPARE = 1e-6
"""Margin of the constraints in the program of the least violation, relative to their sizes. Chosen:
the second one of `guaranteed`; the plan is only where the search goes on."""
_CAP_RESERVE = 1e-3
"""Part of a limit that is added to a cap, because the solver cannot keep caps of nearly
zero; it makes an error of 3 % larger by 0.003 % of the limit."""
_AHEAD = 0.05
"""Part of the keep-out distance by which the least violation may be negative: it leaves room for
the bounds between instants, which change with the plan. Chosen."""


@dataclass(frozen=True, eq=False)
class PassiveSafety:
    """If the engines fail after an impulse, the drift stays outside a ball about the target.

    Parameters
    ----------
    coasting : Coasting
        The drifts: after which impulses the engines may fail, and for how long.
    keep_out_m : float
        Radius of the ball about the origin.
    """

    coasting: Coasting
    keep_out_m: float


@dataclass(frozen=True, eq=False)
class DriftCertificate:
    """Certain distances of all drifts from the target under a plan.

    Parameters
    ----------
    plan : AffinePlan
        The plan.
    tube : CoastTube
        The drifts under the plan with its errors.
    normals : ndarray, shape (K, N, 3)
        A unit vector for each interval of each drift. Any of them prove a distance.
    """

    plan: AffinePlan
    tube: CoastTube
    normals: Floats

    @cached_property
    def distances(self) -> Floats:
        """Lower bounds of the distance in each interval of each drift, m, shape (K, N)."""
        return self.tube.certain_distances(self.normals)

    @property
    def least_distance(self) -> float:
        """The certain distance from the target at all times of all drifts, m; 0 if there is none.

        The flight before a failure is part of the drifts. After the last impulse with a drift the
        flight is covered for the duration of a drift.
        """
        return max(0.0, float(self.distances.min()))


def drift_certificate(
    plan: AffinePlan, coasting: Coasting, normals: Floats | None = None
) -> DriftCertificate:
    """Return the certain distances of drifts, with the best normals that were found.

    If `normals`, shape (K, N, 3), are given, each is replaced only by one that proves more. The
    problem must have states in m and m/s in Hill's axes and impulses in m/s at the starts of the
    periods.

    Raises
    ------
    ValueError
        If there are more failures than impulses, or the intervals are too long for a bound.
    UnboundedCoastError
        If nonlinear motion is not proved to stay within any distance.
    """
    problem = plan.problem
    if coasting.impulses > problem.periods:
        raise ValueError(
            f"engines can fail after at most {problem.periods} impulses, found {coasting.impulses}"
        )
    tube = coasting.tube(plan)
    return DriftCertificate(plan, tube, _best_normals(tube, normals))


def _best_normals(tube: CoastTube, known: Floats | None) -> Floats:
    """Return unit vectors, (K, N, 3), with large certain distances, not smaller than the known."""
    centres = 0.5 * (tube.middles[:, :-1, :3] + tube.middles[:, 1:, :3])
    best = _unit(centres) if known is None else known
    values = tube.certain_distances(best)

    def offer(normals: Floats) -> None:
        found = tube.certain_distances(normals)
        better = found > values
        best_now = np.where(better[..., None], normals, best)
        best[...] = best_now
        values[...] = np.maximum(values, found)

    best = best.copy()
    if known is not None:
        offer(_unit(centres))
    # The axes, and the directions halfway between two or three of them.
    for corner in product((-1.0, 0.0, 1.0), repeat=3):
        if any(corner):
            offer(np.broadcast_to(_unit(np.array(corner)), best.shape))

    # Gilbert's method: towards the point of the set that is nearest to the origin.
    point = tube.nearest(best)
    for _ in range(_NORMAL_STEPS):
        change = tube.nearest(_unit(point)) - point
        square = np.einsum("kia,kia->ki", change, change)
        down = -np.einsum("kia,kia->ki", point, change)
        # The part of the change at which the distance from the origin is least.
        share = np.divide(down, square, out=np.zeros_like(down), where=square > 0.0)
        point = point + np.clip(share, 0.0, 1.0)[..., None] * change
        offer(_unit(point))
    return best


def _unit(vectors: Floats) -> Floats:
    """Return unit vectors; the first axis for zero."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    first = np.zeros(3)
    first[0] = 1.0
    safe = np.where(lengths > 0.0, lengths, 1.0)
    return np.where(lengths > 0.0, vectors / safe, first)


class UnsafeDriftsError(NoRobustPlanError):
    """No plan was found whose drifts are safe.

    Parameters
    ----------
    certificate : DriftCertificate
        Of the plan with the largest certain distance that was found.
    keep_out_m : float
        Radius of the ball that its drifts may enter.
    """

    def __init__(self, certificate: DriftCertificate, keep_out_m: float) -> None:
        coasting = certificate.tube.coasting
        distances = certificate.distances
        impulse, interval = np.unravel_index(distances.argmin(), distances.shape)
        # Intervals of a drift are counted from its impulse.
        begin_s = coasting.interval_s * interval
        self.certificate = certificate
        super().__init__(
            f"no plan was found whose drifts stay {keep_out_m:g} m from the target for all errors; "
            f"the largest certain distance that was found is {certificate.least_distance:.4g} m, "
            f"{begin_s:.5g} s to {begin_s + coasting.interval_s:.5g} s after the impulse at t = "
            f"{impulse} ({coasting.period_s * impulse:.6g} s); reduce the keep-out distance, the "
            "periods of drift or the errors"
        )


class _SafePlan(NamedTuple):
    """A certificate, and the constraints that its program had.

    They are intervals of the drifts, shape (K, N), and rows of the path, shape (k,).
    """

    certificate: DriftCertificate
    intervals: Flags
    path: Flags


class _Search(NamedTuple):
    """What is searched for: the arguments of `safe_plan`."""

    problem: OutputProblem
    safety: PassiveSafety
    window: int | None
    after_program: Callable[[], None]


def safe_plan(
    problem: OutputProblem,
    safety: PassiveSafety,
    window: int | None = None,
    after_program: Callable[[], None] = lambda: None,
) -> DriftCertificate:
    """Return the affine plan with the smallest guarantee that was found with safe drifts.

    The problem and the `window` are those of `affine_plan`, with states in m and m/s in Hill's axes
    and impulses in m/s. The plan's problem has the constraints of the drifts as further rows of the
    path. The normals of the constraints are those of the plan without safety at first, and are then
    renewed until the guarantee stays: the plan is a local optimum. Its distances are certificates.
    `after_program` is called after each plan with constraints on drifts.

    Raises
    ------
    UnsafeDriftsError
        If no safe plan was found.
    NoRobustPlanError, ValueError, NoSolutionError, UnboundedCoastError
        As in `affine_plan` and `drift_certificate`.
    """
    best = best_with_rows(problem, window, no_rows(problem))
    free = _at_own_caps(best.plan)
    certificate = drift_certificate(free, safety.coasting)
    if certificate.least_distance >= safety.keep_out_m:
        return certificate

    search = _Search(problem, safety, window, after_program)
    found = _first_safe(search, best._replace(plan=free))
    for _ in range(MAX_ROUNDS):
        guarantee = found.certificate.plan.guarantee
        # A safe plan is hardly better than the best one without safety.
        if guarantee <= (1.0 + MIN_GAIN) * free.guarantee:
            break
        better = _safe_with(search, found)
        if better is None or better.certificate.plan.guarantee >= guarantee:
            break
        found = better
        if guarantee - found.certificate.plan.guarantee <= MIN_GAIN * guarantee:
            break
    return found.certificate


def _at_own_caps(plan: AffinePlan) -> AffinePlan:
    """Return the plan with errors proportional to its own largest controls.

    No cap is larger than that of the plan's problem: the errors do not increase, and the plan still
    keeps all constraints.
    """
    problem = plan.problem
    if problem.relative_error is None or problem.caps is None:
        return plan
    limits = replace(problem, caps=None).limits
    caps = plan.control_ranges.largest + _CAP_RESERVE * limits
    return plan.under(replace(problem, caps=np.minimum(problem.caps, caps)))


def _first_safe(search: _Search, free: PlanWithRows) -> _SafePlan:
    """Return a safe plan, with normals of the plan without safety at first.

    Errors proportional to the controls are bounded at caps, which are constraints: those of the
    plan without safety may exclude the safe plans, and larger ones make the errors larger. The
    largest cap of each axis at all times is tried first: it was enough in the tests. Then come the
    smallest errors, those of the plan without safety, and the most room, the limits.
    """
    problem = search.problem
    safety = search.safety
    starts = [free.plan]
    if problem.relative_error is not None:
        own = free.plan.control_ranges.largest
        same = np.broadcast_to(own.max(axis=0), own.shape)
        starts = [
            free.plan.under(replace(problem, caps=caps)) for caps in (same, own, problem.limits)
        ]
    farthest = drift_certificate(free.plan, safety.coasting)
    path = free.entered
    for start in starts:
        certificate = drift_certificate(start, safety.coasting)
        found = _SafePlan(certificate, np.zeros(certificate.distances.shape, dtype=bool), path)
        farthest = _farther(farthest, certificate)
        for _ in range(MAX_ROUNDS):
            safe = _safe_with(search, found)
            if safe is not None:
                return safe
            least = found.certificate.distances.min()
            found = _least_violation(search, found)
            farthest = _farther(farthest, found.certificate)
            if found.certificate.distances.min() <= least + MIN_GAIN * safety.keep_out_m:
                break
    raise UnsafeDriftsError(farthest, safety.keep_out_m)


def _farther(one: DriftCertificate, other: DriftCertificate) -> DriftCertificate:
    """Return the certificate with the larger certain distance."""
    return other if other.distances.min() > one.distances.min() else one


def _safe_with(search: _Search, found: _SafePlan) -> _SafePlan | None:
    """Return the best plan with the normals of a certificate, or None if there is none.

    Errors proportional to the controls are first those at the caps of the certificate's plan, and
    then those at the caps of each safe plan.
    """
    problem = search.problem
    safety = search.safety
    caps = found.certificate.plan.problem.caps
    normals = found.certificate.normals
    extents = found.certificate.tube.extents(normals)
    sagittas = found.certificate.tube.sagittas
    ahead = (1.0 + _AHEAD) * safety.keep_out_m
    intervals = found.intervals | _lowest(found.certificate.distances, ahead)
    path = found.path
    best = None
    for _ in range(_MAX_CHECKS):
        rows = _rows(safety, normals, extents + sagittas[..., None], intervals)
        limited = replace(problem, caps=caps, path=joined(problem.path, rows))
        # The rows of the drifts are all in the program at once.
        known = np.concatenate([path, np.ones(len(rows.times), dtype=bool)])
        try:
            plan, entered = plan_with_rows(limited, search.window, known)
        except (NoRobustPlanError, NoSolutionError):
            return best
        search.after_program()
        path = entered[: len(path)]
        own = _at_own_caps(plan)
        tube = safety.coasting.tube(own)
        distances = tube.certain_distances(normals)
        if distances.min() < safety.keep_out_m:
            intervals = intervals | _lowest(distances, safety.keep_out_m)
            # The bounds between instants may be larger for the new plan: they are the next caps.
            extents = np.maximum(extents, tube.extents(normals))
            sagittas = np.maximum(sagittas, tube.sagittas)
            continue

        if best is not None and own.guarantee >= (1.0 - MIN_GAIN) * best.certificate.plan.guarantee:
            return best
        certificate = drift_certificate(own, safety.coasting, normals)
        best = _SafePlan(certificate, intervals, path)
        if problem.relative_error is None:
            return best
        caps = own.problem.caps
        extents = tube.extents(normals)
        sagittas = tube.sagittas
    return best


def _lowest(distances: Floats, below: float) -> Flags:
    """Return flags of the intervals in which the distance of a drift is least, if too small.

    They are local minima over the time of the drift.
    """
    ends = np.full((len(distances), 1), np.inf)
    around = np.hstack([ends, distances, ends])
    is_lowest = (distances <= around[:, :-2]) & (distances <= around[:, 2:])
    return np.asarray(is_lowest & (distances < below))


def _rows(safety: PassiveSafety, normals: Floats, allowances: Floats, entered: Flags) -> PathRows:
    """Return the constraints of x(k) and u(k) for both ends of some intervals.

    `allowances`, shape (K, N, 2), are what is subtracted from normal . position, in m.
    """
    transitions = safety.coasting.transitions
    drifts, intervals = np.nonzero(entered)
    chosen = normals[drifts, intervals]
    begin = np.einsum("ra,ran->rn", chosen, transitions[drifts, intervals, :3])
    end = np.einsum("ra,ran->rn", chosen, transitions[drifts, intervals + 1, :3])
    states = np.concatenate([begin, end])
    return PathRows(
        np.concatenate([drifts, drifts]),
        states,
        states @ IMPULSE,
        # All begins, then all ends, as in `states`.
        safety.keep_out_m + allowances[drifts, intervals].T.ravel(),
        np.full(len(states), np.inf),
    )


def _least_violation(search: _Search, found: _SafePlan) -> _SafePlan:
    """Return the plan whose drifts violate the constraints least, with renewed normals.

    It is `found` itself if no interval of it is near the ball.
    """
    problem = search.problem
    safety = search.safety
    certificate = found.certificate
    limited = replace(problem, caps=certificate.plan.problem.caps)
    known = certificate.tube
    allowances = known.extents(certificate.normals) + known.sagittas[..., None]
    aim = (1.0 + _AHEAD) * safety.keep_out_m
    intervals = found.intervals | _lowest(certificate.distances, aim)
    if not intervals.any():
        return found
    path = found.path
    while True:
        rows = _rows(safety, certificate.normals, allowances, intervals)
        plan, path = _plan_of_least_violation(
            limited, rows, search.window, path, -_AHEAD * safety.keep_out_m
        )
        search.after_program()
        violation = float((rows.lower - plan.ranges_of(rows).lower).max())
        tube = safety.coasting.tube(plan)
        distances = tube.certain_distances(certificate.normals)
        # The rows were for the bounds between instants of the certificate, not of this plan.
        distances = distances + tube.sagittas - known.sagittas
        reached = min(aim, safety.keep_out_m - violation)
        # `reached` is the distance that the intervals in the program have.
        new = _lowest(distances, reached - MIN_GAIN * safety.keep_out_m) & ~intervals
        if not new.any():
            renewed = drift_certificate(plan, safety.coasting, certificate.normals)
            return _SafePlan(renewed, intervals, path)
        intervals = intervals | new


def _plan_of_least_violation(
    problem: OutputProblem, rows: PathRows, window: int | None, known: Flags, least: float
) -> PlanWithRows:
    """Return the plan that minimises the largest violation of the lower ends of rows.

    The violation is `least`, which is negative, or more. The constraints of the problem enter as in
    `plan_with_rows`.
    """
    kept = problem.rows
    limits = len(kept.times) - len(known)
    # The limits of single controls come first, and are all in the program.
    entered = ~problem.is_on_path
    entered[limits:] |= known
    while True:
        program = SparseProgram()
        plan = PlanVariables(program, problem, window, problem.periods)
        violation = program.variables(1)
        less_violation = variable_sum(violation, -np.ones((1, 1)))
        program.keep(less_violation.plus(Affine(np.array([least]))))
        for k in range(len(rows.times)):
            middle, errors = plan.row(int(rows.times[k]), rows.states[k], rows.controls[k])
            under = middle.times(-1.0).plus(program.maxima(problem.errors, errors).below)
            program.keep(under.plus(Affine(rows.lower[k : k + 1])).plus(less_violation))

        inside = kept.chosen(entered)
        plan.keep_rows(inside, _SPARE * row_sizes(problem, inside))
        try:
            point = program.minimise(variable_sum(violation, np.ones((1, 1))))
        except InfeasibleProgramError as error:
            raise NoRobustPlanError("no plan keeps the constraints for all errors") from error
        found = plan.plan(point)
        broken = is_broken(found.row_ranges, kept)
        if not (broken & ~entered).any():
            return PlanWithRows(found, entered[limits:])
        entered = entered | broken
