"""Members of a set that allows for wrong images, over time.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from infoset.experiments.common.figure_style import (
    EVENT,
    GUARANTEED,
    IMPULSE,
    SET_EDGE,
    TRUTH,
    legend_below,
    plain,
    style,
    subplots,
)
from infoset.experiments.interception.course import (
    Clock,
    record_titles,
    true_predicted_misses,
)
from infoset.experiments.interception.figures.process import Trace, traces_of
from infoset.experiments.interception.figures.shared import count_down
from infoset.experiments.interception.member_course import MemberCourse, member_courses
from infoset.sim import Record

LINEAR_M = 10.0
"""The axis is linear to this difference of misses, m, and logarithmic beyond, as the axis of
`level_predicted_miss`, which has the same number; chosen."""


@style()
def draw_members(records: Sequence[Record]) -> Figure:
    """Draw the predicted misses of all members over time, relative to the miss of the true state.

    There is one panel per record and lateral axis; records whose set allows for no wrong image are
    left out, and at least one must allow for some.
    """
    records = [record for record in records if record.scenario.information_set.wrong_images]
    clock = Clock.of(records)
    titles = record_titles(records)
    courses = [member_courses(record) for record in records]
    traces = traces_of(records)
    figure, grid = subplots(95.0, 1, len(traces), sharey=True)
    panels = grid[0]
    for axes, trace in zip(panels, traces, strict=True):
        number = next(i for i, record in enumerate(records) if record is trace[0])
        _draw_trace(axes, trace, courses[number], clock)
        title = titles[number]
        if len(trace[0].scenario.set_model.axes) > 1:
            title += f", along {trace[0].scenario.set_model.axes[trace[1]]}"
        axes.set_title(plain(title))

    panels[0].set_ylabel("miss minus true miss, m")
    maximum = max(LINEAR_M, *(float(np.abs(axes.dataLim.intervaly).max()) for axes in panels))
    panels[0].set_yscale("symlog", linthresh=LINEAR_M)
    panels[0].set_ylim(-2.0 * maximum, 2.0 * maximum)
    legend_below(figure, 3)
    return figure


def _draw_trace(axes: Axes, trace: Trace, courses: Sequence[MemberCourse], clock: Clock) -> None:
    """Draw the members of an engagement along one lateral axis."""
    record, axis = trace
    times = clock.at(record)
    true_m = true_predicted_misses(record)[:, axis]
    axes.axhline(0.0, color=TRUTH, linewidth=1.0, label="true state")
    for course in courses:
        steps = np.array(course.steps)
        intervals_m = np.array(course.intervals_m)[:, axis] - true_m[steps, None]
        look: dict[str, Any] = {
            "color": SET_EDGE,
            "linewidth": 0.7,
            "label": "set without a class of images",
        }
        if course.group is not None:
            look |= {
                "color": GUARANTEED,
                "linewidth": 1.1,
                "label": "set without suspected images",
            }
        band: dict[str, Any] = {"facecolor": look["color"], "alpha": 0.08, "linewidth": 0.0}
        axes.fill_between(times[steps], *intervals_m.T, **band)
        for end in intervals_m.T:
            axes.plot(times[steps], end, **look)
        if course.is_refuted:
            mark: dict[str, Any] = {"color": IMPULSE, "markersize": 5.0, "linestyle": "none"}
            last = np.full(2, times[steps[-1]])
            axes.plot(
                last, intervals_m[-1], marker="x", label="set refuted by the next image", **mark
            )

    proved = record.result.wrong_image_proved_s
    if proved is not None and proved.count():
        place = float(clock.at(record, proved.data[0]))
        axes.axvline(place, label="a wrong image is proved", **EVENT)
    if clock.counts_down:
        count_down([axes], record.scenario)
    else:
        axes.set_xlabel("time t, s")
