"""Random scenarios of the guaranteed model, with all sensors, speeds and ranges.

    from benchmarks.random_scenarios import camera_scenario, gravity_scenario, random_scenario
    scenario = random_scenario(7, rate_sensor=True)
    scenario = camera_scenario(7)

The same number gives the same scenario. Every scenario is valid: it is written as a scenario file
and read again.
"""

from __future__ import annotations

import contextlib
from dataclasses import replace
from typing import Any

import numpy as np

from infoset import (
    AngleSensor,
    Bias,
    Camera,
    InitialSet,
    Model,
    RangeSensor,
    RateSensor,
    SetModel,
    StateBox,
)
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import read_text, to_toml
from infoset.guidance import NoiseKind, Thruster, TieRule
from infoset.sim import Manoeuvre, Scenario, Sun, Target
from infoset.sim.gravity import on_board_model
from infoset.sim.scenario import of_model

SOLAR_PARAMETER_M3_S2 = 1.324948e20
"""Gravitational parameter of the Sun in the paper's scenario."""
STRATEGIES = ("symmetric-miss", "patient")
"""Strategies of random scenarios, in equal shares."""


def random_scenario(number: int, *, rate_sensor: bool) -> Scenario:
    """Return the random scenario with a number, with or without a rate sensor.

    About half of the scenarios have a range sensor. Speeds are 1 to 100 km/s, steps 0.01 to 10 s
    and 16 to 126 of them, angle errors 1e-6 to 1e-2 rad, sections 3 to 500.
    """
    generator = np.random.default_rng(
        np.random.SeedSequence(entropy=18, spawn_key=(number, int(rate_sensor)))
    )
    while True:
        try:
            scenario = _drawn(generator, number, rate_sensor)
            return read_text(Scenario, to_toml(scenario), f"random scenario {number}")
        except InputError:
            continue  # an invalid scenario is drawn again


def with_burns(scenario: Scenario, number: int) -> Scenario:
    """Return the scenario with an engine whose maximum impulse lasts a part of a step, or all of
    it, and with a cut-off before the earliest arrival.

    Raises
    ------
    ValueError
        If the flight has no impulse before this cut-off.
    """
    engine = scenario.thruster
    share = (0.3, 1.0, 0.7)[number % 3]
    longest_m_s = engine.max_impulse_m_s * (1.0 + engine.execution_error_relative)
    earliest_s = scenario.set_model.label_limits_m[0] / scenario.closing_speed_m_s
    # A hundredth of a step is more than the rounding of the times.
    last_s = scenario.nominal_arrival_s - earliest_s + (share + 1.01) * scenario.step_s
    burning = replace(
        engine,
        thrust_N=longest_m_s / (share * scenario.step_s),
        mass_kg=1.0,
        last_impulse_s=max(last_s, engine.last_impulse_s or 0.0),
    )
    return replace(scenario, thruster=burning)


def gravity_scenario(number: int) -> Scenario:
    """Return the random scenario with a number, in strong gravity of a planet or a star.

    The range is 0.3 % to 90 % of the distance from the attractor, and the speed 0.5 to 100 times
    the speed of a circular orbit. In a third of the scenarios the target starts near the attractor,
    and is up to 1000 times as fast. One of two is in space.

    Raises
    ------
    ValueError
        If gravity has no bound in this scenario.
    """
    generator = np.random.default_rng(np.random.SeedSequence(entropy=34, spawn_key=(number,)))

    def power(minimum: float, maximum: float) -> float:
        return float(10.0 ** generator.uniform(minimum, maximum))

    scenario = random_scenario(number, rate_sensor=number % 8 == 5)
    parameter = power(13.5, 20.2)
    distance_m = power(6.9, 11.2)
    direction = generator.uniform(-np.pi, np.pi)
    elevation = generator.uniform(-1.5, 1.5)
    range_m = distance_m * power(-2.5, -0.05)
    speed = power(-0.3, 2.0)
    wide = range_m * power(-4.0, -2.0)
    if number % 3 == 0:
        range_m = distance_m * (1.0 - power(-3.0, -0.3))
        speed = power(1.0, 3.0)
        direction = power(-4.0, -0.3)
        elevation = power(-4.0, -0.3)
        wide = (distance_m - range_m) * power(-4.0, -1.0)
    speed_m_s = min(float(np.sqrt(parameter / distance_m)) * speed, 3e5)
    flight_s = range_m / speed_m_s
    fast = speed_m_s * power(-4.0, -2.0)
    step_s = flight_s / float(generator.integers(30, 200))
    axial = power(-1.0, 0.0)
    along = power(-5.0, -1.5)
    is_spatial = number % 2 == 1
    box = StateBox(
        z_m=(-wide, wide),
        x_m=(range_m - axial * wide, range_m + axial * wide),
        vz_m_s=(-fast, fast),
        vx_m_s=(-speed_m_s * (1.0 + along), -speed_m_s * (1.0 - along)),
        y_m=(-0.3 * wide, wide) if is_spatial else None,
        vy_m_s=(-fast, 0.2 * fast) if is_spatial else None,
    )
    impulse_m_s = float(generator.uniform(0.05, 0.5)) * (fast + wide / flight_s)
    model = replace(
        scenario.set_model,
        closing_speed_m_s=speed_m_s,
        step_s=step_s,
        bounds=box,
        angle_sensor=AngleSensor(step_s, power(-6.0, -4.0), power(-6.0, -4.0), range_m),
        range_threshold_m=float(generator.uniform(1.0, 3.0)) * speed_m_s * step_s,
        disturbance_m_s2=0.0,
        sections=min(scenario.set_model.sections, 29),
        fewest_sections=3,
    )
    ranging = scenario.range_sensor
    rates = scenario.rate_sensor
    scenario = replace(
        scenario,
        name=f"gravity-{number}",
        sun=Sun(parameter, distance_m, float(direction), float(elevation) if is_spatial else 0.0),
        nominal_range_m=range_m,
        dispersion=box,
        **of_model(model),
        range_sensor=None if ranging is None else replace(ranging, period_s=step_s),
        rate_sensor=None if rates is None else replace(rates, period_s=step_s),
        target=None,
        thruster=Thruster(
            30.0 * impulse_m_s, 0.01 * impulse_m_s, impulse_m_s, execution_error_relative=0.01
        ),
    )
    on_board_model(scenario)
    return scenario


