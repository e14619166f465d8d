"""Trajectories: files with the states of a spacecraft and an object, and the scenarios that follow from them."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np

from experiments.common.errors import InputError, input_errors
from experiments.common.input_file import read_file, to_toml
from infoset.arrays import Floats
from infoset.limits import NUMBER, Description, Name, Positive, check_fields
from sim.approach import Approach, find_approach
from sim.covariance import Covariance
from sim.gravity import on_board_model
from sim.scenario import Scenario

ROTATING = ("ITRF", "GRC", "TDR", "EFG")
"""Beginnings of the names of rotating frames in OEM files."""


@dataclass(frozen=True)
class Craft:
    """The state of a spacecraft or an object from the attracting body.

    It is two vectors, or the path of an orbit ephemeris message (`oem`), or a body of SPICE kernels (`spice`).
    """

    position_m: Annotated[tuple[float, ...], NUMBER] | None = None
    velocity_m_s: Annotated[tuple[float, ...], NUMBER] | None = None
    oem: str | None = None
    spice: str | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        vectors = [vector for vector in (self.position_m, self.velocity_m_s) if vector is not None]
        if [len(vectors), self.oem, self.spice].count(None) + (not vectors) != 2 or len(vectors) == 1:
            raise ValueError("Craft: must have position and velocity, or oem, or spice")
        if any(len(vector) != 3 for vector in vectors):
            raise ValueError("Craft: position and velocity must have three components")


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """The states of a spacecraft and an object at an epoch, and the covariance of the relative state.

    The components of the covariance are x, y, z and their rates, of the object from the spacecraft.

    Parameters
    ----------
    epoch : str or None
        Time of the states, for OEM files and kernels; a comment for vectors.
    gravitational_parameter_m3_s2 : float or None
        Of the attracting body; None is no gravity.
    flight_s : float or None
        Time from the start of the scenario to the closest approach; None starts at the epoch.
    pole : tuple of float
        Normal of the reference plane of the B-plane, in the axes of the states.
    kernels : tuple of str
        SPICE kernels, paths relative to the file.
    centre, frame : str
        Attracting body and axes of the states from SPICE kernels.
    """

    kind: ClassVar[str] = "trajectory"
    name: Name
    description: Description = ""
    epoch: str | None = None
    gravitational_parameter_m3_s2: Positive | None = None
    flight_s: Positive | None = None
    pole: Annotated[tuple[float, ...], NUMBER] = (0.0, 0.0, 1.0)
    kernels: tuple[str, ...] = ()
    centre: str = "SUN"
    frame: str = "ECLIPJ2000"
    spacecraft: Craft
    object: Craft
    covariance: Covariance

    def __post_init__(self) -> None:
        check_fields(self)
        if len(self.pole) != 3 or not any(self.pole):
            raise ValueError("pole must have three components, not all zero")
        if self.covariance.size != 6:
            raise ValueError(f"covariance must have 6 components: got {self.covariance.size}")
        if self.epoch is None and any(craft.position_m is None for craft in (self.spacecraft, self.object)):
            raise ValueError("epoch is missing: the time of the states in OEM files and kernels")


def scenario_of(file: str | os.PathLike[str], like: Scenario, sigmas: float) -> tuple[Scenario, str]:
    """Return the scenario of a trajectory file or of a built-in one, and its file with comments.

    It takes the sensors, the engine, the body and the settings of the scenario `like`. Uncertainty and dispersion
    contain a number of standard deviations, `sigmas`. `InputError` if a file is invalid, or the states do not meet.
    """
    trajectory, source = read_file(Trajectory, file), os.fspath(file)
    if not like.is_spatial:
        raise InputError(f"--like: {like.name} is a scenario in a plane; take one in space, for example dart-2022")
    states = _states(trajectory, Path(file).parent, source)
    with input_errors(source):
        found = find_approach(
            states,
            trajectory.gravitational_parameter_m3_s2 or 0.0,
            trajectory.covariance.matrix,
            np.array(trajectory.pole),
            trajectory.flight_s,
        )
    with input_errors(f"{source} at {sigmas:g} sigma: uncertainty"):
        box = found.box(sigmas)
    with input_errors(f"{source} with the sensors and the engine of {like.name}"):
        scenario = replace(
            like,
            name=trajectory.name,
            description=trajectory.description,
            nominal_range_m=float(found.state[2]),
            closing_speed_m_s=float(-found.state[5]),
            b_plane_t_rad=0.0,
            sun=found.sun,
            uncertainty=box,
            dispersion=box,
            covariance=found.covariance,
        )
        on_board_model(scenario)
    return scenario, _text(scenario, found, like.name, sigmas, source)


def _text(scenario: Scenario, found: Approach, like: str, sigmas: float, source: str) -> str:
    t_km, r_km = (value / 1e3 for value in found.miss_m)
    head = f"""\
