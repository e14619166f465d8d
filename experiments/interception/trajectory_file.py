"""Trajectory files: states of a spacecraft and an object, and the scenario that follows."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.ephemeris import craft_state
from infoset.experiments.common.ephemeris.craft_state import CraftState
from infoset.experiments.common.ephemeris.epochs import Epoch, converted, parse_epoch
from infoset.experiments.common.ephemeris.frames import centre_name, frame_of_spice
from infoset.experiments.common.ephemeris.oem import MAX_OEM_BYTES, OemSegment, read_oem
from infoset.experiments.common.errors import InputError, input_errors, on_a_screen
from infoset.experiments.common.input_file import read_file, read_input, to_toml
from infoset.experiments.interception.sun_direction import SunDirection, direction_of
from infoset.experiments.interception.trajectory import kernels
from infoset.experiments.interception.trajectory.files import named_file
from infoset.limits import NUMBER, Description, Line, Name, Positive, check_fields
from infoset.model import StateBox
from infoset.sim.approach import Approach, find_approach
from infoset.sim.body import Body
from infoset.sim.covariance import Covariance
from infoset.sim.gravity import on_board_model
from infoset.sim.scenario import Scenario

_Text = Line(longest=1000)
"""Names and paths: one line, because messages and comments of the scenario repeat them. The maximum
length is chosen.
"""
KERNEL_SCALE = "TDB"
"""Time scale of SPICE."""


@dataclass(frozen=True)
class CraftTrack:
    """The state of a spacecraft or an object from the attracting body.

    It is two vectors, or the path of an orbit ephemeris message (`oem`), or a body of SPICE kernels
    (`spice`).
    """

    position_m: Annotated[tuple[float, ...], NUMBER] | None = None
    velocity_m_s: Annotated[tuple[float, ...], NUMBER] | None = None
    oem: Annotated[str, _Text] | None = None
    spice: Annotated[str, _Text] | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        vectors = [vector for vector in (self.position_m, self.velocity_m_s) if vector is not None]
        sources = [bool(vectors), self.oem is not None, self.spice is not None]
        if sources.count(True) != 1 or len(vectors) == 1:
            raise ValueError("CraftTrack: must have position and velocity, or oem, or spice")
        if any(len(vector) != 3 for vector in vectors):
            raise ValueError("CraftTrack: position and velocity must have three components")


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """The states of a spacecraft and an object at an epoch, and their covariance.

    The covariance is of the relative state, with the components x, y, z and their rates, of the
    object from the spacecraft.

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
    covariance : Covariance or None
        None is the sum of the covariances of the OEM files.
    """

    kind: ClassVar[str] = "trajectory"
    name: Name
    description: Description = ""
    epoch: Annotated[str, _Text] | None = None
    gravitational_parameter_m3_s2: Positive | None = None
    flight_s: Positive | None = None
    pole: Annotated[tuple[float, ...], NUMBER] = (0.0, 0.0, 1.0)
    kernels: Annotated[tuple[str, ...], _Text] = ()
    centre: Annotated[str, _Text] = "SUN"
    frame: Annotated[str, _Text] = "ECLIPJ2000"
    spacecraft: CraftTrack
    object: CraftTrack
    covariance: Covariance | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        if len(self.pole) != 3 or not any(self.pole):
            raise ValueError("pole must have three components, not all zero")
        if self.covariance is not None and self.covariance.size != 6:
            raise ValueError(f"covariance must have 6 components: got {self.covariance.size}")
        crafts = (self.spacecraft, self.object)
        if self.covariance is None and not any(craft.oem for craft in crafts):
            raise ValueError("covariance is missing: only OEM files may have it instead")
        if self.epoch is None and any(craft.position_m is None for craft in crafts):
            raise ValueError("epoch is missing: the time of the states in OEM files and kernels")


class KnownTarget(NamedTuple):
    """Properties of the target that the files of a trajectory do not contain.

    They are its radius, m, and the bound of its acceleration. None is not known.
    """

    radius_m: float | None = None
    disturbance_m_s2: float | None = None


class FoundScenario(NamedTuple):
    """The scenario of a trajectory, its file, and notes and warnings about the trajectory."""

    scenario: Scenario
    text: str
    notes: list[str]
    warnings: list[str]


class _Pair(NamedTuple):
    """The states of both craft, the covariance of the relative state, and notes about them."""

    spacecraft: CraftState
    object: CraftState
    covariance: Floats
    notes: list[str]


def scenario_of(
    file: str | os.PathLike[str],
    like: Scenario,
    sigmas: float,
    target: KnownTarget | None = None,
    folders: Sequence[Path] = (),
) -> FoundScenario:
    """Return the scenario of a trajectory file or of a built-in one.

    Parameters
    ----------
    file : str or path
        The trajectory file, or the name of a built-in one.
    like : Scenario
        The scenario in space from which sensors, engine and settings are taken. Of its target only
        values of the camera are: the centroid error, and how the body reflects.
    sigmas : float
        Number of standard deviations that uncertainty and dispersion contain.
    target : KnownTarget or None
        The size of the target, and the bound of its acceleration.
    folders : sequence of Path
        Folders below which the trajectory file may name files; it may always name files below its
        own folder.

    Raises
    ------
    InputError
        If a file is invalid, the states do not meet, or `like` has a phase angle and the radius of
        the target is not known.
    """
    trajectory = read_file(Trajectory, file)
    source = os.fspath(file)
    if not like.is_spatial:
        raise InputError(
            f"--like: {like.name} is a scenario in a plane; take one in space, for example "
            "dart-2022"
        )

    target = target or KnownTarget()
    camera = like.camera
    if camera is not None and camera.phase_angle_rad is not None and target.radius_m is None:
        raise InputError(
            f"--like: {like.name} has camera.phase_angle_deg, which needs the radius of the "
            "target: add --body-radius-m"
        )

    pair = _pair(trajectory, Path(file).parent, folders, source)
    _check_accuracy(pair, source)

    relative = pair.object.state - pair.spacecraft.state
    with input_errors(source):
        found = find_approach(
            np.concatenate([pair.spacecraft.state, relative]),
            trajectory.gravitational_parameter_m3_s2 or 0.0,
            pair.covariance,
            np.array(trajectory.pole),
            trajectory.flight_s,
        )

    with input_errors(f"{source} at {sigmas:g} sigma: uncertainty"):
        box = found.box(sigmas)
    with input_errors(f"{source} with the sensors and the engine of {like.name}"):
        scenario = _scenario(trajectory, like, found, box, target)
        on_board_model(scenario)

    missing = _missing(target)
    warnings = [*pair.spacecraft.warnings, *pair.object.warnings]
    about_states = [*_origins(trajectory, pair), *pair.notes, *warnings, *missing]
    text = _text(scenario, found, like.name, sigmas, source, about_states)
    return FoundScenario(scenario, text, [*pair.notes, *missing], warnings)


def _scenario(
    trajectory: Trajectory, like: Scenario, found: Approach, box: StateBox, target: KnownTarget
) -> Scenario:
    """Return a scenario of an approach, with the sensors, the engine and the settings of another.

    The uncertainty and the dispersion are the box.
    """
    body = None
    if target.radius_m is not None:
        body = Body(target.radius_m)
    camera = like.camera
    light = direction_of(found.sun)
    if camera is not None and camera.phase_angle_rad is not None and light is not None:
        camera = replace(
            camera,
            phase_angle_rad=math.radians(light.phase_deg),
            sun_angle_rad=math.radians(light.across_deg),
        )
    information_set = replace(
        like.information_set,
        disturbance_m_s2=target.disturbance_m_s2 or 0.0,
        disturbance_y_m_s2=None,
    )
    # The state of the approach is (y, z, x), and then the speeds along y, z and x.
    return replace(
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
        target=None,
        body=body,
        camera=camera,
        information_set=information_set,
    )


def _missing(target: KnownTarget) -> list[str]:
    """Return a line for each value of the target that is not known."""
    lines = []
    if target.radius_m is None:
        lines.append(
            "missing: [body], the radius of the target: no run has a hit without it; add "
            "--body-radius-m"
        )
    if target.disturbance_m_s2 is None:
        lines.append(
            "missing: information_set.disturbance_m_s2, here 0: the guarantee holds only if "
            "nothing but the gravity of [sun] accelerates the target; add --disturbance, for "
            "example 1e-6"
        )
    return lines


def _origins(trajectory: Trajectory, pair: _Pair) -> list[str]:
    """Return where the states come from, and the plane of T and R, one line each."""
    lines = []
    if trajectory.epoch is not None:
        lines.append(f"Epoch: {trajectory.epoch}")
    lines.append(f"Spacecraft: {pair.spacecraft.origin}.")
    lines.append(f"Object: {pair.object.origin}.")

    frames = [
        craft.frame.name for craft in (pair.spacecraft, pair.object) if craft.frame is not None
    ]
    owner = frames[0] if frames else "the states"
    x, y, z = trajectory.pole
    lines.append(
        f"Reference plane of T and R: its normal (pole) is [{x:g}, {y:g}, {z:g}] in the axes of "
        f"{owner}."
    )
    return lines


def _text(
    scenario: Scenario,
    found: Approach,
    like: str,
    sigmas: float,
    source: str,
    about_states: Sequence[str],
) -> str:
    """Return the text of a scenario file, with comments about the approach and about each table."""
    t_km, r_km = (value / 1e3 for value in found.miss_m)
    head = [
        f"The approach of {source}, written by infoset scenarios from-states.",
        "x is along the line of approach (S of the B-plane), y along T, z along R; the origin is "
        "the spacecraft.",
        f"Start: {found.start_s / 86400.0:.6g} d after the epoch, {found.flight_s:.6g} s before "
        "the closest approach.",
        f"Closest approach without impulses: B.T = {t_km:.6g} km, B.R = {r_km:.6g} km.",
        f"Until then gravity changes the closing speed by {found.speed_change_m_s:.3g} m/s and "
        "turns the line of approach by",
        f"{found.turn_rad:.3g} rad; B.T and B.R are in the plane across the line at the start.",
        *map(on_a_screen, about_states),
        f"What is not explained here has the values of {like}: replace them by yours.",
    ]
    comments = _comments(like, sigmas, direction_of(found.sun))
    lines = []
    # Each row of a matrix has its own line.
    for line in to_toml(scenario).replace("], [", "],\n    [").splitlines():
        comment = comments.get(line)
        lines.append(f"{line}  # {comment}" if comment else line)
    return "\n".join([*(f"# {line}" for line in head), *lines]) + "\n"


def _comments(like: str, sigmas: float, light: SunDirection | None) -> dict[str, str]:
    """Return the comments of the tables of a scenario file."""
    camera = f"as {like}; centroid_error_m depends on the size of the target"
    if light is not None:
        camera += f"; by the direction of [sun] {light}"
    comments = {f"[{part.name}]": f"as {like}" for part in fields(Scenario)}
    return comments | {
        "[sun]": (
            "the attracting body, its direction from the spacecraft, and the velocity of the "
            "spacecraft from it"
        ),
        "[uncertainty]": f"known on board: {sigmas:g} sigma around the states",
        "[dispersion]": (
            f"true starts are within {sigmas:g} sigma; those of the covariance beyond are drawn "
            "again"
        ),
        "[covariance]": (
            "of the start, components y, z, x and their rates; lower triangle of the correlations"
        ),
        "[camera]": camera,
        "[body]": "of --body-radius-m",
        "[information_set]": f"as {like}, but the disturbance",
    }


def _pair(trajectory: Trajectory, folder: Path, folders: Sequence[Path], source: str) -> _Pair:
    """Return the states of both craft at the epoch from their sources."""
    crafts = (trajectory.spacecraft, trajectory.object)
    with input_errors(source, kind=InputError):
        messages = {
            craft.oem: _oem(craft.oem, folder, folders) for craft in crafts if craft.oem is not None
        }
        epoch = _epoch(trajectory, is_needed=bool(messages))
        scale = ""
        if epoch is not None:
            scale = craft_state.epoch_scale(epoch, list(messages.values()))

        states = []
        for craft in crafts:
            if craft.oem is not None and epoch is not None:
                state = craft_state.oem_craft(
                    messages[craft.oem],
                    craft.oem,
                    epoch,
                    scale,
                    trajectory.gravitational_parameter_m3_s2 or 0.0,
                    with_covariance=trajectory.covariance is None,
                )
            elif craft.spice is not None:
                state = _spice_craft(trajectory, craft.spice, epoch, scale, folder, folders)
            else:
                state = CraftState(np.array([craft.position_m, craft.velocity_m_s]), source)
            states.append(state)

    one, other = states
    craft_state.need_same_axes(one, other, source)
    covariance, from_files = _covariance(trajectory, one, other, source)
    notes = [*one.notes, *other.notes, *craft_state.axes_note(one, other), *from_files]
    if epoch is not None:
        wanted = [segment.scale for segments in messages.values() for segment in segments]
        if any(craft.spice for craft in crafts):
            wanted.append(KERNEL_SCALE)
        notes += craft_state.time_notes(epoch, scale, wanted)
    return _Pair(one, other, covariance, notes)


def _oem(name: str, folder: Path, folders: Sequence[Path]) -> list[OemSegment]:
    """Return the segments of the OEM file that a trajectory file in a folder names."""
    return read_oem(read_input(named_file(name, folder, folders), MAX_OEM_BYTES), name)


def _epoch(trajectory: Trajectory, *, is_needed: bool) -> Epoch | None:
    """Return the epoch; None without one, or if only SPICE may be able to read it.

    `is_needed` refuses the latter.
    """
    if trajectory.epoch is None:
        return None
    try:
        return parse_epoch(trajectory.epoch)
    except ValueError as error:
        if is_needed:
            raise InputError(f"epoch: {trajectory.epoch} {error}") from None
        return None


def _spice_craft(
    trajectory: Trajectory,
    body: str,
    epoch: Epoch | None,
    scale: str,
    folder: Path,
    folders: Sequence[Path],
) -> CraftState:
    """Return the state of a body of SPICE kernels.

    Without an `epoch`, SPICE reads the text, which `parse_epoch` does not know.
    """
    files = kernels.kernel_files(trajectory.kernels, folder, folders)
    with kernels.loaded(files) as spice:
        if epoch is None:
            time_s = spice.str2et(trajectory.epoch)
        else:
            with input_errors("epoch"):
                time_s = float(converted(epoch, scale, KERNEL_SCALE))
        state = kernels.kernel_state(spice, body, time_s, trajectory.frame, trajectory.centre)

    return CraftState(
        state=state,
        source=f"spice {body}",
        centre=centre_name(trajectory.centre),
        frame=frame_of_spice(trajectory.frame),
        origin=f"body {body} of SPICE kernels, {trajectory.frame}",
    )


def _covariance(
    trajectory: Trajectory, one: CraftState, other: CraftState, source: str
) -> tuple[Floats, list[str]]:
    """Return the covariance of the relative state, and a line about OEM files that give it."""
    if trajectory.covariance is not None:
        return trajectory.covariance.matrix, []
    found = {}
    texts = []
    for craft in (one, other):
        if craft.covariance is not None:
            found[craft.source] = craft.covariance
            texts.append(f"{craft.source} (axes: {craft.covariance_frame})")

    if not found:
        raise InputError(
            f"{source}: covariance: is missing, and the OEM files have none; write the table "
            "[covariance]"
        )

    named = " and ".join(texts)
    if len(found) == 1:
        note = f"covariance: that of {named}; the other state is taken as exact"
    else:
        note = f"covariance: the sum of those of {named}, taken as independent"

    total = np.sum([*found.values()], axis=0)
    rows = tuple(map(tuple, total.tolist()))
    try:
        covariance = Covariance(matrix_m2=rows)
    except ValueError as error:
        reason = str(error).removeprefix("Covariance: ")
        raise InputError(f"{source}: covariance of {' and '.join(found)}: {reason}") from None

    return covariance.matrix, [note]


def _check_accuracy(pair: _Pair, source: str) -> None:
    """Refuse states whose interpolation has greater errors than the covariance claims."""
    errors = pair.spacecraft.error + pair.object.error
    variances = pair.covariance.diagonal()
    # The first three are of the position, the others of the velocity.
    claimed = np.sqrt([variances[:3].sum(), variances[3:].sum()])
    if (errors <= claimed).all():
        return
    raise InputError(
        f"{source}: the interpolation has errors of about {errors[0]:.3g} m and {errors[1]:.3g} "
        f"m/s, more than the standard deviations of the covariance, {claimed[0]:.3g} m and "
        f"{claimed[1]:.3g} m/s: give tables with shorter steps, or a covariance that contains "
        "these errors"
    )
