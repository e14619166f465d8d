"""The limit of the chart of the guaranteed miss is the closed form of the misses that a camera
leaves possible.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.experiments.common.input_file import to_toml
from infoset.sim.closed_form import possible_miss_m
from tests.experiments.command_line import Command

pytest.importorskip("pyarrow")

pytestmark = pytest.mark.usefixtures("unrendered")

BOUND_M = 25.0
FIRST_S = 1440.0
IDEAL = [
    "nominal_range_km=8841.6",  # 1440 s at 6.14 km/s
    "uncertainty.x_km=[8841.6, 8841.6]",
    "dispersion.x_km=8841.6",
    "uncertainty.vx_km_s=[-6.14, -6.14]",
    "dispersion.vx_km_s=-6.14",
    "step_s=20",
    "camera.period_s=20",
    "camera.centroid_error_m=0",
    "camera.bias=random",
    "target.manoeuvre=none",
    "information_set.disturbance_m_s2=0",
    "thruster.min_impulse_m_s=0",
    "thruster.max_impulse_m_s=20",
    "thruster.budget_m_s=1000",
    "thruster.execution_error_relative=0",
    "thruster.pointing_error_rad=0",
]
"""An ideal engine, a known range and speed, and no disturbance."""


@pytest.mark.thorough
def test_the_limit_of_the_chart_is_the_closed_form(infoset: Command, tmp_path: Path) -> None:
    """The noise of the game leaves the misses of the closed form possible, and the last impulse
    centres them.
    """
    file = tmp_path / "ideal.toml"
    file.write_text(to_toml(load_scenario("dart-2022", IDEAL)))
    axes = (
        "camera.pixel_error_rad=1e-6:1.7e-5:5",
        "thruster.last_impulse_s=camera.last_image_s=40:320:8",
    )
    infoset(
        *(
            "sweep",
            file,
            "--vary",
            axes[0],
            "--vary",
            axes[1],
            "--noise",
            "game",
            "--runs",
            "6",
            "--quiet",
        ),
        *("--require", "guaranteed_miss_m p50<25", "--out", tmp_path / "out"),
    )
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    pixels_rad, cut_offs_s = (np.array(axis["values"]) for axis in summary["axes"])
    met = np.array([cell["requirement"] == "met" for cell in summary["cells"]]).reshape(5, 8)
    possible_m = np.sqrt(2.0) * possible_miss_m(
        6140.0, pixels_rad[:, None], 0.0, FIRST_S, cut_offs_s
    )
    # The maximum cut-off that meets the requirement, as the number of values up to it.
    limits = met.sum(axis=1)
    expected = (possible_m < BOUND_M).sum(axis=1)
    assert (np.diff(met.astype(int), axis=1) <= 0).all()
    assert (np.abs(limits - expected) <= 1).all(), (limits, expected)
    assert len(set(expected)) > 3