# The approach of {source}, written by infoset scenarios from-states.
# x is along the line of approach (S of the B-plane), y along T, z along R; the origin is the spacecraft.
# Start: {found.start_s / 86400.0:.6g} d after the epoch, {found.flight_s:.6g} s before the closest approach.
# Closest approach without impulses: B.T = {t_km:.6g} km, B.R = {r_km:.6g} km.
# Until then gravity changes the closing speed by {found.speed_change_m_s:.3g} m/s and turns the line of approach by
# {found.turn_rad:.3g} rad; B.T and B.R are in the plane across the line at the start.
# What is not explained here has the values of {like}: replace them by yours.
"""
    comments = {
        **{f"[{part.name}]": f"as {like}" for part in fields(Scenario)},
        "[sun]": "the attracting body, its direction from the spacecraft, and the velocity of the spacecraft from it",
        "[uncertainty]": f"known on board: {sigmas:g} sigma around the states",
        "[dispersion]": f"true starts are within {sigmas:g} sigma; those of the covariance beyond are drawn again",
        "[covariance]": "of the start, components y, z, x and their rates; lower triangle of the correlations",
    }
    lines = []
    for line in to_toml(scenario).replace("], [", "],\n    [").splitlines():
        comment = comments.get(line)
        lines.append(f"{line}  # {comment}" if comment else line)
    return head + "\n".join(lines) + "\n"


def _states(trajectory: Trajectory, folder: Path, source: str) -> Floats:
    """Return position and velocity of the spacecraft, and of the object from it, shape (4, 3)."""
    found, frames = [], {}
    for craft in (trajectory.spacecraft, trajectory.object):
        if craft.oem is not None:
            state, frames[craft.oem] = _oem_state(folder / craft.oem, str(trajectory.epoch))
        elif craft.spice is not None:
            state = _spice_state(trajectory, craft.spice, folder)
        else:
            state = np.array([craft.position_m, craft.velocity_m_s])
        found.append(state)
    if len(set(frames.values())) > 1:
        (one, first), (other, second) = frames.items()
        raise InputError(
            f"{source}: {one} has {', '.join(first)}, and {other} has {', '.join(second)} (centre, frame, time "
            "system): they must be the same; convert one of the files"
        )
    return np.concatenate([found[0], found[1] - found[0]])


def _oem_state(file: Path, epoch: str) -> tuple[Floats, tuple[str, str, str]]:
    """Return position and velocity of an OEM file at an epoch, m and m/s, and its centre, frame and time system."""
    from oem import OrbitEphemerisMessage  # isort: skip  # it needs astropy
    from astropy.time import Time

    try:
        message = OrbitEphemerisMessage.open(str(file))
        known = message.segments[0].metadata
        frame = known["CENTER_NAME"], known["REF_FRAME"], known["TIME_SYSTEM"]
        state = message(Time(epoch, scale=frame[2].lower()))
    except Exception as error:  # the library has errors of many types for damaged files
        raise InputError(f"{file}: cannot be read at the epoch {epoch}: {error}") from None
    if frame[1].upper().startswith(ROTATING):
        raise InputError(f"{file}: REF_FRAME {frame[1]} rotates; convert the file to an inertial frame")
    return 1e3 * np.array([state.position, state.velocity]), frame


def _spice_state(trajectory: Trajectory, body: str, folder: Path) -> Floats:
    """Return position and velocity of a body of SPICE kernels at the epoch, m and m/s."""
    import spiceypy

    try:
        with spiceypy.KernelPool([str(folder / kernel) for kernel in trajectory.kernels]):
            time_s = spiceypy.str2et(trajectory.epoch)
            state: Any = spiceypy.spkezr(body, time_s, trajectory.frame, "NONE", trajectory.centre)[0]
    except spiceypy.SpiceyError as error:
        raise InputError(f"spice: {body}: {error.long or error.short}") from None
    return 1e3 * np.reshape(state, (2, 3))
