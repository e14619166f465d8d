"""Pursuit-evasion problems: TOML as a person writes it, to the game in SI."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from typing import Any

from experiments.common.errors import InputError
from experiments.common.problem_file import problem_form, problem_hash
from experiments.common.toml_file import Known, Problem, load_tables, read_tables
from experiments.common.toml_values import KILO, LARGEST, nearest, quoted_text, radians, shown, si
from experiments.pursuit.tables import ELEMENTS, KIND, STATE, PlayerTable, PursuitTables
from rendezvous.orbital_elements import OrbitalElements, perigee_m, semi_major_axis_m
from rendezvous.pursuit_evasion import Game, Gravity, Player

SUSPICIOUSLY_SMALL_KM = Decimal(100)
SUSPICIOUSLY_GREAT_KM = Decimal(10_000_000)
SUSPICIOUSLY_GREAT_MU = Decimal("1e12")

PLAYERS = ("pursuer", "evader")
RATIOS = ("phase_deg", "thrust_ratio", "mass_ratio")
"""What a map may vary beside the keys: the evader's lead in true longitude, its thrust and mass by the pursuer's."""

_TOP = ("capture_radius_km", "gravitational_parameter_km3_s2", "j2", "longest_s")
_OWN = (*ELEMENTS, "mass_kg", "dry_mass_kg", "thrust_N", "specific_impulse_s")


@dataclass(frozen=True)
class PursuitProblem:
    """A problem as read.

    Parameters
    ----------
    tables : PursuitTables
    source : str
        What to call it in messages.
    """

    tables: PursuitTables
    source: str

    @property
    def name(self) -> str:
        """Return its name."""
        return self.tables.name

    @property
    def hash(self) -> str:
        """Return a fingerprint of its values."""
        return problem_hash(self.tables)

    def game(self, changes: Mapping[str, float] | None = None) -> Game:
        """Return the game in SI.

        Parameters
        ----------
        changes : mapping of str to float, optional
            Values in place of the file's, by parameter, in the unit of its name.

        Returns
        -------
        Game

        Raises
        ------
        ValueError
            If that is no game.
        """
        return _game(self.tables, changes or {})

    def with_values(self, values: Mapping[str, str]) -> PursuitProblem:
        """Return the problem with some keys set, checked as a file is.

        Parameters
        ----------
        values : mapping of str to str
            Numbers as TOML, by key: ``evader.thrust_N``.

        Returns
        -------
        PursuitProblem

        Raises
        ------
        InputError
            If there is no such key, or the problem is not sound with them.
        """
        if not values:
            return self
        document = _document(self.tables)
        for name, text in values.items():
            table, _, own = name.rpartition(".")
            valid = [*_TOP, *(f"{player}.{each}" for player in PLAYERS for each in _OWN)]
            if name not in valid:
                guess = nearest(name, valid)
                hint = f"did you mean {guess}?" if guess else f"for example {valid[-2]}=5"
                raise InputError(f"--set: there is no {shown(name)} to set; {hint}")
            (document[table] if table else document)[own] = _number_text(name, text)
        return read_problem(_toml(document), f"{self.source} with --set")

    def to_toml(self) -> str:
        """Return it as a file that reads back as the same problem."""
        return _toml(_document(self.tables))

    def warnings(self) -> list[str]:
        """Return what is allowed but probably not meant, a line each."""
        return list(_suspicions(self.tables))


def _checks(known: Known) -> Iterator[Problem]:
    """Check what values must be to one another."""
    for name in PLAYERS:
        if not isinstance(known.document.get(name), dict):
            continue
        yield from _check_start(known, name)
        dry, mass = known.number(name, "dry_mass_kg"), known.number(name, "mass_kg")
        if dry is not None and mass is not None and dry >= mass:
            yield Problem(
                (name, "dry_mass_kg"),
                f"must be below {name}.mass_kg, {mass}, found {dry}",
                "mass_kg is that of the start, propellant and all",
            )
    if known.number("pursuer", "thrust_N") == 0:
        yield Problem(("pursuer", "thrust_N"), "must be greater than 0, found 0", "without thrust there is no pursuit")
    j2 = known.number("j2")
    if j2 is not None and j2 != 0 and known.value("equatorial_radius_km") is None:
        path = ("equatorial_radius_km",)
        if path not in known.bad:
            yield Problem(path, "is missing", "j2 refers to it, for example equatorial_radius_km = 6378.1363")
    yield from _check_orbits(known)


def _check_start(known: Known, name: str) -> Iterator[Problem]:
    """A start is given by elements or by a state, and wholly."""
    table = known.document[name]
    elements = [each for each in ELEMENTS if each in table]
    state = [each for each in STATE if each in table]
    if elements and state:
        yield Problem(
            (name, state[0]),
            f"is given beside {elements[0]}",
            "give the start by orbital elements or by position_km and velocity_km_s, not by both",
        )
        return
    wanted = STATE if state else ELEMENTS
    missing = [each for each in wanted if each not in table]
    if missing:
        yield Problem(
            (name, missing[0]),
            "is missing" if len(missing) == 1 else f"is missing, and so are {', '.join(missing[1:])}",
            f"a start is {', '.join(ELEMENTS)}, or position_km and velocity_km_s",
        )


def _check_orbits(known: Known) -> Iterator[Problem]:
    """Check both orbits, and one against the other, as far as their values are sound."""
    mu, planet = known.number("gravitational_parameter_km3_s2"), known.number("planet_radius_km")
    if mu is None or ("planet_radius_km",) in known.bad:
        return
    mu_si = si(mu, 3 * KILO)
    planet_m = si(planet if planet is not None else PursuitTables.model_fields["planet_radius_km"].default, KILO)
    states = {}
    for name in PLAYERS:
        start = _start(known, name, mu_si)
        if start is None:
            continue
        states[name] = start
        where = (name, "semi_major_axis_km" if known.value(name, "semi_major_axis_km") is not None else "position_km")
        problem = _orbit_problem(start, mu_si, planet_m)
        if problem is not None:
            remedy = "give an orbit above the planet, or its planet_radius_km"
            axis = known.number(name, "semi_major_axis_km")
            if axis is not None and axis < SUSPICIOUSLY_SMALL_KM:
                problem += f"; a semi-major axis of {axis} km is suspiciously small"
                remedy = "is it in other units? planets' radii, for one, or thousands of kilometres: write kilometres"
            yield Problem(where, problem, remedy)
    if len(states) < 2:
        return
    (p, _), (e, _) = states["pursuer"], states["evader"]
    apart_m = math.dist(p, e)
    radius = known.number("capture_radius_km")
    if apart_m == 0.0:
        where = (
            "evader",
            "true_anomaly_deg" if known.value("evader", "true_anomaly_deg") is not None else "position_km",
        )
        yield Problem(where, "puts the evader where the pursuer is", "the game is over then: change one of the two")
    elif radius is not None and apart_m <= si(radius, KILO):
        yield Problem(
            ("capture_radius_km",),
            f"must be below the distance at the start, {apart_m / 1e3:.6g} km, found {radius}",
            "make it smaller, or begin farther apart",
        )


def _start(known: Known, name: str, mu_si: float) -> tuple[Any, Any] | None:
    """Return position and velocity of a player, in SI, if they are sound."""
    if not isinstance(known.document.get(name), dict):
        return None
    if all(each in known.document[name] for each in STATE):
        vectors = [known.value(name, each) for each in STATE]
        if not all(isinstance(vector, list) for vector in vectors):
            return None
        position, velocity = (
            [si(Decimal(each), KILO) for each in vector] for vector in vectors if isinstance(vector, list)
        )
        return position, velocity
    numbers = {each: known.number(name, each) for each in ELEMENTS}
    if any(value is None for value in numbers.values()):
        return None
    return _state({each: float(value or 0) for each, value in numbers.items()}, mu_si)


def _orbit_problem(start: tuple[Any, Any], mu_si: float, planet_m: float) -> str | None:
    import numpy as np

    position, velocity = np.asarray(start[0], dtype=float), np.asarray(start[1], dtype=float)
    if not position.any():
        return "is the centre of the planet"
    axis = semi_major_axis_m(position, velocity, mu_si)
    if not 0.0 < axis < math.inf:
        return "is a start on a parabola or a hyperbola: the velocity is that of escape or more"
    perigee = perigee_m(position, velocity, mu_si)
    if perigee <= 1e-6 * axis:
        return "is a start of a fall along a line through the planet's centre"
    if perigee <= planet_m:
        return (
            f"gives an orbit into the planet: its perigee is {perigee / 1e3:.6g} km from the centre, and the planet's "
            f"radius {planet_m / 1e3:.6g} km"
        )
    return None


FORM = problem_form(KIND, PursuitTables, _checks)


def load_pursuit(name_or_path: str) -> PursuitProblem:
    """Read a built-in problem or a file.

    Parameters
    ----------
    name_or_path : str

    Returns
    -------
    PursuitProblem

    Raises
    ------
    InputError
        If there is no such problem, or it is not sound.
    """
    return PursuitProblem(load_tables(FORM, name_or_path), name_or_path)


def read_problem(text: str, source: str) -> PursuitProblem:
    """Check the text of a problem.

    Parameters
    ----------
    text : str
        TOML.
    source : str
        What to call it in messages.

    Returns
    -------
    PursuitProblem

    Raises
    ------
    InputError
        If it is not sound.
    """
    return PursuitProblem(read_tables(FORM, text, source), source)


def parameter_names() -> list[str]:
    """Return what a map may vary."""
    return [*RATIOS, *_TOP, *(f"{player}.{each}" for player in PLAYERS for each in _OWN)]


def _state(elements: Mapping[str, float], mu_si: float) -> tuple[Any, Any]:
    angles = [radians(Decimal(repr(float(elements[each])))) for each in ELEMENTS[2:]]
    orbit = OrbitalElements(elements["semi_major_axis_km"] * 1e3, elements["eccentricity"], *angles)
    return orbit.state(mu_si)


def _game(tables: PursuitTables, changes: Mapping[str, float]) -> Game:
    top = {
        "gravitational_parameter_km3_s2": float(tables.gravitational_parameter_km3_s2),
        "j2": float(tables.j2),
        "capture_radius_km": float(tables.capture_radius_km),
        "longest_s": math.inf if tables.longest_s is None else float(tables.longest_s),
    }
    own = {"pursuer": _values(tables.pursuer), "evader": _values(tables.evader)}
    for name, value in changes.items():
        table, _, field = name.rpartition(".")
        if table:
            own[table][field] = value
        elif name in top:
            top[name] = value
    pursuer, evader = own["pursuer"], own["evader"]
    longitude = ("raan_deg", "argument_of_perigee_deg", "true_anomaly_deg")
    if "phase_deg" in changes:
        if not all(each in player for player in (pursuer, evader) for each in longitude):
            raise InputError("phase_deg: both players must be given by orbital elements; vary other keys instead")
        lead = sum(pursuer[each] for each in longitude) + changes["phase_deg"]
        evader["true_anomaly_deg"] = (lead - evader["raan_deg"] - evader["argument_of_perigee_deg"]) % 360.0
    if "thrust_ratio" in changes:
        evader["thrust_N"] = changes["thrust_ratio"] * pursuer["thrust_N"]
    if "mass_ratio" in changes:
        evader["mass_kg"] = changes["mass_ratio"] * pursuer["mass_kg"]
    mu_si = top["gravitational_parameter_km3_s2"] * 1e9
    radius = tables.equatorial_radius_km
    gravity = Gravity(
        parameter_m3_s2=mu_si,
        planet_radius_m=si(tables.planet_radius_km, KILO),
        j2=top["j2"],
        equatorial_radius_m=0.0 if radius is None else si(radius, KILO),
    )
    return Game(
        gravity,
        _player(tables.pursuer, pursuer, mu_si),
        _player(tables.evader, evader, mu_si),
        capture_radius_m=top["capture_radius_km"] * 1e3,
        longest_s=top["longest_s"],
    )


def _values(table: PlayerTable) -> dict[str, float]:
    named = {"thrust_N": table.thrust_newton}
    values = {each: named.get(each, getattr(table, each, None)) for each in _OWN}
    return {each: float(value) for each, value in values.items() if value is not None}


def _player(table: PlayerTable, values: Mapping[str, float], mu_si: float) -> Player:
    if table.position_km is not None and table.velocity_km_s is not None:
        position = [si(each, KILO) for each in table.position_km]
        velocity = [si(each, KILO) for each in table.velocity_km_s]
    else:
        position, velocity = _state(values, mu_si)
    return Player(
        position_m=(float(position[0]), float(position[1]), float(position[2])),
        velocity_m_s=(float(velocity[0]), float(velocity[1]), float(velocity[2])),
        mass_kg=values["mass_kg"],
        dry_mass_kg=values["dry_mass_kg"],
        thrust_n=values["thrust_N"],
        specific_impulse_s=values["specific_impulse_s"],
    )


def _suspicions(tables: PursuitTables) -> Iterator[str]:
    if tables.gravitational_parameter_km3_s2 > SUSPICIOUSLY_GREAT_MU:
        yield (
            f"gravitational_parameter_km3_s2 is {tables.gravitational_parameter_km3_s2}, more than the Sun's: "
            "is it in m^3/s^2?"
        )
    for name in PLAYERS:
        axis = getattr(tables, name).semi_major_axis_km
        if axis is not None and axis < SUSPICIOUSLY_SMALL_KM:
            yield f"{name}.semi_major_axis_km is {axis}, less than 100 km: is it in other units?"
        if axis is not None and axis > SUSPICIOUSLY_GREAT_KM:
            yield f"{name}.semi_major_axis_km is {axis}, more than ten million: is it in metres?"


def _number_text(name: str, text: str) -> str:
    try:
        number = Decimal(text)
    except InvalidOperation:
        raise InputError(f"--set: {name} must be a number, found {shown(text)}; for example --set {name}=1.5") from None
    if not number.is_finite() or number.copy_abs() > LARGEST:
        raise InputError(f"--set: {name} must be a finite number of ordinary size, found {shown(text)}")
    return str(number)


def _document(tables: PursuitTables) -> dict[str, Any]:
    """Return a problem as the texts of its values."""
    return {name: _written(value) for name, value in tables.model_dump(by_alias=True, exclude_none=True).items()}


def _written(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _written(each) for name, each in value.items()}
    if isinstance(value, tuple | list):
        return "[" + ", ".join(str(each) for each in value) + "]"
    return quoted_text(value) if isinstance(value, str) else str(value)


def _toml(document: Mapping[str, Any]) -> str:
    lines = [f"{name} = {value}" for name, value in document.items() if not isinstance(value, dict)]
    for name, table in document.items():
        if isinstance(table, dict):
            lines += ["", f"[{name}]", *(f"{own} = {value}" for own, value in table.items())]
    return "\n".join(lines) + "\n"
