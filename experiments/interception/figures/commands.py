"""The figures of the commands, in the order of their names, and `plot`.

Each is drawn after the one before it is written.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from matplotlib.figure import Figure

from infoset.experiments.common.figure_style import CURVE_LOOKS
from infoset.experiments.common.screen import some_runs
from infoset.experiments.interception.course import Clock, Courses
from infoset.experiments.interception.figures.approach import draw_approach
from infoset.experiments.interception.figures.b_plane import cloud, draw_b_plane
from infoset.experiments.interception.figures.comparison import draw_comparison
from infoset.experiments.interception.figures.corridor import draw_corridor
from infoset.experiments.interception.figures.distributions import (
    Sample,
    draw_distributions,
    draw_samples,
)
from infoset.experiments.interception.figures.members import draw_members
from infoset.experiments.interception.figures.process import draw_process
from infoset.experiments.interception.figures.sets import draw_sets
from infoset.experiments.interception.published import printed_single_runs
from infoset.experiments.interception.study import Comparison, Curve, is_of_paper
from infoset.sim import Record, Results, Scenario

DEFAULT_TIMES = (0.5, 4.0, 8.0)
"""Times of the paper's figure 3, s."""


def draw_experiment(
    scenario: Scenario, curves: Sequence[Curve], courses: Sequence[Courses]
) -> Iterator[Figure]:
    """Draw the distributions and the corridor, and in space the misses across the approach."""
    of_paper = is_of_paper(scenario)
    printed = printed_single_runs() if of_paper else None
    yield draw_distributions(curves, scenario.body, printed, numbered=of_paper)
    yield draw_corridor(curves, courses)
    if not scenario.is_spatial:
        return

    for noise in dict.fromkeys(curve.noise for curve in curves):
        clouds = []
        for curve in curves:
            if curve.noise == noise:
                sensor = "with" if curve.range_sensor else "no"
                clouds.append(cloud(f"{noise} noise,\n{sensor} range sensor", [curve.results]))
        yield draw_b_plane(clouds, scenario.body)


def draw_compared(scenario: Scenario, compared: Sequence[Comparison]) -> Iterator[Figure]:
    """Draw the comparison, and in space the misses across the approach for each noise.

    With game noise, each run has its worst tie rule.
    """
    yield draw_comparison(compared, scenario.body)
    if not scenario.is_spatial:
        return
    for noise in dict.fromkeys(one.noise for one in compared):
        clouds = [
            cloud(f"{one.strategy}\n{one.noise_title}", [*one.results.values()])
            for one in compared
            if one.noise == noise
        ]
        yield draw_b_plane(clouds, scenario.body)


def draw_flights(records: Sequence[Record], times_s: Sequence[float]) -> Iterator[Figure]:
    """Draw one or two engagements: over time, their sets at some times, their approach, and the
    members of sets that allow for wrong images.

    Without times, the default times are shown.
    """
    yield draw_process(records)
    yield draw_sets(records, times_s or _default_times(records))
    yield draw_approach(records)
    if any(record.scenario.information_set.wrong_images for record in records):
        yield draw_members(records)


def _default_times(records: Sequence[Record]) -> tuple[float, ...]:
    """Return the times of figure 3, s.

    On a logarithmic time axis (`Clock`), they are evenly distributed over the logarithm of the time
    before the arrival of the first record.
    """
    if not Clock.of(records).counts_down:
        return DEFAULT_TIMES
    arrival_s = records[0].scenario.nominal_arrival_s
    step_s = records[0].scenario.set_model.step_s
    # Three times, as in the figure of the paper: those between the start and the last step.
    return tuple((arrival_s - np.geomspace(arrival_s, step_s, 5)[1:4]).tolist())


def plot(results: Results | Record | Sequence[Record]) -> Figure:
    """Draw results, or the course of up to two engagements.

    Parameters
    ----------
    results : Results, Record or sequence of Record
        Results give the distributions of miss and impulse, each with its 95 % confidence band.
        Records give angle, rate, predicted miss and impulses over time (`draw_process`).
    """
    if isinstance(results, Record):
        return draw_process([results])
    if isinstance(results, Results):
        name = some_runs(len(results))
        sample = Sample(name, CURVE_LOOKS[1], results.miss_m, results.impulse_m_s)
        return draw_samples([sample])
    return draw_process(results)
