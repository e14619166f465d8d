"""Figures and page of an engagement whose images show the centre of brightness."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from infoset.arrays import Floats
from infoset.experiments import load_scenario
from infoset.experiments.interception.figures.process import draw_process
from infoset.experiments.interception.figures.sets import draw_sets, planes_at
from infoset.experiments.interception.page import _axis_data
from infoset.sensors import OffsetCamera
from infoset.sim import Record, fly_one

CASE = Path(__file__).parents[2] / "sim" / "cases" / "bright-asteroid.toml"
PIXEL_RAD = 3e-6
CENTROID_M = 6.0


@pytest.fixture(scope="module")
def record() -> Record:
    return fly_one(load_scenario(CASE))


def offset_m(record: Record) -> tuple[float, ...]:
    sensor = record.scenario.bearing_sensor
    assert isinstance(sensor, OffsetCamera)
    return sensor.offset_m


def errors_urad(axes: Axes) -> Floats:
    (dots,) = (line for line in axes.lines if line.get_label() == "error of the measured angle")
    return np.asarray(dots.get_ydata(), dtype=np.float64)


def test_drawn_errors_are_about_the_point_that_the_images_show(record: Record) -> None:
    """The offset of 15 m is greater than the bound of 6 m."""
    steps = np.flatnonzero(record.measures("angle"))
    bounds_urad = 1e6 * (PIXEL_RAD + CENTROID_M / record.true_range_m[steps])
    about_centre_urad = 1e6 * np.abs(record.measured["angle"] - record.true_angle_rad)[steps]

    rows = [axes for axes in draw_process([record]).axes if "error" in axes.get_ylabel()]
    assert len(rows) == 1
    for axes in rows:
        assert (np.abs(errors_urad(axes)) <= bounds_urad * (1.0 + 1e-9)).all()
    assert (about_centre_urad.max(axis=1) > bounds_urad).any()


def test_allowed_angles_are_those_of_the_centre(record: Record) -> None:
    """The image shows a point at z + o, so the centre is at z = x tan(measured angle) - o."""
    time_s = 10_000.0
    figure = draw_sets([record], [time_s])
    planes = planes_at([record], time_s, 5)

    for axes, plane, length_m in zip(figure.axes, planes, offset_m(record), strict=True):
        assert plane.measured_rad is not None
        spans = [each for each in axes.patches if "allowed" in str(each.get_label())]
        sections = (plane.chosen[0], plane.chosen[-1])
        for span, section in zip(spans, sections, strict=True):
            assert isinstance(span, Rectangle)
            x = section.range_m
            centre_rad = math.atan2(x * math.tan(plane.measured_rad) - length_m, x)
            middle_mrad = span.get_y() + 0.5 * span.get_height()
            assert middle_mrad == pytest.approx(1e3 * centre_rad, rel=1e-9)


def test_page_has_the_offset_that_the_set_subtracts(record: Record) -> None:
    data = [_axis_data(record, axis, [0, 1]) for axis in (0, 1)]
    assert [each["image_shift_m"] for each in data] == list(offset_m(record))
    assert data[0]["measured_name"] == "measured angle of the centre of brightness along y"
