"""The tables and keys of a pursuit-evasion problem, and what each value may be.

Numbers stay decimal here, as written: they are rounded once, when they become SI.
"""

from __future__ import annotations

from decimal import Decimal
from typing import Annotated

from pydantic import PlainValidator

from experiments.common.toml_values import (
    NUMBER,
    ONE,
    ZERO,
    Degrees,
    Description,
    Name,
    NotNegative,
    Number,
    Positive,
    Table,
    Vector,
    key,
    wrong,
)

KIND = "pursuit-evasion"
SCHEMA = 1
ELEMENTS = (
    "semi_major_axis_km",
    "eccentricity",
    "inclination_deg",
    "raan_deg",
    "argument_of_perigee_deg",
    "true_anomaly_deg",
)
STATE = ("position_km", "velocity_km_s")
EARTH_RADIUS_KM = Decimal("6378.137")
_MOST_J2 = Decimal("0.1")
_NOT_NEGATIVE = Number(least=ZERO)


def _ellipse_axis(value: object) -> Decimal:
    number = NUMBER(value)
    if number <= ZERO:
        raise wrong("must be greater than 0: a hyperbola's is negative, and neither player may start on one")
    return number


def _ellipse_eccentricity(value: object) -> Decimal:
    number = _NOT_NEGATIVE(value)
    if number >= ONE:
        raise wrong("must be less than 1: from 1 on the orbit is a parabola or a hyperbola, or a fall along a line")
    return number


Axis = Annotated[Decimal, PlainValidator(_ellipse_axis)]
Eccentricity = Annotated[Decimal, PlainValidator(_ellipse_eccentricity)]
Inclination = Annotated[Decimal, PlainValidator(Number(least=ZERO, most=Decimal(180)))]


class PlayerTable(Table):
    """[pursuer] and [evader]."""

    semi_major_axis_km: Axis | None = key("semi-major axis", "42166.0", default=None)
    eccentricity: Eccentricity | None = key("eccentricity", "0.00013", default=None)
    inclination_deg: Inclination | None = key("inclination", "1.565", default=None)
    raan_deg: Degrees | None = key("right ascension of the ascending node", "47.0", default=None)
    argument_of_perigee_deg: Degrees | None = key("argument of perigee", "0.0", default=None)
    true_anomaly_deg: Degrees | None = key("true anomaly", "350.0", default=None)
    position_km: Vector | None = key("position, in place of the elements", "[42166.0, 0.0, 0.0]", default=None)
    velocity_km_s: Vector | None = key("velocity, in place of the elements", "[0.0, 3.07, 0.0]", default=None)
    mass_kg: Positive = key("mass at the start, propellant and all", "2000.0")
    dry_mass_kg: NotNegative = key("mass without propellant", "1000.0")
    thrust_newton: NotNegative = key("thrust; zero for an evader that coasts", "20.0", alias="thrust_N")
    specific_impulse_s: Positive = key("specific impulse", "350.0")


class PursuitTables(Table):
    """A whole pursuit-evasion problem."""

    schema_number: Annotated[int, PlainValidator(lambda value: value)] = key(
        "version of this form of file", str(SCHEMA), alias="schema", default=SCHEMA
    )
    kind: Annotated[str, PlainValidator(lambda value: value)] = key("what kind of problem it is", f'"{KIND}"')
    name: Name = key("what results are called", '"my-pursuit"', default="pursuit")
    description: Description = key("a line for `infoset problems list`", '"Who pursues whom"', default="")
    gravitational_parameter_km3_s2: Positive = key("gravitational parameter of the planet", "398600.4418")
    planet_radius_km: NotNegative = key("no orbit may reach below it", "6378.137", default=EARTH_RADIUS_KM)
    j2: Annotated[Decimal, PlainValidator(Number(least=-_MOST_J2, most=_MOST_J2))] = key(
        "second zonal harmonic", "1.08262668e-3", default=ZERO
    )
    equatorial_radius_km: Positive | None = key("that j2 refers to", "6378.1363", default=None)
    capture_radius_km: NotNegative = key("distance that counts as capture; 0 for a point", "1.0", default=ZERO)
    longest_s: Positive | None = key(
        "how long the game is looked at; 15 revolutions by default", "200000.0", default=None
    )
    pursuer: PlayerTable = key("who hastens the capture", "")
    evader: PlayerTable = key("who delays it", "")
