"""The course of recorded engagements over time: time axis, misses, schedule and titles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset.arrays import Floats, Integers
from infoset.experiments.common.units import duration_text
from infoset.guidance.thruster import modulus
from infoset.sensors import OffsetCamera
from infoset.sim import Outcome, Record, Scenario
from infoset.sim.adversary import WORST_FOUND
from infoset.sim.engagement import Step
from infoset.sim.results import ending
from infoset.sim.schedule import schedule

MAX_SHOWN_STEPS = 400
"""Number of steps above which a flight is long: more cannot be told apart in a figure or a page.

The time axis of a long flight is logarithmic in the time before the arrival. Pages (`kept_steps`)
and corridors (`Courses`) do not show all of its steps; figures of single engagements do.
"""

MAX_COURSES = 1000
"""Maximum number of runs of a curve whose courses are kept: with `MAX_SHOWN_STEPS` steps, 6 MB."""


@dataclass(frozen=True)
class Clock:
    """The time axis of pictures of engagements.

    It is linear in the time, or logarithmic in the time before the arrival.
    """

    counts_down: bool

    @classmethod
    def of(cls, records: Sequence[Record]) -> Clock:
        """Return the time axis for records.

        It is logarithmic if one of them is a long flight, or has a time of the schedule (`marks`).
        """
        return cls(
            any(record.steps > MAX_SHOWN_STEPS or marks(record.scenario) for record in records)
        )

    def at(self, record: Record, times_s: ArrayLike | None = None) -> Floats:
        """Return the positions of times on the axis, s; None is the times of the steps.

        Times before the arrival are at least half a step, because a logarithmic axis has no zero.
        """
        if times_s is None:
            times_s = record.time_s
        times = np.asarray(times_s, dtype=np.float64)
        if not self.counts_down:
            return times
        return np.maximum(record.scenario.nominal_arrival_s - times, min_to_go_s(record.scenario))

    def text(self, record: Record, time_s: float) -> str:
        """Return a time of a step as text."""
        if not self.counts_down:
            return f"t = {time_s:g} s"
        to_go_s = record.scenario.nominal_arrival_s - time_s
        if abs(to_go_s) < min_to_go_s(record.scenario):
            return "at the nominal arrival"
        if to_go_s < 0.0:
            return f"{-to_go_s:.3g} s after the nominal arrival"
        return f"{duration_text(to_go_s)} to go"


def measured_name(scenario: Scenario) -> str:
    """Return the name of the measured angles, which may be those of another point of the body."""
    if isinstance(scenario.bearing_sensor, OffsetCamera):
        return "measured angle of the centre of brightness"
    return "measured angle"


def min_to_go_s(scenario: Scenario) -> float:
    """Return the minimum time before the arrival of a logarithmic axis, s."""
    return 0.5 * scenario.set_model.step_s


def evenly(places: NDArray[Any], count: int) -> Integers:
    """Return at most `count` indices of `places`, evenly distributed over their values.

    `places` rises, and is not empty. With a `count` of 2 or more the first and the last value are
    among the values of the indices. Of equal values the first one is taken.
    """
    wanted = np.linspace(places[0], places[-1], count)
    return np.unique(np.abs(places - wanted[:, None]).argmin(axis=1))


def kept_steps(record: Record) -> list[int]:
    """Return the steps that pages and terminals show.

    They are all steps, or of a long flight at most `MAX_SHOWN_STEPS`: the first and the last step
    and image, up to a quarter of `MAX_SHOWN_STEPS` impulses, and others that are evenly
    distributed, half over the steps and half over the logarithm of the time before arrival. Steps
    after the arrival have equal logarithms, of which `evenly` takes the first.
    """
    count = record.steps
    if count <= MAX_SHOWN_STEPS:
        return list(range(count))

    fired = np.flatnonzero(record.impulse_m_s.any(axis=1))
    most = MAX_SHOWN_STEPS // 4
    if len(fired) > most:
        fired = fired[evenly(np.arange(len(fired)), most)]
    kept = {0, count - 1, *fired.tolist()}
    seen = np.flatnonzero(record.measures("angle"))
    if len(seen):
        kept |= {int(seen[0]), int(seen[-1])}

    half = (MAX_SHOWN_STEPS - len(kept)) // 2
    places = -np.log(Clock(counts_down=True).at(record))
    kept |= {*evenly(places, half).tolist(), *evenly(np.arange(count), half).tolist()}
    return sorted(kept)


def marks(scenario: Scenario) -> dict[str, float]:
    """Return the times of the first and the last image and of the last impulse.

    Each is a time before the nominal arrival, s, of the schedule that will happen. A time that the
    scenario leaves open is left out, and one that is not between the start and the arrival. There
    are none if the flight has no schedule (`schedule`).
    """
    sensor = scenario.set_model.angle_sensor
    thruster = scenario.thruster
    planned = schedule(scenario)
    if planned is None:
        return {}

    times = {}
    if sensor.first_image_s is not None and planned.images_s:
        times["first image"] = planned.images_s[0]
    # 0, the default, leaves the last image open, as None does elsewhere.
    if sensor.last_image_s and planned.images_s:
        times["last image"] = planned.images_s[-1]
    if thruster.last_impulse_s is not None and planned.impulses_s:
        times["cut-off"] = planned.impulses_s[-1]
    elif thruster.impulses_s:
        times["last impulse"] = planned.impulses_s[-1]
    return {name: time for name, time in times.items() if 0.0 < time < scenario.nominal_arrival_s}


def true_predicted_misses(record: Record) -> Floats:
    """Return the miss of the true state on a straight line, m, shape (N, C).

    It is that at each step before the impulse of this step, from the aim point.

    Notes
    -----
    omega (x^2 + a^2) = V_a x - V_x a for the coordinate a of an axis, and a + V_a x / |V_x| is the
    miss of the centre. |V_x| is that at the start: its change by gravity is neglected.
    """
    slopes = np.tan(record.true_angle_rad)
    x_squared = record.true_range_m**2 / (1.0 + (slopes**2).sum(axis=1))
    # The last component is along x; it is negative in an approach.
    speed = -float(record.result.velocity_m_s[0, -1])
    centre_m = record.true_rate_rad_s * x_squared[:, None] * (1.0 + slopes**2) / speed
    return np.asarray(centre_m + record.scenario.set_model.lateral_aim_m)


def complete_steps(record: Record) -> Integers:
    """Return the indices of the steps with a complete set.

    A set is complete until its nearest section reaches the range threshold and leaves. The last
    step is the one after whose measurement it leaves. Steps without a predicted miss are left out:
    their sets are empty.
    """
    model = record.scenario.set_model
    min_range_m = model.range_threshold_m + model.closing_speed_m_s * model.step_s
    end = record.steps
    for step, sections in enumerate(record.sections):
        # Members of a set that allows for wrong images follow each other.
        nearest_m = min((section.range_m for section in sections), default=math.inf)
        if nearest_m < min_range_m:
            end = step + 1
            break
    # One number stands for all of a step: if a set is empty, all of them are NaN.
    return np.flatnonzero(np.isfinite(record.predicted_miss_m[:end, 0, 0]))


class Courses:
    """Possible misses and impulses of many runs of a scenario over time, an observer of `simulate`.

    The first `MAX_COURSES` runs are kept. `observe` is called with rising steps of a batch.

    Attributes
    ----------
    steps : ndarray of int, shape (n,)
        Steps until the nominal arrival; of a long flight at most `MAX_SHOWN_STEPS`, and the steps
        of scheduled impulses.
    possible_m : ndarray, shape (runs, n)
        Maximum possible miss without further impulses, m; NaN from the first of the steps on in
        which the set is empty or its nearest section leaves, also if it recovers.
    impulse_m_s : ndarray, shape (runs, n)
        Maximum modulus of the impulses after the step before in `steps`, and in this one, m/s.
    """

    def __init__(self, scenario: Scenario, runs: int) -> None:
        self.scenario = scenario
        every = np.arange(math.ceil(scenario.nominal_arrival_s / scenario.set_model.step_s))
        self.steps = every
        if len(every) > MAX_SHOWN_STEPS:
            half = MAX_SHOWN_STEPS // 2
            by_logarithm = evenly(-np.log(len(every) - every), half)
            scheduled: Sequence[int] = ()
            if scenario.thruster.is_scheduled:
                scheduled = scenario.impulse_steps or ()
            steps = np.unique([*by_logarithm, *evenly(every, half), *scheduled])
            self.steps = steps.astype(np.int64)

        self.possible_m = np.full((min(runs, MAX_COURSES), len(self.steps)), np.nan)
        self.impulse_m_s = np.zeros_like(self.possible_m)

    @property
    def before_arrival_s(self) -> Floats:
        """Times of the steps before the nominal arrival, s, shape (n,)."""
        return np.asarray(
            self.scenario.nominal_arrival_s - self.steps * self.scenario.set_model.step_s
        )

    def observe(self, first: int, step: Step) -> None:
        """Store a step of the batch whose first run has this index.

        Steps after the last one in `steps` are not stored.
        """
        column = int(np.searchsorted(self.steps, step.step))
        batch = slice(first, first + len(step.tracking))
        impulse = self.impulse_m_s[batch]
        possible = self.possible_m[batch]
        if column == len(self.steps) or not len(impulse):
            return

        # The maximum impulse of the steps since the step before in `steps`. The batch may have more
        # runs than are kept: only the first `count` are.
        count = len(impulse)
        np.maximum(impulse[:, column], modulus(step.impulse_m_s)[:count], out=impulse[:, column])
        if self.steps[column] != step.step:
            return

        model = self.scenario.set_model
        miss = step.predicted_miss
        nearest_m, _ = step.information.stored_range_interval_m()
        leaving = nearest_m < model.range_threshold_m + model.closing_speed_m_s * model.step_s
        known = step.tracking & miss.exists & ~leaving
        maximum = modulus(np.maximum(np.abs(miss.lower_m), np.abs(miss.upper_m)))
        possible[:, column] = np.where(known, maximum, np.nan)[:count]
        # A set that was not complete before does not become complete again.
        if column:
            possible[np.isnan(possible[:, column - 1]), column] = np.nan


def noise_title(record: Record) -> str:
    """Return the title of the noise of an engagement, for example `game noise, range sensor`."""
    title = f"{record.noise_name} noise"
    if record.noise == WORST_FOUND:
        title = "worst errors found"
    if record.scenario.range_sensor is not None:
        title += ", range sensor"
    return title


def record_titles(records: Sequence[Record]) -> list[str]:
    """Return a title for each record.

    Records with the same title are distinguished by run, seed, strategy, model, tie and scenario:
    by the first of these that differ, until all titles differ. Two and more have letters, too.
    """
    titles = [noise_title(record) for record in records]
    candidates = (
        [f"run {record.run}" for record in records],
        [f"seed {record.seed}" for record in records],
        [record.strategy for record in records],
        [f"{record.scenario.information_set.model.value} model" for record in records],
        [f"tie {record.scenario.tie.value}" for record in records],
        [record.scenario.name for record in records],
    )
    for extra in candidates:
        if len(set(titles)) < len(titles) and len(set(extra)) > 1:
            titles = [f"{title}, {more}" for title, more in zip(titles, extra, strict=True)]
    if len(records) == 1:
        return titles
    return [f"({chr(ord('a') + index)}) {title}" for index, title in enumerate(titles)]


def outcome_title(record: Record) -> str:
    """Return miss, impulse and outcome of an engagement.

    The outcome is left out if it is the arrival. For a body with a size, the title says how the
    engagement ended.
    """
    result = record.result
    text = (
        f"miss {_shown(float(result.miss_m[0]))} m, impulse spent "
        f"{float(result.impulse_m_s[0]):.1f} m/s"
    )
    outcome = result.outcomes[0]
    if outcome is not Outcome.ARRIVED:
        text += f", {outcome.value.replace('-', ' ')}"
    cause = result.causes[0]
    return ending(text, result.hit.tolist()[0], cause and cause.value)


def _shown(metres: float) -> str:
    """Return a length for a title: two decimals below 100 m, none from there on."""
    if metres < 100.0:
        return f"{metres:.2f}"
    return f"{metres:,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}")
