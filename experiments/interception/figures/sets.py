"""Information sets in the (omega, alpha) plane: the paper's figure 3.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from string import ascii_lowercase
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    HALO,
    INK,
    MEASURED,
    WIDTH_MM,
    legend_below,
    letters,
    plain,
    style,
    subplots,
)
from infoset.experiments.interception.course import Clock, evenly, record_titles
from infoset.set_queries import Section
from infoset.sim import Record

TRUTH_MARK = "true (ω, α)"
MEASUREMENT_MARK = "measured α, drawn at the true ω"
SECTIONS_MARK = "sections of the set, the nearest dark"
_TRUTH: dict[str, Any] = {
    "marker": "x",
    "color": INK,
    "markersize": 7.0,
    "markeredgewidth": 1.6,
    "linestyle": "none",
}
_SQUARE: dict[str, Any] = {
    "marker": "s",
    "color": INK,
    "markerfacecolor": "white",
    "markersize": 5.5,
}
_SECTIONS = 5
"""Maximum number of sections of a plane; chosen: more would hide each other."""
_RATES = ("µrad/s", "nrad/s")
"""Units of rates; the second one is for small numbers."""
_ANGLES = ("mrad", "µrad")
"""Units of angles; the second one is for small numbers."""
_SMALL = 0.1
"""Largest number of an axis up to which its second unit is used: there it is at most 100."""
_VISIBLE = 0.3
"""Share of common limits, in omega or alpha, below which a box is too small to see; chosen.

All planes of its lateral axis in the row then have their own limits.
"""
_FAR = 1.5
"""Distance of a measured angle from the box of its set and the true state, in heights of this box,
above which it is not shown.

