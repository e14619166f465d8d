"""A rendezvous from the states of two craft in orbit ephemeris messages (OEM)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from infoset.experiments.common.ephemeris.craft_state import (
    CraftState,
    epoch_scale,
    need_same_axes,
    oem_craft,
    time_notes,
)
from infoset.experiments.common.ephemeris.epochs import parse_epoch
from infoset.experiments.common.ephemeris.frames import centre_name
from infoset.experiments.common.ephemeris.oem import MAX_OEM_BYTES, OemSegment, read_oem
from infoset.experiments.common.errors import InputError, input_errors, on_a_screen, shown
from infoset.experiments.common.input_file import read_file, read_input, to_toml
from infoset.experiments.common.orbit_checks import EARTH_M3_S2, check_orbit
from infoset.experiments.reachability.file import Orbit, Rendezvous, Start
from infoset.rendezvous.reachability import MotionModel
from infoset.rendezvous.relative_motion import hill_state
from infoset.rendezvous.two_body import conic_shape, semi_major_axis_m

GRAVITATIONAL_PARAMETERS_M3_S2 = {
    "SUN": 1.3271244004127942e20,
    "EARTH": EARTH_M3_S2,
    "MOON": 4.9028001184575496e12,
    "MARS": 4.282837362069909e13,
}
"""Gravitational parameters of centres; those of others than the Earth are of the ephemeris DE440.

NAIF, gm_de440.tpc.
"""


class FoundProblem(NamedTuple):
    """The problem of two states, its file, and notes and warnings about the states."""

    problem: Rendezvous
    text: str
    notes: list[str]
    warnings: list[str]


class _TwoCraft(NamedTuple):
    """The states of the active and of the passive craft, and notes about them."""

    chaser: CraftState
    target: CraftState
    notes: list[str]


def problem_of(
    chaser: Path,
    target: Path,
    epoch: str,
    like: str,
    settings: Sequence[str] | None = None,
    mu_m3_s2: float | None = None,
    name: str | None = None,
) -> FoundProblem:
    """Return a rendezvous whose t = 0 is an epoch of two OEM files.

    Its model is the motion about the osculating ellipse of the passive craft.

    Parameters
    ----------
    chaser, target : Path
        OEM files of the active and of the passive craft.
    epoch : str
        The epoch; without a time scale it is in that of the files.
    like : str
        The problem from which all but the orbit, the start and the model are taken: a built-in name
        or a file.
    settings : sequence of str or None
        KEY=VALUE: values that replace those of this problem.
    mu_m3_s2 : float or None
        The gravitational parameter. None is that of the centre of the files.
    name : str or None
        The name of the problem. None is that of the other problem.

    Raises
    ------
    InputError
        If a file is invalid, the files do not fit together, or the start breaks a constraint.
    """
    model = read_file(Rendezvous, like, settings)
    epoch = " ".join(epoch.split())
    files = [read_oem(read_input(file, MAX_OEM_BYTES), str(file)) for file in (chaser, target)]
    if mu_m3_s2 is None:
        mu_m3_s2 = _gravitational_parameter(files)
    craft = _craft_at(epoch, chaser, target, files, mu_m3_s2)

    position, velocity = craft.target.state
    with input_errors(str(target)):
        check_orbit("the state at the epoch", (position, velocity), mu_m3_s2)
    shape = conic_shape(position, velocity, mu_m3_s2)
    orbit = Orbit(
        semi_major_axis_m=semi_major_axis_m(position, velocity, mu_m3_s2),
        eccentricity=shape.eccentricity,
        true_anomaly_rad=shape.true_anomaly_rad,
        gravitational_parameter_m3_s2=mu_m3_s2,
    )
    x, y, z, vx, vy, vz = hill_state(craft.chaser.state, craft.target.state).tolist()
    start = Start(position_m=(x, y, z), velocity_m_s=(vx, vy, vz))

    with input_errors(
        f"{chaser} and {target} with the values of {like}",
        "; change them with --set KEY=VALUE, or take another problem with --like",
    ):
        problem = replace(
            model,
            name=name or model.name,
            description=f"As {model.name}, from two states at {epoch}",
            model=MotionModel.TIME_VARYING,
            orbit=orbit,
            initial=start,
        )

    warnings = [*craft.chaser.warnings, *craft.target.warnings]
    head = [
        f"Written by infoset problems from-states from the states at {epoch}.",
        *craft.notes,
        *warnings,
        "[orbit] is the osculating ellipse of the passive craft, and [initial] the active one in",
        "Hill's axes: x radially outward, y along the motion, z along the orbit's normal.",
        f"All other values are those of {like}: replace them by yours.",
    ]
    lines = [f"# {on_a_screen(line)}" for line in head]
    text = "\n".join([*lines, to_toml(problem)])
    return FoundProblem(problem, text, craft.notes, warnings)


def _gravitational_parameter(files: Sequence[Sequence[OemSegment]]) -> float:
    """Return the gravitational parameter of the centre that all segments have, m^3/s^2."""
    centres = sorted(
        {centre_name(segment.metadata["CENTER_NAME"]) for file in files for segment in file}
    )
    if len(centres) > 1:
        raise InputError(
            f"CENTER_NAME: the files have the centres {', '.join(centres)}; convert them to one, "
            "or remove the segments of the others"
        )
    known = GRAVITATIONAL_PARAMETERS_M3_S2.get(centres[0])
    if known is None:
        raise InputError(
            f"CENTER_NAME: the gravitational parameter of {centres[0]} is not known; give it with "
            "--gravitational-parameter, in m^3/s^2"
        )
    return known


def _craft_at(
    epoch: str,
    chaser: Path,
    target: Path,
    files: Sequence[Sequence[OemSegment]],
    mu_m3_s2: float,
) -> _TwoCraft:
    """Return the states of both craft, whose `files` are in the same order, at an epoch."""
    try:
        time = parse_epoch(epoch)
    except ValueError as error:
        raise InputError(f"--epoch: {shown(epoch)} {error}") from None
    scale = epoch_scale(time, files)
    active, passive = (
        oem_craft(segments, str(file), time, scale, mu_m3_s2, with_covariance=False)
        for segments, file in zip(files, (chaser, target), strict=True)
    )
    need_same_axes(active, passive, "states")

    scales = [segment.scale for file in files for segment in file]
    notes = [
        f"active craft: {active.origin}",
        f"passive craft: {passive.origin}",
        *active.notes,
        *passive.notes,
        *time_notes(time, scale, scales),
    ]
    return _TwoCraft(active, passive, notes)
