"""Information sets in the (omega, alpha) plane: the paper's figure 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from string import ascii_lowercase
from typing import Any

import numpy as np
from matplotlib import patheffects
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.ticker import FuncFormatter, MaxNLocator

from experiments.common.figure_style import INK, MEASURED, WIDTH_MM, new_figure, place_axes, plain, style, width_mm
from experiments.interception.course import Clock, record_titles
from infoset import Section
from infoset.arrays import Floats
from sim import AxisStep, Record, StepRecord

Colour = tuple[float, float, float]

TRUTH_MARK = "true (ω, α)"
MEASUREMENT_MARK = "measured α, drawn at the true ω"

_DARK, _LIGHT = (0.03, 0.14, 0.36), (0.36, 0.66, 0.86)
_PLANE_MM = 90.0
"""Minimum width of a plane and its labels in space, mm."""
_LETTER_MM = 1.8
_COINCIDE = 0.1
"""Share of the size of sections: of a long flight only two sections are drawn if all differ by less."""
_SMALL_MRAD = 0.1
"""Angle below which the ticks of angles are in µrad."""
_LABEL_MM, _LABEL_ROOM_MM = 14.0, 19.0
"""Position of the labels, and width that the sets leave for them, from the right side of the axes."""


def draw_sets(records: Sequence[Record], times_s: Sequence[float] = (0.5, 4.0, 8.0), sections: int = 5) -> Figure:
    """Draw sections of the sets after the measurement: one row per time, one column per record and lateral axis.

    The planes of a row have the same limits for each lateral axis.

    Parameters
    ----------
    times_s : sequence of float
        The nearest step is shown, and the title says which it is.
    sections : int
        Most sections to show, evenly chosen over the range, the first and the last included.
    """
    if not records or not times_s:
        raise ValueError("at least one record and one time are needed")
    if sections < 1:
        raise ValueError(f"at least one section must be shown: got {sections}")
    in_space = any(record.scenario.is_spatial for record in records)
    clock = Clock.of(records)
    titles = [plain(each) for each in record_titles(records)]
    if len(records) > 1:
        titles = [title.removeprefix(f"({letter}) ") for title, letter in zip(titles, ascii_lowercase, strict=False)]
    rows = [planes_at(records, titles, time_s, sections) for time_s in times_s]
    columns, count = len(rows[0]), len(rows) * len(rows[0])
    letters = iter([f"({each}) " for each in ascii_lowercase[:count]] if 1 < count <= 26 else [""] * count)
    with style():
        figure = new_figure(
            height_mm=25.0 + (63.0 + 4.0 * in_space) * len(times_s),
            width_mm=max(WIDTH_MM, _PLANE_MM * columns * in_space),
        )
        grid = place_axes(
            figure,
            len(rows),
            columns,
            margins_mm=(17.0, 4.0, 26.0, 11.0 + 4.0 * in_space),
            gaps_mm=(0.0 if columns == 1 else 17.0 if in_space else 6.0, 15.5 + 4.0 * in_space),
        )
        for row, planes in zip(grid, rows, strict=True):
            level_planes(row, planes)
            for axes, plane in zip(row, planes, strict=True):
                _shade_allowed(axes, plane)
                draw_plane(axes, plane)
                time = clock.text(plane.record, plane.step.time_s)
                label_plane(axes, plane, next(letters), time, in_space, axes is row[0])
        measured = any("angle" in plane.along.measured for planes in rows for plane in planes)
        handles: list[Line2D | Patch] = [
            Line2D([], [], label=TRUTH_MARK, **_TRUTH_LOOK),
            Line2D([], [], color=_colour(0, 2), label="section of the set, with its range in km"),
        ]
        if measured:
            allowed = "angles allowed by the measurement at these ranges"
            handles.insert(1, Line2D([], [], label=MEASUREMENT_MARK, **_MEASUREMENT_LOOK))
            handles.append(Patch(facecolor=MEASURED, alpha=0.22, label=allowed))
        figure.legend(handles=handles, loc="lower center", ncols=2, columnspacing=2.5)
    return figure


@dataclass(frozen=True)
class Plane:
    """Sections of one step in the (omega, alpha) plane of one lateral axis."""

    title: str
    record: Record
    axis: str
    step: StepRecord
    chosen: Sequence[Section]

    @property
    def along(self) -> AxisStep:
        """The step along the axis."""
        return self.step.axes[self.axis]

    @property
    def outlines(self) -> list[Floats]:
        """Vertices of the sections, omega in µrad/s and alpha in mrad."""
        polygons = [each.omega_alpha if self.axis == "z" else each.omega_alpha_y for each in self.chosen]
        return [polygon.polygon() * np.array([1e6, 1e3]) for polygon in polygons if polygon is not None]

    @property
    def sections_coincide(self) -> bool:
        """Whether the boxes around the outlines differ by less than `_COINCIDE` of their size."""
        boxes = np.array([[outline.min(axis=0), outline.max(axis=0)] for outline in self.outlines if len(outline)])
        if not len(boxes):
            return False
        return bool((np.ptp(boxes, axis=0) <= _COINCIDE * np.ptp(boxes[0], axis=0)).all())

    @property
    def extent(self) -> Floats:
        """All points (omega in µrad/s, alpha in mrad) that a drawing must contain."""
        rate, angle = self.along.true_rate_rad_s * 1e6, self.along.true_angle_rad * 1e3
        marks = [[rate, angle]]
        if "angle" in self.along.measured:
            marks.append([rate, self.along.measured["angle"] * 1e3])
        return np.concatenate([np.array(marks), *self.outlines])


def planes_at(records: Sequence[Record], titles: Sequence[str], time_s: float, sections: int) -> list[Plane]:
    """Return the planes of each record at its step nearest to a time, with at most so many sections."""
    planes, is_long = [], Clock.of(records).counts_down
    for record, title in zip(records, titles, strict=True):
        step = min(record.steps, key=lambda step: abs(step.time_s - time_s))
        chosen = choose_sections(step.sections, sections)
        row = [Plane(title, record, axis, step, chosen) for axis in record.scenario.set_model.axes]
        if is_long and all(plane.sections_coincide for plane in row):
            chosen = choose_sections(step.sections, min(2, sections))
            row = [replace(plane, chosen=chosen) for plane in row]
        planes += row
    return planes


def choose_sections(sections: Sequence[Section], most: int) -> list[Section]:
    """Return at most `most` sections in their order, evenly distributed over the range, with the first and the last."""
    if len(sections) <= most:
        return list(sections)
    if most == 1:
        return [sections[len(sections) // 2]]
    ranges = np.array([section.range_m for section in sections])
    wanted = np.linspace(ranges[0], ranges[-1], most)
    chosen = np.unique(np.abs(ranges[None, :] - wanted[:, None]).argmin(axis=1))
    return [sections[index] for index in chosen]


_TRUTH_LOOK: dict[str, Any] = {
    "marker": "x",
    "color": INK,
    "markersize": 7.0,
    "markeredgewidth": 1.6,
    "linestyle": "none",
}
_MEASUREMENT_LOOK: dict[str, Any] = {
    "marker": "s",
    "markerfacecolor": "white",
    "markeredgecolor": INK,
    "markersize": 5.5,
    "markeredgewidth": 1.3,
    "linestyle": "none",
}
_ARROW = {"arrowstyle": "-", "linewidth": 0.6, "shrinkA": 1.0, "shrinkB": 0.0, "relpos": (0.0, 0.5)}


def draw_plane(axes: Axes, plane: Plane) -> None:
    """Draw sections with the true state and the measurement, on axes with fixed limits."""
    outlines, along = plane.outlines, plane.along
    for index, outline in enumerate(outlines):
        _draw_outline(axes, outline, _colour(index, len(outlines)), zorder=3.0 - 0.01 * index)
    _label(axes, plane.chosen, outlines)
    halo = [patheffects.withStroke(linewidth=3.2, foreground="white")]
    rate = along.true_rate_rad_s * 1e6
    if "angle" in along.measured:
        axes.plot(rate, along.measured["angle"] * 1e3, zorder=5, label=MEASUREMENT_MARK, **_MEASUREMENT_LOOK)
    axes.plot(rate, along.true_angle_rad * 1e3, zorder=6, label=TRUTH_MARK, path_effects=halo, **_TRUTH_LOOK)
    if not outlines:
        axes.text(0.5, 0.94, "no section is left", transform=axes.transAxes, ha="center", va="top")


def label_plane(axes: Axes, plane: Plane, letter: str, time: str, in_space: bool, is_first: bool) -> None:
    """Write title and labels; only the first axes of a row have labels on the left, unless a record is in space."""
    along = f" along {plane.axis}" if in_space else ""
    title = f"{plane.title}\nalong {plane.axis}" if in_space else plane.title
    axes.set_title(f"{letter}{title}, {time}")
    axes.set_xlabel(f"line-of-sight rate ω{along}, µrad/s", labelpad=2.0)
    axes.set_ylabel(f"line-of-sight angle α{along}, {angle_unit(axes)}")
    axes.yaxis.label.set_visible(in_space or is_first)
    axes.tick_params(labelleft=in_space or is_first)


def _shade_allowed(axes: Axes, plane: Plane) -> None:
    """Shade the angles that the measurement allows at the nearest and the farthest drawn section."""
    if "angle" not in plane.along.measured or not plane.chosen:
        return
    sensor = plane.record.scenario.set_model.axis(plane.axis).angle_sensor
    for section in (plane.chosen[0], plane.chosen[-1]):
        error = float(sensor.error_bound(section.range_m))
        low, high = ((plane.along.measured["angle"] + sign * error) * 1e3 for sign in (-1.0, 1.0))
        axes.axhspan(low, high, color=MEASURED, alpha=0.09, linewidth=0.0, zorder=0.4)


def _draw_outline(axes: Axes, outline: Floats, colour: Colour, zorder: float) -> None:
    """Draw a section; a point becomes a dot and a segment a thick line with dots at its ends."""
    if len(outline) > 2:
        patch = Polygon(outline.tolist(), closed=True, facecolor=(*colour, 0.05), edgecolor=(*colour, 1.0))
        patch.set(linewidth=1.1, joinstyle="round", zorder=zorder)
        axes.add_patch(patch)
    elif len(outline):
        axes.plot(*outline.T, color=colour, linewidth=2.0, marker="o", markersize=4.0, zorder=zorder + 1.0)


def _label(axes: Axes, chosen: Sequence[Section], outlines: Sequence[Floats]) -> None:
    """Write the ranges in a column to the right of the sets, in the order with fewer crossing lines."""
    anchors = [(*_right_top(outline), index) for index, outline in enumerate(outlines) if len(outline)]
    if not anchors:
        return
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    spacing = 0.085 * (high - low)
    heights = _spread(sorted(y for _, y, _ in anchors), spacing, low + 0.6 * spacing, high - 0.6 * spacing)
    start = right - (_LABEL_MM + _extra_mm(chosen)) / width_mm(axes) * (right - left)
    anchors = min(anchors, anchors[::-1], key=lambda order: _crossings(order, heights, start))
    for (x, y, index), height in zip(anchors, heights, strict=True):
        look: dict[str, Any] = {"xytext": (start, height), "ha": "left", "va": "center", "zorder": 4.5}
        arrow = _ARROW | {"color": _colour(index, len(outlines))}
        axes.annotate(_range_text(chosen[index]), (x, y), arrowprops=arrow, **look)


def _range_text(section: Section) -> str:
    return f"{section.range_m / 1e3:.{0 if section.range_m >= 1e6 else 1}f} km"


def _extra_mm(chosen: Sequence[Section]) -> float:
    """Return the width that labels need beyond that of seven letters, mm."""
    return _LETTER_MM * max(0, max((len(_range_text(section)) for section in chosen), default=0) - 7)


def _crossings(anchors: Sequence[tuple[float, float, int]], heights: Floats, start: float) -> int:
    """Count the crossings of lines from their anchors to the column at `start`, in rising heights."""
    count = 0
    for (lower, low_end), (upper, high_end) in combinations(zip(anchors, heights, strict=True), 2):
        at = max(lower[0], upper[0])
        low, high = (y + (end - y) * (at - x) / (start - x) for (x, y, _), end in ((lower, low_end), (upper, high_end)))
        count += low > high
    return count


def _right_top(outline: Floats) -> tuple[float, float]:
    """Return the rightmost vertex, the upper one of a vertical edge."""
    minimum, maximum = outline[:, 0].min(), outline[:, 0].max()
    edge = outline[outline[:, 0] >= maximum - 1e-6 * (maximum - minimum)]
    x, y = edge[edge[:, 1].argmax()]
    return float(x), float(y)


def _spread(wanted: Sequence[float], spacing: float, low: float, high: float) -> Floats:
    """Return heights near the wanted rising ones, with a minimum distance and inside the limits."""
    heights = np.clip(np.asarray(wanted, dtype=np.float64), low, high)
    steps = spacing * np.arange(len(heights))
    heights = np.maximum.accumulate(heights - steps) + steps
    over = np.maximum(0.0, heights - (high - steps[::-1]))
    return np.asarray(heights - over)


def level_planes(row: Sequence[Axes], planes: Sequence[Plane]) -> None:
    """Give the planes of each lateral axis the same limits, with space for the labels."""
    for axis in {plane.axis for plane in planes}:
        same = [(axes, plane) for axes, plane in zip(row, planes, strict=True) if plane.axis == axis]
        everything = np.concatenate([plane.extent for _, plane in same])
        minimum, maximum = everything.min(axis=0), everything.max(axis=0)
        margin = 0.07 * (maximum - minimum)
        margin = np.where(margin > 0.0, margin, np.maximum(0.05 * np.abs(maximum), 1e-6))
        minimum, maximum = minimum - margin, maximum + margin
        for axes, _ in same:
            room = (_LABEL_ROOM_MM + max(_extra_mm(plane.chosen) for _, plane in same)) / width_mm(axes)
            axes.set_xlim(float(minimum[0]), float(maximum[0] + room / (1.0 - room) * (maximum[0] - minimum[0])))
            axes.set_ylim(float(minimum[1]), float(maximum[1]))
            nbins = 6 if np.abs(minimum[0]) < 1e4 else 3
            axes.xaxis.set_major_locator(MaxNLocator(nbins=nbins, steps=[1, 2, 2.5, 5, 10]))


def angle_unit(axes: Axes) -> str:
    """Return the unit of the ticks of the angles; those of small angles become µrad."""
    if np.abs(axes.get_ylim()).max() > _SMALL_MRAD:
        return "mrad"
    axes.yaxis.set_major_formatter(FuncFormatter(lambda tick, _: f"{1e3 * tick:g}".replace("-", "\N{MINUS SIGN}")))
    return "µrad"


def _colour(index: int, count: int) -> Colour:
    share = index / max(count - 1, 1)
    red, green, blue = ((1.0 - share) * dark + share * light for dark, light in zip(_DARK, _LIGHT, strict=True))
    return red, green, blue