Chosen: nearer ones leave the set at least two fifths of the panel.
"""


@style()
def draw_sets(records: Sequence[Record], times_s: Sequence[float] = (0.5, 4.0, 8.0)) -> Figure:
    """Draw sections of the sets after the measurement at some times.

    There is one row per time, and one column per record and lateral axis.

    At most five sections are drawn, evenly chosen over the range (`choose_sections`); of a set that
    allows for wrong images so many of each member. The planes of a row have the same limits for
    each lateral axis, unless a set would then be too small to see.

    Parameters
    ----------
    times_s : sequence of float
        The nearest step is shown, and the title says which it is.
    """
    if not records or not times_s:
        raise ValueError("at least one record and one time are needed")
    rows = [planes_at(records, time_s, _SECTIONS) for time_s in times_s]
    columns = len(rows[0])
    width_mm = WIDTH_MM if columns > 1 else 100.0
    figure, grid = subplots(15.0 + 60.0 * len(rows), len(rows), columns, width_mm=width_mm)

    for row, planes in zip(grid, rows, strict=True):
        for axes, plane in zip(row, planes, strict=True):
            draw_plane(axes, plane)
        level_planes(row, planes)
        for axes, plane in zip(row, planes, strict=True):
            _shade_allowed(axes, plane)

    titles = [plane.title for planes in rows for plane in planes]
    if columns > 2:
        letters([*grid.flat], [title.replace(", ", ",\n") for title in titles], fontsize=7.0)
    else:
        letters([*grid.flat], titles)
    legend_below(figure, min(2, columns))
    return figure


@dataclass(frozen=True)
class Plane:
    """Sections of one step in the (omega, alpha) plane of one lateral axis, the nearest first."""

    title: str
    noise: str
    record: Record
    axis: int
    step: int
    chosen: Sequence[Section]

    @property
    def name(self) -> str:
        """Name of the axis."""
        return self.record.scenario.set_model.axes[self.axis]

    @property
    def measured_rad(self) -> float | None:
        """The measured angle, if there is one."""
        if not self.record.measures("angle")[self.step]:
            return None
        measured_rad: float = self.record.measured["angle"][self.step, self.axis]
        return measured_rad

    @property
    def outlines(self) -> list[Floats]:
        """Vertices of the sections, omega in µrad/s and alpha in mrad."""
        return [
            section.omega_alpha[self.axis].polygon() * np.array([1e6, 1e3])
            for section in self.chosen
        ]

    @property
    def true(self) -> Floats:
        """The true omega, µrad/s, and alpha, mrad, shape (2,)."""
        at = (self.step, self.axis)
        return np.array(
            [self.record.true_rate_rad_s[at] * 1e6, self.record.true_angle_rad[at] * 1e3]
        )

    @property
    def box(self) -> Floats:
        """The least and the greatest omega and alpha, shape (2, 2).

        They are of the set, of the true state, and of a measurement near them; of any measurement
        if set and true state have one angle.
        """
        points = np.vstack([*self.outlines, self.true])
        low = points.min(axis=0)
        high = points.max(axis=0)
        if self.measured_rad is not None:
            angle = self.measured_rad * 1e3
            far = _FAR * (high[1] - low[1])
            if far == 0.0 or low[1] - far <= angle <= high[1] + far:
                low[1] = min(low[1], angle)
                high[1] = max(high[1], angle)
        return np.array([low, high])


def planes_at(records: Sequence[Record], time_s: float, sections: int) -> list[Plane]:
    """Return the planes of each record at its step nearest to a time.

    A plane has at most so many sections of each member of a set.
    """
    planes = []
    clock = Clock.of(records)
    for number, (record, name) in enumerate(zip(records, record_titles(records), strict=True)):
        noise = name
        if len(records) > 1:
            noise = name.removeprefix(f"({ascii_lowercase[number]}) ")
        step = int(np.abs(record.time_s - time_s).argmin())
        chosen = choose_sections(record.sections[step], sections)
        ranges = "no section is left"
        if chosen:
            ranges = f"{_km(chosen[0])} to {_km(chosen[-1])} km"
        title = plain(f"{noise},\n{clock.text(record, float(record.time_s[step]))}, {ranges}")
        planes += [
            Plane(title, noise, record, axis, step, chosen)
            for axis in range(len(record.scenario.set_model.axes))
        ]

    return planes


def _km(section: Section) -> str:
    digits = 0 if section.range_m >= 1e6 else 1
    return f"{section.range_m / 1e3:.{digits}f}"


def choose_sections(sections: Sequence[Section], most: int) -> list[Section]:
    """Return at most `most` sections of each member, evenly distributed over its range.

    The order of `sections` is that of `Record`, and the result is in ascending order of range. The
    nearest and the farthest section of a member are chosen if `most` is 2 or more.
    """
    chosen: list[Section] = []
    for _, group in groupby(sections, key=lambda section: section.member):
        member = list(group)
        if len(member) > most:
            ranges_m = np.array([section.range_m for section in member])
            member = [member[index] for index in evenly(ranges_m, most)]
        chosen += member
    return sorted(chosen, key=lambda section: section.range_m)


def draw_plane(axes: Axes, plane: Plane) -> None:
    """Draw sections and the true state, and name the axes; `level_planes` draws the measurement.

    The sections have the dark 55 % of the colours, by range; lighter ones could not be seen.
    """
    ranges_m, places = np.unique([section.range_m for section in plane.chosen], return_inverse=True)
    colours = mpl.colormaps["Blues_r"](np.linspace(0.0, 0.55, len(ranges_m)))
    # The nearer a section is, the higher it lies: its outline is seen over those of the others.
    for outline, place in zip(plane.outlines, places.tolist(), strict=True):
        _draw_outline(axes, outline, colours[place], zorder=3.0 - 0.01 * place)
    axes.plot(*plane.true, zorder=6, label=TRUTH_MARK, path_effects=HALO, **_TRUTH)
    axes.set_xlabel(f"rate $\\omega_{plane.name}$, µrad/s")
    axes.set_ylabel(f"angle $\\alpha_{plane.name}$, mrad")


def _shade_allowed(axes: Axes, plane: Plane) -> None:
    """Shade the angles that the measurement allows at the nearest and the farthest section.

    The set subtracts a known offset of the measured point, a length.
    """
    if plane.measured_rad is None or not plane.chosen:
        return
    sensor = plane.record.scenario.set_model.axis(plane.name).angle_sensor
    label = "angles allowed by the measurement"
    for section in (plane.chosen[0], plane.chosen[-1]):
        error = float(sensor.error_bound(section.range_m))
        centre = math.atan(math.tan(plane.measured_rad) - sensor.shift_m / section.range_m)
        low, high = ((centre + sign * error) * 1e3 for sign in (-1.0, 1.0))
        axes.axhspan(low, high, color=MEASURED, alpha=0.09, linewidth=0.0, zorder=0.4, label=label)


def _draw_outline(axes: Axes, outline: Floats, colour: Floats, zorder: float) -> None:
    """Draw a section; a point becomes a dot and a segment a thick line with dots at its ends."""
    if len(outline) > 2:
        look: dict[str, Any] = {"edgecolor": colour, "linewidth": 1.1, "joinstyle": "round"}
        axes.add_patch(
            Polygon(
                outline.tolist(),
                facecolor=(*colour[:3], 0.05),
                label=SECTIONS_MARK,
                zorder=zorder,
                **look,
            )
        )
    elif len(outline):
        dots: dict[str, Any] = {"linewidth": 2.0, "marker": "o", "markersize": 4.0}
        axes.plot(*outline.T, color=colour, zorder=zorder + 1.0, label=SECTIONS_MARK, **dots)


def level_planes(row: Sequence[Axes], planes: Sequence[Plane]) -> None:
    """Set the limits of planes, then name their units and draw the measurements.

    The planes of a lateral axis have the same limits, or their own if a box (`Plane.box`: the set,
    the true state and a near measurement) would then be too small to see. A measurement far from
    its set is beyond the limits. The units follow from the limits, which are set first.
    """
    for axis in {plane.axis for plane in planes}:
        same = [
            (axes, plane) for axes, plane in zip(row, planes, strict=True) if plane.axis == axis
        ]
        boxes = np.array([plane.box for _, plane in same])
        low = boxes[:, 0].min(axis=0)
        high = boxes[:, 1].max(axis=0)
        if (boxes[:, 1] - boxes[:, 0] >= _VISIBLE * (high - low)).all():
            boxes[:] = low, high

        for (axes, plane), (low, high) in zip(same, boxes, strict=True):
            margin = 0.07 * (high - low)  # chosen
            # A set without extent has a margin, too: a part of its numbers, or any if they are 0.
            margin = np.where(margin > 0.0, margin, np.maximum(0.05 * np.abs(high), 1e-6))
            axes.set(
                xlim=(low[0] - margin[0], high[0] + margin[0]),
                ylim=(low[1] - margin[1], high[1] + margin[1]),
            )
            axes.locator_params("x", nbins=3)
            axes.locator_params("y", nbins=4)
            _name_units(axes)
            _draw_measurement(axes, plane)


def _name_units(axes: Axes) -> None:
    """Write the numbers of both axes, in a smaller unit if they are small."""
    for one, limits, (large, small) in (
        (axes.xaxis, axes.get_xlim(), _RATES),
        (axes.yaxis, axes.get_ylim(), _ANGLES),
    ):
        factor = 1.0
        if float(np.abs(limits).max()) <= _SMALL:
            factor = 1e3
            one.set_label_text(one.get_label_text().replace(large, small))
        one.set_major_formatter(partial(_number, factor=factor))


def _number(tick: float, _place: int, factor: float) -> str:
    return f"{factor * tick:g}".replace("-", "\N{MINUS SIGN}")


def _draw_measurement(axes: Axes, plane: Plane) -> None:
    """Draw the measured angle as a square, which is not seen if it is far from the set."""
    if plane.measured_rad is None:
        return
    look = _SQUARE | {"linestyle": "none", "zorder": 5}
    axes.plot(plane.true[0], plane.measured_rad * 1e3, label=MEASUREMENT_MARK, **look)
