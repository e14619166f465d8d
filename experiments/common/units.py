"""Units at the ends of names, and units in tables and figures.

The name ``range_km`` is the quantity ``range`` in kilometres.
"""

from __future__ import annotations

from decimal import Decimal

_DEGREE = Decimal("0.017453292519943295769236907684886127134428718885417")
"""π/180 to 50 digits; `si_factor` rounds it to 28 digits, the precision of Python's decimals."""

UNITS = {
    "m": ("length", Decimal(1)),
    "km": ("length", Decimal(1000)),
    "au": ("length", Decimal(149_597_870_700)),
    "m2": ("covariance", Decimal(1)),
    "km2": ("covariance", Decimal(10) ** 6),
    "s": ("time", Decimal(1)),
    "min": ("time", Decimal(60)),
    "h": ("time", Decimal(3600)),
    "d": ("time", Decimal(86400)),
    "rad": ("angle", Decimal(1)),
    "mrad": ("angle", Decimal("1e-3")),
    "urad": ("angle", Decimal("1e-6")),
    "deg": ("angle", _DEGREE),
    "arcsec": ("angle", _DEGREE / 3600),
    "m_s": ("speed", Decimal(1)),
    "km_s": ("speed", Decimal(1000)),
    "m_s2": ("acceleration", Decimal(1)),
    "km_s2": ("acceleration", Decimal(1000)),
    "rad_s": ("angular rate", Decimal(1)),
    "deg_s": ("angular rate", _DEGREE),
    "m3_s2": ("gravitational parameter", Decimal(1)),
    "km3_s2": ("gravitational parameter", Decimal(10) ** 9),
    "kg": ("mass", Decimal(1)),
    "N": ("force", Decimal(1)),
}
"""Dimension and number of SI units of each unit that a name can end with."""


def quantity_and_unit(name: str) -> tuple[str, str]:
    """Return the quantity and the unit of a name, for example `max_impulse` and `m_s`.

    The unit is empty if the name has none.
    """
    parts = name.split("_")
    for first in range(1, len(parts)):
        unit = "_".join(parts[first:])
        if unit in UNITS:
            return "_".join(parts[:first]), unit
    return name, ""


def units_like(name: str) -> list[str]:
    """Return the units that the quantity of a name can have, the SI unit first.

    There are none if the name has no unit.
    """
    unit = quantity_and_unit(name)[1]
    if not unit:
        return []
    return [other for other, (quantity, _) in UNITS.items() if quantity == UNITS[unit][0]]


def si_factor(name: str, si_name: str) -> Decimal | None:
    """Return the factor from a name's unit to the unit of another name.

    It is 1 for equal names, also without units. None if the quantities differ, or a name has no
    unit, or the units have different dimensions.
    """
    if name == si_name:
        return Decimal(1)
    quantity, unit = quantity_and_unit(name)
    wanted, si_unit = quantity_and_unit(si_name)
    if quantity != wanted or not unit or not si_unit or UNITS[unit][0] != UNITS[si_unit][0]:
        return None
    return UNITS[unit][1] / UNITS[si_unit][1]


M_PER_KM = 1e3

Unit = tuple[str, float]
"""Name of the unit, and its number per SI unit."""

SECONDS = {name: float(size) for name, (quantity, size) in UNITS.items() if quantity == "time"}
"""Length of the units of time, s."""
S_PER_HOUR = SECONDS["h"]


def time_unit(span_s: float) -> Unit:
    """Return the unit for times up to a span; the limits are chosen: numbers have few digits."""
    if span_s > 10.0 * SECONDS["d"]:
        return "days", 1.0 / SECONDS["d"]
    if span_s > 4.0 * S_PER_HOUR:
        return "h", 1.0 / S_PER_HOUR
    return "s", 1.0


def duration_text(seconds: float) -> str:
    """Return a time as text, for example ``2.5 min`` or ``100 s``.

    The unit is the largest one of which the time has exactly one or at least two.
    """
    name = "s"
    for each, unit in SECONDS.items():
        if seconds == unit or seconds >= 2.0 * unit:
            name = each
    return f"{seconds / SECONDS[name]:.3g} {name}"


def length_text(length_m: float) -> str:
    """Return a length with four digits in the unit of its size: ``37.17 m``, ``25.1 km``."""
    name, per_metre = length_unit(length_m)
    return f"{length_m * per_metre:.4g} {name}"


def length_unit(size_m: float) -> Unit:
    """Return the unit for lengths up to a size.

    A larger unit is taken from a few of it on (3 km, 2 Mm, 0.05 au); chosen: numbers have few
    digits before and after the point.
    """
    for name, metres, minimum in (
        ("au", float(UNITS["au"][1]), 7.5e9),
        ("Mm", 1e6, 2e6),
        ("km", M_PER_KM, 3e3),
    ):
        if size_m > minimum:
            return name, 1.0 / metres
    return "m", 1.0


_IN_PRINT = str.maketrans({"_": "/", "2": "\N{SUPERSCRIPT TWO}", "3": "\N{SUPERSCRIPT THREE}"})


def split_unit(name: str) -> tuple[str, str]:
    """Return the words and the unit of a key or a column.

    For example ``impulse`` and ``m/s`` of ``impulse_m_s``.
    """
    quantity, unit = quantity_and_unit(name)
    return quantity.replace("_", " "), unit.translate(_IN_PRINT)
