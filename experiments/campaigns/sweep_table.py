"""The quantiles of every cell of a sweep as one table, and the values that meet a requirement."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.campaigns.samples import LEVELS, OUTCOMES, Sample, noises_of, samples
from sim import QuantileEstimate, QuantileName, Requirement
from sim.stopping_rule import QUANTITIES, level_name
from sim.storage import Axis, CampaignFolder

Floats = NDArray[np.float64]

TABLE = "sweep.parquet"
SHOWN = tuple(QuantileName(quantity, level) for quantity in ("miss_m", "impulse_m_s") for level in (0.5, 0.99))
UNITS = {
    "km3_s2": "km\N{SUPERSCRIPT THREE}/s\N{SUPERSCRIPT TWO}",
    "m_s2": "m/s\N{SUPERSCRIPT TWO}",
    "km_s": "km/s",
    "m_s": "m/s",
    "rad_s": "rad/s",
    "rad": "rad",
    "deg": "deg",
    "km": "km",
    "m": "m",
    "s": "s",
}
"""Units by the end of the key."""


@dataclass(frozen=True)
class SweepTable:
    """Every cell of a sweep.

    Parameters
    ----------
    axes : tuple of Axis
        Keys that vary; the last varies fastest over the cells.
    noises : tuple of str
        Noises of the sweep.
    levels : tuple of float
        Levels of the quantiles.
    cells : tuple of tuple of Sample
        Samples of each cell, one for each noise; empty for a cell without runs.
    """

    axes: tuple[Axis, ...]
    noises: tuple[str, ...]
    levels: tuple[float, ...]
    cells: tuple[tuple[Sample, ...], ...]

    def sample(self, cell: int, noise: str) -> Sample | None:
        """Return the sample of a cell and a noise; None without runs."""
        return next((sample for sample in self.cells[cell] if sample.noise == noise), None)

    def estimate(self, cell: int, noise: str, quantile: QuantileName) -> QuantileEstimate | None:
        """Return a quantile of a cell; None if it is not known."""
        sample = self.sample(cell, noise)
        estimates = () if sample is None else sample.quantiles.get(quantile.quantity, ())
        return next((estimate for estimate in estimates if estimate.level == quantile.level), None)

    def grid(self, noise: str, quantile: QuantileName) -> np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]:
        """Return a quantile over the axes, masked where it is not known."""
        estimates = [self.estimate(cell, noise, quantile) for cell in range(len(self.cells))]
        values = np.array([0.0 if estimate is None else estimate.value for estimate in estimates])
        shape = tuple(len(axis.values) for axis in self.axes)
        return np.ma.MaskedArray(values, mask=[estimate is None for estimate in estimates]).reshape(shape)

    def columns(self) -> tuple[dict[str, list[Any]], dict[str, str]]:
        """Return columns with a row for each cell and noise, and the units of the columns."""
        rows: list[dict[str, Any]] = []
        combinations = itertools.product(*(axis.values for axis in self.axes))
        for cell, values in enumerate(combinations):
            for noise in self.noises:
                sample = self.sample(cell, noise)
                row: dict[str, Any] = {"cell": cell}
                row |= dict(zip((axis.key for axis in self.axes), values, strict=True))
                row |= {"noise": noise, "runs": 0 if sample is None else sample.runs}
                for name in OUTCOMES:
                    row[name.replace("-", "_")] = 0 if sample is None else sample.outcomes.get(name, 0)
                row["truth_kept"] = 0 if sample is None else sample.truth_kept
                for quantity, level in itertools.product(QUANTITIES, self.levels):
                    estimate = self.estimate(cell, noise, QuantileName(quantity, level))
                    name = f"{quantity}_{level_name(level)}"
                    row |= {
                        name: None if estimate is None else estimate.value,
                        f"{name}_lower": None if estimate is None else estimate.lower,
                        f"{name}_upper": None if estimate is None else estimate.upper,
                    }
                for quantity in QUANTITIES:
                    row[f"{quantity}_max"] = None if sample is None else sample.worst.get(quantity)
                rows.append(row)
        columns = {name: [row[name] for row in rows] for name in rows[0]}
        units = {axis.key: unit_of(axis.key) for axis in self.axes}
        units |= {
            name: unit
            for quantity, unit in zip(QUANTITIES, ("m", "m/s", "m"), strict=True)
            for name in columns
            if name.startswith(f"{quantity}_")
        }
        return columns, units


def sweep_table(folder: CampaignFolder, quantiles: Sequence[QuantileName] = ()) -> SweepTable:
    """Summarise a sweep, finished or not, at the levels `LEVELS` and those of some more quantiles."""
    levels = tuple(sorted({*LEVELS, *(quantile.level for quantile in quantiles)}))
    cells = tuple(tuple(samples(folder, cell, levels)) for cell in range(folder.manifest.cells))
    return SweepTable(folder.manifest.axes, tuple(noises_of(folder)), levels, cells)


def crossings(values: Sequence[float], quantile: Sequence[float | None], bound: float, scale: str) -> list[float]:
    """Return the values of an axis at which a quantile crosses a bound, by interpolation on the scale of the axis.

    Parameters
    ----------
    values : sequence of float
        Values of the axis.
    quantile : sequence of float or None
        Quantile at each value; None where it is not known.
    bound : float
        Bound, in the unit of the quantile.
    scale : str
        Scale of the axis, `linear` or `log`.
    """
    crossed = []
    for (left, below), (right, above) in itertools.pairwise(zip(values, quantile, strict=True)):
        if below is None or above is None or (below < bound) == (above < bound):
            continue
        share = (bound - below) / (above - below)
        if scale == "log":
            crossed.append(left * math.exp(share * math.log(right / left)))
        else:
            crossed.append(left + share * (right - left))
    return crossed


def where_met(axis: Axis, quantile: Sequence[float | None], bound: float) -> str:
    """Return the values of an axis for which a quantile is less than a bound, as text: `up to 0.00021`."""
    known = [value for value in quantile if value is not None]
    if not known:
        return "not simulated yet"
    crossed = [f"{value:.3g}" for value in crossings(axis.values, quantile, bound, axis.scale)]
    if not crossed:
        return "everywhere" if known[0] < bound else "nowhere"
    met, pieces = known[0] < bound, []
    for number, value in enumerate(crossed):
        if met:
            pieces.append(f"up to {value}" if number == 0 else f"{crossed[number - 1]} to {value}")
        met = not met
    if met:
        pieces.append(f"from {crossed[-1]}")
    return ", ".join(pieces)


def answers(table: SweepTable, noise: str, requirement: Requirement) -> list[tuple[str, str]]:
    """Return the values of the first axis that meet a requirement, for each combination of values of the others."""
    first, *others = table.axes
    grid = table.grid(noise, requirement.quantile)
    lines = []
    for indices in np.ndindex(*(len(axis.values) for axis in others)):
        column = grid[(slice(None), *indices)]
        known = [
            None if missing else float(value)
            for value, missing in zip(column.data, np.ma.getmaskarray(column), strict=True)
        ]
        label = ", ".join(f"{axis.key} = {axis.values[index]:g}" for axis, index in zip(others, indices, strict=True))
        lines.append((label, where_met(first, known, requirement.bound)))
    return lines


def unit_of(key: str) -> str:
    """Return the unit in the name of a key; empty if it has none."""
    name = _named(key)
    return next((unit for end, unit in UNITS.items() if name.endswith(f"_{end}")), "")


def key_label(key: str) -> str:
    """Return a key as the label of an axis: `angle sensor, error at nominal range, rad`."""
    table, name, *end = key.split(".")
    words = next((name.removesuffix(f"_{end}") for end in UNITS if name.endswith(f"_{end}")), name)
    unit = unit_of(key)
    label = f"{table}: {words} {' '.join(end)}".replace("_", " ").strip()
    return f"{label}, {unit}" if unit else label


def _named(key: str) -> str:
    return key.split(".")[1] if "." in key else key
