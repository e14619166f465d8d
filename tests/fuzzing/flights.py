"""Engagements in proportion to a few numbers, for the tests of numbers under stress."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from infoset import AngleSensor, Camera, InitialSet, Model, RateSensor, SetModel, StateBox
from infoset.arrays import Floats
from infoset.guidance import Strategy, Thruster, TieRule
from infoset.model import Interval
from infoset.sim import Body, Results, Scenario, Target
from infoset.sim.draws import Draws, max_number_of_steps
from infoset.sim.engagement import Engagements, Step
from infoset.sim.scenario import corners, of_model


@dataclass(frozen=True)
class Flight:
    """Values of a batch, step by step, and its results."""

    lower_m: Floats
    upper_m: Floats
    impulse_m_s: Floats
    margin_m: Floats
    results: Results
    ended: bool
    steps_before_a_new_grid: int

    @property
    def seen(self) -> tuple[Floats, Floats, Floats]:
        """Bounds and misses, all lengths, and impulses."""
        phi = self.results.guaranteed_miss_m.filled(0.0)
        lengths = np.concatenate([self.lower_m.ravel(), self.upper_m.ravel(), phi])
        return lengths, self.results.miss_m, self.impulse_m_s


class Errors(NamedTuple):
    """Errors of an engagement: of its angles and of its closing speed, as shares of them.

    `camera` is whether a camera measures the angles, with the largest centroid error.
    """

    angle: float = 0.1
    speed: float = 1e-3
    camera: bool = False


def engagement(
    angle_rad: float,
    range_m: float,
    speed_m_s: float,
    sections: int,
    step_s: float,
    model: Model = Model.GUARANTEED,
    *,
    errors: Errors = Errors(),  # noqa: B008 (it cannot be changed)
    in_space: bool = False,
) -> Scenario:
    """An engagement with numbers in proportion to an angle, a range, a speed and a step."""
    slope = math.tan(angle_rad)
    z = range_m * slope
    v = 0.2 * speed_m_s * slope
    bounds = StateBox(
        (-z, z),
        (0.9 * range_m, 1.1 * range_m),
        (-v, 0.7 * v),
        (-speed_m_s * (1.0 + errors.speed), -speed_m_s * (1.0 - errors.speed)),
    )
    error_rad = errors.angle * angle_rad
    sensor: AngleSensor | Camera = AngleSensor(
        step_s, error_rad, 1.5 * errors.angle * angle_rad, range_m
    )
    if errors.camera:
        sensor = Camera(step_s, error_rad, 0.001999 * range_m)
    thruster = Thruster(10.0 * v, 1e-3 * v, 0.2 * v)
    disturbance = 0.01 * slope * speed_m_s**2 / range_m
    along_y = None
    if in_space:
        bounds = replace(bounds, y_m=(-0.6 * z, 0.9 * z), vy_m_s=(-0.8 * v, v))
        thruster = replace(thruster, pointing_error_rad=0.01)
        along_y = 0.5 * disturbance
    guaranteed = model is Model.GUARANTEED
    return Scenario(
        name="stress",
        nominal_range_m=range_m,
        dispersion=bounds,
        **of_model(
            SetModel(
                speed_m_s,
                step_s,
                bounds,
                sensor,
                disturbance_m_s2=disturbance,
                range_threshold_m=0.02 * range_m,
                sections=sections,
                fewest_sections=min(5, sections),
                initial_set=InitialSet.BOX if guaranteed else InitialSet.RECTANGLE,
                model=model,
                disturbance_y_m_s2=along_y,
            )
        ),
        thruster=thruster,
    )


def numbers(scenario: Scenario, seed: int, batch: int = 3) -> Draws:
    """Random numbers of which half are at their bounds, as a guarantee must allow."""
    generator = np.random.default_rng(seed)
    steps = max_number_of_steps(scenario)
    minimum, maximum = corners(scenario.dispersion)

    shape = (len(scenario.set_model.axes), batch, steps)

    def uniform(shape: tuple[int, ...] = shape) -> Floats:
        return np.clip(generator.uniform(-2.0, 2.0, shape), -1.0, 1.0)

    states = minimum + (maximum - minimum) * generator.uniform(size=(batch, len(minimum)))
    errors = {"angle": uniform(), "range": uniform((batch, steps))}
    tie = uniform()
    if scenario.rate_sensor is not None:
        errors["rate"] = uniform()
    return Draws(
        states[:, : len(minimum) // 2],
        states[:, len(minimum) // 2 :],
        errors=errors,
        tie=tie,
        target=uniform() if scenario.target is not None else None,
        pointing=uniform((batch, steps)) if scenario.thruster.pointing_error_rad > 0.0 else None,
    )


def fly(
    scenario: Scenario, draws: Draws, strategy: Strategy | None = None, steps: int | None = None
) -> Flight:
    flight = Engagements(scenario, draws, strategy)
    seen: list[Step] = []
    labels: list[Floats] = []

    def look(step: Step) -> None:
        seen.append(step)
        labels.append(step.information.labels_m.copy())

    while flight.flying and (steps is None or flight.step < steps):
        flight.advance(look)
    first_new = next(
        (i for i, here in enumerate(labels) if not np.array_equal(here, labels[0])), len(labels)
    )
    return Flight(
        np.array([step.predicted_miss.lower_m for step in seen]),
        np.array([step.predicted_miss.upper_m for step in seen]),
        np.array([step.impulse_m_s for step in seen]),
        np.array(flight.truth_margins_m()),
        flight.results(np.arange(len(draws.position_m))),
        not flight.flying,
        first_new,
    )


def turned(interval: Interval) -> Interval:
    return -interval[1], -interval[0]


def mirrored(scenario: Scenario, draws: Draws) -> tuple[Scenario, Draws]:
    def across(box: StateBox) -> StateBox:
        mirror = replace(box, z_m=turned(box.z_m), vz_m_s=turned(box.vz_m_s))
        if box.y_m is None or box.vy_m_s is None:
            return mirror
        return replace(mirror, y_m=turned(box.y_m), vy_m_s=turned(box.vy_m_s))

    swapped = {TieRule.UPPER: TieRule.LOWER, TieRule.LOWER: TieRule.UPPER}
    sun = scenario.sun
    flip = np.array([-1.0] * len(scenario.set_model.axes) + [1.0])
    image = replace(
        scenario,
        sun=None
        if sun is None
        else replace(sun, direction_rad=-sun.direction_rad, elevation_rad=-sun.elevation_rad),
        dispersion=across(scenario.dispersion),
        **of_model(replace(scenario.set_model, bounds=across(scenario.set_model.bounds))),
        tie=swapped.get(scenario.tie, scenario.tie),
    )
    return image, replace(
        draws,
        position_m=draws.position_m * flip,
        velocity_m_s=draws.velocity_m_s * flip,
        errors={
            name: errors if name == "range" else -errors for name, errors in draws.errors.items()
        },
        tie=-draws.tie,
        target=None if draws.target is None else -draws.target,
    )


def scaled(scenario: Scenario, draws: Draws, length: float, time: float) -> tuple[Scenario, Draws]:
    """The same engagement in other units, its numbers left without them."""
    speed = length / time
    acceleration = length / time**2

    def box(given_box: StateBox) -> StateBox:
        units = {name: speed if name.endswith("_m_s") else length for name in vars(given_box)}
        ends = {
            name: tuple(units[name] * end for end in ends)
            for name, ends in vars(given_box).items()
            if ends
        }
        return StateBox(**ends)

    def in_units(acceleration_m_s2: float | None) -> float | None:
        return None if acceleration_m_s2 is None else acceleration * acceleration_m_s2

    model = scenario.set_model
    engine = scenario.thruster
    sun = scenario.sun
    target = scenario.target
    ranging = scenario.range_sensor
    rating = scenario.rate_sensor
    sensor = replace(model.angle_sensor, period_s=time * model.angle_sensor.period_s)
    if isinstance(sensor, AngleSensor):
        sensor = replace(sensor, nominal_range_m=length * sensor.nominal_range_m)
    elif isinstance(sensor, Camera):
        sensor = replace(sensor, centroid_error_m=length * sensor.centroid_error_m)
    return replace(
        scenario,
        nominal_range_m=length * scenario.nominal_range_m,
        dispersion=box(scenario.dispersion),
        **of_model(
            replace(
                model,
                closing_speed_m_s=speed * model.closing_speed_m_s,
                step_s=time * model.step_s,
                bounds=box(model.bounds),
                angle_sensor=sensor,
                disturbance_m_s2=acceleration * model.disturbance_m_s2,
                disturbance_y_m_s2=in_units(model.disturbance_y_m_s2),
                range_threshold_m=length * model.range_threshold_m,
            )
        ),
        thruster=replace(
            engine,
            budget_m_s=speed * engine.budget_m_s,
            min_impulse_m_s=speed * engine.min_impulse_m_s,
            max_impulse_m_s=speed * engine.max_impulse_m_s,
        ),
        sun=None
        if sun is None
        else replace(
            sun,
            gravitational_parameter_m3_s2=length
            * acceleration
            * length
            * sun.gravitational_parameter_m3_s2,
            distance_m=length * sun.distance_m,
        ),
        range_sensor=None
        if ranging is None
        else replace(ranging, period_s=time * ranging.period_s),
        rate_sensor=None
        if rating is None
        else RateSensor(time * rating.period_s, rating.error_rad_s / time),
        target=None
        if target is None
        else Target(
            target.manoeuvre,
            acceleration * target.acceleration_m_s2,
            time * target.switching_period_s,
            in_units(target.acceleration_y_m_s2),
        ),
        body=None
        if scenario.certain_radius_m is None
        else Body(length * scenario.certain_radius_m),
    ), replace(draws, position_m=length * draws.position_m, velocity_m_s=speed * draws.velocity_m_s)
