"""Results of `infoset observe`, as JSON, CSV and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rich.table import Table

from infoset.arrays import Floats
from infoset.experiments.common.screen import Part, number_table
from infoset.experiments.observer.data import Data, steps_text
from infoset.experiments.observer.file import ObserverProblem
from infoset.observer.cover import Detection
from infoset.observer.estimate import MAX_POLYTOPE_STATES, Estimate, Inconsistency
from infoset.sim.columns import Cell, csv_text

_SHOWN_STEPS = 12
"""Number of the last steps in the table: two tables of them fit on a screen."""
_BOUND_ROUNDING = 1e-12
"""Share of the maximum bound of a state below which a bound is shown as zero.

About 5000 rounding errors, far below the six digits that are shown.
"""


@dataclass(frozen=True, eq=False)
class ObserverReport:
    """Results of one command; `smoothed` are the sets that use later measurements, if asked for."""

    problem: ObserverProblem
    data: Data
    estimates: Sequence[Estimate]
    smoothed: Sequence[Estimate] | None
    inconsistency: Inconsistency
    detection: Detection

    @cached_property
    def excess_widths(self) -> Floats | None:
        """Widths of the last set less the exact widths, (n,); None if not reduced, or empty."""
        last = self.estimates[-1]
        if not last.reduced or last.is_empty:
            return None
        return last.excess_widths()

    @property
    def contradicted(self) -> bool:
        """Whether the measurements contradict the model."""
        return bool(self.inconsistency.step >= 0)

    @property
    def allows_wrong(self) -> bool:
        """Whether the observer allows for wrong measurements."""
        return self.problem.noise.wrong_measurements > 0

    @property
    def proved(self) -> bool:
        """Whether a wrong measurement is proved."""
        return self.allows_wrong and bool(self.detection.step >= 0)

    @property
    def suspected_steps(self) -> list[int]:
        """Steps of the measurements one of which is proved to be wrong; none without a proof."""
        suspected = self.detection.suspected
        # The measurements, without the missing ones, are dealt into the classes in turn. Those
        # after the proof are not suspected.
        is_measured = ~np.isnan(self.data.measured).all(axis=1)
        numbers = np.cumsum(is_measured) - 1
        is_suspected = is_measured & suspected[numbers % len(suspected)]
        return np.flatnonzero(is_suspected[: int(self.detection.step) + 1]).tolist()


def contains(estimate: Estimate, state: Floats) -> bool:
    """Return whether a state is in a set, or within its bounds if it has five or more states."""
    if estimate.states > MAX_POLYTOPE_STATES:
        return bool((estimate.lower <= state).all() and (state <= estimate.upper).all())
    if estimate.states == 2:
        return bool(np.any(estimate.polygons.contains(state)))
    return any(polytope.contains(state) for polytope in estimate.polytopes)


def outlines(estimate: Estimate) -> list[Floats]:
    """Return the vertices of the sets of two states that are not empty, shape (v, 2) each."""
    polygons = estimate.polygons
    each = polygons if polygons.shape else [polygons]
    return [polygon.polygon() for polygon in each if not polygon.is_empty]


def report_json(report: ObserverReport) -> dict[str, object]:
    """Return the results for `infoset.experiments.common.output.to_json`."""
    steps: list[dict[str, object]] = [
        {"k": estimate.step, **_bounds(estimate), "empty": bool(estimate.is_empty)}
        for estimate in report.estimates
    ]
    for index, step in enumerate(steps):
        if report.estimates[index].states == 2:
            step["vertices"] = report.estimates[index].to_dict()["vertices"]
        if report.smoothed is not None:
            step["smoothed"] = _bounds(report.smoothed[index])
        if report.data.states is not None:
            step["state"] = report.data.states[index]

    inconsistency: dict[str, object] | None = None
    if report.contradicted:
        where = report.inconsistency
        inconsistency = {
            "k": int(where.step),
            "output": int(where.output) + 1,  # from 1, as in the columns of a file
            "excess": float(where.excess),
        }
    wrong: dict[str, object] | None = None
    if report.allows_wrong:
        detection = report.detection
        wrong = {
            "assumed": report.problem.noise.wrong_measurements,
            "classes": len(detection.suspected),
            "proved_k": int(detection.step) if report.proved else None,
            "suspected_k": report.suspected_steps,
        }
    return {
        "data": report.data.origin,
        "states": report.problem.names,
        "steps": steps,
        "final": _bounds(report.estimates[-1]),
        "excess_widths": report.excess_widths,
        "inconsistency": inconsistency,
        "wrong_measurements": wrong,
    }


def _bounds(estimate: Estimate) -> dict[str, object]:
    """Return the bounds of the states; null for the empty set."""
    if estimate.is_empty:
        return {"lower": None, "upper": None}
    return {"lower": estimate.lower, "upper": estimate.upper}


def report_csv(report: ObserverReport) -> str:
    """Return the bounds of each step as CSV; the bounds of an empty set are empty cells."""
    states = range(1, len(report.problem.names) + 1)
    sets = {"": report.estimates}
    if report.smoothed is not None:
        sets["smoothed_"] = report.smoothed

    columns = []
    blocks = []
    for kind, estimates in sets.items():
        # Both bounds of the first state, then those of the next one.
        columns += [f"x{state}_{kind}{end}" for state in states for end in ("lower", "upper")]
        blocks.append(bounds_of(estimates).swapaxes(1, 2).reshape(len(estimates), -1))
    if report.data.states is not None:
        columns += [f"x{state}" for state in states]
        blocks.append(report.data.states)

    rows: list[list[Cell]] = [
        [
            estimate.step,
            bool(estimate.is_empty),
            *(None if np.isnan(value) else value for value in row),
        ]
        for estimate, row in zip(report.estimates, np.hstack(blocks).tolist(), strict=True)
    ]
    return csv_text(["k", "empty", *columns], rows)


def times(report: ObserverReport) -> tuple[Floats, str]:
    """Return the times of the steps, and the title of their axis."""
    steps = np.array([estimate.step for estimate in report.estimates], dtype=float)
    step_s = report.problem.system.step_s
    if step_s is None:
        return steps, "step"
    return steps * step_s, "time, s"


def bounds_of(estimates: Sequence[Estimate]) -> Floats:
    """Return the lower and upper bounds of the states, shape (N, 2, n); NaN for the empty set."""
    return np.array([[estimate.lower, estimate.upper] for estimate in estimates])


def shown_bounds(estimates: Sequence[Estimate]) -> Floats:
    """Return `bounds_of` for display: bounds within the rounding errors of a state are zero."""
    bounds = bounds_of(estimates)
    largest = np.abs(np.nan_to_num(bounds)).max(axis=(0, 1))
    bounds[np.abs(bounds) < _BOUND_ROUNDING * largest] = 0.0
    return bounds


def _bounds_table(names: Sequence[str], estimates: Sequence[Estimate]) -> Table:
    """Return a table of the bounds of the last steps."""
    table = number_table("step", *(f"{name}\n{end}" for name in names for end in ("from", "to")))
    # The rounding is that of all steps, also if only the last ones are shown.
    bounds = shown_bounds(estimates)
    for estimate, ends in zip(estimates[-_SHOWN_STEPS:], bounds[-_SHOWN_STEPS:], strict=True):
        cells = ("empty" if np.isnan(end) else f"{end:.6g}" for end in ends.T.ravel())
        table.add_row(str(estimate.step), *cells)
    return table


def report_lines(report: ObserverReport) -> Iterator[Part]:
    """Yield the bounds of the last steps and a contradiction, for the screen."""
    problem = report.problem
    count = len(report.estimates)
    missing = int(np.isnan(report.data.measured).any(axis=1).sum())
    gaps = f", {missing} with missing measurements" if missing else ""
    yield f"{problem.name}: {len(problem.names)} states, {count} steps{gaps}; {report.data.origin}"
    if count > _SHOWN_STEPS:
        yield f"bounds of the last {_SHOWN_STEPS} steps:"

    yield _bounds_table(problem.names, report.estimates)
    if report.smoothed is not None:
        yield "the same with later measurements (--smooth):"
        yield _bounds_table(problem.names, report.smoothed)

    if report.data.states is not None:
        inside = sum(map(contains, report.estimates, report.data.states))
        place = "the set" if len(problem.names) <= MAX_POLYTOPE_STATES else "its bounds"
        yield f"true state inside {place}: {inside} of {count} steps"
    if report.excess_widths is not None:
        excess = ", ".join(f"{each:.3g}" for each in report.excess_widths)
        reason = "the sets have a bounded number of facets"
        if len(problem.names) > MAX_POLYTOPE_STATES:
            reason = "the bounds are those of the last measurements"
        yield f"{reason}; the last one is wider than the exact one by {excess}"
    if report.allows_wrong:
        yield wrong_text(report)
    if report.contradicted:
        where = report.inconsistency
        yield (
            f"the measurements contradict the model at step {int(where.step)}: no state is "
            f"possible; the bound of output {int(where.output) + 1} is exceeded by at least "
            f"{float(where.excess):.6g}"
        )


def wrong_text(report: ObserverReport) -> str:
    """Return what is assumed and proved about wrong measurements."""
    assumed = report.problem.noise.wrong_measurements
    text = f"at most {assumed} wrong measurement{'s' if assumed > 1 else ''} assumed"
    if not report.proved:
        return f"{text}; none is proved"
    if report.contradicted:
        verb = "are" if assumed > 1 else "is"
        return f"{text}; more than {assumed} {verb} wrong, or the model is"

    step = int(report.detection.step)
    step_s = report.problem.system.step_s
    time = "" if step_s is None else f" ({step * step_s:g} s)"
    suspected = steps_text(report.suspected_steps)
    return f"{text}; a wrong one is proved at step {step}{time}; suspected: {suspected}"
