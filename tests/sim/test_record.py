"""What the record of one engagement keeps."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from infoset import InformationSetView, RangeSensor, RateSensor, Recovery, Sensor
from infoset.arrays import Flags, Floats
from infoset.guidance import LineOfSight, NoiseKind
from infoset.sensors import Apart, Cuttable, Geometry, Measurements
from infoset.sim import Outcome, Scenario, fly_one, lower_bound, simulate
from infoset.sim.scenario import of_model
from tests.guaranteed import guaranteed
from tests.space import in_space


class RangeAlone:
    """Gives no angle, and a range that no hypothesis allows."""

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Any]:
        return {"range": 10.0 * sight.range_m}


def test_record_has_the_measurement_that_empties_the_set(brief: Scenario) -> None:
    model = replace(brief.set_model, recovery=Recovery.NONE)
    ranging = replace(brief, **of_model(model), range_sensor=RangeSensor(model.step_s, 1e-3))
    record = fly_one(ranging, noise=RangeAlone())
    assert record.result.outcomes == (Outcome.SET_EMPTY,)
    assert record.measured["range"][0] == 10.0 * record.true_range_m[0]
    assert record.measures("range").tolist()[:2] == [True, False]
    assert not record.measures("angle").any()


def test_a_record_in_space_has_both_axes(brief: Scenario) -> None:
    record = fly_one(in_space(brief), 2, seed=5)
    results = simulate(in_space(brief), 3, seed=5)
    assert record.result.miss_m[0] == results.miss_m[2]
    assert np.hypot(*record.impulse_m_s.T).sum() == pytest.approx(
        float(results.impulse_m_s[2]), rel=1e-12
    )
    y, z, x = results.position_m[2]
    assert record.true_angle_rad[0].tolist() == [np.arctan2(y, x), np.arctan2(z, x)]
    bound = record.scenario.set_model.angle_sensor.error_bound(record.true_range_m[0])
    assert (np.abs(record.measured["angle"][0] - record.true_angle_rad[0]) <= bound).all()
    assert {section.polygons.shape for section in record.sections[0]} == {(2,)}


@dataclass(frozen=True)
class StreakSensor(Sensor):
    """A kind of sensor that the library does not have: the rate of the line of sight from the
    length of streaks.
    """

    name: ClassVar[str] = "streak"
    quantity: ClassVar[str] = "streak_px"
    stream: ClassVar[int] = 99

    period_s: float
    exposure_s: float
    pixel_rad: float

    def true_value(self, sight: Geometry) -> Floats:
        return sight.omega_rad_s * self.exposure_s / self.pixel_rad

    def bound(self, sight: Geometry) -> float:
        return 0.5

    def cut(self, sets: Cuttable, measured: Measurements, where: Flags) -> None:
        rate_of_a_pixel = self.pixel_rad / self.exposure_s
        sets.measure_rate(measured[self.name] * rate_of_a_pixel, 0.5 * rate_of_a_pixel, where)

    def band(
        self, range_m: Floats, closing_speed_m_s: Floats | float, errors: float = 1.0
    ) -> tuple[bool, Floats]:
        return (
            True,
            errors * 0.5 * self.pixel_rad / self.exposure_s * range_m**2 / closing_speed_m_s,
        )

    def share(self, apart: Apart) -> Floats:
        return RateSensor(self.period_s, 0.5 * self.pixel_rad / self.exposure_s).share(apart)


class WithStreaks(Scenario):
    @property
    def sensors(self) -> dict[str, Sensor]:
        return {**super().sensors, "streak": StreakSensor(2.0 * self.set_model.step_s, 0.1, 2e-7)}


@pytest.mark.parametrize("noise", NoiseKind)
def test_a_new_kind_of_sensor_is_one_class(brief: Scenario, noise: NoiseKind) -> None:
    plain = replace(guaranteed(brief), noise=noise)
    streaks = WithStreaks(**{field.name: getattr(plain, field.name) for field in fields(plain)})
    record = fly_one(streaks)
    assert record.measures("streak")[:4].tolist() == [True, False, True, False]
    assert record.result.truth_kept.all()
    without = fly_one(plain)
    assert record.measured["angle"][0] == without.measured["angle"][0]
    width, wide = (np.nansum(np.diff(flown.predicted_miss_m[1:9])) for flown in (record, without))
    assert width < wide
    assert lower_bound(streaks).bound_m <= lower_bound(plain).bound_m
