"""The quantiles of every cell of a sweep as one table, and the values that meet a requirement."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.campaigns.axis_names import tied_keys, unit_of
from experiments.campaigns.samples import LEVELS, OUTCOMES, Sample, noises_of, samples, shown_value
from experiments.interception.study import SetCounts
from sim import HitEstimate, QuantileEstimate, QuantileName, estimate_hits
from sim.requirement import AnyRequirement, Decision, Verdict, judge
from sim.stopping_rule import QUANTITIES, level_name
from sim.storage import Axis, CampaignFolder

Floats = NDArray[np.float64]

TABLE = "sweep.parquet"
SHOWN = tuple(QuantileName(quantity, level) for quantity in ("miss_m", "impulse_m_s") for level in (0.5, 0.99))
SHOWN_WITH_HITS = (SHOWN[0], SHOWN[1], SHOWN[3])


@dataclass(frozen=True)
class SweepTable:
    """Every cell of a sweep.

    Parameters
    ----------
    axes : tuple of Axis
        Keys that vary; the last varies fastest over the cells.
    cells : tuple of tuple of Sample
        Samples of each cell, one for each noise; empty for a cell without runs.
    verdicts : tuple of mapping of str to Verdict
        For each cell, what the runs of each noise say about the requirement.
    hits : tuple of HitEstimate or None
        Probability of a hit in each cell, over all runs; None if the body has no size.
    radius_m : float or None
        Radius of the body; None if it has no size, or different sizes.
    """

    axes: tuple[Axis, ...]
    noises: tuple[str, ...]
    levels: tuple[float, ...]
    cells: tuple[tuple[Sample, ...], ...]
    required: AnyRequirement
    verdicts: tuple[Mapping[str, Verdict], ...]
    hits: tuple[HitEstimate | None, ...]
    radius_m: float | None

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

    def sample(self, cell: int, noise: str) -> Sample | None:
        """Return the sample of a cell and a noise; None without runs."""
        return next((sample for sample in self.cells[cell] if sample.noise == noise), None)

    def estimate(self, cell: int, noise: str, quantile: QuantileName) -> QuantileEstimate | None:
        """Return a quantile of a cell; None if it is not known."""
        sample = self.sample(cell, noise)
        estimates = () if sample is None else sample.quantiles.get(quantile.quantity, ())
        return next((estimate for estimate in estimates if estimate.level == quantile.level), None)

    def value(self, cell: int, noise: str, quantile: QuantileName) -> float | None:
        """Return a quantile of a cell; None if its runs do not show it."""
        sample, estimate = self.sample(cell, noise), self.estimate(cell, noise, quantile)
        return None if sample is None or estimate is None else shown_value(sample, quantile.quantity, estimate)

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
                row: dict[str, Any] = {"cell": cell}
                row |= {
                    key: value for axis, value in zip(self.axes, values, strict=True) for key in tied_keys(axis.key)
                }
                row |= {"noise": noise, "runs": 0 if sample is None else sample.runs}
                for name in OUTCOMES:
                    row[name.replace("-", "_")] = 0 if sample is None else sample.outcomes.get(name, 0)
                sets = SetCounts() if sample is None else sample.sets
                row |= {"truth_kept": sets.truth_kept, "set_emptied": sets.set_emptied}
                verdict = self.verdict(cell, noise)
                row["requirement"] = None if verdict is None else verdict.decision.value
                for quantity, level in itertools.product(QUANTITIES, self.levels):
                    estimate = self.estimate(cell, noise, QuantileName(quantity, level))
                    name = f"{quantity}_{level_name(level)}"
                    row |= {
                        name: self.value(cell, noise, QuantileName(quantity, level)),
                        f"{name}_lower": None if estimate is None else estimate.lower,
                        f"{name}_upper": None if estimate is None else estimate.upper,
                    }
                for quantity in QUANTITIES:
                    row[f"{quantity}_max"] = None if sample is None else sample.worst.get(quantity)
                rows.append(row)
        columns = {name: [row[name] for row in rows] for name in rows[0]}
        units = {key: unit_of(key) for axis in self.axes for key in tied_keys(axis.key)}
        units |= {
            name: unit_of(quantity) for quantity in QUANTITIES for name in columns if name.startswith(f"{quantity}_")
        }
        return columns, units


def sweep_table(folder: CampaignFolder, required: AnyRequirement, quantiles: Sequence[QuantileName] = ()) -> SweepTable:
    """Summarise a sweep, finished or not, at the levels `LEVELS` and those of some more quantiles."""
    levels = tuple(sorted({*LEVELS, *(quantile.level for quantile in quantiles)}))
    noises, numbers = tuple(noises_of(folder)), range(folder.manifest.cells)
    cells = tuple(tuple(samples(folder, cell, levels)) for cell in numbers)
    read = partial(folder.sample, required.quantity, unknown=required.unknown)
    by_noise = [{noise: read(noise, cell) for noise in noises} for cell in numbers]
    verdicts = tuple(
        {
            noise: judge(values, required, watched=folder.manifest.until is not None)
            for noise, values in samples.items()
            if values.size
        }
        for samples in by_noise
    )
    flags = [folder.numbers("hit", cell).compressed() for cell in numbers]
    hits = tuple(estimate_hits(int(values.sum()), values.size) if values.size else None for values in flags)
    axes, body = folder.manifest.axes, folder.manifest.scenario.body
    is_varied = any("body.radius_m" in tied_keys(axis.key) for axis in axes)
    radius_m = None if body is None or is_varied else body.radius_m
    return SweepTable(axes, noises, levels, cells, required, verdicts, hits, radius_m)


@dataclass(frozen=True)
class Limit:
    """The end of the values of an axis that meet a requirement.

    Parameters
    ----------
    value : float or None
        Interpolated between the estimates of two neighbouring cells; None if undecided cells lie at the limit, or an
        estimate is not known.
    lower, upper : float
        The limit lies between these values: where the ends of the confidence intervals reach the bound, or the decided
        cells around the undecided ones.
    """

    value: float | None
    lower: float
    upper: float


def limits(axis: Axis, verdicts: Sequence[Verdict | None], bound: float) -> list[Limit]:
    """Return the limits along an axis, each between a cell that meets the requirement and one that does not.

    Cells without runs are treated as undecided.

    Parameters
    ----------
    axis : Axis
        Axis whose scale is that of the interpolation.
    verdicts : sequence of Verdict or None
        Verdict for each value of the axis.
    bound : float
        Bound of the requirement, in the unit of the verdicts.
    """
    decided = [
        (index, verdict)
        for index, verdict in enumerate(verdicts)
        if verdict is not None and verdict.decision is not Decision.UNDECIDED
    ]
    ends = []
    for (left, first), (right, last) in itertools.pairwise(decided):
        if first.decision is last.decision:
            continue
        near, far = axis.values[left], axis.values[right]
        if right > left + 1:
            ends.append(Limit(None, near, far))
            continue

        def crossing(begin: float | None, end: float | None, near: float = near, far: float = far) -> float:
            if begin is None or end is None:
                # An open end is infinitely far from the bound, so that the line reaches it at the other cell.
                return near if end is None else far
            share = min(max((bound - begin) / (end - begin), 0.0), 1.0) if begin != end else 1.0
            return near * (far / near) ** share if axis.scale == "log" else near + share * (far - near)

        edges = sorted((crossing(first.lower, last.lower), crossing(first.upper, last.upper)))
        known = first.value is not None and last.value is not None
        ends.append(Limit(crossing(first.value, last.value) if known else None, edges[0], edges[1]))
    return ends


@dataclass(frozen=True)
class Answer:
    """Whether a requirement is met along the first axis, at fixed values of the others.

    Parameters
    ----------
    at : str
        Values of the other axes; empty if there are none.
    met : str
        Decisions along the axis and the limits, as text.
    limits : sequence of Limit
        The limits between decided cells.
    """

    at: str
    met: str
    limits: Sequence[Limit]


def answer(axis: Axis, verdicts: Sequence[Verdict | None], bound: float, at: str = "") -> Answer:
    """Return the decisions and limits along an axis."""
    unit = unit_of(axis.key)
    words = ["not simulated" if verdict is None else str(verdict.decision) for verdict in verdicts]
    ends = limits(axis, verdicts, bound)
    if len(set(words)) == 1:
        return Answer(at, f"{words[0]} at all {len(words)} values", ends)
    pieces = []
    for word, group in itertools.groupby(range(len(words)), lambda index: words[index]):
        indices = list(group)
        first, last = (axis.values[index] for index in (indices[0], indices[-1]))
        pieces.append(
            _with_unit(f"{word} at {first:g}" if first == last else f"{word} from {first:g} to {last:g}", unit)
        )
    for end in ends:
        interval = _with_unit(f"between {end.lower:.3g} and {end.upper:.3g}", unit)
        known = "" if end.value is None else f"{_with_unit(f'{end.value:.3g}', unit)}, with 95 % confidence "
        pieces.append(f"limit {known}{interval}")
    return Answer(
        at, "; ".join([", ".join(pieces[: len(pieces) - len(ends)]), *pieces[len(pieces) - len(ends) :]]), ends
    )


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
            table.required.bound,
            ", ".join(f"{axis.key} = {axis.values[index]:g}" for axis, index in zip(others, indices, strict=True)),
        )
        for indices in np.ndindex(*shape[1:])
    ]
