"""Figures of sweeps: the decisions, the estimates, and lines where the required quantile equals its
bound.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pytest

from infoset.experiments.campaigns.sweep_axes import tied_keys
from infoset.experiments.campaigns.sweep_figures import draw_sweep
from infoset.experiments.campaigns.sweep_report import SHOWN
from infoset.experiments.campaigns.sweep_table import SweepTable, limits
from infoset.sim import QuantileName, Requirement
from infoset.sim.requirement import AnyRequirement, HitRequirement
from infoset.sim.storage import Axis

REQUIRED = Requirement(QuantileName("miss_m", 0.99), 10.0)


def made_table(
    axes: Sequence[Axis], required: AnyRequirement, value: Callable[..., float]
) -> SweepTable:
    """Return a table whose required quantile is a function of the values of the axes; a fifth of it
    is undecided.
    """
    rows = []
    for values in itertools.product(*(axis.values for axis in axes)):
        middle = value(*values)
        share = 1.0 / (1.0 + middle)
        shown = share if isinstance(required, HitRequirement) else middle
        bound = 80.0 if isinstance(required, HitRequirement) else required.bound
        distance = math.log(middle / bound)
        decision = "undecided" if abs(distance) < 0.2 else "met" if distance < 0.0 else "not-met"
        row: dict[str, Any] = dict(
            zip((tied_keys(axis.key)[0] for axis in axes), values, strict=True)
        )
        row |= {
            "noise": "game",
            "requirement": decision,
            "limit_quantile": middle,
            "limit_bound": bound,
        }
        row |= {
            "required_value": shown,
            "required_lower": 0.9 * shown,
            "required_upper": 1.1 * shown,
        }
        for quantity, level in itertools.product(("miss_m", "impulse_m_s"), (0.5, 0.99)):
            name = f"{quantity}_p{100 * level:g}"
            row |= {
                name: level * middle,
                f"{name}_lower": 0.8 * level * middle,
                f"{name}_upper": math.nan,
            }
        rows.append(row)
    return SweepTable(tuple(axes), ("game",), required, pd.DataFrame(rows))


def test_sweep_of_one_key_is_drawn_as_lines_over_the_decisions() -> None:
    axis = Axis("thruster.max_impulse_m_s", (2.0, 4.0, 8.0, 16.0))
    table = made_table([axis], REQUIRED, lambda impulse: 40.0 / impulse)
    figure = draw_sweep(table, SHOWN, "game")
    first = figure.axes[0]
    assert [axes.get_ylabel() for axes in figure.axes] == ["miss, m", "impulse spent, m/s"]
    drawn = [np.asarray(line.get_ydata()).tolist() for line in first.lines]
    assert (
        table.rows["required_value"].tolist() in drawn
    )  # the estimate that decides, not that of a fixed number of runs
    assert table.rows["miss_m_p50"].tolist() in drawn


def test_limit_of_a_sweep_of_two_keys_is_drawn_as_a_line() -> None:
    axes = (
        Axis("camera.pixel_error_rad", tuple(np.geomspace(1e-6, 5e-5, 8).tolist()), "log"),
        Axis("thruster.last_impulse_s", tuple(np.geomspace(30.0, 900.0, 8).tolist()), "log"),
    )
    required = Requirement(QuantileName("guaranteed_miss_m", 0.99), 25.0)
    table = made_table(axes, required, lambda error_rad, time_s: 2e4 * error_rad * time_s)
    table.rows["closed_form_m"] = 1.5 * table.rows["limit_quantile"]
    figure = draw_sweep(table, SHOWN, "game")
    first = figure.axes[0]
    assert first.get_xlabel() == "camera: pixel error, $10^{-5}$\N{NO-BREAK SPACE}rad"
    assert first.get_title(loc="left") == "(a) guaranteed miss p99 under 25 m"
    assert len(first.texts) == 64
    drawn, form = (
        np.asarray(each.get_paths()[0].vertices, dtype=float) for each in first.collections[1:]
    )
    # Positions are numbers of values: products are planes on logarithmic scales.
    error_rad, time_s = (
        np.exp(np.interp(line, range(8), np.log(axis.values)))
        for line, axis in zip(drawn.T, axes, strict=True)
    )
    np.testing.assert_allclose(2e4 * error_rad * time_s, 25.0, rtol=1e-9)
    known = limits(table).dropna()
    assert len(known)
    for row in known.to_dict("records"):
        crossing = np.interp(-row["thruster.last_impulse_s"], -time_s, error_rad)
        assert crossing == pytest.approx(row["interpolated"], rel=1e-6)
    assert form[:, 0].max() < drawn[:, 0].max()
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names[-2:] == [
        "limit, interpolated between cells",
        "closed form: worst errors, no later images",
    ]
    table.rows["requirement"] = "undecided"
    few = draw_sweep(table, SHOWN, "game")
    assert "limit, interpolated between cells" not in [
        text.get_text() for text in few.legends[0].get_texts()
    ]
