"""Epochs as text, and the time scales of orbit ephemeris messages and SPICE kernels.

An epoch becomes an exact number of seconds, so the difference of two epochs keeps all of its
digits.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_right
from datetime import date, timedelta
from fractions import Fraction
from typing import NamedTuple

J2000 = date(2000, 1, 1)
"""Day of the epoch J2000, at noon of which all scales count zero."""
DAY_S = 86_400

LEAP_DAYS = (
    date(1972, 1, 1),
    date(1972, 7, 1),
    date(1973, 1, 1),
    date(1974, 1, 1),
    date(1975, 1, 1),
    date(1976, 1, 1),
    date(1977, 1, 1),
    date(1978, 1, 1),
    date(1979, 1, 1),
    date(1980, 1, 1),
    date(1981, 7, 1),
    date(1982, 7, 1),
    date(1983, 7, 1),
    date(1985, 7, 1),
    date(1988, 1, 1),
    date(1990, 1, 1),
    date(1991, 1, 1),
    date(1992, 7, 1),
    date(1993, 7, 1),
    date(1994, 7, 1),
    date(1996, 1, 1),
    date(1997, 7, 1),
    date(1999, 1, 1),
    date(2006, 1, 1),
    date(2009, 1, 1),
    date(2012, 7, 1),
    date(2015, 7, 1),
    date(2017, 1, 1),
)
"""Days from which TAI - UTC is 10, 11, 12, ... s (IERS Bulletin C)."""
FIRST_OFFSET_S = 10
"""TAI - UTC from the first of these days on, s."""
LAST_OFFSET_S = FIRST_OFFSET_S + len(LEAP_DAYS) - 1
"""TAI - UTC from the last of these days on, s."""
LEAPS_KNOWN_UNTIL = date(2027, 6, 28)
"""Last day for which the IERS says that the table is complete."""

TT_FROM_TAI_S = Fraction("32.184")
"""TT - TAI, s, by the definition of TT (IAU 1991)."""
TAI_FROM_GPS_S = 19
"""TAI - GPS, s: GPS time was equal to UTC on 6 January 1980, when TAI - UTC was 19 s."""
SCALES = ("UTC", "TAI", "TT", "TDB", "GPS")
"""Time scales that are read. UT1, TCB, TCG and clocks of spacecraft have other lengths of the
second.
"""
SAME_SCALE = {"TDT": "TT", "ET": "TDB", "Z": "UTC"}
"""Other names of these scales."""

# TDB - TT as SPICE kernels define it (NAIF, Time Required Reading): K sin(E) with E = M + e sin(M).
# The neglected terms are below 50 microseconds, in which an object at 30 km/s moves by 1.5 m.
_K_S = 1.657e-3
_ECCENTRICITY = 1.671e-2
_ANOMALY_RAD = 6.239996
_ANOMALY_RAD_S = 1.99096871e-7

_EPOCH = re.compile(
    r"(\d{4})-(?:(\d{2})-(\d{2})|(\d{3}))"  # calendar date, or day of the year
    r"(?:[T ](\d{2}):(\d{2})(?::(\d{2}(?:\.\d{0,30})?))?)?"
    r"\s*([A-Za-z]{0,4})",
    flags=re.ASCII,
)


class Epoch(NamedTuple):
    """An epoch as written: its day, the seconds since midnight, and its time scale or None.

    The seconds are less than 86 401: a leap second counts from 86 400 on.
    """

    day: date
    second: Fraction
    scale: str | None


def parse_epoch(text: str) -> Epoch:
    """Return an epoch such as ``2029-03-01T12:00:00.5`` or ``2029-03-01T12:00:00 TDB``.

    The day can be the day of the year, ``2029-060T12:00:00.5Z``.

    A ValueError is raised for other text.
    """
    match = _EPOCH.fullmatch(text.strip())
    if match is None:
        raise ValueError("is not an epoch such as 2029-03-01T12:00:00.5 or 2029-060T12:00:00.5")

    year, month, day_of_month, day_of_year, hour, minute, second, suffix = match.groups()
    day = _day(int(year), month, day_of_month, day_of_year)

    # A part that is not written is 0.
    minutes = 60 * int(hour or 0) + int(minute or 0)
    seconds = Fraction(second or 0)
    if int(hour or 0) > 23 or int(minute or 0) > 59 or seconds >= 61:
        raise ValueError("has an hour, minute or second that does not exist")
    # Second 60 exists only at the end of a day before a leap day; in UTC only, but the scale of an
    # epoch may be written elsewhere.
    # The first of `LEAP_DAYS` only begins the table: no leap second is before it.
    leap_ends = [leap - timedelta(1) for leap in LEAP_DAYS[1:]]
    if seconds >= 60 and (minutes != 60 * 24 - 1 or day not in leap_ends):
        raise ValueError("has a second 60, and there is no leap second at this time")

    scale = None
    if suffix:
        scale = known_scale(suffix)
    return Epoch(day, 60 * minutes + seconds, scale)


def known_scale(name: str) -> str:
    """Return the name of a time scale in `SCALES`; a ValueError is raised for others."""
    scale = SAME_SCALE.get(name.upper(), name.upper())
    if scale not in SCALES:
        raise ValueError(
            f"time scale {name} is not one of {', '.join(SCALES)}; convert the times to one of them"
        )
    return scale


def seconds_in(epoch: Epoch, scale: str) -> Fraction:
    """Return the seconds from J2000 to an epoch of a scale, in a scale without leaps.

    UTC counts as TAI. A ValueError is raised for UTC before 1972, whose seconds had other lengths.
    """
    seconds = (epoch.day - J2000).days * DAY_S - DAY_S // 2 + epoch.second
    if scale != "UTC":
        return seconds
    if epoch.day < LEAP_DAYS[0]:
        raise ValueError("is before 1972, and UTC then had no leap seconds; write it in TAI or TDB")
    # `bisect_right` counts the leap days up to the epoch, of which the first has FIRST_OFFSET_S.
    return seconds + FIRST_OFFSET_S - 1 + bisect_right(LEAP_DAYS, epoch.day)


def converted(epoch: Epoch, scale: str, wanted: str) -> Fraction:
    """Return the seconds from J2000 to an epoch of a scale, as counted in another scale.

    They are counted as by `seconds_in`.
    """
    seconds = seconds_in(epoch, scale)
    if scale == wanted or {scale, wanted} == {"UTC", "TAI"}:
        return seconds
    return _from_tt(_to_tt(seconds, scale), wanted)


def is_guess(epoch: Epoch, scale: str, wanted: str) -> bool:
    """Return whether a conversion from or to UTC uses leap seconds that are not yet known."""
    return (scale == "UTC") != (wanted == "UTC") and epoch.day > LEAPS_KNOWN_UNTIL


def tdb_drift_s(seconds: Fraction, scale: str) -> float:
    """Return TDB - TT at a time of a scale, s: less than 2 ms, and 0 for TDB.

    The other scales differ from TT by a constant; UTC is counted as TAI. Velocities are derivatives
    with respect to TDB, in which orbits around the Sun are computed. The difference changes by up
    to 3.3e-10 s/s: 1e-5 m/s at 30 km/s, or 9 m in ten days.
    """
    if scale == "TDB":
        return 0.0
    return float(_tdb_minus_tt(_to_tt(seconds, scale)))


def _day(year: int, month: str | None, day_of_month: str | None, day_of_year: str | None) -> date:
    """Return the day of a calendar date or of a day of the year."""
    if month is not None and day_of_month is not None:
        try:
            return date(year, int(month), int(day_of_month))
        except ValueError:
            raise ValueError("is a date that does not exist") from None
    number = int(day_of_year or 0)
    # `date` ends with the year 9999, and the day 366 may be in the next year.
    if not 1 <= year <= 9998 or not 1 <= number <= 366:
        raise ValueError("is a date that does not exist")

    day = date(year, 1, 1) + timedelta(number - 1)
    if day.year != year:
        raise ValueError("is a date that does not exist")
    return day


def _to_tt(seconds: Fraction, scale: str) -> Fraction:
    """Return seconds of a scale, as `seconds_in` counts them, in TT: UTC is counted as TAI."""
    if scale == "TT":
        return seconds
    if scale == "TDB":
        # The argument in TDB instead of TT changes the result by less than 1e-12 s.
        return seconds - _tdb_minus_tt(seconds)
    if scale == "GPS":
        return seconds + TAI_FROM_GPS_S + TT_FROM_TAI_S
    return seconds + TT_FROM_TAI_S


def _from_tt(seconds: Fraction, scale: str) -> Fraction:
    """Return seconds of TT in a scale; for UTC those of TAI, as `seconds_in` counts."""
    if scale == "TT":
        return seconds
    if scale == "TDB":
        return seconds + _tdb_minus_tt(seconds)
    if scale == "GPS":
        return seconds - TT_FROM_TAI_S - TAI_FROM_GPS_S
    return seconds - TT_FROM_TAI_S


def _tdb_minus_tt(seconds: Fraction) -> Fraction:
    """Return TDB - TT at a time of TT, s."""
    anomaly = _ANOMALY_RAD + _ANOMALY_RAD_S * float(seconds)
    return Fraction(_K_S * math.sin(anomaly + _ECCENTRICITY * math.sin(anomaly)))
