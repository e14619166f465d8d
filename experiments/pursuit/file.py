"""Problem files of kind `pursuit-evasion`: tables, checks, and the game in SI.

Numbers stay decimal, as written: they are rounded once, when they are converted to SI.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike
from pydantic import PlainValidator

from experiments.common.errors import InputError
from experiments.common.problem_file import ProblemTables, ReadProblem, orbit_problems, problem_form
from experiments.common.toml_file import load_tables
from experiments.common.toml_form import Known, Problem
from experiments.common.toml_values import (
    KILO,
    NUMBER,
    ONE,
    ZERO,
    Degrees,
    Name,
    NotNegative,
    Number,
    Positive,
    Table,
    Vector,
    key,
    radians,
    si,
    wrong,
)
from rendezvous.pursuit_evasion import Game, Gravity, Player
from rendezvous.two_body import OrbitalElements

KIND = "pursuit-evasion"
SUSPICIOUSLY_SMALL_KM = Decimal(100)
SUSPICIOUSLY_GREAT_MU = Decimal("1e12")
EARTH_RADIUS_KM = Decimal("6378.137")

PLAYERS = ("pursuer", "evader")
RATIOS = ("phase_deg", "thrust_ratio", "mass_ratio")
"""Parameters of a map in addition to the keys: lead of the evader in true longitude, its thrust and mass by the
pursuer's."""
STATE = ("position_km", "velocity_km_s")
_LONGITUDE = ("raan_deg", "argument_of_perigee_deg", "true_anomaly_deg")
ELEMENTS = ("semi_major_axis_km", "eccentricity", "inclination_deg", *_LONGITUDE)
_TOP = ("capture_radius_km", "gravitational_parameter_km3_s2", "j2", "longest_s")
_OF_PLAYER = (*ELEMENTS, "mass_kg", "dry_mass_kg", "thrust_N", "specific_impulse_s")
_SETTABLE = (*_TOP, *(f"{player}.{name}" for player in PLAYERS for name in _OF_PLAYER))


def _ellipse_axis(value: object) -> Decimal:
    number = NUMBER(value)
    if number <= ZERO:
        raise wrong("must be greater than 0: a negative one is a hyperbola, and each player must start on an ellipse")
    return number


def _ellipse_eccentricity(value: object) -> Decimal:
    number = Number(least=ZERO)(value)
    if number >= ONE:
        raise wrong("must be less than 1: from 1 on the orbit is a parabola, a hyperbola or a fall along a line")
    return number


Axis = Annotated[Decimal, PlainValidator(_ellipse_axis)]
Eccentricity = Annotated[Decimal, PlainValidator(_ellipse_eccentricity)]
Inclination = Annotated[Decimal, PlainValidator(Number(least=ZERO, most=Decimal(180)))]
Oblateness = Annotated[Decimal, PlainValidator(Number(least=Decimal("-0.1"), most=Decimal("0.1")))]


class PlayerTable(Table):
    """[pursuer] and [evader]."""

    semi_major_axis_km: Axis | None = key("semi-major axis", "42166.0", default=None)
    eccentricity: Eccentricity | None = key("eccentricity", "0.00013", "0.00016", default=None)
    inclination_deg: Inclination | None = key("inclination", "1.565", "0.828", default=None)
    raan_deg: Degrees | None = key("right ascension of the ascending node", "47.0", "79.0", default=None)
    argument_of_perigee_deg: Degrees | None = key("argument of perigee", "0.0", default=None)
    true_anomaly_deg: Degrees | None = key("true anomaly", "350.0", "309.0", default=None)
    position_km: Vector | None = key(
        "in place of the elements: position, inertial axes, z along the planet's axis",
        "[42166.0, 0.0, 0.0]",
        default=None,
    )
    velocity_km_s: Vector | None = key("velocity in the same axes", "[0.0, 3.07, 0.0]", default=None)
    mass_kg: Positive = key("initial mass, with propellant", "2000.0")
    dry_mass_kg: NotNegative = key("mass without propellant", "1000.0")
    thrust_newton: NotNegative = key("thrust; 0 for an evader that coasts", "20.0", "10.0", alias="thrust_N")
    specific_impulse_s: Positive = key("specific impulse", "350.0")


