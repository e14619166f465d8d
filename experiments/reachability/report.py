"""Results of `infoset reach`, as JSON, CSV and tables."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rich.table import Table

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import AXES
from infoset.experiments.common.problem_command import CONTROL_COLUMNS, trajectories_csv
from infoset.experiments.common.screen import Part, number, number_table
from infoset.experiments.common.units import Unit, length_unit
from infoset.experiments.reachability.file import Rendezvous
from infoset.rendezvous.reachability import (
    AffinePlan,
    ClosedLoopFlight,
    NonlinearMotion,
    SetKind,
    Solution,
    ThrustShape,
    effort,
)

IMPULSE_COLUMNS = ("impulse_x_m_s", "impulse_y_m_s", "impulse_z_m_s")
POINTS = 24
"""Points of a displayed trajectory per period; chosen for smooth curves."""
NORM = "(m, m/s)"
"""Unit of a norm of states."""
_MAX_SHOWN = 5
"""Number of controls in figures and pages; chosen: more curves cannot be told apart."""
_ALIKE = 1e-4
"""Difference of two controls, as a part of their bound, below which only one is shown."""


@dataclass(frozen=True, eq=False)
class ChosenControl:
    """An optimal control, with its states, shape (T + 1, 6), in both models.

    `between` is the largest violation of a constraint between the periods by the linear model, as a
    fraction of the bound; at most 0 if there is none.
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

    `fixed_miss` is the minimum terminal norm without disturbance, by controls that keep the
    constraints without feedback, and `plan` the plan with feedback. If there is none, `conflict`
    and `refusal` are the reasons.
    """

    fixed_miss: float | None
    conflict: str | None
    plan: AffinePlan | None
    refusal: str | None

    @property
    def worst_miss(self) -> float:
        """An upper bound of the terminal norm of the plan over all disturbances."""
        assert self.plan is not None
        return float(np.linalg.norm(self.plan.state_ranges.largest[-1]))


@dataclass(frozen=True, eq=False)
class ReachabilityReport:
    """Results of one command.

    `min_periods` is the minimum number of periods, up to `searched_periods`, in which the terminal
    norm is zero, or None. `forward`, `tube` and `backward`, shape (T + 1, 6, 2), are bounds of the
    sets, `ranges`, shape (T, 3, 2), those of the optimal controls. `flight` is the simulation in
    closed loop, `noisy` are those with navigation errors.
    """

    rendezvous: Rendezvous
    solution: Solution
    min_periods: int | None
    searched_periods: int
    forward: Floats
    tube: Floats
    backward: Floats | None
    ranges: Floats
    members: tuple[ChosenControl, ...]
    flight: ClosedLoopFlight | None
    noisy: tuple[ClosedLoopFlight, ...]
    robustness: Robustness | None

    @property
    def length_unit(self) -> Unit:
        """Return the unit in which positions are shown."""
        return length_unit(float(np.abs(self.tube[:, :3]).max()))

    @cached_property
    def shown(self) -> tuple[tuple[ChosenControl, Floats], ...]:
        """Return the first `_MAX_SHOWN` different members with nonlinear trajectories, (points, 6).

        A member is left out if each of its controls differs by at most `_ALIKE` from one before it.
        """
        bounds = self.rendezvous.problem.control_bounds
        chosen: list[ChosenControl] = []
        for member in self.members:
            differences = [np.abs(member.controls - other.controls) / bounds for other in chosen]
            if all(difference.max() > _ALIKE for difference in differences):
                chosen.append(member)
        return tuple((member, self._trajectory(member)) for member in chosen[:_MAX_SHOWN])

    def _trajectory(self, member: ChosenControl) -> Floats:
        """Return the states at `shown_times_s`."""
        rendezvous = self.rendezvous
        start = rendezvous.problem.initial
        controls = member.controls[None]
        if rendezvous.has_impulses:
            paths = rendezvous.truth.coast(start, controls, rendezvous.period_s, POINTS)
        else:
            pushes = rendezvous.unit_m_s2 * controls
            paths = rendezvous.truth.fly(start, pushes, rendezvous.period_s, POINTS)
        return np.asarray(paths[0])

    @property
    def shown_times_s(self) -> Floats:
        """Return the times of displayed trajectories.

        The start of each period occurs twice with impulses: before and after the impulse.
        """
        rendezvous = self.rendezvous
        periods = rendezvous.problem.periods
        first = 0 if rendezvous.has_impulses else 1
        times = np.arange(periods)[:, None] + np.arange(first, POINTS + 1) / POINTS
        return rendezvous.period_s * np.concatenate([[0.0], times.ravel()])


def flown(rendezvous: Rendezvous, controls: Floats, truth: NonlinearMotion | None = None) -> Floats:
    """Return the states at t = 0..T of the nonlinear model, before an impulse, (k, T + 1, 6).

    The controls have shape (k, T, 3); `truth` replaces the nonlinear model.
    """
    motion = truth or rendezvous.truth
    start = rendezvous.problem.initial
    if rendezvous.has_impulses:
        # Without the states just after the impulses, which are between the others.
        return motion.coast(start, controls, rendezvous.period_s)[:, ::2]
    return motion.fly(start, rendezvous.unit_m_s2 * controls, rendezvous.period_s)


def delta_v(rendezvous: Rendezvous, controls: Floats) -> dict[str, float]:
    """Return the Delta-v of controls, shape (T, 3), in m/s: the sum, and the part of each axis.

    The sum is over the axes, each of which has an engine; for thrust in a ball, with one engine, it
    is over the norms.
    """
    pushes = rendezvous.delta_v_m_s * controls
    axes = np.abs(pushes).sum(axis=0)
    ball = rendezvous.problem.thrust is ThrustShape.BALL
    total = np.linalg.norm(pushes, axis=1).sum() if ball else axes.sum()
    return {"sum": float(total), **dict(zip("xyz", axes.tolist(), strict=True))}


def trajectories(report: ReachabilityReport) -> str:
    """Return the trajectories of the selected controls in both models, as CSV.

    A held control is constant over its period; an impulse acts after the state of its row.
    """
    rendezvous = report.rendezvous
    unit = 1.0 if rendezvous.has_impulses else rendezvous.unit_m_s2
    times_s = rendezvous.period_s * np.arange(rendezvous.problem.periods + 1)
    tracks = []
    for member in report.members:
        controls = np.vstack([unit * member.controls, np.full(3, np.nan)])
        tracks += [
            ([member.name, model], [times_s, states, controls])
            for model, states in (("linear", member.linear), ("nonlinear", member.nonlinear))
        ]
    columns = IMPULSE_COLUMNS if rendezvous.has_impulses else CONTROL_COLUMNS
    return trajectories_csv(["control", "model"], tracks, columns)


def report_json(report: ReachabilityReport) -> dict[str, object]:
    """Return the results for `infoset.experiments.common.output.to_json`.

    Key ``units`` has the units of the results.
    """
    solution = report.solution
    rendezvous = report.rendezvous
    controls = "parts of acceleration_m_s2, along x, y, z"
    if rendezvous.has_impulses:
        controls = "impulses at the starts of the periods, in m/s, along x, y, z"
    return {
        "units": {
            "period_s": rendezvous.period_s,
            "axes": AXES,
            "states": "x, y, z in m and their rates in m/s",
            "misses": "Euclidean norm of six components, in m and m/s",
            "controls": controls,
            "acceleration_m_s2": rendezvous.acceleration_m_s2,
        },
        **solution_json(solution, report.min_periods, (report.forward, report.tube), report.ranges),
        "min_periods_searched": report.searched_periods,
        "backward": report.backward,
        "controls": [_member_json(rendezvous, member) for member in report.members],
        "replan": report.flight and _flight_json(rendezvous, report.flight),
        "replan_noisy": [_flight_json(rendezvous, flight) for flight in report.noisy],
        "robust": report.robustness and _robust_json(report.robustness),
    }


def solution_json(
    solution: Solution, min_periods: int | None, sets: tuple[Floats, Floats], ranges: Floats
) -> dict[str, object]:
    """Return the keys of a solution; `sets` are the bounds of the forward sets and of the tube."""

    def set_json(kind: SetKind, time: int, bounds: Floats) -> dict[str, object]:
        # None if the set is not known by its vertices: then its counts are null.
        counts = solution.sets.counts(kind, time)
        values: dict[str, object] = {"min": bounds[:, 0], "max": bounds[:, 1]}
        for key in ("vertices", "facets", "dimension"):
            values[key] = counts and getattr(counts, key)
        return values

    periods: list[dict[str, object]] = []
    for t in range(1, solution.problem.periods + 1):
        at_period: dict[str, object] = {"period": t}
        for kind, bounds in zip(SetKind, sets, strict=True):
            at_period[kind.value] = set_json(kind, t, bounds[t])
        periods.append(at_period)
    return {
        "route": solution.route,
        "route_reason": solution.reason,
        "optimal_miss": solution.optimal.miss,
        "optimal_dimension": solution.optimal.dimension,
        "min_periods": min_periods,
        "sets": periods,
        "control_ranges": ranges,
    }


def _member_json(rendezvous: Rendezvous, member: ChosenControl) -> dict[str, object]:
    return {
        **vars(member),
        "nonlinear_miss": member.nonlinear_miss,
        "delta_v_m_s": delta_v(rendezvous, member.controls),
        **vars(effort(member.controls)),
    }


def _flight_json(rendezvous: Rendezvous, flight: ClosedLoopFlight) -> dict[str, object]:
    return {
        **vars(flight),
        "miss": flight.miss,
        "delta_v_m_s": delta_v(rendezvous, flight.controls),
    }


def _robust_json(robustness: Robustness) -> dict[str, object]:
    plan = robustness.plan
    shown = plan and {
        "worst_miss": robustness.worst_miss,
        "nominal": plan.nominal,
        "lower": plan.state_ranges.lower,
        "upper": plan.state_ranges.upper,
    }
    return {**vars(robustness), "plan": shown}


def report_lines(report: ReachabilityReport) -> Iterator[Part]:
    """Yield the minimum norm, the tube, the controls and the simulations, for the screen."""
    rendezvous = report.rendezvous
    solution = report.solution
    minimum = report.min_periods
    reached = f"norm 0 not reached in {report.searched_periods} periods"
    if minimum is not None:
        reached = f"norm 0 needs at least {minimum} period{'s' if minimum > 1 else ''}"
    yield f"{rendezvous.name}: minimum terminal norm {solution.optimal.miss:.9g} {NORM}; {reached}"
    yield from solution_lines(solution)
    yield f"axes: {AXES}"
    control = "u is an impulse at the start of a period, in m/s"
    if not rendezvous.has_impulses:
        control = f"u is in units of {rendezvous.unit_m_s2:g} m/s^2"
    yield f"units: {NORM} is the norm of a state in m and m/s; {control}"
    yield from ("", _sets_table("tube", report.tube, first=1))
    if report.backward is not None:
        yield from ("", _sets_table("backward set", report.backward, first=0))
    if report.members:
        yield from ("", _members_table(report))
    yield from _flight_lines(report)


def _sets_table(name: str, bounds: Floats, first: int) -> Table:
    """Return the ranges of the positions in sets, from a period on."""
    # Plus zero, which has no sign: -0 is printed as 0.
    table = number_table("period", *(f"{axis} of the {name}\nm" for axis in "xyz"))
    for t in range(first, len(bounds)):
        table.add_row(str(t), *(f"{low:.1f} .. {high:.1f}" for low, high in bounds[t, :3] + 0.0))
    return table


def _flight_lines(report: ReachabilityReport) -> Iterator[str]:
    """Yield the misses in closed loop, and the bounds with disturbances."""
    if report.flight is not None:
        used = delta_v(report.rendezvous, report.flight.controls)["sum"]
        yield (
            "\n"
            f"replanned every period: nonlinear miss {number(report.flight.miss)} {NORM}, Delta-v "
            f"{used:.4f} m/s"
        )
    if report.noisy:
        misses = [flight.miss for flight in report.noisy]
        relaxed = max(float(flight.relaxations.max()) for flight in report.noisy)
        yield (
            f"with navigation errors, {len(misses)} simulations: median "
            f"{number(float(np.median(misses)))}, largest {number(max(misses))} {NORM}; "
            f"constraints relaxed by at most {relaxed:.2%}"
        )

    robustness = report.robustness
    if robustness is not None:
        fixed = robustness.conflict or "controls that keep the constraints exist"
        yield f"\nwith the errors of [disturbance], without feedback: {fixed}"
        bound = robustness.refusal
        if robustness.plan is not None:
            bound = f"terminal norm at most {number(robustness.worst_miss)} {NORM}"
        known = "with feedback of the exact state"
        if report.rendezvous.navigation is not None:
            known += ", without the errors of [navigation]"
        yield f"with the errors of [disturbance], {known}: {bound}"


def solution_lines(solution: Solution) -> Iterator[str]:
    """Yield the route and the size of the set of optimal controls."""
    dimension = solution.optimal.dimension
    yield f"route: {solution.route.value} ({solution.reason})"
    yield f"optimal controls: {f'a set of dimension {dimension}' if dimension else 'one'}"


def _members_table(report: ReachabilityReport) -> Table:
    unit = "m/s" if report.rendezvous.has_impulses else "u"
    table = number_table(
        "control",
        "energy\n(m/s)^2" if report.rendezvous.has_impulses else "energy\nu^2",
        f"peak\n{unit}",
        "Delta-v\nm/s",
        f"nonlinear miss\n{NORM}",
        "violation between\nperiods",
    )
    for member in report.members:
        spent = effort(member.controls)
        used = delta_v(report.rendezvous, member.controls)["sum"]
        costs = (
            f"{spent.energy:.6f}",
            f"{spent.peak:.6f}",
            f"{used:.4f}",
            f"{member.nonlinear_miss:.4g}",
        )
        table.add_row(member.name, *costs, f"{max(member.between, 0.0):.2%}")
    return table