def camera_scenario(number: int) -> Scenario:
    """Return the random scenario with a number, with a camera.

    Two of three are in space, one in eight has rates. The centroid error is a tenth of the range
    threshold, or less. The bias, the first and the last image, and the probability of a lost image
    are random.
    """
    generator = np.random.default_rng(np.random.SeedSequence(entropy=22, spawn_key=(number,)))
    scenario = random_scenario(number, rate_sensor=number % 8 == 5)

    def often(share: float) -> bool:
        return bool(generator.uniform() < share)

    model = scenario.set_model
    arrival_s = scenario.nominal_arrival_s
    centroid_m = 0.1 * model.range_threshold_m * float(10.0 ** -abs(generator.normal(0.0, 1.0)))
    last_s = arrival_s * float(10.0 ** generator.uniform(-2.5, -0.7)) if often(0.5) else 0.0
    first_s = last_s + (arrival_s - last_s) * float(generator.uniform(0.3, 1.1))
    sensor = Camera(
        model.angle_sensor.period_s,
        model.angle_sensor.constant_error_rad * float(10.0 ** generator.uniform(-2.0, 0.0)),
        0.0 if often(0.1) else centroid_m * (1.0 - 1e-12),
        bias=Bias.CONSTANT if often(0.5) else Bias.RANDOM,
        first_image_s=first_s if often(0.5) else None,
        last_image_s=last_s,
        miss_probability=float(generator.uniform(0.0, 0.8)) if often(0.5) else 0.0,
    )
    if number % 3 == 0:
        return replace(scenario, **of_model(replace(model, angle_sensor=sensor)))
    scale = float(10.0 ** generator.uniform(-1.5, 0.5))

    def in_space(box: StateBox) -> StateBox:
        (_, z_m), (_, vz_m_s) = box.z_m, box.vz_m_s
        return replace(box, y_m=(-z_m * scale, 0.7 * z_m), vy_m_s=(-vz_m_s, vz_m_s * scale))

    dispersion = in_space(scenario.dispersion)
    # The box contains the dispersion, which is smaller than the box of z in some scenarios.
    z_m = model.bounds.z_m[1]
    vz_m_s = model.bounds.vz_m_s[1]
    wider = max(scale, 1.0)
    known = replace(model.bounds, y_m=(-z_m * wider, z_m), vy_m_s=(-vz_m_s, vz_m_s * wider))
    thruster = replace(scenario.thruster, pointing_error_rad=float(generator.choice([0.0, 0.02])))
    spatial = replace(model, bounds=known, angle_sensor=sensor)
    return replace(scenario, **of_model(spatial), dispersion=dispersion, thruster=thruster)


