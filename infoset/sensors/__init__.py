"""Sensors with bounded errors of unknown distribution: one class for each kind."""

from infoset.sensors.bearing import (
    AngleSensor,
    BearingSensor,
    Bias,
    Camera,
    OffsetCamera,
    RangeOrRanges,
)
from infoset.sensors.brightness import Brightness
from infoset.sensors.range_and_rate import RangeSensor, RateSensor
from infoset.sensors.sensor import Apart, Cuttable, Geometry, Measurements, Sensor

SENSORS: tuple[type[Sensor], ...] = (BearingSensor, RangeSensor, RateSensor)
"""The measured quantities, in the order of their columns in files."""

__all__ = [
    "SENSORS",
    "AngleSensor",
    "Apart",
    "BearingSensor",
    "Bias",
    "Brightness",
    "Camera",
    "Cuttable",
    "Geometry",
    "Measurements",
    "OffsetCamera",
    "RangeOrRanges",
    "RangeSensor",
    "RateSensor",
    "Sensor",
]
