"""Random numbers of a batch of runs. Each run has its own streams, independent of the batch."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.guidance import NoiseKind, TieRule
from infoset.guidance.gaussian_noise import correlated_uniform
from infoset.sensors import Camera, RangeSensor, Sensor
from infoset.sim.covariance import Covariance
from infoset.sim.gravity import max_impulses_m_s, with_gravity
from infoset.sim.scenario import Scenario, corners
from infoset.sim.wrong_images import WrongMeasurements, draw_wrong_measurements

START, TIE, EXECUTION, TARGET, POINTING, BIAS, IMAGES = 0, 3, 5, 6, 7, 8, 9
MISALIGNMENT, WRONG_IMAGES, WRONG_RANGES, DRIFT, AXIS_ANGLE = 10, 11, 12, 13, 14
"""Streams of a run; each kind of sensor has a separate one (`Sensor.stream`). Their numbers are
never changed or used again: runs of a seed would change.
"""
Y = 16
"""Offset of the streams of the y axis, greater than all streams of the z axis. In a plane the
streams of the z axis are used.
"""
MIN_SLOWDOWN = 1.01
"""Minimum factor of the time of a flight at the lowest closing speed. Chosen; a flight ends at its
arrival, so results do not depend on it: misses have the same bits from 1.001 to 2 (measured).
"""
MAX_SPEED_CHANGE = 0.75
"""Maximum share of the closing speed that gravity can take away in the time of a flight. Chosen; it
limits the memory of the random numbers to four times the memory in free space. The misses of
dart-2022 and comet-fast have the same bits from 0.2 to 0.9 (measured).
"""


@dataclass(frozen=True)
class Draws:
    """Random numbers of a batch of B engagements.

    Parameters
    ----------
    position_m, velocity_m_s : ndarray, shape (B, C + 1)
        True relative (z, x) and (V_z, V_x) at t = 0; in space (y, z, x) and (V_y, V_z, V_x).
    errors : mapping of str to ndarray, shape (C, B, steps), for ranges (B, steps)
        Measurement errors by sensor, in [-1, 1], in units of their bounds.
    tie : ndarray, shape (C, B, steps)
        Choices between ties, uniform in [-1, 1]; zeros if the scenario does not choose at random.
    execution, pointing : ndarray, shape (B, steps), or None
        Errors of the impulses and of their directions in units of their bounds, uniform in [-1, 1];
        None is zero.
    target : ndarray, shape (C, B, steps), or None
        Changes of side of the target, uniform in [-1, 1]; None is zero.
    bias : ndarray, shape (C, B), or None
        Constant errors of the centroid of a camera in units of their bound; None for a camera with
        random errors.
    misalignment : ndarray, shape (C, B), or None
        Constant shifts of the slopes that a camera sees; None is zero.
    drift : ndarray, shape (C, B, steps), or None
        Errors of the drift of a camera's attitude in units of their bound, uniform in [-1, 1] and
        correlated in time; None is zero.
    images : ndarray, shape (B, steps), or None
        Uniform in [0, 1); an image is lost if its number is less than the probability of a loss.
        None loses no image.
    wrong : ndarray, shape (C, B, steps), or None
        Errors of wrong images in units of their bounds, zero for other images; None has no wrong
        image.
    wrong_by_noise : ndarray of bool, shape (B, steps), or None
        Other images that are wrong: the measurement noise of the batch makes these errors.
    wrong_ranges : ndarray, shape (B, steps), or None
        Errors of wrong ranges in units of their bounds, zero for other ranges; None has no wrong
        range.
    redraws : ndarray of int, shape (B,), or None
        Normal starts outside the dispersion that were drawn again; None for uniform starts.
    axis_angle_rad : ndarray, shape (B,), or None
        Directions of the ellipse of the body, rad, uniform in [0, pi); None if the direction is
        known, or the body is no ellipse.
    """

    position_m: Floats
    velocity_m_s: Floats
    errors: Mapping[str, Floats]
    tie: Floats
    execution: Floats | None = None
    target: Floats | None = None
    pointing: Floats | None = None
    bias: Floats | None = None
    misalignment: Floats | None = None
    drift: Floats | None = None
    images: Floats | None = None
    wrong: Floats | None = None
    wrong_by_noise: Flags | None = None
    wrong_ranges: Floats | None = None
    redraws: Integers | None = None
    axis_angle_rad: Floats | None = None

    @property
    def steps(self) -> int:
        """Number of steps for which numbers are drawn."""
        return int(self.tie.shape[-1])

    @property
    def is_wrong(self) -> Flags | None:
        """Whether each image is wrong, shape (B, steps); None if none is."""
        if self.wrong is None:
            return self.wrong_by_noise
        return np.asarray((self.wrong != 0.0).any(axis=0))


class Starts(NamedTuple):
    """Initial states of runs, as in `Draws`."""

    position_m: Floats
    velocity_m_s: Floats
    redraws: Integers | None


def draw(scenario: Scenario, runs: Sequence[int], seed: int) -> Draws:
    """Return the random numbers of some runs.

    In a scenario they depend on the seed and the run only, not on the other runs.
    """
    steps = max_number_of_steps(scenario)
    axes = scenario.set_model.axes
    starts = draw_starts(scenario, runs, seed)

    def uniform(stream: int, size: int = steps) -> Floats:
        return np.stack(
            [generator(seed, run, stream).uniform(-1.0, 1.0, size=size) for run in runs]
        )

    def lateral(stream: int, size: int = steps) -> Floats:
        return np.stack([uniform(stream + Y * (axis == "y"), size) for axis in axes])

    # Numbers that a scenario does not use are not drawn: they take time and memory.
    errors = {}
    for name, sensor in scenario.sensors.items():
        drawn = lateral if sensor.is_lateral else uniform
        errors[name] = drawn(sensor.stream)
    tie = np.broadcast_to(0.0, (len(axes), len(runs), steps))
    if scenario.noise is NoiseKind.GAME and scenario.tie is TieRule.RANDOM:
        tie = lateral(TIE)
    thruster = scenario.engine
    camera = scenario.bearing_sensor
    turned = None
    if camera.misalignment_rad > 0.0:
        turned = camera.misalignment_rad * lateral(MISALIGNMENT, 1)[..., 0]
    drift = None
    if isinstance(camera, Camera) and camera.drift_rad > 0.0:
        correlation = math.exp(-scenario.set_model.step_s / scenario.drift_time_s)
        drift = correlated_uniform(lateral(DRIFT), correlation)
    images = None
    if camera.miss_probability > 0.0:
        images = np.stack([generator(seed, run, IMAGES).uniform(size=steps) for run in runs])
    return Draws(
        starts.position_m,
        starts.velocity_m_s,
        errors,
        tie=tie,
        execution=uniform(EXECUTION) if thruster.execution_error_relative > 0.0 else None,
        target=lateral(TARGET) if scenario.target is not None else None,
        pointing=uniform(POINTING) if thruster.pointing_error_rad > 0.0 else None,
        bias=lateral(BIAS, 1)[..., 0] if camera.has_constant_bias else None,
        misalignment=turned,
        drift=drift,
        images=images,
        wrong=_wrong_images(scenario, runs, seed, steps),
        wrong_ranges=_wrong_ranges(scenario, runs, seed, steps),
        redraws=starts.redraws,
        axis_angle_rad=_axis_angles(scenario, runs, seed),
    )


def _axis_angles(scenario: Scenario, runs: Sequence[int], seed: int) -> Floats | None:
    """Return the directions of the ellipse of the body, shape (B,); None if it is known."""
    if scenario.body is None or not scenario.body.is_turned_by_chance:
        return None
    return np.array([generator(seed, run, AXIS_ANGLE).uniform(0.0, np.pi) for run in runs])


def _wrong_images(scenario: Scenario, runs: Sequence[int], seed: int, steps: int) -> Floats | None:
    """Return the errors of wrong images, shape (C, B, steps); None without any."""
    wrong = scenario.wrong_images
    if wrong is None or wrong.number == 0:
        return None
    before_s = _before_arrival_s(scenario, scenario.bearing_sensor, steps)
    axes = len(scenario.set_model.axes)
    return _wrong_measurements(wrong, before_s, axes, runs, seed, WRONG_IMAGES)


def _wrong_ranges(scenario: Scenario, runs: Sequence[int], seed: int, steps: int) -> Floats | None:
    """Return the errors of wrong ranges, shape (B, steps); None without any."""
    wrong = scenario.wrong_ranges
    sensor = scenario.sensors.get(RangeSensor.name)
    if wrong is None or wrong.number == 0 or sensor is None:
        return None
    before_s = _before_arrival_s(scenario, sensor, steps)
    return np.asarray(_wrong_measurements(wrong, before_s, 1, runs, seed, WRONG_RANGES)[0])


def _before_arrival_s(scenario: Scenario, sensor: Sensor, steps: int) -> Floats:
    """Return the time of each step before the nominal arrival, s; NaN where a sensor does not
    measure.
    """
    model = scenario.set_model
    every = model.steps_in(sensor.period_s)
    before_s: Floats = scenario.nominal_arrival_s - model.step_s * np.arange(float(steps))
    for step, before in enumerate(before_s.tolist()):
        if step % every != 0 or not sensor.measures_at(before):
            before_s[step] = np.nan
    return before_s


def _wrong_measurements(
    wrong: WrongMeasurements,
    before_s: Floats,
    axes: int,
    runs: Sequence[int],
    seed: int,
    stream: int,
) -> Floats:
    """Return the errors of the wrong measurements of some runs, shape (axes, B, steps)."""
    return np.stack(
        [
            draw_wrong_measurements(wrong, before_s, axes, generator(seed, run, stream))
            for run in runs
        ],
        axis=1,
    )


def draw_starts(scenario: Scenario, runs: Sequence[int], seed: int) -> Starts:
    """Return the initial states of some runs.

    They are uniform in the dispersion; with a covariance they are normal and within it.
    """
    lower, upper = corners(scenario.dispersion)
    redraws = None
    if scenario.covariance is None:
        # (z, x, V_z, V_x). In space y is inserted before z, and V_y before V_z.
        uniform = np.stack([generator(seed, run, START).uniform(size=4) for run in runs])
        if scenario.is_spatial:
            along_y = np.stack([generator(seed, run, START + Y).uniform(size=2) for run in runs])
            uniform = np.insert(uniform, [0, 2], along_y, axis=1)
        starts = lower + (upper - lower) * uniform
    else:
        drawn = [
            _normal_start(lower, upper, scenario.covariance, generator(seed, run, START))
            for run in runs
        ]
        starts = np.stack([start for start, _ in drawn])
        redraws = np.array([count for _, count in drawn])
    position_m, velocity_m_s = np.split(starts, 2, axis=1)
    return Starts(position_m, velocity_m_s, redraws)


def _normal_start(
    lower: Floats, upper: Floats, covariance: Covariance, random: np.random.Generator
) -> tuple[Floats, int]:
    """Return a normal start around the middle of a box, and how many starts before it were outside.

    A start outside the box is drawn again.
    """
    redraws = 0
    while True:
        normal = random.standard_normal(covariance.size)
        start = 0.5 * (lower + upper) + (covariance.root * normal).sum(axis=1)
        if ((lower <= start) & (start <= upper)).all():
            return start, redraws
        redraws += 1


def generator(seed: int, run: int, stream: int) -> np.random.Generator:
    """Return the random generator of one stream of one run."""
    return np.random.Generator(
        np.random.PCG64(np.random.SeedSequence(entropy=seed, spawn_key=(run, stream)))
    )


def max_number_of_steps(scenario: Scenario) -> int:
    """Return a number of steps after which every start has passed its closest approach.

    The time at the lowest closing speed is increased by the share of this speed that gravity can
    take away, at least by 1 %. Two steps are added for flights of few steps, whose 1 % is less than
    a step. If gravity can take away more than `MAX_SPEED_CHANGE`, a flight may end before its
    closest approach.
    """
    box = scenario.dispersion
    slowest = -box.vx_m_s[1]  # V_x is negative
    model = scenario.set_model
    model = with_gravity(model, scenario.sun, max_impulses_m_s(model, scenario.engine))
    speed_change = min(model.gravity_speed_change, MAX_SPEED_CHANGE)
    longer = max(MIN_SLOWDOWN, 1.0 / (1.0 - speed_change))
    return math.ceil(longer * box.x_m[1] / (slowest * model.step_s)) + 2
