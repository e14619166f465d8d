"""Animations of engagements: the sets step by step, above their predicted misses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from matplotlib.animation import PillowWriter
from PIL import Image, ImageSequence

from experiments.common.figure_style import INK, style, subplots
from experiments.interception.course import Clock, evenly
from experiments.interception.figures.process import draw_predicted_miss, level_predicted_miss, traces_of
from experiments.interception.figures.sets import draw_plane, level_planes, planes_at
from experiments.interception.figures.shared import count_down
from infoset.arrays import Floats
from sim import Record

DURATION_S = 8.0
COLOURS = 16

_SECTIONS = 7


@style()
def animate(
    records: Sequence[Record],
    max_frames: int = 40,
    width_px: int | None = None,
    progress: Callable[[float], None] = lambda _done: None,
) -> bytes:
    """Return a GIF animation of engagements, side by side, of eight seconds and 16 colours.

    Frames are evenly distributed over the steps, and take about 0.2 s of computing each. The default width of a frame
    is 425 pixels, or 640 for two planes.
    """
    clock = Clock.of(records)
    chosen = _frame_times(records, clock, max_frames)
    writer = PillowWriter(fps=max(1, round(max_frames / DURATION_S)))
    traces = traces_of(records)
    width_mm, usual_px = (120.0, 425) if len(traces) == 1 else (85.0 * len(traces), 320 * len(traces))
    figure, (above, below) = subplots(135.0, 2, len(traces), width_mm=width_mm, height_ratios=[1.2, 1.0])
    for axes, trace in zip(below, traces, strict=True):
        draw_predicted_miss(axes, trace, clock)
        if clock.counts_down:
            count_down([axes], trace[0].scenario)
        else:
            axes.set_xlabel("time t, s")
        axes.set_ylabel("predicted miss π, m")
    level_predicted_miss(below)
    lines = [axes.axvline(float(chosen[0]), color=INK, linewidth=1.0) for axes in below]
    width = usual_px if width_px is None else width_px
    with TemporaryDirectory() as folder:
        file = Path(folder) / "animation.gif"
        with writer.saving(figure, str(file), width / figure.get_figwidth()):
            for index, time in enumerate(chosen.tolist()):
                planes = planes_at(records, time, _SECTIONS)
                for axes, plane in zip(above, planes, strict=True):
                    axes.clear()
                    draw_plane(axes, plane)
                    axes.set_title(clock.text(plane.record, plane.step.time_s))
                level_planes(above, planes)
                for line, (record, _) in zip(lines, traces, strict=True):
                    line.set_xdata(clock.at(record, [time, time]))
                writer.grab_frame()
                figure.set_layout_engine("none")  # after the first frame, so that nothing moves
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
