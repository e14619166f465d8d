"""Limits between the decided cells of a sweep, and the columns of its table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from infoset.experiments.campaigns.sweep_axes import sweep_cells
from infoset.experiments.campaigns.sweep_table import SweepTable, limits, spans_decades, sweep_table
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Body, Campaign, CampaignNoise, QuantileName, Requirement, Scenario, simulate
from infoset.sim.requirement import AnyRequirement, HitRequirement, judge
from infoset.sim.storage import Axis, CampaignFolder

REQUIRED = Requirement(QuantileName("miss_m", 0.99), 10.0)
MET, NOT_MET, OPEN = "met", "not-met", "undecided"
Cell = tuple[float | None, str | None]


def along(
    axis: Axis, cells: Sequence[Cell], bound: float = 10.0
) -> list[tuple[float | None, float, float]]:
    """Return the limits along an axis as (interpolated, met, not met), from quantiles and
    decisions.
    """
    quantiles, decisions = zip(*cells, strict=True)
    rows = pd.DataFrame({axis.key: axis.values, "noise": "game", "requirement": decisions})
    rows["limit_quantile"] = np.array(quantiles, dtype=np.float64)
    rows["limit_bound"] = bound
    found = limits(SweepTable((axis,), ("game",), REQUIRED, rows))
    assert (found["noise"] == "game").all()
    values = found[["interpolated", "met", "not_met"]].itertuples(index=False, name=None)
    return [(None if math.isnan(value) else value, met, missed) for value, met, missed in values]


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        ([(5.0, MET), (15.0, NOT_MET), (5.0, MET)], [(1.5, 1.0, 2.0), (3.0, 4.0, 2.0)]),
        ([(5.0, MET), (10.5, OPEN), (15.0, NOT_MET)], [(None, 1.0, 4.0)]),
        ([(5.0, MET), (None, None), (15.0, NOT_MET)], [(None, 1.0, 4.0)]),
        ([(10.5, OPEN), (15.0, NOT_MET), (10.5, OPEN)], []),
        ([(5.0, MET), (None, NOT_MET), (15.0, NOT_MET)], [(None, 1.0, 2.0)]),
        # An estimate contradicts its decision, which added runs can cause.
        ([(11.0, MET), (15.0, NOT_MET), (15.0, NOT_MET)], [(None, 1.0, 2.0)]),
        ([(5.0, MET), (9.0, NOT_MET), (9.0, NOT_MET)], [(None, 1.0, 2.0)]),
        # Logarithms of quantiles that span decades are interpolated.
        ([(1.0, MET), (100.0, NOT_MET), (100.0, NOT_MET)], [(1.5, 1.0, 2.0)]),
    ],
)
def test_limits_are_interpolated_between_neighbouring_decided_cells_only(
    cells: list[Cell], expected: list[tuple[float | None, float, float]]
) -> None:
    assert along(Axis("step_s", (1.0, 2.0, 4.0)), cells) == [
        pytest.approx(limit) for limit in expected
    ]


def test_limits_on_a_logarithmic_axis() -> None:
    axis = Axis("a", (1.0, 100.0), "log")
    assert along(axis, [(5.0, MET), (15.0, NOT_MET)]) == [pytest.approx((10.0, 1.0, 100.0))]


@given(values=st.lists(st.floats(0.0, 20.0), min_size=2, max_size=12), bound=st.floats(1.0, 19.0))
def test_limits_lie_between_cells_on_either_side_of_the_bound(
    values: list[float], bound: float
) -> None:
    axis = Axis("a", tuple(float(index) for index in range(len(values))))
    found = along(axis, [(value, MET if value < bound else NOT_MET) for value in values], bound)
    changes = [
        left
        for left in range(len(values) - 1)
        if (values[left] < bound) != (values[left + 1] < bound)
    ]
    drawn = np.log if spans_decades(pd.Series(values)) else np.array
    for (value, *ends), left in zip(found, changes, strict=True):
        assert value is not None
        assert sorted(ends) == [left, left + 1]
        assert left <= value <= left + 1
        assert np.interp(value, axis.values, drawn(values)) == pytest.approx(
            drawn(bound), rel=1e-9, abs=1e-9
        )


def test_limits_hold_the_true_limit_of_an_exponential_dependence() -> None:
    """A straight line between the ends of the confidence intervals never holds it: the limit is
    1.997.
    """
    axis = Axis("a", tuple(np.linspace(0.0, 4.0, 4)))
    required = Requirement(QuantileName("miss_m", 0.9), 10.0)
    generator = np.random.default_rng(3)
    true = math.log(20.0) / 1.5
    factor = math.exp(
        0.5 * 1.2815515655446004
    )  # the 90 % quantile of the distribution below, by its median
    for _ in range(50):
        misses = np.exp(0.5 * generator.standard_normal(400)) / factor
        verdicts = [
            judge(0.5 * math.exp(1.5 * x) * misses, required, watched=False) for x in axis.values
        ]
        ((value, met, missed),) = along(
            axis, [(each.value, each.decision.value) for each in verdicts]
        )
        assert met <= true <= missed
        assert value == pytest.approx(true, abs=0.1)


def swept(
    scenario: Scenario,
    axes: tuple[Axis, ...],
    runs: int,
    folder: Path,
    required: AnyRequirement = REQUIRED,
) -> SweepTable:
    """Return the table of a sweep with game noise."""
    cells = sweep_cells(scenario, axes)
    Campaign(
        scenario, runs, folder, axes=axes, cells=cells, noise=CampaignNoise.GAME, guarantee=False
    ).run()
    return sweep_table(CampaignFolder.read(folder), required)


def test_the_limit_of_hits_along_the_radius_is_the_quantile_of_the_miss(
    brief: Scenario, tmp_path: Path
) -> None:
    """The radius changes no miss. An interpolated probability gave 19 % more."""
    misses_m = simulate(replace(brief, noise=NoiseKind.GAME), 80).miss_m
    quantile_m = float(np.quantile(misses_m, 0.95))
    axis = Axis("body.radius_m", (0.5 * quantile_m, 1.3 * quantile_m))
    table = swept(
        replace(brief, body=Body(8.0)), (axis,), 80, tmp_path / "radius", HitRequirement(0.95)
    )
    assert limits(table)["interpolated"].tolist() == pytest.approx([quantile_m])
    assert table.rows["hits"].tolist() == [
        int((misses_m <= radius_m).sum()) for radius_m in axis.values
    ]


@pytest.mark.thorough
def test_limit_of_hits_is_confirmed_by_a_finer_sweep(tmp_path: Path) -> None:
    """An interpolated probability gave 1.4e-5 rad, just above the last cell that meets the
    requirement.
    """
    short = [
        "nominal_range_km=8841.6",
        "uncertainty.x_km=[8831.6, 8851.6]",
        "dispersion.x_km=[8836.6, 8846.6]",
    ]
    quick = ["step_s=20", "camera.period_s=20", "thruster.max_impulse_m_s=1"]
    scenario = load_scenario("dart-2022", [*short, *quick])
    found = []
    for count in (2, 7):
        axis = Axis("camera.pixel_error_rad", tuple(np.linspace(1.3e-5, 2.5e-5, count).tolist()))
        (limit,) = limits(
            swept(scenario, (axis,), 40, tmp_path / str(count), HitRequirement(0.9))
        ).to_dict("records")
        found.append(limit)
    coarse, fine = found
    assert fine["not_met"] - fine["met"] < 0.4 * (coarse["not_met"] - coarse["met"])
    assert fine["met"] < coarse["interpolated"] < fine["not_met"]


def test_table_has_the_results_of_each_simulated_cell(brief: Scenario, tmp_path: Path) -> None:
    axes = (
        Axis("thruster.max_impulse_m_s", (2.0, 8.0)),
        Axis("thruster.budget_m_s", (10.0, 500.0)),
    )
    rows = swept(brief, axes, 30, tmp_path / "two").rows
    assert rows["cell"].tolist() == [0, 1, 2, 3]
    for _, row in rows.iterrows():
        changed = {
            key.split(".")[1]: row[key]
            for key in ("thruster.max_impulse_m_s", "thruster.budget_m_s")
        }
        cell = replace(brief, thruster=replace(brief.thruster, **changed), noise=NoiseKind.GAME)
        flown = simulate(cell, 30)
        assert row["runs"] == 30
        assert row["miss_m_p90"] == np.quantile(flown.miss_m, 0.9)
        assert row["impulse_m_s_p50"] == np.quantile(flown.impulse_m_s, 0.5)
        assert row["miss_m_max"] == flown.miss_m.max()
        assert row[["miss_m_p99", "miss_m_p99_upper", "hits"]].isna().all()
        assert row["miss_m_p50_lower"] in flown.miss_m
        assert row["truth_kept"] == int(flown.truth_kept.sum())
        assert row["set_emptied"] == int(flown.set_emptied.sum())
        assert row[["arrived", "set_empty", "budget_spent", "diverged"]].sum() == 30
