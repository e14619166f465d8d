"""Units in tables, figures and pages."""

from __future__ import annotations

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


_UNITS = {
    "km3_s2": "km\N{SUPERSCRIPT THREE}/s\N{SUPERSCRIPT TWO}",
    "m_s2": "m/s\N{SUPERSCRIPT TWO}",
    "km_s": "km/s",
    "m_s": "m/s",
    "rad_s": "rad/s",
    **{unit: unit for unit in ("rad", "deg", "km", "kg", "m", "s", "N")},
}


def split_unit(name: str) -> tuple[str, str]:
    """Return the words and the unit of a key or a column: ``impulse`` and ``m/s`` of ``impulse_m_s``."""
    for end, unit in _UNITS.items():
        if name.endswith(f"_{end}"):
            return name.removesuffix(f"_{end}").replace("_", " "), unit
    return name.replace("_", " "), ""