class PursuitTables(ProblemTables):
    """A problem file of kind `pursuit-evasion`."""

    name: Name = key("name of the results", '"my-pursuit"', default="pursuit")
    gravitational_parameter_km3_s2: Positive = key("gravitational parameter of the planet", "398600.4418")
    planet_radius_km: NotNegative = key("the orbits stay above it", "6378.137", default=EARTH_RADIUS_KM)
    j2: Oblateness = key("second zonal harmonic, for example 1.08262668e-3 for the Earth", "0.0", default=ZERO)
    equatorial_radius_km: Positive | None = key(
        "radius that j2 refers to; needed only if j2 is not 0", "6378.1363", default=None
    )
    capture_radius_km: NotNegative = key("distance of a capture; 0 for the same point", "0.0", default=ZERO)
    longest_s: Positive | None = key(
        "longest game searched; without this key: 15 revolutions", "200000.0", default=None
    )
    pursuer: PlayerTable = key("the pursuer, which minimizes the time of capture", "")
    evader: PlayerTable = key("the evader, which maximizes the time of capture", "")


class PursuitProblem(ReadProblem[PursuitTables]):
    """A problem as read."""

    def game(self, changes: Mapping[str, float] | None = None) -> Game:
        """Return the game in SI, with `changes` of values by parameter, in the unit of its name.

        Raise `ValueError` if a value is impossible.
        """
        return _game(self.tables, changes or {})

    def warnings(self) -> Iterator[str]:
        """Yield a line for each value that is allowed but probably in a wrong unit."""
        mu = self.tables.gravitational_parameter_km3_s2
        if mu > SUSPICIOUSLY_GREAT_MU:
            yield f"gravitational_parameter_km3_s2 is {mu}, larger than that of the Sun; is it in m^3/s^2?"
        for name in PLAYERS:
            axis = getattr(self.tables, name).semi_major_axis_km
            if axis is not None and axis < SUSPICIOUSLY_SMALL_KM:
                yield f"{name}.semi_major_axis_km is {axis}, less than 100 km; is it in another unit?"


def _checks(known: Known) -> Iterator[Problem]:
    """Check the values against each other."""
    for name in PLAYERS:
        if not isinstance(known.document.get(name), dict):
            continue
        yield from _check_start(known, name)
        dry, mass = known.number(name, "dry_mass_kg"), known.number(name, "mass_kg")
        if dry is not None and mass is not None and dry >= mass:
            yield Problem(
                (name, "dry_mass_kg"),
                f"must be below {name}.mass_kg, {mass}, found {dry}",
                "mass_kg is the initial mass, with propellant",
            )
    if known.number("pursuer", "thrust_N") == 0:
        yield Problem(("pursuer", "thrust_N"), "must be greater than 0, found 0", "the pursuer needs thrust")
    path = ("equatorial_radius_km",)
    if known.number("j2") and known.value(*path) is None and path not in known.bad:
        yield Problem(path, "is missing", "j2 refers to it, for example equatorial_radius_km = 6378.1363")
    yield from _check_orbits(known)


def _check_start(known: Known, name: str) -> Iterator[Problem]:
    """Check that a start is complete, by elements or by a state."""
    table = known.document[name]
    elements = [element for element in ELEMENTS if element in table]
    state = [vector for vector in STATE if vector in table]
    if elements and state:
        yield Problem(
            (name, state[0]),
            f"is given together with {elements[0]}",
            "give either the orbital elements or position_km and velocity_km_s",
        )
        return
    missing = [wanted for wanted in (STATE if state else ELEMENTS) if wanted not in table]
    if missing:
        others = f", and so are {', '.join(missing[1:])}" if len(missing) > 1 else ""
        remedy = f"give {', '.join(ELEMENTS)}, or position_km and velocity_km_s"
        yield Problem((name, missing[0]), f"is missing{others}", remedy)


def _check_orbits(known: Known) -> Iterator[Problem]:
    """Check both orbits, and the distance between the players."""
    mu, planet = known.number("gravitational_parameter_km3_s2"), known.number("planet_radius_km")
    if mu is None or ("planet_radius_km",) in known.bad:
        return
    mu_si, planet_m = si(mu, 3 * KILO), si(EARTH_RADIUS_KM if planet is None else planet, KILO)
    positions = {}
    for name in PLAYERS:
        start = _start(known, name, mu_si)
        if start is None:
            continue
        positions[name] = np.asarray(start[0], dtype=float)
        axis_km = known.number(name, "semi_major_axis_km")
        path = (name, "position_km" if axis_km is None else "semi_major_axis_km")
        remedy = "choose an orbit above the planet, in kilometres, or correct planet_radius_km"
        yield from orbit_problems(path, start, mu_si, remedy, planet_m)
    if len(positions) < len(PLAYERS):
        return
    distance_m, radius = math.dist(*positions.values()), known.number("capture_radius_km")
    if distance_m == 0.0:
        by_state = known.value("evader", "true_anomaly_deg") is None
        where = ("evader", "position_km" if by_state else "true_anomaly_deg")
        yield Problem(where, "puts the evader where the pursuer is", "move one of the two")
    elif radius is not None and distance_m <= si(radius, KILO):
        yield Problem(
            ("capture_radius_km",),
            f"must be below the distance at the start, {distance_m / 1e3:.6g} km, found {radius}",
            "make it smaller, or start farther apart",
        )


