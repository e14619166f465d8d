"""The state of a spacecraft or an object at an epoch, with its frame and covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.ephemeris.epochs import (
    LAST_OFFSET_S,
    Epoch,
    converted,
    is_guess,
    tdb_drift_s,
)
from infoset.experiments.common.ephemeris.frames import (
    SOLAR_SYSTEM,
    Frame,
    centre_name,
    inertial_frame,
    is_same_frame,
)
from infoset.experiments.common.ephemeris.interpolation import Interpolated, interpolate
from infoset.experiments.common.ephemeris.oem import OemCovariance, OemSegment
from infoset.experiments.common.errors import InputError
from infoset.sim.approach import propagate

SAME_EPOCH_S = Fraction(1, 1000)
"""Largest difference between the epochs of a covariance and of the states.

Files write both with milliseconds.
"""
MODEL_SHARE = 0.01
"""Difference to two-body motion from which a warning reports a state.

It is a share of the distance to the nearest tabulated state.
Perturbations of an orbit change it by less (the Earth's oblateness by 0.1 %), wrong units and
manoeuvres by more.
"""
MAX_SPANS = 3
"""Number of the spans of segments that a message lists: a line has room for them."""
ALONG_RADIUS = ("RTN", "RSW", "RIC", "QSW")
"""Names of the axes radius, transverse, normal of the orbit."""
ALONG_VELOCITY = ("TNW",)
"""Name of the axes velocity, normal in the plane, normal of the orbit."""


@dataclass(frozen=True)
class CraftState:
    """A state, shape (2, 3), and the facts that its source gives about it.

    Parameters
    ----------
    source : str
        The file, or the body of kernels.
    centre, frame : str and Frame, or None
        None for vectors of the trajectory file.
    covariance : array of shape (6, 6) or None
        Of position and velocity, in the axes of the state.
    covariance_frame : str
        The axes in which the file gives it.
    origin : str
        How the state was found, for the comments of the scenario.
    error : array of shape (2,)
        Estimated error of the interpolation of position and velocity.
    notes, warnings : tuple of str
        What the user must know, one line each.
    """

    state: Floats
    source: str
    centre: str | None = None
    frame: Frame | None = None
    covariance: Floats | None = None
    covariance_frame: str = ""
    origin: str = "vectors of the trajectory file"
    error: Floats = field(default_factory=lambda: np.zeros(2))
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def epoch_scale(epoch: Epoch, files: Sequence[Sequence[OemSegment]]) -> str:
    """Return the time scale of an epoch.

    It is as written, or the scale of all OEM files; UTC without such files, as in SPICE. Raise
    `InputError` if the files have several.
    """
    if epoch.scale is not None:
        return epoch.scale
    scales = sorted({segment.scale for segments in files for segment in segments})
    if not scales:
        return "UTC"
    if len(scales) > 1:
        raise InputError(
            f"epoch: has no time scale, and the OEM files have {' and '.join(scales)}; write one "
            f'of them after it, for example epoch = "2029-03-01T00:00:00 {scales[0]}"'
        )
    return scales[0]


def oem_craft(
    segments: Sequence[OemSegment],
    source: str,
    epoch: Epoch,
    scale: str,
    parameter_m3_s2: float,
    *,
    with_covariance: bool,
) -> CraftState:
    """Return the state of an OEM file at an epoch in a time scale.

    The covariance is None if it is not wanted, or the segment has none.

    `InputError` if no segment holds the epoch or two overlap there, its frame rotates or is
    unknown, the epoch is in a gap, or if the covariance is wanted and the segment has covariances,
    but none of the epoch or one in unknown axes.
    """
    segment = _segment_at(segments, source, epoch, scale)
    where = f"{source}: segment {segment.number}"
    seconds = converted(epoch, scale, segment.scale)
    try:
        frame = inertial_frame(
            segment.metadata["REF_FRAME"], segment.metadata.get("REF_FRAME_EPOCH")
        )
        found = interpolate(
            seconds,
            segment.seconds,
            segment.states,
            segment.method,
            segment.degree,
            lambda time: tdb_drift_s(time, segment.scale),
        )
    except ValueError as error:
        raise InputError(f"{where}: {error}") from None

    covariance = None
    covariance_frame = ""
    if with_covariance and segment.covariances:
        given = _covariance_at(segment, where, seconds)
        # The same axes for positions and velocities.
        axes = np.kron(np.eye(2), _axes_of(given, where, segment, frame, found.state))
        covariance = axes.T @ given.matrix @ axes
        covariance_frame = given.frame or f"{frame.name}, as the states"

    notes = []
    if found.method not in ("TABULATED", "LINEAR") and found.degree < segment.degree:
        notes.append(
            f"{where}: has fewer states around the epoch than degree + 1 = {segment.degree + 1}: "
            f"interpolated with degree {found.degree}"
        )
    centre = centre_name(segment.metadata["CENTER_NAME"])
    return CraftState(
        state=found.state,
        source=source,
        centre=centre,
        frame=frame,
        covariance=covariance,
        covariance_frame=covariance_frame,
        origin=f"segment {segment.number} of {source}, {_method_text(found)}",
        error=found.error,
        notes=tuple(notes),
        warnings=tuple(_warnings(where, found, centre, frame, parameter_m3_s2)),
    )


def time_notes(epoch: Epoch, scale: str, wanted: Sequence[str]) -> list[str]:
    """Return a line if UTC is converted with leap seconds that are not yet known."""
    if not any(is_guess(epoch, scale, each) for each in wanted):
        return []
    return [
        f"the leap seconds of {epoch.day} are not yet known: UTC is converted with TAI - UTC = "
        f"{LAST_OFFSET_S} s"
    ]


def need_same_axes(one: CraftState, other: CraftState, source: str) -> None:
    """Raise `InputError` unless two states from files have the same centre and frame."""
    if one.frame is None or other.frame is None or one.centre is None or other.centre is None:
        return
    if one.centre == other.centre and is_same_frame(one.frame, other.frame):
        return
    raise InputError(
        f"{source}: {one.source} has {one.centre}, {one.frame.name}, and {other.source} has "
        f"{other.centre}, {other.frame.name} (centre, frame): they must be the same; convert one "
        "of them"
    )


def axes_note(one: CraftState, other: CraftState) -> list[str]:
    """Return a line if only one of two states has a known frame."""
    known = [craft for craft in (one, other) if craft.frame is not None]
    if len(known) != 1 or known[0].frame is None:
        return []
    return [
        f"the vectors of the trajectory file are taken in the axes of {known[0].source}: "
        f"{known[0].centre}, {known[0].frame.name}"
    ]


def _segment_at(
    segments: Sequence[OemSegment], source: str, epoch: Epoch, scale: str
) -> OemSegment:
    """Return the segment that holds an epoch.

    Of two segments that meet at the epoch it is the later one in the file, after a manoeuvre. A
    segment with the epoch at one of its ends gives way to one with the epoch inside.
    """
    holding = []
    inside = []
    for segment in segments:
        try:
            seconds = converted(epoch, scale, segment.scale)
        except ValueError as error:
            raise InputError(f"epoch: {error}") from None
        if segment.start <= seconds <= segment.stop:
            holding.append(segment)
        if segment.start < seconds < segment.stop:
            inside.append(segment)

    if not holding:
        spans = ", ".join(map(_usable_span, segments[:MAX_SPANS]))
        if len(segments) > MAX_SPANS:
            spans += f" and {len(segments) - MAX_SPANS} more"
        raise InputError(
            f"{source}: no segment holds the epoch: the usable spans are {spans}; take an epoch "
            "within one"
        )

    if len(inside) > 1:
        raise InputError(
            f"{source}: segments {inside[0].number} and {inside[1].number} both hold the epoch"
        )
    return (inside or holding)[-1]


def _usable_span(segment: OemSegment) -> str:
    """Return the span of a segment as its metadata state it, as text.

    The states may begin later or end earlier.
    """
    known = segment.metadata
    start = known.get("USEABLE_START_TIME", known.get("START_TIME", "the first state"))
    stop = known.get("USEABLE_STOP_TIME", known.get("STOP_TIME", "the last state"))
    return f"from {start} to {stop} {segment.scale}"


def _method_text(found: Interpolated) -> str:
    if found.method == "TABULATED":
        return "a tabulated state"
    return (
        f"{found.method} of degree {found.degree}, estimated errors {found.error[0]:.2g} m and "
        f"{found.error[1]:.2g} m/s"
    )


def _warnings(
    where: str, found: Interpolated, centre: str, frame: Frame, parameter_m3_s2: float
) -> list[str]:
    lines = []
    if frame.is_of_date:
        lines.append(
            f"{where}: the frame {frame.name} is of date, its axes turn slowly; EME2000 or ICRF "
            "are better"
        )
    if centre == SOLAR_SYSTEM and parameter_m3_s2:
        lines.append(
            f"{where}: the centre is the {SOLAR_SYSTEM}, and gravity is computed from there"
        )

    distance_m = float(np.linalg.norm(found.state[0] - found.nearest[0]))
    difference_m = _two_body_difference(found, parameter_m3_s2)
    if difference_m > MODEL_SHARE * distance_m:
        lines.append(
            f"{where}: the state differs by {difference_m / 1e3:.4g} km from two-body motion from "
            f"the nearest tabulated state, {distance_m / 1e3:.4g} km away: check the units, "
            "gravitational_parameter and the steps"
        )
    return lines


def _two_body_difference(found: Interpolated, parameter_m3_s2: float) -> float:
    """Return the distance from the two-body motion of the nearest tabulated state, m.

    It is zero for a tabulated state, and infinite if the motion cannot be computed.
    """
    if not found.nearest_s:
        return 0.0
    # `propagate` moves a pair of states; only the first one is wanted.
    pair = np.concatenate([found.nearest, np.zeros((2, 3))])
    try:
        moved, _ = propagate(pair, parameter_m3_s2, found.nearest_s)
    except ValueError:
        return np.inf
    return float(np.linalg.norm(moved[0] - found.state[0]))


def _covariance_at(segment: OemSegment, where: str, seconds: Fraction) -> OemCovariance:
    """Return the covariance of a segment, which has at least one, at an epoch.

    `InputError` if the nearest one is more than `SAME_EPOCH_S` from the epoch.
    """
    nearest = min(segment.covariances, key=lambda each: abs(each.seconds - seconds))
    if abs(nearest.seconds - seconds) > SAME_EPOCH_S:
        raise InputError(
            f"{where}: has no covariance of the epoch, the nearest is of {nearest.epoch}; take "
            "that epoch, or write [covariance] in the trajectory file"
        )
    return nearest


def _axes_of(
    covariance: OemCovariance, where: str, segment: OemSegment, frame: Frame, state: Floats
) -> Floats:
    """Return the axes of a covariance as rows, shape (3, 3), in the frame of the states.

    No COV_REF_FRAME means that frame. `state`, shape (2, 3), gives the axes of the orbit; the
    suffix _INERTIAL (axes fixed at the epoch) does not change them. `InputError`, beginning with
    `where`, for any other frame; EME2000 and ICRF count as different.
    """
    name = covariance.frame
    if name is None:
        return np.eye(3)

    plain = name.upper().removesuffix("_INERTIAL")
    if plain in (*ALONG_RADIUS, *ALONG_VELOCITY):
        return _local_axes(state, where, along_radius=plain in ALONG_RADIUS)

    try:
        is_same = inertial_frame(name, segment.metadata.get("REF_FRAME_EPOCH")) == frame
    except ValueError:
        is_same = False

    if not is_same:
        raise InputError(
            f"{where}: COV_REF_FRAME {name} is neither the frame of the states nor one of "
            f"{', '.join((*ALONG_RADIUS, *ALONG_VELOCITY))}; write [covariance] in the trajectory "
            "file"
        )
    return np.eye(3)


def _local_axes(state: Floats, where: str, *, along_radius: bool) -> Floats:
    """Return the axes of an orbit at a state as rows.

    The first axis is along the radius or along the velocity, the last one is the normal of the
    orbit, and the second one completes them: last x first. `InputError` if the orbit is a line.
    """
    position, velocity = state
    normal = np.cross(position, velocity)
    if not normal.any():
        raise InputError(
            f"{where}: the covariance is in the axes of the orbit, and the motion is along the "
            "radius"
        )
    first = position if along_radius else velocity
    first = first / np.linalg.norm(first)
    normal = normal / np.linalg.norm(normal)
    return np.stack([first, np.cross(normal, first), normal])
