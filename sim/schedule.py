"""The images and impulses that a scenario schedules, and where they differ from the times that it
asks for.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from infoset.clock import steps_between
from infoset.sim.scenario import MAX_STEPS, Scenario

SAID_FROM = 0.1
"""Part of a step from which a difference between a time of the file and its step is reported."""


@dataclass(frozen=True)
class Difference:
    """A time of a scenario and the time of the image or step that it means, s before the nominal
    arrival.
    """

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
    differences : tuple of Difference
        Times of the scenario that differ by more than a tenth of a step from those of the schedule.
    """

    images_s: tuple[float, ...]
    impulses_s: tuple[float, ...]
    images_before_last_decision: int
    differences: tuple[Difference, ...]


def schedule(scenario: Scenario) -> Schedule | None:
    """Return the schedule of a scenario; None if the nominal arrival is more than `MAX_STEPS`
    away.
    """
    arrival_s = scenario.nominal_arrival_s
    step_s = scenario.step_s
    if arrival_s > MAX_STEPS * step_s:
        return None
    last_step = steps_between(arrival_s, 0.0, step_s)
    steps = scenario.impulse_steps
    if steps is None:
        steps = range(scenario.thruster.delay_steps, last_step + 1)
    images_s = _before_s(scenario, [*images_until(scenario, last_step)][::-1])
    impulses_s = _before_s(scenario, [step for step in steps if step <= last_step])
    asked = [*_asked_images(scenario, images_s), *_asked_impulses(scenario, impulses_s)]
    differences = [
        each for each in asked if abs(each.scheduled_s - each.asked_s) > SAID_FROM * step_s
    ]
    return Schedule(images_s, impulses_s, len(image_times_s(scenario)), tuple(differences))


def image_times_s(scenario: Scenario) -> list[float]:
    """Return the times before the nominal arrival of the images until the last decision of an
    impulse, s.
    """
    model = scenario.set_model
    steps = scenario.impulse_steps
    end_s = scenario.nominal_arrival_s - model.min_range_m / model.closing_speed_m_s
    last_step = int(end_s / model.step_s) if steps is None else int(max(steps))
    images = [*images_until(scenario, last_step - scenario.thruster.delay_steps)][::-1]
    return [*_before_s(scenario, images)]


def images_until(scenario: Scenario, last_step: int) -> Iterator[int]:
    """Yield the steps with images of the line-of-sight angles until a step, the last one first."""
    sensor = scenario.bearing_sensor
    for step in reversed(range(0, last_step + 1, scenario.set_model.steps_in(sensor.period_s))):
        if sensor.measures_at(scenario.nominal_arrival_s - step * scenario.step_s):
            yield step


def _before_s(scenario: Scenario, steps: Sequence[int]) -> tuple[float, ...]:
    """Return the times of steps before the nominal arrival, s."""
    return tuple(scenario.nominal_arrival_s - step * scenario.step_s for step in steps)


def _asked_images(scenario: Scenario, images_s: Sequence[float]) -> Iterator[Difference]:
    """Yield the times of the first and the last image that the scenario has, and those of the
    schedule.
    """
    sensor = scenario.bearing_sensor
    if images_s and sensor.first_image_s is not None:
        yield Difference(f"{sensor.table}.first_image_s", sensor.first_image_s, images_s[0])
    if images_s and sensor.last_image_s > 0.0:
        yield Difference(f"{sensor.table}.last_image_s", sensor.last_image_s, images_s[-1])


def _asked_impulses(scenario: Scenario, impulses_s: Sequence[float]) -> Iterator[Difference]:
    """Yield the times of impulses that the scenario has, and those of the schedule."""
    thruster = scenario.thruster
    arrival_s = scenario.nominal_arrival_s
    step_s = scenario.step_s

    def meant(key: str, time_s: float) -> Difference:
        step = steps_between(arrival_s, time_s, step_s)
        return Difference(f"thruster.{key}", time_s, arrival_s - step * step_s)

    for time_s in thruster.impulses_s:
        yield meant("impulses_s", time_s)
    if impulses_s and thruster.first_impulse_s is not None:
        yield Difference("thruster.first_impulse_s", thruster.first_impulse_s, impulses_s[0])
    if not thruster.last_impulse_s:
        return
    yield meant("last_impulse_s", thruster.last_impulse_s)
    if thruster.impulse_period_s is not None:
        for place in range(1, len(impulses_s)):
            yield meant(
                "impulse_period_s", thruster.last_impulse_s + place * thruster.impulse_period_s
            )
