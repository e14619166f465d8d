"""Orbit ephemeris messages (OEM, CCSDS 502.0-B-1 to B-3) in keyword-value notation.

The reader takes the content of a file and opens nothing. It reads over keywords that the program
does not use, because versions of the standard differ in them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.ephemeris.epochs import known_scale, parse_epoch, seconds_in
from infoset.experiments.common.ephemeris.interpolation import (
    DEFAULT_DEGREE,
    MAX_DEGREE,
    METHODS,
)
from infoset.experiments.common.errors import InputError, shown
from infoset.limits import MAXIMUM

MAX_OEM_BYTES = 20_000_000
"""Size of the largest file that is read: 120 000 states, 80 days in steps of a minute.

The shortest possible states, of 21 bytes, fill it with 950 000 of them, which take 450 MB and half
a minute.
"""
VERSIONS = ("1.0", "2.0", "3.0")
NEEDED_KEYS = ("CENTER_NAME", "REF_FRAME", "TIME_SYSTEM")
"""Keywords without which the states of a segment have no meaning."""
ROW_LENGTHS = (7, 10)
"""Number of words of a state: epoch, position, velocity, and in some files the acceleration.

The acceleration is not used.
"""
COMPONENTS = 6
"""Number of components of position and velocity."""
METRES_PER_KM = 1e3
"""OEM files are in kilometres."""

_PAIR = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)\s*=\s*(.*)")


class OemCovariance(NamedTuple):
    """A covariance of position and velocity, m^2, m^2/s and m^2/s^2, with epoch and frame.

    The frame is None if it is not written.
    """

    epoch: str
    seconds: Fraction
    frame: str | None
    matrix: Floats


@dataclass
class OemSegment:
    """A segment of a message.

    Parameters
    ----------
    number, line : int
        Number of the segment in its file, from one, and the line of its META_START.
    metadata : dict
        Values of its keywords as written.
    scale : str
        Time scale of the epochs.
    seconds : list of Fraction
        Epochs of the states, s (`seconds_in`).
    states : array of shape (N, 2, 3)
        Positions and velocities, m and m/s.
    method, degree : str, int
        Interpolation that the file recommends.
    start, stop : Fraction
        Ends of the time span in which the states may be interpolated, s: within the states and the
        START_TIME, USEABLE_START_TIME, STOP_TIME and USEABLE_STOP_TIME that the file has.
    """

    number: int
    line: int
    metadata: dict[str, str] = field(default_factory=dict)
    scale: str = ""
    seconds: list[Fraction] = field(default_factory=list)
    states: Floats = field(default_factory=lambda: np.empty((0, 2, 3)))
    covariances: list[OemCovariance] = field(default_factory=list)
    method: str = "HERMITE"
    degree: int = DEFAULT_DEGREE
    start: Fraction = Fraction(0)
    stop: Fraction = Fraction(0)


def read_oem(content: bytes, source: str) -> list[OemSegment]:
    """Return the segments of an OEM file.

    Raise `InputError` with `source` and the line if it is not valid.
    """
    reading = _Reading(source)
    for number, line in enumerate(re.split("\r\n|\r|\n", _text(content, source)), start=1):
        reading.take(number, line.strip())
    return reading.finish()


def _text(content: bytes, source: str) -> str:
    """Return the text of a file in UTF-8, or else in Latin-1.

    Older programs write Latin-1 into comments.
    """
    # 100 bytes: blanks may stand before the first tag; chosen.
    if content[:100].lstrip().startswith((b"<", b"\xef\xbb\xbf<")):
        raise InputError(
            f"{source}: is XML, and OEM files are read in keyword-value notation (KVN); export it "
            "as KVN"
        )
    if b"\0" in content:
        raise InputError(f"{source}: is not text; give an OEM file in keyword-value notation (KVN)")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        # A mark of UTF-8 at the start (BOM), which such a file can have too, is not text.
        return content.decode("latin-1").removeprefix("\u00ef\u00bb\u00bf")


class _Reading:
    """A file that is being read line by line.

    `take` calls the function of the section in which the line is.
    """

    def __init__(self, source: str) -> None:
        self._source = source
        self._line = 0
        self._section = self._version
        self._header: dict[str, str] = {}
        self._segments: list[OemSegment] = []
        self._rows: list[list[float]] = []
        self._covariance: dict[str, str] = {}
        self._entries: list[list[float]] = []

    def take(self, number: int, line: str) -> None:
        """Take a line."""
        self._line = number
        if line and not re.match(r"COMMENT\b", line):
            self._section(line)

    def finish(self) -> list[OemSegment]:
        """Return the segments after the last line."""
        if self._section == self._metadata:
            raise self._fault("META_STOP is missing at the end of the file")
        if self._section == self._covariances:
            raise self._fault("COVARIANCE_STOP is missing at the end of the file")
        if not self._segments:
            raise InputError(
                f"{self._source}: has no segment (META_START); give a complete OEM file"
            )
        self._end_segment()
        return self._segments

    def _fault(self, text: str) -> InputError:
        return InputError(f"{self._source}: line {self._line}: {text}")

    def _version(self, line: str) -> None:
        """Take the first line."""
        match = _PAIR.fullmatch(line)
        if match is None or match[1] != "CCSDS_OEM_VERS":
            raise self._fault("is not an OEM file: the first keyword must be CCSDS_OEM_VERS")
        if match[2] not in VERSIONS:
            raise self._fault(
                f"CCSDS_OEM_VERS {shown(match[2])} is not one of {', '.join(VERSIONS)}"
            )
        self._section = self._head

    def _head(self, line: str) -> None:
        if line == "META_START":
            self._begin_segment()
        else:
            self._keep_pair(line, self._header, "the header")

    def _metadata(self, line: str) -> None:
        """Take a line of the metadata; the last one, META_STOP, checks them."""
        segment = self._segments[-1]
        if line != "META_STOP":
            self._keep_pair(line, segment.metadata, "the metadata")
            return

        missing = [key for key in NEEDED_KEYS if not segment.metadata.get(key)]
        if missing:
            raise self._fault(
                f"{missing[0]} is missing in the metadata of segment {segment.number}"
            )

        try:
            segment.scale = known_scale(segment.metadata["TIME_SYSTEM"])
        except ValueError as error:
            raise self._fault(f"TIME_SYSTEM: {error}") from None

        segment.method, segment.degree = self._interpolation(segment.metadata)
        self._section = self._data

    def _interpolation(self, metadata: dict[str, str]) -> tuple[str, int]:
        """Return method and degree; without them Hermite's, and the default degree."""
        method = metadata.get("INTERPOLATION", METHODS[0]).upper()
        if method not in METHODS:
            raise self._fault(f"INTERPOLATION {shown(method)} is not one of {', '.join(METHODS)}")
        if method == "LINEAR":
            return method, 1

        degree = metadata.get("INTERPOLATION_DEGREE", str(DEFAULT_DEGREE))
        if not re.fullmatch("[0-9]{1,4}", degree) or not 1 <= int(degree) <= MAX_DEGREE:
            raise self._fault(
                f"INTERPOLATION_DEGREE must be a whole number from 1 to {MAX_DEGREE}: "
                f"{shown(degree)}"
            )
        return method, int(degree)

    def _data(self, line: str) -> None:
        """Take a state, or the line that begins covariances or the next segment."""
        if line == "META_START":
            self._end_segment()
            self._begin_segment()
            return
        if line == "COVARIANCE_START":
            self._need_states()
            self._section = self._covariances
            return

        words = line.split()
        if len(words) not in ROW_LENGTHS:
            raise self._fault(
                f"must be an epoch and 6 numbers, or 9 with the acceleration: {shown(line)}"
            )

        segment = self._segments[-1]
        seconds = self._seconds(words[0], segment.scale)
        if segment.seconds and seconds <= segment.seconds[-1]:
            raise self._fault(
                "the epoch is not later than the one before; sort the states, each epoch once"
            )

        segment.seconds.append(seconds)
        self._rows.append(self._numbers(words[1 : 1 + COMPONENTS]))

    def _covariances(self, line: str) -> None:
        """Take a line of the covariances: keywords, and then rows of one, two, ... six numbers."""
        if line == "COVARIANCE_STOP":
            if self._covariance or self._entries:
                raise self._fault(
                    f"the covariance ends after {len(self._entries)} of {COMPONENTS} rows"
                )
            self._section = self._data
            return

        if "=" in line:
            if self._entries:
                raise self._fault(
                    f"the covariance has {len(self._entries)} rows, it must have {COMPONENTS}"
                )
            self._keep_pair(
                line, self._covariance, "the covariance", known=("EPOCH", "COV_REF_FRAME")
            )
            return

        row = self._numbers(line.split())
        if len(row) != len(self._entries) + 1:
            raise self._fault(
                f"row {len(self._entries) + 1} of the covariance must have "
                f"{len(self._entries) + 1} numbers"
            )

        self._entries.append(row)
        if len(self._entries) == COMPONENTS:
            self._end_covariance()

    def _begin_segment(self) -> None:
        self._segments.append(OemSegment(number=len(self._segments) + 1, line=self._line))
        self._rows = []
        self._section = self._metadata

    def _end_segment(self) -> None:
        """Store the states of the last segment, and the time span in which they may be used."""
        self._need_states()
        segment = self._segments[-1]
        segment.states = METRES_PER_KM * np.array(self._rows).reshape(-1, 2, 3)

        starts = [*self._times(segment, "START_TIME", "USEABLE_START_TIME"), segment.seconds[0]]
        stops = [*self._times(segment, "STOP_TIME", "USEABLE_STOP_TIME"), segment.seconds[-1]]
        segment.start = max(starts)
        segment.stop = min(stops)

    def _end_covariance(self) -> None:
        if "EPOCH" not in self._covariance:
            raise self._fault("EPOCH of the covariance is missing")
        epoch = self._covariance["EPOCH"]
        segment = self._segments[-1]
        matrix = np.zeros((COMPONENTS, COMPONENTS))
        for index, row in enumerate(self._entries):
            # The rows of the file are the lower triangle.
            matrix[index, : index + 1] = row
            matrix[: index + 1, index] = row
        segment.covariances.append(
            OemCovariance(
                epoch=epoch,
                seconds=self._seconds(epoch, segment.scale),
                frame=self._covariance.get("COV_REF_FRAME"),
                matrix=METRES_PER_KM**2 * matrix,
            )
        )
        self._covariance = {}
        self._entries = []

    def _times(self, segment: OemSegment, *keys: str) -> Iterator[Fraction]:
        for key in keys:
            if key in segment.metadata:
                yield self._seconds(
                    segment.metadata[key], segment.scale, f"{key} of segment {segment.number}: "
                )

    def _need_states(self) -> None:
        if not self._rows:
            raise self._fault(f"segment {self._segments[-1].number} has no states")

    def _seconds(self, text: str, scale: str, name: str = "") -> Fraction:
        """Return the seconds of an epoch in a scale.

        A Z or another scale at its end has no meaning in these files, and is read over.
        """
        try:
            return seconds_in(parse_epoch(text), scale)
        except ValueError as error:
            raise self._fault(f"{name}{shown(text)} {error}") from None

    def _numbers(self, words: list[str]) -> list[float]:
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = [np.nan]
        if not all(abs(value) <= MAXIMUM for value in values):  # NaN is not either
            raise self._fault(f"must be numbers, found {shown(' '.join(words))}")
        return values

    def _keep_pair(
        self, line: str, pairs: dict[str, str], where: str, known: tuple[str, ...] = ()
    ) -> None:
        """Store KEYWORD = VALUE of a line; with `known`, other keywords are refused."""
        match = _PAIR.fullmatch(line)
        if match is None or (known and match[1] not in known):
            raise self._fault(f"must be KEYWORD = VALUE in {where}, found {shown(line)}")
        if match[1] in pairs:
            raise self._fault(f"{match[1]} is written again in {where}")
        value = match[2].strip()
        if not value.isprintable():
            raise self._fault(f"{match[1]} has control characters in {where}")
        pairs[match[1]] = value
