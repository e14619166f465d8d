"""The images and impulses that a scenario schedules, and where they differ from the times that it
asks for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from infoset.clock import steps_between
from infoset.sim.scenario import MAX_STEPS, Scenario

REPORTED_DIFFERENCE = 0.1
"""Minimum difference between a time of the file and its step that is reported, in steps: times that
are rounded in a file to a tenth of a step are not.
"""


@dataclass(frozen=True)
class Difference:
    """A time of a scenario, and the time of its image or step, s before the nominal arrival."""

    key: str
    asked_s: float
    scheduled_s: float


@dataclass(frozen=True)
class Schedule:
    """Images and possible impulses of the nominal flight.

    Parameters
    ----------
    images_s, impulses_s : tuple of float
        Times of all images and of all steps in which an impulse can be given, s before the nominal
        arrival, decreasing.
    images_before_last_decision : int
        Number of images until the last decision of an impulse.
    true_arrivals_s : tuple of float
        Earliest and latest arrival of the starts of the dispersion without impulses and gravity, s
        after the nominal one.
    differences : tuple of Difference
        Times of the scenario that differ by more than a tenth of a step from the schedule.
    """

    images_s: tuple[float, ...]
    impulses_s: tuple[float, ...]
    images_before_last_decision: int
    true_arrivals_s: tuple[float, float]
    differences: tuple[Difference, ...]


def schedule(scenario: Scenario) -> Schedule | None:
    """Return the schedule; None if the nominal arrival is more than `MAX_STEPS` away."""
    arrival_s = scenario.nominal_arrival_s
    step_s = scenario.fitted_step_s
    if arrival_s > MAX_STEPS * step_s:
        return None

    last_step = steps_between(arrival_s, 0.0, step_s)
    steps = scenario.impulse_steps
    if steps is None:
        steps = range(scenario.engine.delay_steps, last_step + 1)
    images_s = _before_s(scenario, [*images_until(scenario, last_step)][::-1])
    impulses_s = _before_s(scenario, [step for step in steps if step <= last_step])

    reported_s = REPORTED_DIFFERENCE * step_s
    asked = [*_asked_images(scenario, images_s), *_asked_impulses(scenario, impulses_s)]
    differences = tuple(each for each in asked if abs(each.scheduled_s - each.asked_s) > reported_s)
    return Schedule(
        images_s,
        impulses_s,
        len(image_times_s(scenario)),
        _true_arrivals_s(scenario),
        differences,
    )


def _true_arrivals_s(scenario: Scenario) -> tuple[float, float]:
    """Return the earliest and the latest arrival of `Schedule`."""
    box = scenario.dispersion
    fastest_m_s, slowest_m_s = -box.vx_m_s[0], -box.vx_m_s[1]
    nominal_s = scenario.nominal_arrival_s
    return box.x_m[0] / fastest_m_s - nominal_s, box.x_m[1] / slowest_m_s - nominal_s


def image_times_s(scenario: Scenario) -> list[float]:
    """Return the times of the images until the last decision, s before the nominal arrival.

    They decrease, and an image in the step of that decision counts. Without times of impulses the
    last decision is for the last step until the minimum range. The list is empty if there is no
    such image.
    """
    model = scenario.set_model
    steps = scenario.impulse_steps
    if steps is None:
        end_s = scenario.nominal_arrival_s - model.min_range_m / model.closing_speed_m_s
        last_step = int(end_s / model.step_s)
    else:
        last_step = int(max(steps))

    last_decision = last_step - scenario.engine.delay_steps
    images = [*images_until(scenario, last_decision)][::-1]
    return [*_before_s(scenario, images)]


def images_until(scenario: Scenario, last_step: int) -> Iterator[int]:
    """Yield the steps with images of the line-of-sight angles, from `last_step` back to the start.

    `last_step` itself counts.
    """
    sensor = scenario.bearing_sensor
    period_steps = scenario.set_model.steps_in(sensor.period_s)
    for step in reversed(range(0, last_step + 1, period_steps)):
        if sensor.measures_at(scenario.nominal_arrival_s - step * scenario.fitted_step_s):
            yield step


def _before_s(scenario: Scenario, steps: Sequence[int]) -> tuple[float, ...]:
    """Return the times of steps before the nominal arrival, s."""
    return tuple(scenario.nominal_arrival_s - step * scenario.fitted_step_s for step in steps)


def _asked_images(scenario: Scenario, images_s: Sequence[float]) -> Iterator[Difference]:
    """Yield the first and the last image of the scenario, with their times in the schedule."""
    sensor = scenario.bearing_sensor
    if images_s and sensor.first_image_s is not None:
        yield Difference(f"{sensor.table}.first_image_s", sensor.first_image_s, images_s[0])
    if images_s and sensor.last_image_s > 0.0:
        yield Difference(f"{sensor.table}.last_image_s", sensor.last_image_s, images_s[-1])


def _asked_impulses(scenario: Scenario, scheduled_s: Sequence[float]) -> Iterator[Difference]:
    """Yield each time that the thruster's table asks for, and the time of its step.

    `scheduled_s` are the times of all possible impulses.
    """
    thruster = scenario.thruster
    arrival_s = scenario.nominal_arrival_s
    step_s = scenario.fitted_step_s

    def nearest_step(key: str, time_s: float) -> Difference:
        step = steps_between(arrival_s, time_s, step_s)
        return Difference(f"thruster.{key}", time_s, arrival_s - step * step_s)

    for time_s in thruster.impulses_s:
        yield nearest_step("impulses_s", time_s)
    if scheduled_s and thruster.first_impulse_s is not None:
        yield Difference("thruster.first_impulse_s", thruster.first_impulse_s, scheduled_s[0])

    last_s = thruster.last_impulse_s
    if not last_s:  # None and 0 are no cut-off.
        return
    yield nearest_step("last_impulse_s", last_s)
    if thruster.impulse_period_s is not None:
        # The last impulse, 0 periods, is reported above.
        for periods in range(1, len(scheduled_s)):
            time_s = last_s + periods * thruster.impulse_period_s
            yield nearest_step("impulse_period_s", time_s)
