"""What is computed for `infoset reach`, and its JSON; computing and writing only, nothing is drawn or printed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from experiments.common.errors import InputError
from experiments.reachability.file import KIND, Rendezvous
from infoset.polytope import EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError
from rendezvous.reachability import (
    MOST_PERIODS,
    EmptyTubeError,
    FeedbackPlan,
    Flight,
    NoRobustPlanError,
    Route,
    SetKind,
    Solution,
    TooLargeError,
    TooManyVerticesError,
    analytic_centre,
    chebyshev_centre,
    effort,
    feedback_plan,
    least_periods,
    minimum_energy,
    minimum_l1,
    minimum_norms,
    minimum_peak,
    replan,
    samples,
    solve,
    tightened,
    vertices,
)

Floats = NDArray[np.float64]
Progress = Callable[[float], None]

SINGLE = {
    "energy": minimum_energy,
    "l1": minimum_l1,
    "norms": minimum_norms,
    "peak": minimum_peak,
    "chebyshev": chebyshev_centre,
    "analytic": analytic_centre,
}
"""Choices that are one control each: least sum of squares, of absolute values, of Euclidean norms, and so on."""
VERTICES, SAMPLES = "vertices", "samples"
MOST_SAMPLES = 1000
POINTS = 24
"""Of a flight that is shown, a period."""
_LONGER = 4
_MOST_SHOWN, _ALIKE = 5, 1e-4


@dataclass(frozen=True, eq=False)
class Member:
    """An optimal control.

    Parameters
    ----------
    name : str
    controls : ndarray, shape (T, 3)
    linear, nonlinear : ndarray, shape (T + 1, 6)
        States of the model and of the truth.
    between : float
        Greatest excess over a constraint between the periods, on the linear motion, as a fraction of the bound; at
        most 0 where none is broken.
    """

    name: str
    controls: Floats
    linear: Floats
    nonlinear: Floats
    between: float


@dataclass(frozen=True, eq=False)
class Robustness:
    """What the unknown acceleration leaves.

    Parameters
    ----------
    fixed_miss : float or None
        The least norm of the state without disturbance, by controls that are safe without feedback; None if there are
        none.
    conflict : str or None
        Then why.
    plan : FeedbackPlan or None
        With feedback; None if there is none.
    refusal : str or None
        Then why.
    """

    fixed_miss: float | None
    conflict: str | None
    plan: FeedbackPlan | None
    refusal: str | None


@dataclass(frozen=True, eq=False)
class Report:
    """All that a run of `infoset reach` finds.

    Parameters
    ----------
    rendezvous : Rendezvous
    solution : Solution
    least_periods : int or None
    searched_periods : int
        How far the least number of periods was looked for.
    forward, tube : ndarray, shape (T + 1, 6, 2)
        Bounds.
    ranges : ndarray, shape (T, 3, 2)
        Of the controls.
    members : tuple of Member
    flight : Flight or None
        In closed loop.
    noisy : tuple of Flight
        The same with errors of navigation.
    robustness : Robustness or None
    elapsed_s : float
    """

    rendezvous: Rendezvous
    solution: Solution
    least_periods: int | None
    searched_periods: int
    forward: Floats
    tube: Floats
    ranges: Floats
    members: tuple[Member, ...]
    flight: Flight | None
    noisy: tuple[Flight, ...]
    robustness: Robustness | None
    elapsed_s: float

    @cached_property
    def shown(self) -> tuple[tuple[Member, Floats], ...]:
        """The first few members that differ from each other, each with its nonlinear flight, shape (points, 6)."""
        chosen: list[Member] = []
        for each in self.members:
            if all(np.abs(each.controls - other.controls).max() > _ALIKE for other in chosen):
                chosen.append(each)
        return tuple((each, self._flown(each)) for each in chosen[:_MOST_SHOWN])

    def _flown(self, member: Member) -> Floats:
        rendezvous = self.rendezvous
        push = rendezvous.acceleration_m_s2 * member.controls[None]
        path = rendezvous.truth.fly(rendezvous.problem.initial, push, rendezvous.period_s, POINTS)[0]
        return np.asarray(path)


def make_report(
    rendezvous: Rendezvous,
    selection: Sequence[str],
    *,
    sample_count: int = 0,
    seed: int = 0,
    route: Route | None = None,
    closed_loop: bool = False,
    noisy_flights: int = 0,
    progress: Progress = lambda _done: None,
) -> Report:
    """Solve a problem, choose members of its optimal controls and fly them.

    Parameters
    ----------
    rendezvous : Rendezvous
    selection : sequence of str
        Names of `SINGLE`, "vertices" or "samples".
    sample_count : int
    seed : int
    route : Route or None
    closed_loop : bool
    noisy_flights : int
        How many, where the problem has errors of navigation.
    progress : callable
        Told the fraction done.

    Returns
    -------
    Report

    Raises
    ------
    InputError
        If the constraints conflict, or what was asked for cannot be had.
    """
    try:
        return _report(
            rendezvous, selection, sample_count, seed, route, closed_loop, noisy_flights, perf_counter(), progress
        )
    except EmptyTubeError as error:
        raise InputError(_conflict(rendezvous, error)) from None
    except (TooLargeError, UncertainHullError) as error:
        raise InputError(f"--route exact: {error}; choose --route lifted") from None
    except (ArithmeticError, np.linalg.LinAlgError, EmptyPolytopeError, UnboundedPolytopeError) as error:
        raise InputError(
            f"{rendezvous.name}: could not be solved to its tolerance: {error}; check the units of the numbers, and "
            "that no constraint is within 1e-9 of its bound of having no solution"
        ) from None


def _report(
    rendezvous: Rendezvous,
    selection: Sequence[str],
    sample_count: int,
    seed: int,
    route: Route | None,
    closed_loop: bool,
    noisy_flights: int,
    began_s: float,
    progress: Progress,
) -> Report:
    solution = solve(rendezvous.problem, route)
    progress(0.2)
    searched = rendezvous.problem
    if solution.optimal.miss > 0.0:
        searched = rendezvous.lasting(min(_LONGER * searched.periods, MOST_PERIODS))
    least = least_periods(searched)
    progress(0.3)
    forward, tube = (solution.sets.bounds(kind) for kind in (SetKind.FORWARD, SetKind.TUBE))
    progress(0.5)
    ranges = solution.optimal.ranges()
    members = _members(rendezvous, solution, selection, sample_count, seed)
    progress(0.7)
    flight, noisy = None, []
    if closed_loop:
        flight = _fly(rendezvous, None)
        for run in range(noisy_flights if rendezvous.navigation_error is not None else 0):
            sequence = np.random.SeedSequence(entropy=seed, spawn_key=(run,))
            noisy.append(_fly(rendezvous, np.random.default_rng(sequence)))
            progress(0.7 + 0.2 * (run + 1) / noisy_flights)
    robustness = None if rendezvous.disturbance is None else _robustness(rendezvous)
    progress(1.0)
    elapsed_s = perf_counter() - began_s
    return Report(
        rendezvous,
        solution,
        least,
        searched.periods,
        forward,
        tube,
        ranges,
        members,
        flight,
        tuple(noisy),
        robustness,
        elapsed_s,
    )


def report_json(report: Report) -> dict[str, object]:
    """Return what a report says as values for JSON.

    Parameters
    ----------
    report : Report

    Returns
    -------
    dict
        Beside lists of states, misses and controls, which have no one unit, it has `units`.
    """
    from experiments.common.output import library_version

    solution = report.solution
    return {
        "version": library_version(),
        "kind": KIND,
        "problem": report.rendezvous.name,
        "problem_hash": report.rendezvous.hash,
        "units": {
            "period_s": report.rendezvous.period_s,
            "states": "x, y, z in m and their rates in m/s",
            "misses": "Euclidean norm of six components, in m and m/s",
            "controls": "parts of acceleration_m_s2, along x, y, z",
            "acceleration_m_s2": report.rendezvous.acceleration_m_s2,
        },
        "elapsed_s": report.elapsed_s,
        "route": solution.route.value,
        "route_reason": solution.reason,
        "optimal_miss": solution.optimal.miss,
        "optimal_dimension": solution.optimal.dimension,
        "least_periods": report.least_periods,
        "least_periods_searched": report.searched_periods,
        "sets": [
            {
                "period": t,
                "forward": _set_json(solution, SetKind.FORWARD, t, report.forward[t]),
                "tube": _set_json(solution, SetKind.TUBE, t, report.tube[t]),
            }
            for t in range(1, solution.problem.periods + 1)
        ],
        "controls": [_member_json(each) for each in report.members],
        "control_ranges": report.ranges.tolist(),
        "replan": None if report.flight is None else _flight_json(report),
        "robust": None if report.robustness is None else _robust_json(report.robustness),
    }


def _set_json(solution: Solution, kind: SetKind, time: int, bounds: Floats) -> dict[str, object]:
    counts = solution.sets.counts(kind, time)
    return {
        "min": bounds[:, 0].tolist(),
        "max": bounds[:, 1].tolist(),
        "vertices": None if counts is None else counts.vertices,
        "facets": None if counts is None else counts.facets,
        "dimension": None if counts is None else counts.dimension,
    }


def _member_json(member: Member) -> dict[str, object]:
    cost = effort(member.controls)
    return {
        "name": member.name,
        "u": member.controls.tolist(),
        "energy": cost.energy,
        "l1": cost.l1,
        "norms": cost.norms,
        "peak": cost.peak,
        "linear_end": member.linear[-1].tolist(),
        "nonlinear_end": member.nonlinear[-1].tolist(),
        "nonlinear_miss": float(np.linalg.norm(member.nonlinear[-1])),
        "between_periods_excess": member.between,
    }


def _flight_json(report: Report) -> dict[str, object]:
    flight = report.flight
    assert flight is not None
    misses = [each.miss for each in report.noisy]
    return {
        "miss": flight.miss,
        "end": flight.states[-1].tolist(),
        "u": flight.controls.tolist(),
        "expected_misses": flight.expected_misses.tolist(),
        "relaxations": flight.relaxations.tolist(),
        "noisy_misses": misses,
        "noisy_largest_relaxations": [float(each.relaxations.max()) for each in report.noisy],
    }


def _robust_json(found: Robustness) -> dict[str, object]:
    plan = found.plan
    return {
        "without_feedback": {"nominal_miss": found.fixed_miss, "conflict": found.conflict},
        "with_feedback": {
            "worst_miss": None if plan is None else plan.worst_miss,
            "conflict": found.refusal,
            "nominal_u": None if plan is None else plan.nominal.tolist(),
            "min": None if plan is None else plan.lower.tolist(),
            "max": None if plan is None else plan.upper.tolist(),
        },
    }


def _members(
    rendezvous: Rendezvous, solution: Solution, selection: Sequence[str], sample_count: int, seed: int
) -> tuple[Member, ...]:
    names: list[str] = []
    controls: list[Floats] = []
    for choice in selection:
        if choice in SINGLE:
            found = SINGLE[choice](solution.optimal)[None]
        elif choice == VERTICES:
            try:
                found = vertices(solution.optimal)
            except (TooManyVerticesError, UncertainHullError) as error:
                raise InputError(f"--select vertices: {error}; choose for example --select samples:20") from None
        else:
            found = samples(solution.optimal, sample_count, np.random.default_rng(seed))
        single = {VERTICES: "vertex", SAMPLES: "sample"}.get(choice)
        names += [choice] if single is None else [f"{single} {place + 1}" for place in range(len(found))]
        controls += [*found]
    if not controls:
        return ()
    return fly_members(rendezvous, names, np.array(controls))


def fly_members(rendezvous: Rendezvous, names: Sequence[str], controls: Floats) -> tuple[Member, ...]:
    """Fly controls on the model and on the truth.

    Parameters
    ----------
    rendezvous : Rendezvous
    names : sequence of str
    controls : ndarray, shape (k, T, 3)

    Returns
    -------
    tuple of Member
    """
    problem = rendezvous.problem
    linear = problem.run(controls)
    nonlinear = rendezvous.truth.fly(problem.initial, rendezvous.acceleration_m_s2 * controls, rendezvous.period_s)
    between = replace(problem, between=rendezvous.instants).excess(controls)
    return tuple(
        Member(*each)
        for each in zip(names, controls, linear, nonlinear, (float(each) for each in between), strict=True)
    )


def _fly(rendezvous: Rendezvous, generator: np.random.Generator | None) -> Flight:
    def truth(period: int, state: Floats, control: Floats) -> Floats:
        start_s = rendezvous.period_s * period
        push = rendezvous.acceleration_m_s2 * control
        return np.asarray(rendezvous.truth.paths(start_s, state, push, [start_s + rendezvous.period_s])[0, 0])

    def observe(_period: int, state: Floats) -> Floats:
        assert generator is not None
        assert rendezvous.navigation_error is not None
        return state + rendezvous.navigation_error * generator.uniform(-1.0, 1.0, 6)

    try:
        return replan(rendezvous.problem, truth, None if generator is None else observe)
    except ArithmeticError as error:
        raise InputError(f"--replan: {error}; reduce the errors of navigation, or leave --replan out") from None


def _robustness(rendezvous: Rendezvous) -> Robustness:
    assert rendezvous.disturbance is not None
    problem, disturbance = rendezvous.problem, rendezvous.disturbance
    fixed, conflict, plan, refusal = None, None, None, None
    try:
        fixed = solve(tightened(problem, disturbance), Route.LIFTED).optimal.miss
    except EmptyTubeError as error:
        conflict = str(error)
    try:
        plan = feedback_plan(problem, disturbance)
    except (NoRobustPlanError, ValueError) as error:
        refusal = str(error)
    return Robustness(fixed, conflict, plan, refusal)


def _conflict(rendezvous: Rendezvous, error: EmptyTubeError) -> str:
    bounds = rendezvous.problem.state_bounds
    by = f"bounds.position_m by {error.relaxation * bounds[:3].max():.6g} and bounds.velocity_m_s by "
    return (
        f"{rendezvous.name}: no control keeps the constraints: they conflict at t = {error.time} "
        f"({', '.join(error.names)}); relax all constraints on states by {100.0 * error.relaxation:.4g} % of their "
        f"bounds, that is {by}{error.relaxation * bounds[3:].max():.6g}, or begin elsewhere"
    )
