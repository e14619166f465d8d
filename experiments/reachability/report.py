"""Results of `infoset reach`: their computation, and their JSON."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from time import perf_counter

import numpy as np

from experiments.common.display_units import Unit, length_unit
from experiments.common.errors import InputError
from experiments.common.hill_axes import AXES
from experiments.common.output import CONTROL_COLUMNS, STATE_COLUMNS, Cell, trajectories_csv
from experiments.common.problems import head
from experiments.reachability.file import Rendezvous
from infoset.arrays import Floats
from infoset.polytope import EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError
from rendezvous.reachability import (
    EmptyTubeError,
    FeedbackPlan,
    Flight,
    NonlinearMotion,
    NoRobustPlanError,
    Route,
    SetKind,
    Solution,
    ThrustShape,
    TooLargeError,
    TooManyVerticesError,
    analytic_centre,
    chebyshev_centre,
    effort,
    feedback_plan,
    min_periods,
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

Progress = Callable[[float], None]

SINGLE = {
    "energy": minimum_energy,
    "l1": minimum_l1,
    "norms": minimum_norms,
    "peak": minimum_peak,
    "chebyshev": chebyshev_centre,
    "analytic": analytic_centre,
}
"""Selections of one control each: minimum sum of squares, of absolute values, of Euclidean norms, and so on."""
VERTICES, SAMPLES = "vertices", "samples"
MAX_SAMPLES = 1000
POINTS = 24
"""Points of a displayed trajectory per period."""
_MAX_SHOWN, _ALIKE = 5, 1e-4


@dataclass(frozen=True)
class Request:
    """What is computed for a problem.

    `selection` contains names of `SINGLE`, "vertices" or "samples". No `route` lets `solve` choose it. `noisy_flights`
    is the number of simulations in closed loop with navigation errors, if the problem has them.
    """

    selection: Sequence[str]
    samples: int = 0
    seed: int = 0
    route: Route | None = None
    closed_loop: bool = False
    noisy_flights: int = 0


@dataclass(frozen=True, eq=False)
class Member:
    """An optimal control, and the states, shape (T + 1, 6), of the linear and of the nonlinear model.

    `between` is the largest violation of a constraint between the periods by the linear model, as a fraction of the
    bound; at most 0 if there is none.
    """

    name: str
    controls: Floats
    linear: Floats
    nonlinear: Floats
    between: float

    @property
    def nonlinear_miss(self) -> float:
        """Return the terminal norm of the nonlinear model."""
        return float(np.linalg.norm(self.nonlinear[-1]))


@dataclass(frozen=True, eq=False)
class Robustness:
    """Plans under the unknown acceleration.

    `fixed_miss` is the minimum terminal norm without disturbance, by controls that keep the constraints without
    feedback, and `plan` the plan with feedback. If there is none, `conflict` and `refusal` are the reasons.
    """

    fixed_miss: float | None
    conflict: str | None
    plan: FeedbackPlan | None
    refusal: str | None


@dataclass(frozen=True, eq=False)
class Report:
    """Results of one command.

    `min_periods` is the minimum number of periods, up to `searched_periods`, in which the terminal norm is zero.
    `forward` and `tube`, shape (T + 1, 6, 2), are bounds of the sets, `ranges`, shape (T, 3, 2), those of the optimal
    controls. `flight` is the simulation in closed loop, `noisy` are those with navigation errors.
    """

    rendezvous: Rendezvous
    solution: Solution
    min_periods: int | None
    searched_periods: int
    forward: Floats
    tube: Floats
    ranges: Floats
    members: tuple[Member, ...]
    flight: Flight | None
    noisy: tuple[Flight, ...]
    robustness: Robustness | None
    elapsed_s: float

    @property
    def length_unit(self) -> Unit:
        """Return the unit in which positions are shown."""
        return length_unit(float(np.abs(self.tube[:, :3]).max()))

    @cached_property
    def shown(self) -> tuple[tuple[Member, Floats], ...]:
        """Return the first few different members, each with its nonlinear trajectory, shape (points, 6)."""
        chosen: list[Member] = []
        for member in self.members:
            if all(np.abs(member.controls - other.controls).max() > _ALIKE for other in chosen):
                chosen.append(member)
        return tuple((member, self._trajectory(member)) for member in chosen[:_MAX_SHOWN])

    def _trajectory(self, member: Member) -> Floats:
        rendezvous = self.rendezvous
        push = rendezvous.acceleration_m_s2 * member.controls[None]
        return np.asarray(rendezvous.truth.fly(rendezvous.problem.initial, push, rendezvous.period_s, POINTS)[0])


def make_report(rendezvous: Rendezvous, request: Request, progress: Progress = lambda _done: None) -> Report:
    """Solve a problem, select optimal controls and simulate them; ``progress`` receives the fraction done.

    Raise `InputError` if the constraints conflict, or a request is impossible.
    """
    try:
        return _report(rendezvous, request, progress)
    except EmptyTubeError as error:
        raise InputError(_conflict(rendezvous, error)) from None
    except (TooLargeError, UncertainHullError) as error:
        raise InputError(f"--route exact: {error}; choose --route lifted") from None
    except (ArithmeticError, np.linalg.LinAlgError, EmptyPolytopeError, UnboundedPolytopeError) as error:
        raise InputError(
            f"{rendezvous.name}: could not be solved to its tolerance: {error}; check the units of the numbers, and "
            "relax constraints that are within 1e-9 of being impossible"
        ) from None


def _report(rendezvous: Rendezvous, request: Request, progress: Progress) -> Report:
    began_s = perf_counter()
    solution = solve(rendezvous.problem, request.route)
    progress(0.2)
    searched = rendezvous.problem if solution.optimal.miss == 0.0 else rendezvous.longer
    minimum = min_periods(searched)
    progress(0.3)
    forward, tube = (solution.sets.bounds(kind) for kind in (SetKind.FORWARD, SetKind.TUBE))
    progress(0.5)
    ranges = solution.optimal.ranges()
    members = _members(rendezvous, solution, request)
    progress(0.7)
    flight, noisy = None, []
    if request.closed_loop:
        flight = _fly(rendezvous, None)
        for run in range(request.noisy_flights if rendezvous.navigation_error is not None else 0):
            sequence = np.random.SeedSequence(entropy=request.seed, spawn_key=(run,))
            noisy.append(_fly(rendezvous, np.random.default_rng(sequence)))
            progress(0.7 + 0.2 * (run + 1) / request.noisy_flights)
    effect = rendezvous.disturbance_effect
    robustness = None if effect is None else _robustness(rendezvous, effect)
    progress(1.0)
    return Report(
        rendezvous,
        solution,
        minimum,
        searched.periods,
        forward,
        tube,
        ranges,
        members,
        flight,
        tuple(noisy),
        robustness,
        elapsed_s=perf_counter() - began_s,
    )


def _members(rendezvous: Rendezvous, solution: Solution, request: Request) -> tuple[Member, ...]:
    controls: dict[str, Floats] = {}
    for name in request.selection:
        if name in SINGLE:
            controls[name] = SINGLE[name](solution.optimal)
        elif name == VERTICES:
            try:
                several = vertices(solution.optimal)
            except (TooManyVerticesError, UncertainHullError) as error:
                raise InputError(f"--select vertices: {error}; choose for example --select samples:20") from None
            controls |= {f"vertex {number}": control for number, control in enumerate(several, start=1)}
        else:
            several = samples(solution.optimal, request.samples, np.random.default_rng(request.seed))
            controls |= {f"sample {number}": control for number, control in enumerate(several, start=1)}
    return fly_members(rendezvous, [*controls], np.array([*controls.values()])) if controls else ()


def fly_members(
    rendezvous: Rendezvous, names: Sequence[str], controls: Floats, truth: NonlinearMotion | None = None
) -> tuple[Member, ...]:
    """Simulate controls, shape (k, T, 3), on the linear and on the nonlinear model; `truth` replaces the latter."""
    problem = rendezvous.problem
    linear = problem.run(controls)
    pushes = rendezvous.acceleration_m_s2 * controls
    nonlinear = (truth or rendezvous.truth).fly(problem.initial, pushes, rendezvous.period_s)
    between = replace(problem, between=rendezvous.instants).excess(controls)
    rows = zip(names, controls, linear, nonlinear, between.tolist(), strict=True)
    return tuple(Member(*row) for row in rows)


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
        raise InputError(f"--replan: {error}; reduce the navigation errors, or omit --replan") from None


def _robustness(rendezvous: Rendezvous, disturbance: Floats) -> Robustness:
    problem = rendezvous.problem
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
    position, velocity = error.relaxation * bounds[:3].max(), error.relaxation * bounds[3:].max()
    return (
        f"{rendezvous.name}: no control keeps the constraints: they conflict at t = {error.time} "
        f"({', '.join(error.names)}); relax all constraints on states by {100.0 * error.relaxation:.4g} % of their "
        f"bounds, that is bounds.position_m by {position:.6g} and bounds.velocity_m_s by {velocity:.6g}, or change the "
        "initial state"
    )


def delta_v(rendezvous: Rendezvous, controls: Floats) -> dict[str, float]:
    """Return the Delta-v of controls, shape (T, 3), in m/s: the sum, and that along each axis.

    The sum is over the axes, each of which has an engine; for thrust in a ball, with one engine, it is over the norms.
    """
    pushes = rendezvous.acceleration_m_s2 * rendezvous.period_s * controls
    axes = np.abs(pushes).sum(axis=0)
    ball = rendezvous.problem.thrust is ThrustShape.BALL
    total = np.linalg.norm(pushes, axis=1).sum() if ball else axes.sum()
    return {"sum": float(total), **dict(zip("xyz", axes.tolist(), strict=True))}


def trajectories(report: Report) -> str:
    """Return the trajectories of the selected controls on both models, as CSV; a control is held over its period."""
    rendezvous = report.rendezvous
    periods = np.arange(rendezvous.problem.periods + 1)
    tracks: list[tuple[list[Cell], Floats]] = []
    for member in report.members:
        controls = np.vstack([rendezvous.acceleration_m_s2 * member.controls, np.full(3, np.nan)])
        for model, states in (("linear", member.linear), ("nonlinear", member.nonlinear)):
            values = np.column_stack([periods * rendezvous.period_s, states, controls])
            tracks.append(([member.name, model], values))
    return trajectories_csv(["control", "model"], ["time_s", *STATE_COLUMNS, *CONTROL_COLUMNS], tracks)


def report_json(report: Report) -> dict[str, object]:
    """Return the results for `experiments.common.output.to_json`; key ``units`` has the units of the states."""
    solution, rendezvous = report.solution, report.rendezvous
    return {
        **head(rendezvous),
        "kind": rendezvous.kind,
        "units": {
            "period_s": rendezvous.period_s,
            "axes": AXES,
            "states": "x, y, z in m and their rates in m/s",
            "misses": "Euclidean norm of six components, in m and m/s",
            "controls": "parts of acceleration_m_s2, along x, y, z",
            "acceleration_m_s2": rendezvous.acceleration_m_s2,
        },
        "elapsed_s": report.elapsed_s,
        "route": solution.route,
        "route_reason": solution.reason,
        "optimal_miss": solution.optimal.miss,
        "optimal_dimension": solution.optimal.dimension,
        "min_periods": report.min_periods,
        "min_periods_searched": report.searched_periods,
        "sets": [
            {
                "period": t,
                "forward": _set_json(solution, SetKind.FORWARD, t, report.forward[t]),
                "tube": _set_json(solution, SetKind.TUBE, t, report.tube[t]),
            }
            for t in range(1, solution.problem.periods + 1)
        ],
        "controls": [_member_json(report.rendezvous, member) for member in report.members],
        "control_ranges": report.ranges,
        "replan": None if report.flight is None else _flight_json(report.rendezvous, report.flight, report.noisy),
        "robust": None if report.robustness is None else _robust_json(report.robustness),
    }


def _set_json(solution: Solution, kind: SetKind, time: int, bounds: Floats) -> dict[str, object]:
    counts = solution.sets.counts(kind, time)
    keys = ("vertices", "facets", "dimension")
    return {"min": bounds[:, 0], "max": bounds[:, 1]} | {key: counts and getattr(counts, key) for key in keys}


def _member_json(rendezvous: Rendezvous, member: Member) -> dict[str, object]:
    return {
        "name": member.name,
        "u": member.controls,
        "delta_v_m_s": delta_v(rendezvous, member.controls),
        **vars(effort(member.controls)),
        "linear_end": member.linear[-1],
        "nonlinear_end": member.nonlinear[-1],
        "nonlinear_miss": member.nonlinear_miss,
        "between_periods_excess": member.between,
    }


def _flight_json(rendezvous: Rendezvous, flight: Flight, noisy: Sequence[Flight]) -> dict[str, object]:
    return {
        "miss": flight.miss,
        "end": flight.states[-1],
        "u": flight.controls,
        "delta_v_m_s": delta_v(rendezvous, flight.controls),
        "expected_misses": flight.expected_misses,
        "relaxations": flight.relaxations,
        "noisy_misses": [noisy_flight.miss for noisy_flight in noisy],
        "noisy_max_relaxations": [noisy_flight.relaxations.max() for noisy_flight in noisy],
    }


def _robust_json(robustness: Robustness) -> dict[str, object]:
    plan = robustness.plan
    return {
        "without_feedback": {"nominal_miss": robustness.fixed_miss, "conflict": robustness.conflict},
        "with_feedback": {
            "worst_miss": None if plan is None else plan.worst_miss,
            "conflict": robustness.refusal,
            "nominal_u": None if plan is None else plan.nominal,
            "min": None if plan is None else plan.lower,
            "max": None if plan is None else plan.upper,
        },
    }
