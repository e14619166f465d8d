"""Animations of engagements: the sets step by step, above their predicted misses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.animation import PillowWriter
from matplotlib.axes import Axes
from PIL import Image, ImageSequence

from experiments.common.figure_style import INK, new_figure, place_axes, plain, style
from experiments.interception.course import Clock, evenly, record_titles
from experiments.interception.figures.approach import count_down
from experiments.interception.figures.process import draw_predicted_miss, level_predicted_miss, traces_of
from experiments.interception.figures.sets import Plane, draw_plane, label_plane, level_planes, planes_at
from infoset.arrays import Floats
from sim import Record

DURATION_S = 8.0
COLOURS = 16

_SECTIONS = 7
_SECOND_MM = 58.0


def animate(
    records: Sequence[Record],
    max_frames: int = 40,
    width_px: int | None = None,
    progress: Callable[[float], None] = lambda _done: None,
) -> bytes:
    """Return a GIF animation of engagements, side by side, of eight seconds and 16 colours.

    Frames are evenly distributed over the steps, and take about 0.2 s of computing each. The default width of a frame
    is 425 pixels, or 640 for two records.
    """
    clock = Clock.of(records)
    chosen = _frame_times(records, clock, max_frames)
    fps = max(1, round(max_frames / DURATION_S))
    writer = PillowWriter(fps=fps)
    traces = traces_of(records)
    in_space = any(record.scenario.is_spatial for record in records)
    width_mm, usual_px = {1: (120.0, 425), 2: (180.0, 640)}.get(len(traces), (90.0 * len(traces), 320 * len(traces)))
    width = usual_px if width_px is None else width_px
    with style(), TemporaryDirectory() as folder:
        file = Path(folder) / "animation.gif"
        figure = new_figure(height_mm=86.0 + _SECOND_MM + 4.0 * in_space, width_mm=width_mm)
        gap = 0.0 if len(traces) == 1 else 16.0 if in_space else 8.0
        margins = (18.0, 5.0, 11.0, 8.0 + 4.0 * in_space)
        above, below = place_axes(figure, 2, len(traces), margins_mm=margins, gaps_mm=(gap, 15.0))
        titles = [plain(each) for each in record_titles(records)]
        for axes, trace in zip(below, traces, strict=True):
            draw_predicted_miss(axes, trace, clock)
            if clock.counts_down:
                count_down(axes, trace[0].scenario)
            else:
                axes.set_xlabel("time t, s")
            along = f" along {trace[1]}" if in_space else ""
            axes.set_ylabel(f"predicted miss π{along}, m" if in_space or axes is below[0] else "")
            axes.tick_params(labelleft=in_space or axes is below[0])
        level_predicted_miss(below, traces)
        lines = [axes.axvline(float(chosen[0]), color=INK, linewidth=1.0) for axes in below]
        with writer.saving(figure, str(file), width / figure.get_figwidth()):
            for index, time in enumerate(chosen.tolist()):
                _draw_planes(above, planes_at(records, titles, time, _SECTIONS), clock)
                for line, (record, _) in zip(lines, traces, strict=True):
                    line.set_xdata(clock.at(record, [time, time]))
                writer.grab_frame()
                progress((index + 1) / len(chosen))
        return _few_colours(file)


def _frame_times(records: Sequence[Record], clock: Clock, most: int) -> Floats:
    """Return at most `most` times of steps, evenly distributed over the time axis or over the steps."""
    times = np.unique([step.time_s for record in records for step in record.steps])
    count = min(len(times), most)
    if not clock.counts_down:
        return np.asarray(times[np.unique(np.linspace(0, len(times) - 1, count).round().astype(int))])
    last = max(records, key=lambda record: record.scenario.nominal_arrival_s)
    return np.asarray(times[evenly(-np.log(clock.at(last, times)), count)])


def _few_colours(file: Path) -> bytes:
    """Return a GIF file with few colours, which makes it smaller."""
    with Image.open(file) as animation:
        frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(animation)]
    flat = [frame.quantize(COLOURS, dither=Image.Dither.NONE) for frame in frames]
    content = BytesIO()
    frame_ms = round(1000 * DURATION_S / len(flat))
    flat[0].save(content, "gif", save_all=True, append_images=flat[1:], duration=frame_ms, loop=0, optimize=True)
    return content.getvalue()


def _draw_planes(row: Sequence[Axes], planes: Sequence[Plane], clock: Clock) -> None:
    for axes in row:
        axes.clear()
    level_planes(row, planes)
    in_space = any(plane.record.scenario.is_spatial for plane in planes)
    for axes, plane in zip(row, planes, strict=True):
        draw_plane(axes, plane)
        time_s = plane.step.time_s
        time = clock.text(plane.record, time_s) if clock.counts_down else f"t = {time_s:.1f} s"
        label_plane(axes, plane, "", time, in_space, axes is row[0])
