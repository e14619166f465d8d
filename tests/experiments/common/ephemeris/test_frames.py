"""Reference frames and centres of orbit ephemeris messages."""

from __future__ import annotations

import pytest

from infoset.experiments.common.ephemeris.frames import (
    centre_name,
    frame_of_spice,
    inertial_frame,
    is_same_frame,
)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("EME2000", "J2000"),
        ("eme2000", "EME 2000"),
        ("ICRF", "ICRF3"),
        ("ICRF", "gcrf"),
        ("ICRF2", "GCRF1"),
        ("ECLIPJ2000", "ECLIPTIC_J2000"),
        ("TEME", "TEMEOFDATE"),
        ("TOD", "True of Date"),
        ("tod", "TOD_EARTH"),
    ],
)
def test_synonymous_frame_names_give_equal_frames(one: str, other: str) -> None:
    assert is_same_frame(inertial_frame(one), inertial_frame(other))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("EME2000", "ICRF"),
        ("EME2000", "ECLIPJ2000"),
        ("TOD_EARTH", "TOD_MOON"),
        ("MOD", "TOD"),
        ("B1950", "J2000"),
    ],
)
def test_different_frames_are_unequal(one: str, other: str) -> None:
    assert not is_same_frame(inertial_frame(one), inertial_frame(other))


@pytest.mark.parametrize(
    "name",
    [
        "ITRF",
        "ITRF2000",
        "ITRF-97",
        "ITRF2014",
        "IGS14",
        "DTRF2014",
        "GRC",
        "GTOD",
        "PEF",
        "TIRS",
        "CIRS",
        "TDR",
        "EFG",
        "ECEF",
        "ECF",
        "WGS84",
        "FIXED_EARTH",
        "FIXED_CB",
        "MOON_ME",
        "MOON_PA440",
        "IAU_EARTH",
        "IAU_MARS",
        "RTN",
        "RSW",
        "TNW",
        "ICRF-ROT",
        "EME2000X",
        "",
    ],
)
def test_rotating_and_unknown_frames_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="is not a known inertial frame, it may rotate; convert"):
        inertial_frame(name)


@pytest.mark.parametrize("name", ["TOD", "TOD_EARTH", "MOD", "TEME", "TRUE_OF_DATE"])
def test_frame_of_date_is_marked_unless_it_has_an_epoch(name: str) -> None:
    assert inertial_frame(name).is_of_date
    assert not inertial_frame(name, "2029-03-01T00:00:00").is_of_date


def test_frame_of_epoch_needs_its_epoch() -> None:
    with pytest.raises(ValueError, match="REF_FRAME_EPOCH is missing"):
        inertial_frame("TEMEOFEPOCH")
    assert inertial_frame("TOE", "2029-03-01") != inertial_frame("TOE", "2029-03-02")


@pytest.mark.parametrize("name", ["EME2000", "ICRF", "GCRF"])
def test_j2000_of_spice_is_both_eme2000_and_icrf(name: str) -> None:
    assert is_same_frame(frame_of_spice("j2000"), inertial_frame(name))
    assert not is_same_frame(frame_of_spice("ECLIPJ2000"), inertial_frame(name))


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("Sun", "SUN"),
        ("10", "SUN"),
        ("SSB", "Solar_System_Barycenter"),
        ("399", "earth"),
        ("EMB", "Earth Barycenter"),
    ],
)
def test_synonymous_centre_names_give_one_name(one: str, other: str) -> None:
    assert centre_name(one) == centre_name(other)


def test_barycentre_and_body_have_different_names() -> None:
    assert centre_name("MARS BARYCENTER") != centre_name("MARS")
    assert centre_name("SSB") != centre_name("SUN")
