"""The sensors of a batch: which of them measure in a step, and in which engagements."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats, some
from infoset.guidance import GameNoise, LineOfSight, MeasurementNoise
from infoset.guidance.noise import checked_measurements
from infoset.information_set import InformationSetView
from infoset.sensors import BearingSensor, Measurements, RangeSensor, Sensor
from infoset.sim.draws import Draws
from infoset.sim.impulse_queue import Pending
from infoset.sim.kepler import Sight
from infoset.sim.scenario import Scenario
from infoset.sim.wrong_images import wrong_angles, wrong_ranges


class Cut(NamedTuple):
    """Measured values by sensor, and the engagements in which they cut the set."""

    values: Measurements
    where: Flags


class StepMeasurements(NamedTuple):
    """Measurements of one step.

    Parameters
    ----------
    sensors : dict of str to Sensor
        Sensors that are due, in the order in which they cut the set.
    cuts : tuple of Cut
        Values and engagements: one cut for all that track, or, if images can be lost, one where the
        image was taken and, with other sensors due, one where it was lost.
    values : mapping of str to ndarray
        Values of the sensors that measured in at least one engagement.
    """

    sensors: dict[str, Sensor]
    cuts: tuple[Cut, ...]
    values: Measurements


NOTHING = StepMeasurements({}, (), {})
"""Measurements of a step without any."""


class Instruments:
    """The sensors of B engagements, with the noise of their measurements.

    Attributes
    ----------
    sensors : dict of str to Sensor
        Sensors on board by name.
    latest : mapping of str to ndarray
        Last values measured by each sensor. A sensor is missing before its first measurement; the
        angle is NaN in engagements that have lost all images so far.
    seen : mapping of str to ndarray of bool
        Engagements in which each sensor measured in this step. Empty if no image can be lost in the
        step: then all sensors that are due measured in all.
    """

    def __init__(self, scenario: Scenario, draws: Draws, noise: MeasurementNoise) -> None:
        model = scenario.set_model
        self.sensors = scenario.sensors
        self.latest: dict[str, Floats] = {}
        self.seen: dict[str, Flags] = {}
        self._noise = noise
        self._draws = draws
        self._arrival_s = scenario.nominal_arrival_s
        self._step_s = model.step_s
        self._image_loss = model.angle_sensor.miss_probability
        self._period_steps = {
            name: model.steps_in(sensor.period_s) for name, sensor in self.sensors.items()
        }

    @property
    def noise_side(self) -> Floats | None:
        """Side to which game noise shifts the true state, 0 for no shift; None for other noises."""
        return self._noise.truth_side if isinstance(self._noise, GameNoise) else None

    def measure(
        self,
        step: int,
        sight: Sight,
        pending: Pending,
        tracking: Flags,
        information: InformationSetView,
    ) -> StepMeasurements:
        """Measure with the sensors that are due, and update `latest` and `seen`.

        Nothing is measured, and the noise is not called, if no engagement tracks.
        """
        self.seen = {}
        due = self._due(step)
        if not due or not some(tracking):
            return NOTHING

        errors = self._draws.errors
        asked = LineOfSight(
            step,
            sight.alpha_rad,
            sight.omega_rad_s,
            sight.range_m,
            due,
            pending,
            step * self._step_s,
            {name: errors[name][..., step] for name in due if name in errors},
            sight.along_x_m,
        )
        values = self._noise.measure(asked, information)
        measured = checked_measurements(values, asked, self._noise)
        wrong = self._draws.wrong
        camera = BearingSensor.name
        if wrong is not None and camera in measured:
            angles = wrong_angles(due[camera], asked, measured[camera], wrong[..., step])
            measured[camera] = angles
        of_ranges = self._draws.wrong_ranges
        ranges = RangeSensor.name
        if of_ranges is not None and ranges in measured:
            measured[ranges] = wrong_ranges(
                due[ranges], asked, measured[ranges], of_ranges[:, step]
            )
        if self._draws.images is not None and BearingSensor.name in measured:
            seen = self._draws.images[:, step] >= self._image_loss
            return self._with_lost_images(due, measured, seen, tracking)

        self.latest = self.latest | measured
        return StepMeasurements(due, (Cut(measured, tracking),), measured)

    def _due(self, step: int) -> dict[str, Sensor]:
        """Return the sensors that measure in a step."""
        before_s = self._arrival_s - step * self._step_s
        return {
            name: sensor
            for name, sensor in self.sensors.items()
            if step % self._period_steps[name] == 0 and sensor.measures_at(before_s)
        }

    def _with_lost_images(
        self, due: dict[str, Sensor], measured: Measurements, seen: Flags, tracking: Flags
    ) -> StepMeasurements:
        """Return the measurements of a step with an image in the engagements `seen` only.

        Where the image is lost, the set is cut by the other measurements.
        """
        camera = BearingSensor.name
        others = {name: values for name, values in measured.items() if name != camera}
        self.seen = {name: seen if name == camera else np.ones_like(seen) for name in measured}
        last_angle = self.latest.get(camera, np.nan)
        angle = np.where(seen, measured[camera], last_angle)
        self.latest = self.latest | others | {camera: angle}

        with_image = Cut(measured, tracking & seen)
        cuts = (with_image, Cut(others, tracking & ~seen)) if others else (with_image,)
        values = measured if with_image.where.any() else others
        return StepMeasurements(due, cuts, values)
