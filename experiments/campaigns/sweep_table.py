"""What a sweep comes to: quantiles of every cell, as one table, and where a requirement is met."""

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
"""Units by the end of a key that names them."""


@dataclass(frozen=True)
class SweepTable:
    """Every cell of a sweep.

    Parameters
    ----------
    axes : tuple of Axis
    noises : tuple of str
    levels : tuple of float
        Of the quantiles.
    cells : tuple of tuple of Sample
        The samples of each cell, one a noise; none where it has not been flown. The last axis varies fastest.
    """

    axes: tuple[Axis, ...]
    noises: tuple[str, ...]
    levels: tuple[float, ...]
    cells: tuple[tuple[Sample, ...], ...]

    def sample(self, cell: int, noise: str) -> Sample | None:
        """Return what a cell has under a noise."""
        return next((each for each in self.cells[cell] if each.noise == noise), None)

    def estimate(self, cell: int, noise: str, quantile: QuantileName) -> QuantileEstimate | None:
        """Return a quantile of a cell; None where it is not known."""
        found = self.sample(cell, noise)
        estimates = () if found is None else found.quantiles.get(quantile.quantity, ())
        return next((each for each in estimates if each.level == quantile.level), None)

    def grid(self, noise: str, quantile: QuantileName) -> np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]:
        """Return a quantile over the axes, masked where it is not known."""
        found = [self.estimate(cell, noise, quantile) for cell in range(len(self.cells))]
        values = np.array([0.0 if each is None else each.value for each in found])
        shape = tuple(len(axis.values) for axis in self.axes)
        return np.ma.MaskedArray(values, mask=[each is None for each in found]).reshape(shape)

    def columns(self) -> tuple[dict[str, list[Any]], dict[str, str]]:
        """Return one row a cell and noise, by column, and the units of the columns."""
        rows: list[dict[str, Any]] = []
        combinations = itertools.product(*(axis.values for axis in self.axes))
        for cell, values in enumerate(combinations):
            for noise in self.noises:
                found = self.sample(cell, noise)
                row: dict[str, Any] = {"cell": cell}
                row |= dict(zip((axis.key for axis in self.axes), values, strict=True))
                row |= {"noise": noise, "runs": 0 if found is None else found.runs}
                for name in OUTCOMES:
                    row[name.replace("-", "_")] = 0 if found is None else found.outcomes.get(name, 0)
                row["truth_kept"] = 0 if found is None else found.truth_kept
                for quantity, level in itertools.product(QUANTITIES, self.levels):
                    each = self.estimate(cell, noise, QuantileName(quantity, level))
                    name = f"{quantity}_{level_name(level)}"
                    row |= {
                        name: None if each is None else each.value,
                        f"{name}_lower": None if each is None else each.lower,
                        f"{name}_upper": None if each is None else each.upper,
                    }
                for quantity in QUANTITIES:
                    row[f"{quantity}_max"] = None if found is None else found.worst.get(quantity)
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
    """Summarise a sweep.

    Parameters
    ----------
    folder : CampaignFolder
        Of a sweep, finished or not.
    quantiles : sequence of QuantileName
        Whose levels are wanted besides the usual ones.

    Returns
    -------
    SweepTable
    """
    levels = tuple(sorted({*LEVELS, *(each.level for each in quantiles)}))
    cells = tuple(tuple(samples(folder, cell, levels)) for cell in range(folder.manifest.cells))
    return SweepTable(folder.manifest.axes, tuple(noises_of(folder)), levels, cells)


def crossings(values: Sequence[float], quantile: Sequence[float | None], bound: float, scale: str) -> list[float]:
    """Return where a quantile crosses a bound along an axis, between its values on the axis's own scale.

    Parameters
    ----------
    values : sequence of float
    quantile : sequence of float or None
        At each value; None where it is not known.
    bound : float
    scale : str
        `linear` or `log`.

    Returns
    -------
    list of float
    """
    found = []
    for (left, below), (right, above) in itertools.pairwise(zip(values, quantile, strict=True)):
        if below is None or above is None or (below < bound) == (above < bound):
            continue
        share = (bound - below) / (above - below)
        if scale == "log":
            found.append(left * math.exp(share * math.log(right / left)))
        else:
            found.append(left + share * (right - left))
    return found


def where_met(axis: Axis, quantile: Sequence[float | None], bound: float) -> str:
    """Say for which values of an axis a quantile stays under a bound.

    Parameters
    ----------
    axis : Axis
    quantile : sequence of float or None
    bound : float

    Returns
    -------
    str
        Such as `up to 0.00021`.
    """
    known = [each for each in quantile if each is not None]
    if not known:
        return "not flown yet"
    crossed = [f"{each:.3g}" for each in crossings(axis.values, quantile, bound, axis.scale)]
    if not crossed:
        return "everywhere" if known[0] < bound else "nowhere"
    met, pieces = known[0] < bound, []
    for place, each in enumerate(crossed):
        if met:
            pieces.append(f"up to {each}" if place == 0 else f"{crossed[place - 1]} to {each}")
        met = not met
    if met:
        pieces.append(f"from {crossed[-1]}")
    return ", ".join(pieces)


def answers(table: SweepTable, noise: str, requirement: Requirement) -> list[tuple[str, str]]:
    """Say where a requirement is met along the first axis, for each value of the others.

    Parameters
    ----------
    table : SweepTable
    noise : str
    requirement : Requirement

    Returns
    -------
    list of tuple of str
        What the others are, and where it is met.
    """
    first, *others = table.axes
    grid = table.grid(noise, requirement.quantile)
    lines = []
    for places in np.ndindex(*(len(axis.values) for axis in others)):
        column = grid[(slice(None), *places)]
        known = [
            None if missing else float(value)
            for value, missing in zip(column.data, np.ma.getmaskarray(column), strict=True)
        ]
        said = ", ".join(f"{axis.key} = {axis.values[place]:g}" for axis, place in zip(others, places, strict=True))
        lines.append((said, where_met(first, known, requirement.bound)))
    return lines


def unit_of(key: str) -> str:
    """Return the unit that a key names; empty where it names none."""
    name = _named(key)
    return next((unit for end, unit in UNITS.items() if name.endswith(f"_{end}")), "")


def key_label(key: str) -> str:
    """Return a key as the label of an axis: `angle sensor, error at nominal range, rad`."""
    table, name, *end = key.split(".")
    words = next((name.removesuffix(f"_{each}") for each in UNITS if name.endswith(f"_{each}")), name)
    unit = unit_of(key)
    said = f"{table}: {words} {' '.join(end)}".replace("_", " ").strip()
    return f"{said}, {unit}" if unit else said


def _named(key: str) -> str:
    return key.split(".")[1] if "." in key else key
