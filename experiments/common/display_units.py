"""Units in tables, figures and pages."""

from __future__ import annotations

from experiments.common.units import quantity_and_unit

M_PER_KM = 1e3

Unit = tuple[str, float]
"""Name of the unit, and its number per SI unit."""

S_PER_HOUR, _S_PER_DAY = 3600.0, 86400.0


def time_unit(span_s: float) -> Unit:
    """Return the unit for times up to a span."""
    if span_s > 10.0 * _S_PER_DAY:
        return "days", 1.0 / _S_PER_DAY
    return ("h", 1.0 / S_PER_HOUR) if span_s > 4.0 * S_PER_HOUR else ("s", 1.0)


def length_unit(size_m: float) -> Unit:
    """Return the unit for lengths up to a size."""
    for name, metres, minimum in (("au", 149_597_870_700.0, 7.5e9), ("Mm", 1e6, 2e6), ("km", M_PER_KM, 3e3)):
        if size_m > minimum:
            return name, 1.0 / metres
    return "m", 1.0


_IN_PRINT = str.maketrans({"_": "/", "2": "\N{SUPERSCRIPT TWO}", "3": "\N{SUPERSCRIPT THREE}"})


def split_unit(name: str) -> tuple[str, str]:
    """Return the words and the unit of a key or a column: ``impulse`` and ``m/s`` of ``impulse_m_s``."""
    quantity, unit = quantity_and_unit(name)
    return quantity.replace("_", " "), unit.translate(_IN_PRINT)
