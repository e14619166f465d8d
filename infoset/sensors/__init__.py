"""Sensors with bounded errors of unknown distribution: one class for each kind."""

from infoset.sensors.bearing import AngleSensor, BearingSensor, Bias, Camera, RangeOrRanges
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
    "Camera",
    "Cuttable",
    "Geometry",
    "Measurements",
    "RangeOrRanges",
    "RangeSensor",
    "RateSensor",
    "Sensor",
]
