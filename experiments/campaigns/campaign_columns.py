"""The columns of a campaign by noise, and the correlation of the miss with the initial state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from experiments.campaigns.samples import noise_flags
from infoset.arrays import Floats
from sim.statistics import correlation_interval
from sim.storage import CampaignFolder

START = ("y_km", "z_km", "x_km", "vy_km_s", "vz_km_s", "vx_km_s")
"""Columns of the initial state; those of y are null in a plane."""


@dataclass(frozen=True)
class CampaignColumns:
    """The columns of the rows of one noise.

    `start` has the components of the initial state by column: of position, then of velocity. `guaranteed_miss_m` has
    the known values, so it may be shorter than the other columns.
    """

    noise: str
    range_sensor: bool
    miss_m: Floats
    impulse_m_s: Floats
    guaranteed_miss_m: Floats
    start: Mapping[str, Floats]
    guarantees: bool
    radius_m: float | None = None


def campaign_columns(folder: CampaignFolder) -> list[CampaignColumns]:
    """Return the columns of all rows, one entry for each noise with rows."""
    scenario = folder.manifest.scenario
    miss, impulse, guaranteed = (folder.numbers(name) for name in ("miss_m", "impulse_m_s", "guaranteed_miss_m"))
    start = {name: values.data for name in START if (values := folder.numbers(name)).count()}
    columns = [
        CampaignColumns(
            noise,
            scenario.range_sensor is not None,
            miss.data[rows],
            impulse.data[rows],
            guaranteed[rows].compressed(),
            {name: values[rows] for name, values in start.items()},
            scenario.set_model.is_guaranteed,
            scenario.radius_m,
        )
        for noise, rows in noise_flags(folder).items()
    ]
    return [column for column in columns if column.miss_m.size]


def correlations(columns: CampaignColumns) -> dict[str, dict[str, float | None]]:
    """Return Pearson's and Spearman's correlation of the miss with each component of the initial state, by component.

    Each has the ends of its 95 % confidence interval. The moduli of the lateral components are included, for example
    `|z_km|`. A correlation is None where the component or the miss does not vary, and its ends also with fewer than 4
    runs.
    """
    start = dict(columns.start)
    start |= {f"|{name}|": np.abs(values) for name, values in start.items() if name not in ("x_km", "vx_km_s")}
    miss = columns.miss_m
    return {
        name: _with_ends("pearson", _correlation(values, miss), miss.size)
        | _with_ends("spearman", _correlation(_ranks(values), _ranks(miss)), miss.size)
        for name, values in start.items()
    }


def _with_ends(kind: str, value: float | None, size: int) -> dict[str, float | None]:
    ends = None if value is None else correlation_interval(value, size, ranks=kind == "spearman")
    lower, upper = (None, None) if ends is None else ends
    return {kind: value, f"{kind}_lower": lower, f"{kind}_upper": upper}


def _correlation(one: Floats, other: Floats) -> float | None:
    deviations = one - one.mean(), other - other.mean()
    size = float(np.sqrt((deviations[0] ** 2).sum() * (deviations[1] ** 2).sum()))
    if len(one) < 2 or size == 0.0:
        return None
    return float(np.clip((deviations[0] * deviations[1]).sum() / size, -1.0, 1.0))


def _ranks(values: Floats) -> Floats:
    """Return the ranks of values, from 0; equal values have the mean of their ranks."""
    _, indices, counts = np.unique(values, return_inverse=True, return_counts=True)
    first = np.cumsum(counts) - counts
    return np.asarray((first + 0.5 * (counts - 1))[indices], dtype=np.float64)
