"""Results of `infoset observe`, as JSON, CSV and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rich.table import Table

from infoset.arrays import Floats
from infoset.experiments.common.screen import Part, number_table
from infoset.experiments.observer.data import Data
from infoset.experiments.observer.file import ObserverProblem
from infoset.observer.linear_observer import MAX_POLYTOPE_STATES, Estimate, Inconsistency
from infoset.sim.columns import Cell, csv_text

_SHOWN_STEPS = 12
_ROUNDING = 1e-12
"""Share of the maximum bound of a state below which a bound that is shown is zero."""


@dataclass(frozen=True, eq=False)
class ObserverReport:
    """Results of one command; `smoothed` are the sets that use later measurements too, if they are
    wanted.
    """

    problem: ObserverProblem
    data: Data
    estimates: Sequence[Estimate]
    smoothed: Sequence[Estimate] | None
    inconsistency: Inconsistency

    @cached_property
    def excess_widths(self) -> Floats | None:
        """Difference between the widths of the last set and the exact ones, shape (n,); None if it
        is not reduced.
        """
        last = self.estimates[-1]
        return last.excess_widths() if last.reduced and not last.is_empty else None

    @property
    def contradicted(self) -> bool:
        """Whether the measurements contradict the model."""
        return bool(self.inconsistency.step >= 0)


def contains(estimate: Estimate, state: Floats) -> bool:
    """Whether a state is in a set; of five and more states, within its bounds."""
    if estimate.states > MAX_POLYTOPE_STATES:
        return bool((estimate.lower <= state).all() and (state <= estimate.upper).all())
    shape = estimate.polygons if estimate.states == 2 else estimate.polytopes[0]
    return bool(shape.contains(state))


def report_json(report: ObserverReport) -> dict[str, object]:
    """Return the results for `infoset.experiments.common.output.to_json`."""
    where = report.inconsistency
    steps: list[dict[str, object]] = [
        {"k": estimate.step, **_bounds(estimate), "empty": bool(estimate.is_empty)}
        for estimate in report.estimates
    ]
    for index, step in enumerate(steps):
        if report.estimates[index].states == 2:
            step["vertices"] = report.estimates[index].polygons.polygon()
        if report.smoothed is not None:
            step["smoothed"] = _bounds(report.smoothed[index])
        if report.data.states is not None:
            step["state"] = report.data.states[index]
    return {
        "data": report.data.origin,
        "states": report.problem.names,
        "steps": steps,
        "final": _bounds(report.estimates[-1]),
        "excess_widths": report.excess_widths,
        "inconsistency": {
            "k": int(where.step),
            "output": int(where.output) + 1,
            "excess": float(where.excess),
        }
        if report.contradicted
        else None,
    }


def _bounds(estimate: Estimate) -> dict[str, object]:
    """Return the bounds of the states; null for the empty set."""
    return {
        end: None if estimate.is_empty else getattr(estimate, end) for end in ("lower", "upper")
    }


def report_csv(report: ObserverReport) -> str:
    """Return the bounds of each step as CSV; those of an empty set are empty cells."""
    states = range(1, len(report.problem.names) + 1)
    sets = {
        "": report.estimates,
        **({} if report.smoothed is None else {"smoothed_": report.smoothed}),
    }
    columns = [
        f"x{state}_{kind}{end}" for kind in sets for state in states for end in ("lower", "upper")
    ]
    blocks = [
        bounds_of(sets[kind]).swapaxes(1, 2).reshape(len(report.estimates), -1) for kind in sets
    ]
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
    return (steps, "step") if step_s is None else (steps * step_s, "time, s")


def bounds_of(estimates: Sequence[Estimate]) -> Floats:
    """Return the lower and upper bounds of the states, shape (N, 2, n); NaN for the empty set."""
    return np.array([[estimate.lower, estimate.upper] for estimate in estimates])


def shown_bounds(estimates: Sequence[Estimate]) -> Floats:
    """Return the same to be read: bounds within the rounding errors of the maximum bounds of a
    state are zero.
    """
    bounds = bounds_of(estimates)
    bounds[np.abs(bounds) < _ROUNDING * np.abs(np.nan_to_num(bounds)).max(axis=(0, 1))] = 0.0
    return bounds


def _bounds_table(names: Sequence[str], estimates: Sequence[Estimate]) -> Table:
    """Return a table of the bounds of the last steps."""
    table = number_table("step", *(f"{name}\n{end}" for name in names for end in ("from", "to")))
    for estimate, ends in list(zip(estimates, shown_bounds(estimates), strict=True))[
        -_SHOWN_STEPS:
    ]:
        table.add_row(
            str(estimate.step),
            *("empty" if np.isnan(end) else f"{end:.6g}" for end in ends.T.ravel()),
        )
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
    if report.contradicted:
        where = report.inconsistency
        yield (
            f"the measurements contradict the model at step {int(where.step)}: no state is "
            f"possible; the bound of output {int(where.output) + 1} is exceeded by at least "
            f"{float(where.excess):.6g}"
        )
