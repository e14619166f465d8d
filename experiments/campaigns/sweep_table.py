"""The table of a sweep: summaries and decisions of cells, and limits of the values that decide."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from infoset.arrays import Floats
from infoset.experiments.campaigns.run_tables import LEVELS, or_nan, summary
from infoset.experiments.campaigns.sample_rows import Step, noises_of
from infoset.experiments.campaigns.sweep_axes import sweep_cells, tied_keys
from infoset.sim import Requirement, Scenario
from infoset.sim.closed_form import possible_miss_of
from infoset.sim.requirement import AnyRequirement, Decision, judge
from infoset.sim.statistics import shows
from infoset.sim.storage import Axis, CampaignFolder

_LOG_FROM = 30.0
"""Ratio of the maximum to the minimum value from which the values have a logarithmic axis.

On a linear axis from zero the smallest value would be less than a thirtieth of the axis above its
end.
"""
_ESTIMATE = ("required_value", "required_lower", "required_upper", "required_known")
"""Columns of the estimate that decides."""


@dataclass(frozen=True)
class SweepTable:
    """The cells of a sweep.

    Parameters
    ----------
    rows : DataFrame
        A row for each cell and noise; the last of the axes varies fastest. The columns are the
        columns of `run_tables.summary` and the decision: `requirement` (a value of `Decision`; none
        without runs), the required estimate with its interval, `required_value`, `_lower` and
        `_upper`, the runs with a value of the quantity, `required_known`, and the runs of all
        noises that would decide, `runs_needed` (NaN if more than `requirement.MAX_RUNS_NEEDED`).
        `limit_quantile` and `limit_bound` are compared by interpolation: the required quantile and
        its bound; for hits, the quantile of the miss and the radius of the body. `closed_form_m` is
        the guaranteed miss by the closed form of a camera (`closed_form.py`), if the requirement is
        about it.
    """

    axes: tuple[Axis, ...]
    noises: tuple[str, ...]
    required: AnyRequirement
    rows: pd.DataFrame

    @property
    def keys(self) -> list[str]:
        """The varied keys, one of each axis."""
        return [tied_keys(axis.key)[0] for axis in self.axes]

    def of_noise(self, noise: str) -> pd.DataFrame:
        """Return the rows of a noise."""
        return self.rows[self.rows["noise"] == noise]


def sweep_table(folder: CampaignFolder, required: AnyRequirement) -> SweepTable:
    """Return the table of a sweep, finished or not, with the required quantile."""
    levels = set(LEVELS)
    if isinstance(required, Requirement):
        levels.add(required.quantile.level)
    columns = tuple(dict.fromkeys((required.quantity, "miss_m")))
    decided = Step(columns, partial(_decision, required=required, folder=folder))
    rows = summary(folder, sorted(levels), [decided]).astype(
        {"required_known": "Int64", "runs_needed": "Int64"}
    )

    noises = noises_of(folder)
    if isinstance(required, Requirement):
        rows["limit_bound"] = required.bound
    else:
        rows["limit_bound"] = _radii_m(folder, rows)
    if required.quantity == "guaranteed_miss_m" and folder.manifest.scenario.camera is not None:
        # The rows of a cell follow each other, one for each noise.
        # The closed form does not depend on the noise.
        rows["closed_form_m"] = np.repeat(_closed_forms(folder), len(noises))
    return SweepTable(folder.manifest.axes, tuple(noises), required, rows)


def _decision(
    runs: pd.DataFrame, required: AnyRequirement, folder: CampaignFolder
) -> dict[str, Any]:
    """Return the decision of a cell with its estimate, and the quantile that shows its limit."""
    row: dict[str, Any] = {
        "requirement": None,
        **dict.fromkeys((*_ESTIMATE, "runs_needed"), math.nan),
    }
    values = required.numbers(runs[required.quantity])

    if values.size:
        verdict = judge(values, required, watched=folder.manifest.is_watched)
        row["requirement"] = verdict.decision.value
        row["required_value"] = or_nan(verdict.value)
        row["required_lower"] = or_nan(verdict.lower)
        row["required_upper"] = or_nan(verdict.upper)
        row["required_known"] = or_nan(verdict.known)
        # Numbers of runs count the runs of all noises, like --runs and --max-runs.
        row["runs_needed"] = len(noises_of(folder)) * or_nan(verdict.runs_needed)

    # For hits: the quantile of the miss at the required share; at the limit it is the radius of the
    # body. A probability of no miss by a cause has no such quantile.
    row["limit_quantile"] = math.nan
    if isinstance(required, Requirement):
        row["limit_quantile"] = row["required_value"]
    elif required.cause is None and len(runs) and shows(len(runs), required.share):
        row["limit_quantile"] = float(np.quantile(runs["miss_m"], required.share))
    return row


def _radii_m(folder: CampaignFolder, table: pd.DataFrame) -> Any:
    """Return the radius of the body, m: one number, or a column if a key of the body is varied."""
    scenario = folder.manifest.scenario
    axes = folder.manifest.axes
    if not any("body." in axis.key for axis in axes):
        return or_nan(_radius_m(scenario))
    radii_m = [_radius_m(cell) for cell in sweep_cells(scenario, axes)]
    return table["cell"].map(dict(enumerate(radii_m)))


def _radius_m(scenario: Scenario) -> float | None:
    """Return the radius of a body whose hits follow from the misses, m; None for another one."""
    if scenario.body is None or not scenario.body.is_sphere_around_aim:
        return None
    return scenario.certain_radius_m


def _closed_forms(folder: CampaignFolder) -> list[float]:
    """Return the closed form of the guaranteed miss of each cell, m.

    NaN in cells with fewer than two images, or with a camera that can lose images.
    """
    values = []
    for cell in sweep_cells(folder.manifest.scenario, folder.manifest.axes):
        try:
            values.append(or_nan(possible_miss_of(cell)))
        except ValueError:
            values.append(math.nan)
    return values


def limits(table: SweepTable) -> pd.DataFrame:
    """Return the limits along the first axis.

    The table has a row for each noise, combination of the other values, and limit.

    A limit lies between the values `met` and `not_met` of two decided cells; cells without runs are
    undecided. `interpolated` has no confidence. It is where the interpolated `limit_quantile` of
    two neighbouring cells equals its bound, on the scale of the axis; logarithms of the quantiles
    if `spans_decades`. It is NaN if undecided cells lie between the two, or a quantile is not known
    or is on the other side of the bound than the decision. A probability of hits is not
    interpolated: between two cells it can be a step.
    """
    others = ["noise", *table.keys[1:]]
    rows = []
    for at, cells in table.rows.groupby(others, sort=False):
        where = dict(zip(others, at, strict=True))
        rows += [where | limit for limit in _limits_along(table.axes[0], cells)]
    return pd.DataFrame(rows, columns=[*others, "met", "not_met", "interpolated"])


def _limits_along(axis: Axis, cells: pd.DataFrame) -> Iterator[dict[str, float]]:
    """Yield the limits of the cells along an axis: where two decided cells, between which none is
    decided, have different decisions.
    """
    above = above_bound(cells)
    met = (cells["requirement"] == Decision.MET.value).to_numpy()
    is_decided = met | (cells["requirement"] == Decision.NOT_MET.value)
    decided = np.flatnonzero(is_decided).tolist()

    for left, right in itertools.pairwise(decided):
        if met[left] == met[right]:
            continue
        good, bad = right, left
        if met[left]:
            good, bad = left, right

        # Only between neighbours, and only if the quantiles are on the sides of the decisions.
        interpolated = math.nan
        if right == left + 1 and above[good] < 0.0 <= above[bad]:
            share = above[left] / (above[left] - above[right])
            interpolated = _between(axis, left, right, share)
        yield {
            "met": axis.values[good],
            "not_met": axis.values[bad],
            "interpolated": interpolated,
        }


def _between(axis: Axis, left: int, right: int, share: float) -> float:
    """Return the value at a share of the way between two values, on the scale of the axis."""
    near = axis.values[left]
    far = axis.values[right]
    if axis.scale == "log":
        value: float = near * (far / near) ** share
        return value
    return near + share * (far - near)


def above_bound(cells: pd.DataFrame, quantile: str = "limit_quantile") -> Floats:
    """Return the difference of a quantile and its bound in each cell; NaN if it is unknown.

    If the `limit_quantile` of these cells spans decades, it is the difference of the logarithms,
    also for another `quantile`.
    """
    values = cells[quantile].to_numpy(np.float64)
    bounds = cells["limit_bound"].to_numpy(np.float64)
    if spans_decades(cells["limit_quantile"]):
        return np.asarray(np.log(values) - np.log(bounds))
    return np.asarray(values - bounds)


def spans_decades(values: pd.Series) -> bool:
    """Return whether values are positive and need a logarithmic axis; NaN is left out."""
    return bool(values.max() > _LOG_FROM * values.min() > 0.0)
