"""Epochs as text, and conversions of time scales."""

from __future__ import annotations

import math
from datetime import date
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from infoset.experiments.common.ephemeris.epochs import (
    converted,
    is_guess,
    known_scale,
    parse_epoch,
    seconds_in,
    tdb_drift_s,
)

LEAP_KERNEL = """\
KPL/LSK
\\begindata
DELTET/DELTA_T_A = 32.184
DELTET/K = 1.657D-3
DELTET/EB = 1.671D-2
DELTET/M = ( 6.239996 1.99096871D-7 )
DELTET/DELTA_AT = (
10, @1972-JAN-1, 11, @1972-JUL-1, 12, @1973-JAN-1, 13, @1974-JAN-1, 14, @1975-JAN-1,
15, @1976-JAN-1, 16, @1977-JAN-1, 17, @1978-JAN-1, 18, @1979-JAN-1, 19, @1980-JAN-1,
20, @1981-JUL-1, 21, @1982-JUL-1, 22, @1983-JUL-1, 23, @1985-JUL-1, 24, @1988-JAN-1,
25, @1990-JAN-1, 26, @1991-JAN-1, 27, @1992-JUL-1, 28, @1993-JUL-1, 29, @1994-JUL-1,
30, @1996-JAN-1, 31, @1997-JUL-1, 32, @1999-JAN-1, 33, @2006-JAN-1, 34, @2009-JAN-1,
35, @2012-JUL-1, 36, @2015-JUL-1, 37, @2017-JAN-1 )
"""


@pytest.mark.parametrize(
    ("text", "day", "second", "scale"),
    [
        ("2029-03-01T12:00:00.5", date(2029, 3, 1), Fraction(86401, 2), None),
        ("2029-060T12:00:00.5", date(2029, 3, 1), Fraction(86401, 2), None),
        ("2028-366T00:00:00", date(2028, 12, 31), Fraction(0), None),
        ("2029-03-01T00:00:00Z", date(2029, 3, 1), Fraction(0), "UTC"),
        ("2029-03-01T00:00:00 TDB", date(2029, 3, 1), Fraction(0), "TDB"),
        ("2029-03-01T00:00:00 et", date(2029, 3, 1), Fraction(0), "TDB"),
        ("2029-03-01 06:30", date(2029, 3, 1), Fraction(23400), None),
        ("2029-03-01", date(2029, 3, 1), Fraction(0), None),
        ("2016-12-31T23:59:60.25Z", date(2016, 12, 31), Fraction("86400.25"), "UTC"),
        ("2029-03-01T00:00:00.1234567890123", date(2029, 3, 1), Fraction("0.1234567890123"), None),
    ],
)
def test_epoch_is_read_with_all_its_digits(
    text: str, day: date, second: Fraction, scale: str | None
) -> None:
    assert parse_epoch(text) == (day, second, scale)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "tomorrow",
        "2029-13-01T00:00:00",
        "2029-02-30T00:00:00",
        "2029-366T00:00:00",
        "2029-000T00:00:00",
        "0000-001T00:00:00",
        "9998-999T00:00:00",  # beyond the last day that a date can be
        "2029-03-01T24:00:00",
        "2029-03-01T00:60:00",
        "2029-03-01T00:00:61",
        "2029-03-01T23:59:60",  # no leap second on this day
        "2016-12-31T12:59:60",
        "9999-12-31T23:59:60",  # the last day that a date can be
        "2029-03-01T00:00:00 UT1",
        "2029-03-01T00:00:00." + "1" * 31,
        "٢٠٢٩-03-01T00:00:00",  # digits of another script
    ],
)
def test_malformed_epoch_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"epoch|exist|leap second|scale"):
        parse_epoch(text)


@pytest.mark.parametrize("name", ["UT1", "TCB", "TCG", "GMST", "MRT", "SCLK", ""])
def test_scale_with_another_second_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="is not one of UTC, TAI, TT, TDB, GPS"):
        known_scale(name)


