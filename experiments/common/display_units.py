"""Units of times and lengths in figures and pages."""

from __future__ import annotations

M_PER_KM = 1e3

Unit = tuple[str, float]
"""Name of the unit, and its number per SI unit."""

_S_PER_HOUR, _S_PER_DAY = 3600.0, 86400.0


def time_unit(span_s: float) -> Unit:
    """Return the unit for times up to a span."""
    if span_s > 10.0 * _S_PER_DAY:
        return "days", 1.0 / _S_PER_DAY
    return ("h", 1.0 / _S_PER_HOUR) if span_s > 4.0 * _S_PER_HOUR else ("s", 1.0)


def length_unit(size_m: float) -> Unit:
    """Return the unit for lengths up to a size."""
    for name, metres, least in (("au", 149_597_870_700.0, 7.5e9), ("Mm", 1e6, 2e6), ("km", M_PER_KM, 3e3)):
        if size_m > least:
            return name, 1.0 / metres
    return "m", 1.0
