"""`infoset reach` for a rendezvous with bounded errors: what it can guarantee."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.screen import BeginProgress
from infoset.experiments.common.units import Unit
from infoset.experiments.reachability.command import Reach
from infoset.experiments.reachability.file import Rendezvous
from infoset.experiments.reachability.guarantee_flights import affine_flights, replanned_flights
from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous.reachability import (
    IMPULSE,
    Acceptance,
    AffinePlan,
    DriftCertificate,
    LateConstraintError,
    NonlinearPlan,
    NormFaces,
    NoRobustPlanError,
    NoSolutionError,
    OutputProblem,
    PassiveSafety,
    PlanFlights,
    ProblemPart,
    ReplannedFlights,
    ReplannedPart,
    ReplannedPlan,
    ThrustShape,
    UnboundedCoastError,
    UnsafeDriftsError,
    acting_controls,
    affine_plan,
    answers_within,
    drift_certificate,
    independent_parts,
    information_radius,
    keeps_distances,
    keeps_drifts,
    keeps_limits,
    lower_bound,
    nonlinear_plan,
    norm_faces,
    part_of_plan,
    plan_of_parts,
    plan_within,
    safe_plan,
    sighted_plan,
    whole_problem,
)

WINDOW = 4
"""Number of the last measurements that a control reacts to. In the table of
`docs/guaranteed-rendezvous.md` more give no smaller guarantee."""
_LAST_LIMIT = 2.0
"""Limit of the last control, as a multiple of its largest value in the affine plan, if constraints
after it do not follow from its own limit. Chosen: an answer is about as large as the affine
reaction."""
_NO_GAIN = 1e-5
"""Part of a guarantee that is not printed: five digits are."""
_NO_PLAN = (NoRobustPlanError, NoSolutionError, UnboundedCoastError)
"""Reasons why there is no plan: constraints, the solver, and no bound of nonlinear motion."""
_RELAXED = 10.0
"""Factor of the limit of thrust and of the bounds of states that shows whether one is the conflict;
chosen."""


@dataclass(frozen=True, eq=False)
class GuaranteeReport:
    """Results of one command; guarantees are in units of the goal's box.

    `open_loop` is the best plan without measurements, None if no such plan was found. If `plan`
    has feedback, `open_loop` is for linear motion and its drifts are not proved.
    `answered`, `bound` and `radius` are None without measured positions and for nonlinear motion;
    `answered` is also None if `refusal` says why there is none. `drifts` are the certain distances
    if the engines fail, None if the problem does not ask for them, and `replanned` are flights that
    are planned again, None without --replan.
    """

    rendezvous: Rendezvous
    plan: AffinePlan
    open_loop: AffinePlan | None
    answered: float | None
    refusal: str | None
    bound: float | None
    radius: float | None
    flights: PlanFlights
    drifts: DriftCertificate | None = None
    replanned: ReplannedFlights | None = None

    @cached_property
    def by_measurements(self) -> Floats:
        """The guarantees of affine plans that have only the first k = 0..T measurements.

        Element k is for k measurements, the last one is that of `plan`. NaN if none was found. The
        first access solves the problem for each k from 1 to T - 1.
        """
        problem = self.rendezvous.output_problem
        guarantees = [np.nan if self.open_loop is None else self.open_loop.guarantee]
        for count in range(1, problem.periods):
            try:
                shorter = first_measurements(problem, count)
                guarantees.append(best_plan(self.rendezvous, shorter).guarantee)
            except _NO_PLAN:
                guarantees.append(np.nan)
        return np.array([*guarantees, self.plan.guarantee])

    @property
    def thrust_faces(self) -> NormFaces | None:
        """The faces that replace a limit of thrust in norm; None if it is one of each axis."""
        if self.rendezvous.thrust is ThrustShape.BOX:
            return None
        # Of one acting control the limit in norm is that of its axis.
        acting = acting_controls(self.rendezvous.output_problem)
        return norm_faces(len(acting)) if len(acting) > 1 else None

    def tube(self, time: int, states: list[int]) -> Floats:
        """Return the vertices of the set of two states at a time for all errors, shape (k, 2)."""
        middle = self.plan.nominal_states[time, states]
        return Zonotope(middle, self.plan.state_columns[time][states].T).vertices

    @cached_property
    def path(self) -> Floats:
        """The states without errors at `path_times_s`, shape (points, 6)."""
        legs = []
        for t, control in enumerate(self.plan.nominal):
            state = self.plan.nominal_states[t]
            after = state
            if self.rendezvous.has_impulses:
                after = state + IMPULSE @ control
            inner = self.rendezvous.instants[t] @ np.concatenate([state, control])
            legs.append(np.vstack([state, after, inner]))
        return np.concatenate([*legs, self.plan.nominal_states[-1:]])

    @property
    def path_times_s(self) -> Floats:
        """The times of `path`: that of each control twice, then times within its period."""
        periods = self.plan.problem.periods
        # Without the end of the period, which is the start of the next one.
        inner = np.linspace(0.0, 1.0, self.rendezvous.instants.shape[1] + 2)[:-1]
        times = np.arange(periods)[:, None] + np.concatenate([[0.0], inner])
        return self.rendezvous.period_s * np.concatenate([times.ravel(), [periods]])

    @property
    def unit(self) -> Unit:
        """The unit of printed guarantees: m if the box of positions is a cube."""
        goal = self.rendezvous.goal
        assert goal is not None
        if np.ptp(goal.position_box_m) > 0.0:
            return "boxes", 1.0
        return "m", goal.position_box_m[0]

    @property
    def control_unit(self) -> Unit:
        """The unit of printed controls."""
        if self.rendezvous.has_impulses:
            return "m/s", 1.0
        return "m/s^2", self.rendezvous.unit_m_s2


def solve_guarantee(
    rendezvous: Rendezvous, options: Reach, begin: BeginProgress
) -> GuaranteeReport:
    """Return the certified plans, the bounds of all strategies, and the simulated flights."""
    _check_options(rendezvous, options)
    # The shares of the progress are chosen.
    progress = begin(rendezvous.name)
    problem = rendezvous.output_problem
    open_loop = None
    try:
        open_loop = best_plan(rendezvous, first_measurements(problem, 0))
    except _NO_PLAN as error:
        if not rendezvous.has_feedback:
            raise _refusal(rendezvous, error, progress) from None
    progress(0.1)
    answered, refusal, bound, radius = None, None, None, None
    if not rendezvous.has_feedback:
        assert open_loop is not None
        plan = open_loop
    else:
        try:
            plan = _feedback(rendezvous, problem)
        except _NO_PLAN as error:
            raise _refusal(rendezvous, error, progress) from None
        progress(0.3)
        if _bound_refusal(rendezvous) is None:
            # Parts at rest, on which no error acts, are left out: they end at their target.
            parts = [part.problem for part in independent_parts(problem)]
            bound = max((lower_bound(part).value for part in parts), default=0.0)
            radius = max((information_radius(part).value for part in parts), default=0.0)
        progress(0.4)
        answered, refusal = _answered(rendezvous, plan, bound)
        progress(0.5)
    progress(0.6)
    checked = _checked_plan(rendezvous, plan, progress)
    if not rendezvous.has_feedback:
        # The printed guarantee is that of the plan that is flown.
        open_loop = checked.plan
    progress(0.9)
    flights = affine_flights(rendezvous, checked.plan, options)
    progress(1.0)
    replanned = None
    if options.replan:
        before = _plan_in_flight(rendezvous, checked)
        replanned = replanned_flights(rendezvous, before, options, begin("flights"))
    return GuaranteeReport(
        rendezvous,
        checked.plan,
        open_loop,
        answered,
        refusal,
        bound,
        radius,
        flights,
        checked.drifts,
        replanned,
    )


class CheckedPlan(NamedTuple):
    """A plan, with what it proves beyond its problem: drifts, and distances of nonlinear motion."""

    plan: AffinePlan
    drifts: DriftCertificate | None = None
    nonlinear: NonlinearPlan | None = None


def _checked_plan(
    rendezvous: Rendezvous, plan: AffinePlan, progress: Callable[[float], None]
) -> CheckedPlan:
    """Return a plan whose drifts are safe and whose guarantee holds for nonlinear motion, as the
    problem asks; `plan` if it asks for neither.

    Raise `InputError` if none was found.
    """
    safety = rendezvous.passive_safety
    if safety is None and not rendezvous.nonlinear:
        return CheckedPlan(plan)
    drifts = rendezvous.drifts
    proved = list[DriftCertificate]()
    programs = itertools.count(1)

    def after_program() -> None:
        # From 60 % to 90 %, a tenth of the rest each: how many programs will follow is not known.
        progress(0.9 - 0.3 * 0.9 ** next(programs))

    def solve(problem: OutputProblem) -> AffinePlan:
        if safety is None:
            found = _feedback(rendezvous, problem)
            after_program()
            return found
        keep_out = PassiveSafety(drifts, safety.keep_out_m)

        def safe(each: OutputProblem) -> AffinePlan:
            certificate = safe_plan(each, keep_out, WINDOW, after_program)
            proved.append(certificate)
            return certificate.plan

        return _sighted(rendezvous, problem, lambda each: _within(rendezvous, each, safe))

    problem = rendezvous.output_problem
    # Plans with lines of sight have outputs of their own, which depend on the plan.
    if rendezvous.sight is None:
        # With the constraints that the plan needed already, but not with its caps.
        problem = replace(plan.problem, caps=None)
    found = None
    try:
        if rendezvous.nonlinear:
            found = nonlinear_plan(problem, drifts, solve)
            checked = found.plan
        else:
            checked = solve(problem)
    except UnsafeDriftsError as error:
        raise _unsafe(rendezvous, error) from None
    except (NoRobustPlanError, UnboundedCoastError) as error:
        raise InputError(f"{rendezvous.name}: {error}") from None
    if safety is None:
        return CheckedPlan(checked, None, found)
    # Its directions prove at least the distance of its constraints.
    normals = next((each.normals for each in proved if each.plan is checked), None)
    certificate = drift_certificate(checked, drifts, normals)
    return CheckedPlan(checked, certificate, found)


def _unsafe(rendezvous: Rendezvous, error: UnsafeDriftsError) -> InputError:
    """Return the error of drifts that no plan proves, with the values that one proves."""
    safety = rendezvous.passive_safety
    assert safety is not None
    certificate = error.certificate
    is_safe = certificate.distances >= safety.keep_out_m
    changes = []
    # Three digits, below the certain distance; 1e-3 only avoids the logarithm of zero.
    digits = 10.0 ** (math.floor(math.log10(max(certificate.least_distance, 1e-3))) - 2)
    distance_m = digits * math.floor(certificate.least_distance / digits)
    if distance_m > 0.0:
        changes.append(f"keep_out_m = {distance_m:g}")
    instants = certificate.tube.coasting.instants
    # The first period, and the first impulse, that are not safe: those before them are.
    by_period = is_safe.reshape(len(is_safe), -1, instants).all(axis=(0, 2))
    periods = int(by_period.argmin())
    if periods:
        changes.append(f"drift_periods = {periods}")
    impulses = int(is_safe.all(axis=1).argmin())
    if impulses:
        changes.append(f"until_period = {impulses - 1}")
    advice = ""
    if changes:
        advice = f"; the plan with this distance is safe with {' or '.join(changes)}"
    return InputError(f"{rendezvous.name}: passive_safety: {error}{advice}")


def _plan_in_flight(rendezvous: Rendezvous, checked: CheckedPlan) -> ReplannedPlan:
    """Return the plan before flights that are planned again, and what each new plan must prove."""
    plan = checked.plan
    parts = [
        ReplannedPart(part, part_of_plan(part, plan), _acceptance(rendezvous, checked, part))
        for part in _parts_in_flight(rendezvous, plan.problem)
    ]
    return ReplannedPlan(plan, parts, WINDOW)


def _parts_in_flight(rendezvous: Rendezvous, problem: OutputProblem) -> tuple[ProblemPart, ...]:
    """Return the parts of a problem that can be planned again apart.

    Constraints between impulses may depend on all states: the problem is then one part.
    """
    whole = (whole_problem(problem),)
    if rendezvous.couples_all_states:
        return whole
    parts = independent_parts(problem)
    limits = rendezvous.path_limits
    if limits is None:
        return parts
    # Apart are parts if no constraint acts on two of them.
    acting = [limits.normals[:, part.states].any(axis=1) for part in parts]
    are_apart = (np.sum(acting, axis=0) <= 1).all()
    return parts if are_apart else whole


def _acceptance(
    rendezvous: Rendezvous, checked: CheckedPlan, part: ProblemPart
) -> Acceptance | None:
    """Return what each new plan of a part must prove beyond the constraints of its program."""
    safety = rendezvous.passive_safety
    conditions = list[Acceptance]()
    if rendezvous.path_limits is not None:
        conditions.append(keeps_limits(rendezvous.path_limits, part))
    if checked.drifts is not None and safety is not None:
        conditions.append(keeps_drifts(checked.drifts, safety.keep_out_m))
    if checked.nonlinear is not None:
        conditions.append(keeps_distances(checked.nonlinear, rendezvous.drifts))
    if not conditions:
        return None

    def accepts(plan: AffinePlan, time: int) -> bool:
        return all(condition(plan, time) for condition in conditions)

    return accepts


def _check_options(rendezvous: Rendezvous, options: Reach) -> None:
    for option, given in (("--select", options.select), ("--backward", options.backward)):
        if given:
            raise InputError(f"{option}: is for problems without [sensor] and [initial_error]")
    if options.replan and rendezvous.sensor is None:
        raise InputError("--replan: needs [sensor]; without measurements the plan stays the same")


def first_measurements(problem: OutputProblem, count: int) -> OutputProblem:
    """Return the problem with the first `count` measurements only; the others are zero."""
    output = problem.output.copy()
    noise = problem.noise.copy()
    output[count:] = 0.0
    noise[count:] = 0.0
    return replace(problem, output=output, noise=noise)


def best_plan(rendezvous: Rendezvous, problem: OutputProblem) -> AffinePlan:
    """Return the best affine plan of a problem, which keeps the constraints at all times."""

    def solve(whole: OutputProblem) -> AffinePlan:
        parts = independent_parts(whole)
        return plan_of_parts(whole, [(part, affine_plan(part.problem, WINDOW)) for part in parts])

    return _within(rendezvous, problem, solve)


def _feedback(rendezvous: Rendezvous, problem: OutputProblem) -> AffinePlan:
    """Return the best affine plan of a problem with the sensor of a rendezvous."""
    return _sighted(rendezvous, problem, lambda each: best_plan(rendezvous, each))


def _sighted(
    rendezvous: Rendezvous, problem: OutputProblem, solve: Callable[[OutputProblem], AffinePlan]
) -> AffinePlan:
    """Return a plan with the outputs of a problem, or with measured directions and ranges."""
    sight = rendezvous.sight
    if sight is None or not rendezvous.has_feedback:
        return solve(problem)
    return sighted_plan(problem, sight, 3, solve)  # three components of a position


def _within(
    rendezvous: Rendezvous, problem: OutputProblem, solve: Callable[[OutputProblem], AffinePlan]
) -> AffinePlan:
    """Return a plan that keeps the constraints at all times, if there is a bound between them."""
    limits = rendezvous.path_limits
    return solve(problem) if limits is None else plan_within(problem, limits, solve)


def _bound_refusal(rendezvous: Rendezvous) -> str | None:
    """Return why there is neither a bound of all strategies nor an answer of the last control."""
    if rendezvous.nonlinear:
        return "only for linear motion"
    if rendezvous.sight is not None:
        return "only for measured positions"
    return None


def _answered(
    rendezvous: Rendezvous, plan: AffinePlan, bound: float | None
) -> tuple[float | None, str | None]:
    """Return the guarantee with a last control that answers all outputs, or why there is none.

    It is that of the affine plan if no strategy can guarantee less than `_NO_GAIN` below it: an
    affine reaction is one of the possible answers.
    """
    refusal = _bound_refusal(rendezvous)
    if refusal is not None:
        return None, refusal
    if rendezvous.passive_safety is not None:
        # The last control, and so the drift after it, is not known before the flight.
        return None, "not with [passive_safety]"
    if bound is not None and plan.guarantee <= bound * (1.0 + _NO_GAIN):
        return plan.guarantee, None
    return _best_answer(rendezvous, plan)


def _best_answer(rendezvous: Rendezvous, plan: AffinePlan) -> tuple[float | None, str | None]:
    """Return the smallest guarantee with an answer, or why there is none.

    If constraints after the last control do not follow from its limits, smaller limits are tried.
    The problem of a plan has the caps of errors that are proportional to controls.
    """
    refusal = ""
    problem = replace(rendezvous.output_problem, caps=plan.problem.caps)
    own = problem.limits.copy()
    if rendezvous.thrust is ThrustShape.BALL:
        # The limits of an answer are those of a box.
        own[-1] *= norm_faces(len(acting_controls(problem))).box
    smaller = own.copy()
    smaller[-1] = np.minimum(own[-1], _LAST_LIMIT * plan.control_ranges.largest[-1])
    for limits in (own, smaller):
        problem = replace(problem, control_limits=limits)
        try:
            answers = answers_within(problem, rendezvous.path_limits, WINDOW)
        except LateConstraintError as error:
            refusal = str(error)
        except NoRobustPlanError as error:
            return None, str(error)
        else:
            # The affine plan is one of the answers, and may be outside the limits of a box.
            found = max((answer.guarantee for answer in answers), default=0.0)
            return min(found, plan.guarantee), None
    return None, refusal


def _refusal(
    rendezvous: Rendezvous, error: Exception, progress: Callable[[float], None]
) -> Exception:
    """Return the error of a rendezvous without a plan, which says what to change."""
    if isinstance(error, NoRobustPlanError):
        return _conflict(rendezvous, progress)
    if isinstance(error, UnboundedCoastError):
        return InputError(f"{rendezvous.name}: {error}")
    # The command adds what to check if a program is not solved.
    return error


def _conflict(rendezvous: Rendezvous, progress: Callable[[float], None]) -> InputError:
    """Return the error of a rendezvous whose constraints no plan keeps, with what to change."""
    # The progress moves by half of the rest: how many constraints there are is not counted.
    found = []
    for done, (name, relaxed) in enumerate(_relaxations(rendezvous)):
        try:
            _feedback(relaxed, relaxed.output_problem)
        except _NO_PLAN:
            continue
        finally:
            progress(1.0 - 0.5 ** (done + 1))
        found.append(name)
    advice = "reduce the errors, or relax several constraints"
    if found:
        advice = f"relax {' or '.join(found)}, or reduce the errors"
    return InputError(
        f"{rendezvous.name}: no plan with affine feedback keeps the constraints for all errors; "
        f"{advice}"
    )


def _relaxations(rendezvous: Rendezvous) -> Iterator[tuple[str, Rendezvous]]:
    """Yield a constraint's name, and the rendezvous without it or with a limit `_RELAXED` as large.

    One constraint is relaxed at a time.
    """
    # A file refuses a larger limit that is no limit: it is not the conflict.
    with suppress(ValueError):
        yield _with_more_thrust(rendezvous)
    bounds = rendezvous.bounds
    for key in ("position_m", "velocity_m_s"):
        x, y, z = (_RELAXED * value for value in getattr(bounds, key))
        wider = replace(bounds, **{key: (x, y, z)})
        yield f"bounds.{key}", replace(rendezvous, bounds=wider)
    if rendezvous.cone is not None:
        yield "[cone]", replace(rendezvous, cone=None)
    for key in ("keep_in", "control_limits"):
        tables = getattr(rendezvous, key)
        for number in range(len(tables)):
            rest = tables[:number] + tables[number + 1 :]
            yield f"{key} #{number + 1}", replace(rendezvous, **{key: rest})


def _with_more_thrust(rendezvous: Rendezvous) -> tuple[str, Rendezvous]:
    """Return the key of the limit of thrust, and the rendezvous with a larger one."""
    if rendezvous.max_impulse_m_s is not None:
        x, y, z = (_RELAXED * value for value in rendezvous.max_impulse_m_s)
        return "max_impulse_m_s", replace(rendezvous, max_impulse_m_s=(x, y, z))
    larger_m_s2 = _RELAXED * rendezvous.unit_m_s2
    return "acceleration_m_s2", replace(rendezvous, acceleration_m_s2=larger_m_s2)


def guarantee_lines(report: GuaranteeReport) -> Iterator[str]:
    """Yield the certified guarantees, and the bound of all strategies, a line for each."""
    unit, factor = report.unit

    def line(title: str, value: float | None, note: str = "") -> str:
        number = "none" if value is None else f"{factor * value:.5g} {unit}"
        return f"{title:<29}{number:<10}  {note}".rstrip()

    rendezvous = report.rendezvous
    open_loop = None if report.open_loop is None else report.open_loop.guarantee
    yield line("without measurements", open_loop, _open_loop_note(report))
    if not rendezvous.has_feedback:
        if rendezvous.sensor is not None:
            yield line("affine feedback", None, "known only in flight: directions without ranges")
        yield from _further_lines(report)
        return
    yield line(
        "affine feedback",
        report.plan.guarantee,
        f"certified; a control reacts to the last {WINDOW} measurements",
    )
    noun = "impulse" if rendezvous.has_impulses else "control"
    yield line(f"last {noun} re-planned", report.answered, report.refusal or "certified")
    yield line("no strategy guarantees less", report.bound, _bound_refusal(rendezvous) or "")
    yield from _further_lines(report)


def _open_loop_note(report: GuaranteeReport) -> str:
    """Return for what the guarantee without measurements holds."""
    rendezvous = report.rendezvous
    if report.open_loop is None:
        return "no plan was found that keeps the constraints for all errors"
    note = "certified"
    if report.open_loop is report.plan:
        return note
    if rendezvous.nonlinear:
        note += " for linear motion"
    if rendezvous.passive_safety is not None:
        note += ", without [passive_safety]"
    return note


def _plan_name(rendezvous: Rendezvous) -> str:
    """Return what the plan of a report is called in texts."""
    return "affine feedback" if rendezvous.has_feedback else "the plan without measurements"


def constraint_times(rendezvous: Rendezvous) -> str:
    """Return the times at which the constraints on states hold for all errors."""
    if rendezvous.path_limits is not None:
        return "at all times"
    times = f"at t = 0..{rendezvous.periods}"
    if rendezvous.has_impulses:
        times += ", before and after each impulse"
    if rendezvous.checks_between_periods:
        times += f", and at {rendezvous.checks_between_periods} instants within each period"
    return times


def _further_lines(report: GuaranteeReport) -> Iterator[str]:
    """Yield what else is certain: for which motion, and what happens if the engines fail."""
    rendezvous = report.rendezvous
    faces = report.thrust_faces
    if faces is not None:
        yield (
            f"thrust in norm: {len(faces.normals)} faces inside the ball lose at most "
            f"{100.0 * faces.loss:.2g} % of the limit"
        )
    yield f"constraints hold for all errors {constraint_times(rendezvous)}"
    if rendezvous.nonlinear:
        yield f"{_plan_name(rendezvous)} and its ranges hold for the motion about a central body"
    if report.drifts is None or rendezvous.passive_safety is None:
        return
    safety = rendezvous.passive_safety
    yield (
        f"engines failing after any impulse until t = {rendezvous.drifts.impulses - 1}: at least "
        f"{report.drifts.least_distance:.4g} m from the target for {safety.drift_periods} periods "
        f"(keep-out {safety.keep_out_m:g} m)"
    )


def flight_lines(report: GuaranteeReport) -> Iterator[str]:
    """Yield the numbers of flights outside their guarantee, and how near to it the worst one came.

    There is no line without flights.
    """
    motion = " about a central body" if report.rendezvous.nonlinear else ""
    bounds = "half of them with errors at their bounds"
    flights = report.flights
    name = _plan_name(report.rendezvous)
    if len(flights.distances):
        # A guarantee of zero has no shares.
        share = flights.distances.max() / report.plan.guarantee if report.plan.guarantee else 0.0
        yield (
            f"{len(flights.distances)} flights of {name}{motion}, {bounds}: "
            f"{flights.outside} outside, worst {100.0 * share:.0f} % of the guarantee"
        )
    replanned = report.replanned
    if replanned is not None and len(replanned.distances):
        unit, factor = report.unit
        last = factor * replanned.guarantees[:, -1]
        noun = "impulse" if report.rendezvous.has_impulses else "control"
        yield (
            f"{len(last)} flights re-planned in flight{motion}, {bounds}: {replanned.outside} "
            f"outside, guarantee at the last {noun}: median {np.median(last):.4g}, largest "
            f"{last.max():.4g} {unit}"
        )
