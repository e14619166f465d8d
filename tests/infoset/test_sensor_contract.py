"""A sensor without the methods of which the lower bound is proved cannot be made."""

from __future__ import annotations

from typing import Any

import pytest

from infoset import RateSensor, Sensor
from infoset.sensors import SENSORS


def rate_sensor_without(name: str) -> type[Sensor]:
    """A sensor of the rate of the line of sight that has all methods of the contract but one."""
    methods: dict[str, Any] = {
        method: getattr(RateSensor, method)
        for method in ("true_value", "bound", "cut", "band", "share")
    }
    del methods[name]
    return type("Forgetful", (Sensor,), methods)


@pytest.mark.parametrize("name", ["true_value", "bound", "cut", "band", "share"])
def test_sensor_without_a_method_of_the_contract_is_refused(name: str) -> None:
    with pytest.raises(TypeError, match=rf"abstract class Forgetful .*{name}"):
        rate_sensor_without(name)()


@pytest.mark.parametrize("kind", SENSORS)
def test_each_kind_of_the_library_defines_its_share(kind: type[Sensor]) -> None:
    assert kind.share is not Sensor.share
    assert kind.band is not Sensor.band