def test_second_passes_in_a_leap_second() -> None:
    before, within, after = (
        seconds_in(parse_epoch(text), "UTC")
        for text in ("2016-12-31T23:59:59.5", "2016-12-31T23:59:60.5", "2017-01-01T00:00:00.5")
    )

    assert within - before == after - within == 1


def test_utc_before_leap_seconds_is_refused() -> None:
    with pytest.raises(ValueError, match="before 1972"):
        seconds_in(parse_epoch("1971-12-31T00:00:00"), "UTC")


@pytest.mark.parametrize(
    ("scale", "wanted", "difference"),
    [
        # At 2029: TAI - UTC = 37 s, TT - TAI = 32.184 s, TAI - GPS = 19 s. The seconds of UTC count
        # as TAI.
        ("UTC", "TAI", Fraction(37)),
        ("UTC", "TT", Fraction("69.184")),
        ("GPS", "TAI", Fraction(19)),
        ("TT", "GPS", Fraction("-51.184")),
        ("TAI", "TT", Fraction("32.184")),
    ],
)
def test_scales_with_constant_differences_are_converted_exactly(
    scale: str, wanted: str, difference: Fraction
) -> None:
    epoch = parse_epoch("2029-03-01T00:00:00.123456789")

    assert converted(epoch, scale, wanted) - seconds_in(epoch, "TT") == difference


@pytest.mark.parametrize("year", range(1973, 2050, 3))
def test_tdb_from_utc_equals_spice(year: int, tmp_path: Path) -> None:
    spice: Any = pytest.importorskip(
        "spiceypy", reason="needs the extra trajectory: pip install '.[trajectory]'"
    )
    (tmp_path / "leap.tls").write_text(LEAP_KERNEL)
    text = f"{year}-{1 + year % 12:02}-{1 + year % 28:02}T{year % 24:02}:34:56"

    with spice.KernelPool(str(tmp_path / "leap.tls")):
        wanted = spice.str2et(text)

    # SPICE has seconds from J2000 in double precision: 1.2e-7 s at 1e9 s.
    assert float(converted(parse_epoch(text), "UTC", "TDB")) == pytest.approx(
        wanted, rel=0.0, abs=5e-7
    )


def test_tdb_and_back_is_the_same_time() -> None:
    epoch = parse_epoch("2029-03-01T00:00:00")
    there = converted(epoch, "TT", "TDB")

    back = converted(
        epoch._replace(second=epoch.second + there - seconds_in(epoch, "TT")), "TDB", "TT"
    )

    assert (
        abs(float(back - seconds_in(epoch, "TT"))) < 1e-12
    )  # the argument differs by 2 ms, the rate is 3.3e-10


def test_drift_is_the_variable_part_of_tdb() -> None:
    """TDB - TT is 1.657 ms sin(M + e sin M), M the mean anomaly of the Earth (NAIF, Time Required
    Reading).
    """
    seconds = seconds_in(parse_epoch("2029-03-01T00:00:00"), "TT")
    anomaly = 6.239996 + 1.99096871e-7 * float(seconds)

    assert tdb_drift_s(seconds, "TDB") == 0.0
    assert tdb_drift_s(seconds, "TT") == pytest.approx(
        1.657e-3 * math.sin(anomaly + 1.671e-2 * math.sin(anomaly))
    )
    assert tdb_drift_s(seconds - Fraction("32.184"), "UTC") == tdb_drift_s(seconds, "TT")


@pytest.mark.parametrize(
    ("day", "scale", "wanted", "guess"),
    [
        ("2027-06-29", "UTC", "TDB", True),
        ("2027-06-29", "TT", "UTC", True),
        ("2027-06-29", "UTC", "UTC", False),
        ("2027-06-29", "TAI", "TDB", False),
        ("2027-06-28", "UTC", "TDB", False),
    ],
)
def test_conversion_with_future_leap_seconds_is_a_guess(
    day: str, scale: str, wanted: str, guess: bool
) -> None:
    assert is_guess(parse_epoch(day), scale, wanted) is guess
