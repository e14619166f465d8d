"""Units at the ends of names: ``range_km`` is the quantity ``range`` in kilometres."""

from __future__ import annotations

from decimal import Decimal

_DEGREE = Decimal("0.017453292519943295769236907684886127134428718885417")

UNITS = {
    "m": ("length", Decimal(1)),
    "km": ("length", Decimal(1000)),
    "au": ("length", Decimal(149_597_870_700)),
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
    """Return the quantity and the unit of a name; the unit is empty if the name has none.

    >>> quantity_and_unit("max_impulse_m_s")
    ('max_impulse', 'm_s')
    """
    parts = name.split("_")
    for first in range(1, len(parts)):
        unit = "_".join(parts[first:])
        if unit in UNITS:
            return "_".join(parts[:first]), unit
    return name, ""


def si_factor(name: str, si_name: str) -> Decimal | None:
    """Return the factor from a name's unit to that of another name; None unless both are the same quantity.

    >>> si_factor("range_km", "range_m")
    Decimal('1000')
    """
    if name == si_name:
        return Decimal(1)
    (quantity, unit), (wanted, si_unit) = quantity_and_unit(name), quantity_and_unit(si_name)
    if quantity != wanted or not unit or not si_unit or UNITS[unit][0] != UNITS[si_unit][0]:
        return None
    return UNITS[unit][1] / UNITS[si_unit][1]