def _start(known: Known, name: str, mu_si: float) -> tuple[ArrayLike, ArrayLike] | None:
    """Return position and velocity of a player in SI, or None if a value is invalid."""
    table = known.document.get(name)
    if not isinstance(table, dict):
        return None
    if all(vector in table for vector in STATE):
        position, velocity = (known.value(name, vector) for vector in STATE)
        if not isinstance(position, list) or not isinstance(velocity, list):
            return None
        return [si(Decimal(x), KILO) for x in position], [si(Decimal(v), KILO) for v in velocity]
    numbers = {element: known.number(name, element) for element in ELEMENTS}
    if any(value is None for value in numbers.values()):
        return None
    return _state({element: float(value or 0) for element, value in numbers.items()}, mu_si)


FORM = problem_form(KIND, PursuitTables, _checks, [f"{player}.{element}" for player in PLAYERS for element in ELEMENTS])


def load_pursuit(name_or_path: str, settings: Sequence[str] | None = None) -> PursuitProblem:
    """Read a built-in problem by its name or a file by its path, with settings KEY=VALUE in place of its values.

    Raises
    ------
    InputError
        If there is no such problem, or it is not sound.
    """
    return PursuitProblem(load_tables(FORM, name_or_path, settings), name_or_path)


def parameter_names() -> list[str]:
    """Return the parameters that a map may vary."""
    return [*RATIOS, *_SETTABLE]


def _state(elements: Mapping[str, float], mu_si: float) -> tuple[ArrayLike, ArrayLike]:
    angles = [radians(Decimal(repr(float(elements[name])))) for name in ELEMENTS[2:]]
    orbit = OrbitalElements(elements["semi_major_axis_km"] * 1e3, elements["eccentricity"], *angles)
    return orbit.state(mu_si)


def _game(tables: PursuitTables, changes: Mapping[str, float]) -> Game:
    document = tables.model_dump(by_alias=True)
    top = {name: math.inf if document[name] is None else float(document[name]) for name in _TOP}
    of_player = {
        player: {name: float(document[player][name]) for name in _OF_PLAYER if document[player][name] is not None}
        for player in PLAYERS
    }
    for name, value in changes.items():
        if name not in RATIOS:
            table, _, own = name.rpartition(".")
            (of_player[table] if table else top)[own] = value
    pursuer, evader = of_player.values()
    if "phase_deg" in changes:
        if not all(angle in player for player in (pursuer, evader) for angle in _LONGITUDE):
            raise InputError("phase_deg: both players must be given by orbital elements; vary other keys instead")
        lead = sum(pursuer[angle] for angle in _LONGITUDE) + changes["phase_deg"]
        evader["true_anomaly_deg"] = (lead - evader["raan_deg"] - evader["argument_of_perigee_deg"]) % 360.0
    if "thrust_ratio" in changes:
        evader["thrust_N"] = changes["thrust_ratio"] * pursuer["thrust_N"]
    if "mass_ratio" in changes:
        evader["mass_kg"] = changes["mass_ratio"] * pursuer["mass_kg"]
    mu_si = top["gravitational_parameter_km3_s2"] * 1e9
    gravity = Gravity(
        parameter_m3_s2=mu_si,
        planet_radius_m=tables.si("planet_radius_km"),
        j2=top["j2"],
        equatorial_radius_m=tables.si("equatorial_radius_km") or 0.0,
    )
    return Game(
        gravity,
        _player(tables.pursuer, pursuer, mu_si),
        _player(tables.evader, evader, mu_si),
        capture_radius_m=top["capture_radius_km"] * 1e3,
        longest_s=top["longest_s"],
    )


def _player(table: PlayerTable, values: Mapping[str, float], mu_si: float) -> Player:
    if table.position_km is not None:
        x, y, z, vx, vy, vz = table.si_numbers(*STATE)
    else:
        (x, y, z), (vx, vy, vz) = (np.asarray(vector).tolist() for vector in _state(values, mu_si))
    return Player(
        position_m=(x, y, z),
        velocity_m_s=(vx, vy, vz),
        mass_kg=values["mass_kg"],
        dry_mass_kg=values["dry_mass_kg"],
        thrust_n=values["thrust_N"],
        specific_impulse_s=values["specific_impulse_s"],
    )
