"""Reference frames and centres in orbit ephemeris messages.

Inertial frames, and names that mean the same.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

FIXED = {
    "EME2000": "EME2000|J2000",
    "ICRF": "ICRF[123]?|GCRF[123]?|BCRF[123]?",
    "ECLIPJ2000": "ECLIPJ2000|ECLIPTICJ2000|J2000ECLIPTIC",
    "B1950": "B1950",
    "GALACTIC": "GALACTIC|GALACTICII",
}
"""Frames whose axes are fixed to the stars, and the names of each, in capitals and without
separators.

EME2000 and ICRF differ by 0.023 arc seconds, which is 17 km at the distance of the Sun.
"""
OF_DATE = {
    "TOD": "TOD|TODEARTH|TRUEOFDATE",
    "MOD": "MOD|MODEARTH|MEANOFDATE",
    "TEME": "TEME|TEMEOFDATE",
    "TOD of the Moon": "TODMOON",
    "MOD of the Moon": "MODMOON",
    "TOD of the centre": "TODCB",
    "MOD of the centre": "MODCB",
    "TRUE ECLIPTIC": "TRUEECLIPTIC",
}
"""Frames whose axes follow precession or nutation; with a REF_FRAME_EPOCH they are those of that
epoch.
"""
OF_EPOCH = {
    "TOE": "TOE|TOEEARTH",
    "MOE": "MOE|MOEEARTH",
    "TEME of epoch": "TEMEOFEPOCH",
    "TOE of the Moon": "TOEMOON",
    "MOE of the Moon": "MOEMOON",
    "TOE of the centre": "TOECB",
    "MOE of the centre": "MOECB",
}
"""Frames of an epoch that the file must state."""

CENTRES = {
    "0": "SOLAR SYSTEM BARYCENTER",
    "SSB": "SOLAR SYSTEM BARYCENTER",
    "10": "SUN",
    "3": "EARTH BARYCENTER",
    "EMB": "EARTH BARYCENTER",
    "EARTH MOON BARYCENTER": "EARTH BARYCENTER",
    "199": "MERCURY",
    "299": "VENUS",
    "399": "EARTH",
    "301": "MOON",
    "4": "MARS BARYCENTER",
    "499": "MARS",
    "5": "JUPITER BARYCENTER",
    "599": "JUPITER",
    "6": "SATURN BARYCENTER",
    "699": "SATURN",
}
"""Other names of centres, NAIF's numbers among them."""
SPICE_J2000 = "J2000 of SPICE"
"""The frame of kernels that may be EME2000 or ICRF: SPICE has one name for both."""
SOLAR_SYSTEM = "SOLAR SYSTEM BARYCENTER"


class Frame(NamedTuple):
    """A known inertial frame by its common name, and whether its axes are of date."""

    name: str
    is_of_date: bool = False


def inertial_frame(name: str, epoch: str | None = None) -> Frame:
    """Return the inertial frame of a REF_FRAME and its REF_FRAME_EPOCH.

    A frame of date with an epoch is fixed at it; frames fixed to the stars need no epoch. A
    ValueError is raised for any other frame, and if the epoch of a frame of `OF_EPOCH` is missing.
    """
    plain = re.sub("[^A-Z0-9]", "", name.upper())
    fixed, of_date, of_epoch = (_common_name(plain, names) for names in (FIXED, OF_DATE, OF_EPOCH))
    if fixed is not None:
        return Frame(fixed)
    if of_date is not None and epoch is None:
        return Frame(of_date, is_of_date=True)
    if of_epoch is not None and epoch is None:
        raise ValueError(f"REF_FRAME {name} is a frame of an epoch, and REF_FRAME_EPOCH is missing")
    if of_date is not None or of_epoch is not None:
        return Frame(f"{of_date or of_epoch} at {epoch}")

    raise ValueError(
        f"REF_FRAME {name} is not a known inertial frame, it may rotate; convert the file to "
        "EME2000 or ICRF"
    )


def _common_name(plain: str, frames: Mapping[str, str]) -> str | None:
    """Return the frame that has a name in capitals without separators, or None."""
    return next((frame for frame, names in frames.items() if re.fullmatch(names, plain)), None)


def frame_of_spice(name: str) -> Frame:
    """Return an inertial frame of SPICE by its common name."""
    if name.upper() == "J2000":
        return Frame(SPICE_J2000)
    try:
        return inertial_frame(name)
    except ValueError:
        return Frame(name.upper())


def is_same_frame(one: Frame, other: Frame) -> bool:
    """Return whether two frames have the same axes.

    J2000 of SPICE is the same as EME2000 and as ICRF, although these two are different.
    """
    names = {one.name, other.name}
    return len(names) == 1 or (SPICE_J2000 in names and names <= {SPICE_J2000, "EME2000", "ICRF"})


def centre_name(name: str) -> str:
    """Return a centre by its common name in capitals."""
    words = " ".join(
        re.split(r"[\s_]+|(?<=\w)-", name.strip().upper())
    )  # the minus of a number stays
    return CENTRES.get(words, words)
