"""What the record of one engagement keeps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from guidance import LineOfSight
from infoset import InformationSetView, RangeSensor, Recovery
from infoset.sensors import SENSORS
from sim import Outcome, Scenario, fly_one
from sim.draws import EXECUTION, START, TARGET, TIE


class RangeAlone:
    """Gives no angle, and a range that no hypothesis allows."""

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Any]:
        return {"range": 10.0 * sight.range_m}


def test_the_measurement_that_empties_the_set_for_good_is_kept(brief: Scenario) -> None:
    model = replace(brief.set_model, recovery=Recovery.NONE)
    ranging = replace(brief, set_model=model, range_sensor=RangeSensor(model.step_s, 1e-3))
    record = fly_one(ranging, noise=RangeAlone())
    first, later = record.steps[0], record.steps[1]
    assert record.result.outcomes == (Outcome.SET_LOST,)
    assert first.measured == {"range": 10.0 * first.true_range_m}
    assert later.measured == {}


def test_each_kind_of_sensor_has_its_own_name_column_and_stream() -> None:
    for key in ("name", "quantity", "stream"):
        assert len({getattr(kind, key) for kind in SENSORS}) == len(SENSORS)
    assert {kind.stream for kind in SENSORS}.isdisjoint({START, TIE, EXECUTION, TARGET})
