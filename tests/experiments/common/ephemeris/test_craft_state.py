"""States at an epoch from orbit ephemeris messages: segments, time scales, frames, covariances and
warnings.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.experiments.common.ephemeris.craft_state import (
    CraftState,
    axes_note,
    epoch_scale,
    need_same_axes,
    oem_craft,
    time_notes,
)
from infoset.experiments.common.ephemeris.epochs import Epoch, parse_epoch
from infoset.experiments.common.ephemeris.frames import Frame
from infoset.experiments.common.ephemeris.oem import OemSegment, read_oem
from infoset.experiments.common.errors import InputError
from tests.oem_text import HEADER, covariance_block, segment

SUN_M3_S2 = 1.32712440018e20
RADIUS_M = 1.5e11
RATE = float(np.sqrt(SUN_M3_S2 / RADIUS_M**3))
EPOCH = parse_epoch("2029-03-01T06:00:00")


def circle(times_s: Sequence[float]) -> Floats:
    """A circular orbit around the Sun, m and m/s, at times from 2029-03-01."""
    angles = RATE * np.array(times_s, dtype=float)
    none = np.zeros_like(angles)
    places = RADIUS_M * np.stack([np.cos(angles), np.sin(angles), none], axis=1)
    speeds = RATE * RADIUS_M * np.stack([-np.sin(angles), np.cos(angles), none], axis=1)
    return np.stack([places, speeds], axis=1)


HOURS = range(-12, 13)
"""Hours of the states from 2029-03-01."""


def hourly(
    hours: Sequence[int] = HOURS, states: Any = None, covariance: str = "", **metadata: str
) -> str:
    epochs = [f"2029-{59 + (hour + 24) // 24:03}T{hour % 24:02}:00:00" for hour in hours]
    if states is None:
        states = circle([3600.0 * hour for hour in hours])
    return segment(epochs, states, covariance, **metadata)


def read(*segments: str) -> list[OemSegment]:
    return read_oem((HEADER + "".join(segments)).encode(), "a.oem")


def found(
    *segments: str, epoch: Epoch = EPOCH, scale: str = "TDB", with_covariance: bool = True
) -> CraftState:
    return oem_craft(
        read(*segments), "a.oem", epoch, scale, SUN_M3_S2, with_covariance=with_covariance
    )


def test_interpolated_state_is_on_the_orbit() -> None:
    craft = found(hourly(), epoch=parse_epoch("2029-03-01T05:40:00"))

    np.testing.assert_allclose(
        craft.state[0], circle([20400.0])[0, 0], rtol=0.0, atol=1e-3
    )  # roundings of 3e-5 m
    np.testing.assert_allclose(craft.state[1], circle([20400.0])[0, 1], rtol=0.0, atol=1e-6)
    assert craft.origin.startswith("segment 1 of a.oem, HERMITE of degree 7, estimated errors ")
    assert (craft.notes, craft.warnings, craft.covariance) == ((), (), None)


@pytest.mark.parametrize(
    ("scale", "seconds"), [("UTC", 69.184), ("TAI", 32.184), ("TT", 0.0), ("GPS", 51.184)], ids=str
)
def test_epoch_is_converted_to_the_scale_of_the_segment(scale: str, seconds: float) -> None:
    """An epoch in another scale is 32 to 69 s away: up to 2000 km at the speed of the Earth."""
    craft = found(hourly(), scale=scale)

    # TDB - TT is at most 1.7 ms, or 50 m.
    np.testing.assert_allclose(
        craft.state[0], circle([21600.0 + seconds])[0, 0], rtol=0.0, atol=51.0
    )


def test_table_in_utc_has_the_state_of_the_table_in_tdb() -> None:
    """An instant in both scales, with 37 s of leap seconds; velocities are derivatives with respect
    to TDB.
    """
    utc = hourly(states=circle([3600.0 * hour + 69.184 for hour in HOURS]), TIME_SYSTEM="UTC")

    one = found(hourly())
    other = found(utc)

    np.testing.assert_allclose(other.state[0], one.state[0], rtol=0.0, atol=51.0)
    np.testing.assert_allclose(other.state[1], one.state[1], rtol=0.0, atol=1e-5)


def test_later_of_two_segments_that_meet_is_used() -> None:
    turned = np.stack(
        [circle([3600.0 * hour for hour in range(6, 13)])[:, 0], np.ones((7, 3))], axis=1
    )

    craft = found(hourly(range(-12, 7)), hourly(range(6, 13), turned))

    np.testing.assert_array_equal(craft.state[1], np.ones(3))
    assert craft.origin.startswith("segment 2")


def test_interpolation_uses_only_the_segment_of_the_epoch() -> None:
    wrong = circle([3600.0 * hour for hour in range(7, 13)]) * 2.0

    craft = found(
        hourly(range(-12, 8)), hourly(range(7, 13), wrong), epoch=parse_epoch("2029-03-01T06:30:00")
    )

    np.testing.assert_allclose(craft.state[0], circle([23400.0])[0, 0], rtol=0.0, atol=1e-2)
    assert craft.warnings == ()


def test_two_segments_that_overlap_are_refused() -> None:
    with pytest.raises(InputError, match=r"a.oem: segments 1 and 2 both hold the epoch"):
        found(hourly(), hourly())


@pytest.mark.parametrize(
    "metadata",
    [{}, {"USEABLE_STOP_TIME": "2029-03-01T05:00:00"}, {"START_TIME": "2029-03-01T07:00:00"}],
    ids=["states", "usable span", "span"],
)
def test_epoch_outside_the_segments_is_refused_with_their_span(metadata: dict[str, str]) -> None:
    epoch = EPOCH if metadata else parse_epoch("2029-03-02T00:00:00")

    with pytest.raises(
        InputError, match=r"a.oem: no segment holds the epoch: .* from 2029-.* to 2029-.* TDB; take"
    ):
        found(hourly(HOURS, None, **metadata), epoch=epoch)


@pytest.mark.parametrize(
    "metadata", [{"REF_FRAME": "ITRF2000"}, {"REF_FRAME": "GTOD"}, {"REF_FRAME": "IAU_EARTH"}]
)
def test_only_the_frame_of_the_segment_of_the_epoch_counts(metadata: dict[str, str]) -> None:
    good = hourly(range(-12, 8))
    other = hourly(range(8, 13), None, **metadata)
    assert found(good, other).frame == Frame("EME2000")

    with pytest.raises(
        InputError, match=r"a.oem: segment 2: REF_FRAME \w+ is not a known inertial frame"
    ):
        found(good, other, epoch=parse_epoch("2029-03-01T09:00:00"))


def test_frame_of_date_and_barycentre_are_warnings() -> None:
    (of_date,) = found(hourly(REF_FRAME="TOD")).warnings
    (barycentre,) = found(hourly(CENTER_NAME="SSB")).warnings

    assert "the frame TOD is of date" in of_date
    assert "the centre is the SOLAR SYSTEM BARYCENTER" in barycentre


def test_few_states_are_noted() -> None:
    (note,) = found(hourly(range(4, 8)), epoch=parse_epoch("2029-03-01T05:30:00")).notes

    assert "fewer states around the epoch than degree + 1 = 8: interpolated with degree 3" in note


@pytest.mark.parametrize(
    "wrong",
    [
        lambda states: states * [[[1.0], [1e3]]],  # velocities in m/s
        lambda states: states * [[[1.0], [-1.0]]],
        lambda states: states * [[[0.1], [0.1]]],  # 30 times the gravity of the orbit
    ],
    ids=["units of velocity", "sign of velocity", "other scale"],
)
def test_state_far_from_two_body_motion_has_a_warning(wrong: object) -> None:
    assert callable(wrong)
    states = wrong(circle([3600.0 * hour for hour in HOURS]))

    (warning,) = found(
        hourly(states=states, INTERPOLATION="LAGRANGE"), epoch=parse_epoch("2029-03-01T05:30")
    ).warnings

    assert "from two-body motion from the nearest tabulated state" in warning


def test_epoch_has_the_scale_of_all_files_or_needs_one() -> None:
    tdb = read(hourly())
    utc = read(hourly(TIME_SYSTEM="UTC"))

    assert epoch_scale(EPOCH, [tdb, tdb]) == "TDB"
    assert epoch_scale(EPOCH, []) == "UTC"
    assert epoch_scale(parse_epoch("2029-03-01T00:00:00 TAI"), [tdb, utc]) == "TAI"
    with pytest.raises(
        InputError, match=r"no time scale, and the OEM files have TDB and UTC; write one of them"
    ):
        epoch_scale(EPOCH, [tdb, utc])


def test_unknown_leap_seconds_have_one_note() -> None:
    (note,) = time_notes(EPOCH, "UTC", ["UTC", "TDB", "TDB"])

    assert "leap seconds of 2029-03-01 are not yet known" in note
    assert time_notes(EPOCH, "TDB", ["TDB", "TAI"]) == []


MATRIX = np.diag([1.0, 4.0, 9.0, 1e-6, 4e-6, 9e-6])


def covariance_of(
    frame: str | None, epoch: str = "2029-03-01T06:00:00", states: Floats | None = None
) -> Floats:
    covariance = found(
        hourly(states=states, covariance=covariance_block(epoch, MATRIX, frame))
    ).covariance
    assert covariance is not None
    return covariance


@pytest.mark.parametrize("frame", [None, "EME2000", "J2000"])
def test_covariance_in_the_frame_of_the_states_is_itself(frame: str | None) -> None:
    np.testing.assert_allclose(covariance_of(frame), MATRIX, rtol=1e-14)


def test_covariance_is_of_the_epoch_to_a_millisecond() -> None:
    np.testing.assert_allclose(covariance_of(None, "2029-03-01T06:00:00.0009"), MATRIX, rtol=1e-14)
    with pytest.raises(
        InputError,
        match=r"no covariance of the epoch, the nearest is of 2029-03-01T06:00:00.002; take",
    ):
        covariance_of(None, "2029-03-01T06:00:00.002")


@pytest.mark.parametrize("frame", ["RTN", "rsw", "RIC", "QSW", "RSW_INERTIAL"])
def test_covariance_along_the_radius_is_turned_with_the_state(frame: str) -> None:
    """The variance along a direction d is d^T P d: 1 along the radius, 4 along the motion, 9 along
    the normal.
    """
    matrix = covariance_of(frame)
    position, velocity = circle([21600.0])[0]
    directions = position / RADIUS_M, velocity / np.linalg.norm(velocity), np.array([0.0, 0.0, 1.0])

    for variance, direction in zip((1.0, 4.0, 9.0), directions, strict=True):
        assert direction @ matrix[:3, :3] @ direction == pytest.approx(variance, rel=1e-12)
        assert direction @ matrix[3:, 3:] @ direction == pytest.approx(variance * 1e-6, rel=1e-12)


def test_covariance_along_the_velocity_is_turned_with_the_state() -> None:
    """The velocity is out of the radius by some degrees: 1 along it, 4 along W x T and 9 along the
    normal W.
    """
    states = circle([3600.0 * hour for hour in HOURS])
    states[:, 1] += 0.1 * states[:, 0] * RATE

    matrix = covariance_of("TNW", states=states)

    position, velocity = states[18]
    along = velocity / np.linalg.norm(velocity)
    normal = np.cross(position, velocity) / np.linalg.norm(np.cross(position, velocity))
    for variance, direction in zip(
        (1.0, 4.0, 9.0), (along, np.cross(normal, along), normal), strict=True
    ):
        assert direction @ matrix[:3, :3] @ direction == pytest.approx(variance, rel=1e-12)


@pytest.mark.parametrize("frame", ["ITRF2000", "ICRF", "LVLH", "RSW_ROTATING"])
def test_covariance_in_another_frame_is_refused_if_it_is_needed(frame: str) -> None:
    with pytest.raises(
        InputError, match=f"COV_REF_FRAME {frame} is neither the frame of the states nor one of RTN"
    ):
        covariance_of(frame)

    block = covariance_block("2029-03-01T06:00:00", MATRIX, frame)
    assert found(hourly(covariance=block), with_covariance=False).covariance is None


def craft(source: str, centre: str | None, frame: str | None) -> CraftState:
    return CraftState(
        np.zeros((2, 3)), source, centre=centre, frame=None if frame is None else Frame(frame)
    )


@pytest.mark.parametrize(
    ("centre", "frame"),
    [("EARTH", "EME2000"), ("SUN", "ICRF")],
    ids=["another centre", "another frame"],
)
def test_craft_with_different_axes_are_refused(centre: str, frame: str) -> None:
    one = craft("a.oem", "SUN", "EME2000")
    other = craft("b.oem", centre, frame)

    with pytest.raises(
        InputError,
        match=rf"t.toml: a.oem has SUN, EME2000, and b.oem has {centre}, {frame} \(centre",
    ):
        need_same_axes(one, other, "t.toml")


def test_vectors_without_frame_take_the_axes_of_the_file_with_a_note() -> None:
    one = craft("a.oem", "SUN", "EME2000")
    vectors = craft("t.toml", None, None)

    need_same_axes(one, vectors, "t.toml")

    assert axes_note(one, vectors) == [
        "the vectors of the trajectory file are taken in the axes of a.oem: SUN, EME2000"
    ]
    assert axes_note(one, one) == axes_note(vectors, vectors) == []
