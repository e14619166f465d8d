"""The quantiles of every cell of a sweep as one table, and the values that meet a requirement."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from experiments.campaigns.samples import LEVELS, OUTCOMES, Sample, noises_of, samples, shown_value
from experiments.campaigns.sweep_axes import sweep_cells, tied_keys, unit_of
from sim import HitEstimate, QuantileEstimate, QuantileName, Requirement, Scenario
from sim.closed_form import possible_miss_of
from sim.requirement import AnyRequirement, Decision, HitRequirement, Verdict, judge
from sim.statistics import level_name, shows
from sim.stopping_rule import QUANTITIES
from sim.storage import Axis, CampaignFolder

TABLE = "sweep.parquet"
SHOWN = tuple(QuantileName(quantity, level) for quantity in ("miss_m", "impulse_m_s") for level in (0.5, 0.99))
SHOWN_WITH_HITS = (SHOWN[0], SHOWN[1], SHOWN[3])
QUANTITY_NAMES = {
    "miss_m": "miss, m",
    "impulse_m_s": "impulse spent, m/s",
    "guaranteed_miss_m": "guaranteed miss, m",
    "hit": "probability of a hit",
}
_LOG_FROM = 30.0
"""Ratio of the maximum to the minimum value from which the values have a logarithmic axis."""
_MAX_WHOLE = 1e9
"""Whole numbers below this one are printed with all digits."""


@dataclass(frozen=True)
class SweepTable:
    """Every cell of a sweep; the last of the axes varies fastest over the cells.

    Parameters
    ----------
    cells : tuple of tuple of Sample
        Samples of each cell, one for each noise; empty for a cell without runs.
    verdicts : tuple of mapping of str to Verdict
        For each cell, the verdict of each noise about the requirement; `runs_needed` counts the runs of all noises.
    hits : tuple of HitEstimate or None
        Probability of a hit in each cell, for the noise with the fewest hits; None if the body has no size.
    radius_m : float or None
        Radius of the body; None if it has no size, or different sizes.
    closed_form_m : tuple of float or None
        Guaranteed miss of each cell by the closed form of a camera, m (`sim.closed_form`); empty if the requirement is
        about another quantity or the sensor is no camera.
    """

    axes: tuple[Axis, ...]
    noises: tuple[str, ...]
    levels: tuple[float, ...]
    cells: tuple[tuple[Sample, ...], ...]
    required: AnyRequirement
    verdicts: tuple[Mapping[str, Verdict], ...]
    hits: tuple[HitEstimate | None, ...]
    radius_m: float | None
    closed_form_m: tuple[float | None, ...] = ()

    def verdict(self, cell: int, noise: str) -> Verdict | None:
        """Return the verdict of a cell and a noise; None without runs."""
        return self.verdicts[cell].get(noise)

    def decision(self, cell: int) -> Decision:
        """Return the decision of a cell: met if met with every noise, not met if not met with one."""
        decisions = {
            Decision.UNDECIDED if verdict is None else verdict.decision
            for verdict in (self.verdict(cell, noise) for noise in self.noises)
        }
        order = (Decision.NOT_MET, Decision.UNDECIDED, Decision.MET)
        return next(decision for decision in order if decision in decisions)

    def sample(self, cell: int, noise: str) -> Sample:
        """Return the sample of a cell and a noise, which may have no runs."""
        return next((sample for sample in self.cells[cell] if sample.noise == noise), Sample(noise))

    def estimate(self, cell: int, noise: str, quantile: QuantileName) -> QuantileEstimate | None:
        """Return a quantile of a cell; None if it is not known."""
        estimates = self.sample(cell, noise).quantiles.get(quantile.quantity, ())
        return next((estimate for estimate in estimates if estimate.level == quantile.level), None)

    def value(self, cell: int, noise: str, quantile: QuantileName) -> float | None:
        """Return a quantile of a cell; None if its runs do not show it."""
        sample, estimate = self.sample(cell, noise), self.estimate(cell, noise, quantile)
        return None if estimate is None else shown_value(sample, quantile.quantity, estimate)

    def grid(self, noise: str, quantile: QuantileName) -> np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]:
        """Return a quantile over the axes, masked where the runs do not show it."""
        values = [self.value(cell, noise, quantile) for cell in range(len(self.cells))]
        shape = tuple(len(axis.values) for axis in self.axes)
        known = [0.0 if value is None else value for value in values]
        return np.ma.MaskedArray(known, mask=[value is None for value in values]).reshape(shape)

    def columns(self) -> tuple[dict[str, list[Any]], dict[str, str]]:
        """Return columns with a row for each cell and noise, and the units of the columns."""
        rows: list[dict[str, Any]] = []
        combinations = itertools.product(*(axis.values for axis in self.axes))
        for cell, values in enumerate(combinations):
            for noise in self.noises:
                sample = self.sample(cell, noise)
                verdict = self.verdict(cell, noise)
                row: dict[str, Any] = {"cell": cell}
                row |= {
                    key: value for axis, value in zip(self.axes, values, strict=True) for key in tied_keys(axis.key)
                }
                row |= {"noise": noise, "runs": sample.runs}
                row |= {name.replace("-", "_"): sample.outcomes.get(name, 0) for name in OUTCOMES}
                row |= {"truth_kept": sample.sets.truth_kept, "set_emptied": sample.sets.set_emptied}
                row["hits"] = getattr(sample.hits, "hits", None)
                row |= {f"hit_{name}": getattr(sample.hits, name, None) for name in ("probability", "lower", "upper")}
                row["requirement"] = None if verdict is None else verdict.decision.value
                for name in ("value", "lower", "upper", "known"):
                    row[f"required_{name}"] = getattr(verdict, name, None)
                for quantity, level in itertools.product(QUANTITIES, self.levels):
                    estimate = self.estimate(cell, noise, QuantileName(quantity, level))
                    name = f"{quantity}_{level_name(level)}"
                    row |= {
                        name: self.value(cell, noise, QuantileName(quantity, level)),
                        f"{name}_lower": getattr(estimate, "lower", None),
                        f"{name}_upper": getattr(estimate, "upper", None),
                    }
                row |= {f"{quantity}_max": sample.worst.get(quantity) for quantity in QUANTITIES}
                rows.append(row)
        columns = {name: [row[name] for row in rows] for name in rows[0]}
        units = {key: unit_of(key) for axis in self.axes for key in tied_keys(axis.key)}
        for quantity in QUANTITIES:
            units |= {name: unit_of(quantity) for name in columns if name.startswith(f"{quantity}_")}
        if isinstance(self.required, Requirement):
            units |= {f"required_{name}": unit_of(self.required.quantity) for name in ("value", "lower", "upper")}
        return columns, units


def sweep_table(folder: CampaignFolder, required: AnyRequirement, quantiles: Sequence[QuantileName] = ()) -> SweepTable:
    """Summarise a sweep, finished or not, at the levels `LEVELS` and those of some more quantiles."""
    levels = tuple(sorted({*LEVELS, *(quantile.level for quantile in quantiles)}))
    noises, numbers = tuple(noises_of(folder)), range(folder.manifest.cells)
    cells = tuple(tuple(samples(folder, cell, levels)) for cell in numbers)
    read = partial(folder.sample, required.quantity, unknown=required.unknown)
    axes, body = folder.manifest.axes, folder.manifest.scenario.body
    is_varied = any("body.radius_m" in tied_keys(axis.key) for axis in axes)
    radius_m = None if body is None or is_varied else body.radius_m
    radii_m = [cell.radius_m for cell in sweep_cells(folder.manifest.scenario, axes)] if is_varied else None

    def judged(noise: str, cell: int) -> Verdict | None:
        """Return a verdict whose runs are those of all noises, like --runs and --max-runs; None without runs."""
        values = read(noise, cell)
        if not values.size:
            return None
        verdict = judge(values, required, watched=folder.manifest.is_watched)
        if isinstance(required, HitRequirement):
            misses_m = folder.sample("miss_m", noise, cell)
            quantile_m = float(np.quantile(misses_m, required.share)) if shows(misses_m.size, required.share) else None
            verdict = replace(verdict, quantile=quantile_m, bound=radii_m[cell] if radii_m else radius_m)
        return replace(verdict, runs_needed=verdict.runs_needed and len(noises) * verdict.runs_needed)

    by_noise = [{noise: judged(noise, cell) for noise in noises} for cell in numbers]
    verdicts = tuple({noise: one for noise, one in cell.items() if one is not None} for cell in by_noise)
    estimates = [[sample.hits for sample in samples if sample.hits is not None] for samples in cells]
    hits = tuple(min(group, key=lambda hits: hits.probability, default=None) for group in estimates)
    form = _closed_forms(folder.manifest.scenario, axes) if required.quantity == "guaranteed_miss_m" else ()
    return SweepTable(axes, noises, levels, cells, required, verdicts, hits, radius_m, form)


def _closed_forms(scenario: Scenario, axes: Sequence[Axis]) -> tuple[float | None, ...]:
    """Return the closed form of the guaranteed miss of each cell, m; None in cells with fewer than two images."""
    if not scenario.set_model.angle_sensor.is_camera:
        return ()
    values: list[float | None] = []
    for cell in sweep_cells(scenario, axes):
        try:
            values.append(possible_miss_of(cell))
        except ValueError:
            values.append(None)
    return tuple(values)


@dataclass(frozen=True)
class Limit:
    """The end of the values of an axis that meet a requirement.

    It lies between the values `lower` and `upper` of two decided cells, one of which meets the requirement. `value` is
    an interpolation between the quantiles of two neighbouring cells, without a confidence: for hits, the quantiles of
    the miss at the required share. It is None if undecided cells lie between them, or a quantile is not known or is on
    the other side of the bound than the decision.
    """

    value: float | None
    lower: float
    upper: float


def limits(axis: Axis, verdicts: Sequence[Verdict | None]) -> list[Limit]:
    """Return the limits along an axis, each between a cell that meets the requirement and one that does not.

    Cells without runs are treated as undecided. The quantiles are interpolated on the scale of the axis; their
    logarithms are if `spans_decades`. A probability of hits is not interpolated: between two cells it can be a step.
    """
    decided = [
        (index, verdict)
        for index, verdict in enumerate(verdicts)
        if verdict is not None and verdict.decision is not Decision.UNDECIDED
    ]
    log_values = spans_decades([one.quantile for one in verdicts if one is not None and one.quantile is not None])
    ends = []
    for (left, first), (right, last) in itertools.pairwise(decided):
        if first.decision is not last.decision:
            near, far = axis.values[left], axis.values[right]
            begin, end = (_agreeing(verdict, log_values) for verdict in (first, last))
            value = None
            if right == left + 1 and begin is not None and end is not None:
                share = begin / (begin - end)
                value = near * (far / near) ** share if axis.scale == "log" else near + share * (far - near)
            ends.append(Limit(value, near, far))
    return ends


def _agreeing(verdict: Verdict, log_values: bool) -> float | None:
    """Return `above_bound`; None on the other side of the bound than the decision, which added runs can cause."""
    above = above_bound(verdict.quantile, verdict.bound, log_values)
    return above if above is not None and (above < 0.0) == (verdict.decision is Decision.MET) else None


def above_bound(quantile: float | None, bound: float | None, log_values: bool) -> float | None:
    """Return how far a quantile is above its bound, or the difference of their logarithms; None if it is not known."""
    if quantile is None or bound is None:
        return None
    return math.log(quantile) - math.log(bound) if log_values else quantile - bound


def spans_decades(values: Sequence[float]) -> bool:
    """Return whether values are positive and differ so much that they are drawn on a logarithmic axis."""
    return bool(values) and max(values) > _LOG_FROM * min(values) > 0.0


def separating_digits(axis: Axis) -> int:
    """Return the number of significant digits that separate neighbouring values of an axis."""
    return max(_digits(max(abs(low), abs(high)), high - low) for low, high in itertools.pairwise(axis.values))


def _digits(value: float, gap: float) -> int:
    """Return the number of digits of a value down to the first digit of a gap."""
    return 1 + math.floor(math.log10(value)) - math.floor(math.log10(abs(gap) * (1.0 + 1e-9))) if value and gap else 1


def value_text(axis: Axis, value: float, digits: int = 4) -> str:
    """Return a value of an axis with `digits` digits, or more if neighbouring values would be equal."""
    if value == round(value) and abs(value) < _MAX_WHOLE:
        return f"{value:.0f}"
    return f"{value:.{max(digits, 1 + separating_digits(axis))}g}"


def interpolated_text(axis: Axis, limit: Limit) -> str:
    """Return the interpolated value as text, rounded to the distance of the two cells; empty if there is none."""
    if limit.value is None:
        return ""
    digits = max(1, 1 + _digits(abs(limit.value), limit.upper - limit.lower))
    return value_text(axis, float(f"{limit.value:.{digits}g}"), digits=max(6, digits))


@dataclass(frozen=True)
class Answer:
    """Whether a requirement is met along the first axis, at the values `at` of the others."""

    at: str
    met: str
    limits: Sequence[Limit]


def answer(axis: Axis, verdicts: Sequence[Verdict | None], at: str = "") -> Answer:
    """Return the decisions and limits along an axis."""
    unit = unit_of(axis.key)
    words = ["not simulated" if verdict is None else str(verdict.decision) for verdict in verdicts]
    ends = limits(axis, verdicts)
    if len(set(words)) == 1:
        return Answer(at, f"{words[0]} at all {len(words)} values", ends)
    pieces = []
    for word, group in itertools.groupby(range(len(words)), lambda index: words[index]):
        indices = list(group)
        first, last = (value_text(axis, axis.values[index]) for index in (indices[0], indices[-1]))
        pieces.append(_with_unit(f"{word} at {first}" if len(indices) == 1 else f"{word} from {first} to {last}", unit))
    texts = [", ".join(pieces)]
    for end in ends:
        interval = f"between the decided cells {value_text(axis, end.lower)} and {value_text(axis, end.upper)}"
        about = interpolated_text(axis, end)
        about = f", by interpolation about {_with_unit(about, unit)}" if about else ""
        texts.append(f"limit {_with_unit(interval, unit)}{about}")
    return Answer(at, "; ".join(texts), ends)


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit else text


def answers(table: SweepTable, noise: str) -> list[Answer]:
    """Return the answer along the first axis for each combination of values of the others."""
    first, *others = table.axes
    shape = [len(axis.values) for axis in table.axes]
    cells = np.arange(math.prod(shape)).reshape(shape)
    return [
        answer(
            first,
            [table.verdict(cell, noise) for cell in cells[(slice(None), *indices)].tolist()],
            values_text(others, indices),
        )
        for indices in np.ndindex(*shape[1:])
    ]


def values_text(axes: Sequence[Axis], indices: Sequence[int]) -> str:
    """Return the values at some indices of axes: `thruster.budget_m_s = 200, nominal_range_km = 5800`."""
    return ", ".join(
        f"{axis.key} = {value_text(axis, axis.values[index])}" for axis, index in zip(axes, indices, strict=True)
    )