def scheduled(scenario: Scenario, number: int) -> Scenario:
    """Return the scenario with a random delay and schedule.

    The delay is up to three steps; the schedule has up to five times of impulses, or a cut-off.
    """
    generator = np.random.default_rng(np.random.SeedSequence(entropy=23, spawn_key=(number,)))
    arrival_s = scenario.nominal_arrival_s
    step_s = scenario.set_model.step_s
    delay = int(generator.integers(4))
    times_s = tuple(
        sorted(generator.uniform(0.02, 0.8, int(generator.integers(6))) * arrival_s, reverse=True)
    )
    last_s = arrival_s * float(10.0 ** generator.uniform(-2.5, -0.5))
    thruster = replace(scenario.thruster, delay_steps=delay)
    schedules: tuple[dict[str, Any], ...] = {"impulses_s": times_s}, {"last_impulse_s": last_s}
    for schedule in schedules:
        changed = replace(thruster, **schedule)
        with contextlib.suppress(ValueError):  # two times in one step, or none that can be given
            changed.impulse_steps(arrival_s, step_s)
            return replace(scenario, thruster=changed)
    return scenario


def _drawn(generator: np.random.Generator, number: int, rate_sensor: bool) -> Scenario:
    """Return a scenario that may be invalid.

    The order of the draws must not change: a number would give another scenario.
    """

    def decades(minimum: float, maximum: float) -> float:
        return float(10.0 ** generator.uniform(minimum, maximum))

    def often(share: float) -> bool:
        return bool(generator.uniform() < share)

    speed_m_s = 1e3 * decades(0.0, 2.0)
    steps = decades(1.2, 2.1)
    step_s = decades(-2.0, 1.0)
    flight_s = steps * step_s
    range_m = speed_m_s * flight_s
    z_m = range_m * decades(-4.0, -1.3)
    vz_m_s = speed_m_s * decades(-5.5, -2.5)
    spread = decades(-2.5, -1.0)
    speed_error = 0.0 if often(0.1) else decades(-5.0, -1.0)
    bounds = StateBox(
        (-z_m, z_m),
        (range_m * (1.0 - spread), range_m * (1.0 + spread)),
        (-vz_m_s, vz_m_s),
        (-speed_m_s * (1.0 + speed_error), -speed_m_s * (1.0 - speed_error)),
    )
    error_rad = decades(-6.0, -2.0)
    error_at_zero_rad = error_rad * float(generator.uniform(0.5, 3.0))
    sections = round(decades(0.5, 1.8 if often(0.95) else 2.7))
    disturbance_m_s2 = 0.0 if often(0.4) else z_m / flight_s**2 * decades(-3.0, 0.0)
    model = SetModel(
        speed_m_s,
        step_s,
        bounds,
        AngleSensor(step_s * int(generator.integers(1, 4)), error_rad, error_at_zero_rad, range_m),
        disturbance_m_s2=disturbance_m_s2,
        range_threshold_m=range_m * decades(-5.0, -1.5),
        sections=sections,
        fewest_sections=int(generator.integers(2, min(6, sections) + 1)),
        initial_set=InitialSet.BOX,
        model=Model.GUARANTEED,
    )
    max_m_s = z_m / flight_s * decades(-0.5, 1.5)
    thruster = Thruster(
        max_m_s * steps * decades(-1.5, 0.0),
        0.0 if often(0.3) else max_m_s * decades(-2.0, -0.3),
        max_m_s,
        (0.0, 0.0, 0.01, 0.05)[int(generator.integers(4))],
    )
    sun = None
    if often(0.6):
        sun = Sun(
            SOLAR_PARAMETER_M3_S2, decades(10.3, 11.3), float(generator.uniform(0.0, 2.0 * np.pi))
        )
    dispersion = bounds
    if often(0.3):
        dispersion = replace(
            bounds, z_m=(-0.5 * z_m, 0.5 * z_m), vz_m_s=(-0.5 * vz_m_s, 0.5 * vz_m_s)
        )
    rate_error_rad_s = error_rad / step_s * decades(-2.5, 0.5)

    range_sensor = None
    if often(0.5):
        range_sensor = RangeSensor(step_s * int(generator.integers(1, 5)), decades(-3.0, -0.5))
    strategy = STRATEGIES[int(generator.integers(len(STRATEGIES)))]
    rates = None
    if rate_sensor:
        rates = RateSensor(step_s * int(generator.integers(1, 4)), rate_error_rad_s)
    target = None
    if disturbance_m_s2 > 0.0 and often(0.7):
        kinds = [manoeuvre for manoeuvre in Manoeuvre if manoeuvre is not Manoeuvre.NONE]
        manoeuvre = kinds[int(generator.integers(len(kinds)))]
        target = Target(manoeuvre, disturbance_m_s2, 0.1 * flight_s)
    return Scenario(
        name=f"random-{number}",
        description="",
        sun=sun,
        nominal_range_m=range_m,
        dispersion=dispersion,
        **of_model(model),
        range_sensor=range_sensor,
        thruster=thruster,
        strategy=strategy,
        # Draws contain tie choices only with this noise; `soundness` uses them as additional random
        # numbers.
        noise=NoiseKind.GAME,
        tie=TieRule.RANDOM,
        rate_sensor=rates,
        target=target,
    )
