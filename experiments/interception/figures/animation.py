"""Animations of engagements: the sets step by step, above their predicted misses.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import INK, plain, style, subplots
from infoset.experiments.interception.course import Clock, evenly
from infoset.experiments.interception.figures.process import (
    draw_predicted_miss,
    level_predicted_miss,
    traces_of,
)
from infoset.experiments.interception.figures.sets import draw_plane, level_planes, planes_at
from infoset.experiments.interception.figures.shared import count_down
from infoset.sim import Record

DURATION_S = 8.0
"""Duration of an animation, s."""
COLOURS = 16
"""Number of colours of an image: the panels have few, and more would make the file larger."""

_SECTIONS = 7
"""Maximum number of sections of a set; chosen: more would hide each other."""


@style()
def animate(
    records: Sequence[Record],
    max_frames: int = 40,
    progress: Callable[[float], None] = lambda _done: None,
) -> bytes:
    """Return a GIF animation of engagements, side by side, of about eight seconds and 16 colours.

    Frames are evenly distributed over the time axis of the lower panels if it is logarithmic,
    otherwise over the steps, and take about 0.2 s of computing each. A frame is 425 pixels wide, or
    320 for each of several planes: the file stays small enough for a web page. `max_frames` is
    chosen: 40 frames are five a second.
    """
    clock = Clock.of(records)
    chosen = _frame_times(records, clock, max_frames)
    traces = traces_of(records)
    # The sizes in mm, chosen, decide only how large the text is in a frame.
    width_mm = 120.0
    width_px = 425
    if len(traces) > 1:
        width_mm = 85.0 * len(traces)
        width_px = 320 * len(traces)
    figure, (above, below) = subplots(
        135.0, 2, len(traces), width_mm=width_mm, height_ratios=[1.2, 1.0]
    )
    figure.set_dpi(width_px / figure.get_figwidth())

    # The lower panels stay; a line moves in them.
    for axes, trace in zip(below, traces, strict=True):
        draw_predicted_miss(axes, trace, clock)
        if clock.counts_down:
            count_down([axes], trace[0].scenario)
        else:
            axes.set_xlabel("time t, s")
        axes.set_ylabel("predicted miss π, m")

    level_predicted_miss(below)
    lines = [axes.axvline(float(chosen[0]), color=INK, linewidth=1.0) for axes in below]

    canvas: Any = figure.canvas
    frames = []
    for index, time in enumerate(chosen.tolist()):
        planes = planes_at(records, time, _SECTIONS)
        for axes, plane in zip(above, planes, strict=True):
            axes.clear()
            draw_plane(axes, plane)
            time_text = clock.text(plane.record, float(plane.record.time_s[plane.step]))
            axes.set_title(f"{plain(plane.noise)}\n{time_text}")
        level_planes(above, planes)
        for line, (record, _) in zip(lines, traces, strict=True):
            line.set_xdata(clock.at(record, [time, time]))
        canvas.draw()
        # After the first frame: the panels keep the places of this frame, and do not jump.
        figure.set_layout_engine("none")
        image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        frames.append(image.quantize(COLOURS, dither=Image.Dither.NONE))
        progress((index + 1) / len(chosen))

    content = BytesIO()
    # A whole number of 10 ms, the unit of GIF.
    frame_ms = 10 * round(100 * DURATION_S / len(frames))
    frames[0].save(
        content,
        "gif",
        save_all=True,
        append_images=frames[1:],
        duration=frame_ms,
        loop=0,  # without end
        optimize=True,
    )
    return content.getvalue()


def _frame_times(records: Sequence[Record], clock: Clock, most: int) -> Floats:
    """Return at most `most` times of steps.

    They are evenly distributed over a logarithmic time axis, or on a linear one over the times of
    all records.
    """
    times = np.unique(np.concatenate([record.time_s for record in records]))
    places: Floats = np.arange(len(times), dtype=np.float64)
    if clock.counts_down:
        last = max(records, key=lambda record: record.scenario.nominal_arrival_s)
        places = -np.log(clock.at(last, times))
    return np.asarray(times[evenly(places, min(len(times), most))])
