"""The kind of sensor that a test changes."""

from __future__ import annotations

from infoset import AngleSensor
from infoset.sensors import BearingSensor


def linear(sensor: BearingSensor | None) -> AngleSensor:
    """Return a sensor of angles that has a linear error bound."""
    assert isinstance(sensor, AngleSensor)
    return sensor
