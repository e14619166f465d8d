"""Tables and keys of a scenario file, with the allowed values.

Numbers stay decimal, as written; the change to SI units rounds them once.
"""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from typing import Annotated, Any

from pydantic import PlainValidator

import guidance
from experiments.common.toml_form import keys_of, tables_of
from experiments.common.toml_values import (
    KILO,
    ZERO,
    Constant,
    DecimalPair,
    Degrees,
    Description,
    Name,
    Number,
    Numbers,
    Pair,
    Positive,
    Table,
    Whole,
    key,
    known_name,
)
from guidance.noise import NoiseKind, TieRule
from guidance.thruster import Thruster
from infoset.limits import POSITIVE, limits_of
from infoset.model import MOST_SECTIONS, InitialSet, Model, Recovery, SetModel, StateBox
from infoset.sensors import SENSORS, AngleSensor, Bias, Convention, ErrorShape, RangeSensor, RateSensor
from sim.draws import MOST_STEPS
from sim.scenario import Body, Manoeuvre, Scenario, Sun, Target

SCHEMA = 1
SPEED_OF_LIGHT_KM_S = Decimal("299792.458")
"""Largest speed of a scenario file."""


def _strategy(value: object) -> str:
    return known_name(value, tuple(guidance.strategy_names()))


_SPEED = Number(least=-SPEED_OF_LIGHT_KM_S, most=SPEED_OF_LIGHT_KM_S)
_APPROACH = Number(below=Decimal(0), least=-SPEED_OF_LIGHT_KM_S)

Elevation = Annotated[Decimal, PlainValidator(Number(least=Decimal(-90), most=Decimal(90)))]
ClosingSpeed = Annotated[Decimal, PlainValidator(Number(above=Decimal(0), most=SPEED_OF_LIGHT_KM_S))]

_NOMINAL_RANGE = Number.of(limits_of(Scenario, "nominal_range_m"), KILO)
_PIXEL = PlainValidator(Number.of(limits_of(AngleSensor, "error_at_zero_range_rad")))

_SPACE = {"space": True}


def _space_key(meaning: str, example: str, default: object = None) -> Any:
    """Describe an optional key that only a scenario in space has."""
    return key(f"{meaning}; in space only", example, default=default, json_schema_extra=_SPACE)


def _pair(field: str, *, fixed: bool = False) -> PlainValidator:
    return PlainValidator(Pair(Number.of(limits_of(StateBox, field), KILO), fixed))


class SunTable(Table, owner=Sun):
    """[sun]."""

    gravitational_parameter_km3_s2: Decimal = key("gravitational parameter of the Sun", "1.324948e11")
    distance_km: Decimal = key("distance of the Sun from the spacecraft at t0", "150.0e6")
    direction_deg: Degrees = key("direction of the Sun at t0, from the x axis toward z", "90.0")
    elevation_deg: Elevation = _space_key("its angle out of the plane (x, z), toward y", "0.0", ZERO)


class NominalTable(Table):
    """[nominal]."""

    range_km: Annotated[Decimal, PlainValidator(_NOMINAL_RANGE)] = key("nominal range at t0", "5801.3")
    closing_speed_km_s: ClosingSpeed = key("closing speed of the on-board model", "58.0")


class UncertaintyTable(Table):
    """[uncertainty]."""

    z_km: Annotated[DecimalPair, _pair("z_m")] = key("position across the approach", "[-10.0, 10.0]")
    x_km: Annotated[DecimalPair, _pair("x_m")] = key("range", "[5301.3, 6301.3]")
    vz_km_s: Annotated[DecimalPair, PlainValidator(Pair(_SPEED))] = key("speed across", "[-0.1, 0.1]")
    vx_km_s: Annotated[DecimalPair, PlainValidator(Pair(_APPROACH))] = key(
        "speed along x; negative, the object approaches", "[-59.0, -57.0]"
    )
    y_km: Annotated[DecimalPair | None, _pair("y_m")] = _space_key(
        "position along the second axis across", "[-10.0, 10.0]"
    )
    vy_km_s: Annotated[DecimalPair | None, PlainValidator(Pair(_SPEED))] = _space_key("speed along it", "[-0.1, 0.1]")


class DispersionTable(Table):
    """[dispersion]."""

    z_km: Annotated[DecimalPair, _pair("z_m", fixed=True)] = key(
        "a pair is a uniform interval, a number is fixed", "[-1.0, 1.0]"
    )
    x_km: Annotated[DecimalPair, _pair("x_m", fixed=True)] = key("range", "[5701.3, 5901.3]")
    vz_km_s: Annotated[DecimalPair, PlainValidator(Pair(_SPEED, fixed=True))] = key("speed across", "[-0.1, 0.1]")
    vx_km_s: Annotated[DecimalPair, PlainValidator(Pair(_APPROACH, fixed=True))] = key(
        "speed along x; negative, the object approaches", "[-58.1, -57.9]"
    )
    y_km: Annotated[DecimalPair | None, _pair("y_m", fixed=True)] = _space_key(
        "position along the second axis across", "[-1.0, 1.0]"
    )
    vy_km_s: Annotated[DecimalPair | None, PlainValidator(Pair(_SPEED, fixed=True))] = _space_key(
        "speed along it", "[-0.1, 0.1]"
    )


class AngleSensorTable(Table, owner=AngleSensor):
    """[angle_sensor]."""

    period_s: Decimal = key("time between measurements, a multiple of guidance.step_s", "0.5")
    error_at_nominal_range_rad: Decimal | None = key("greatest error at nominal.range_km", "0.00015", default=None)
    error_at_zero_range_rad: Decimal | None = key(
        "greatest error at range zero; a straight line joins both", "0.00023", default=None
    )
    pixel_error_rad: Annotated[Decimal, _PIXEL] | None = key(
        "a camera, in place of both errors above: error of an image", "5e-6", default=None
    )
    centroid_error_m: Decimal | None = key(
        "error of the body's centre: a camera adds it divided by the distance", "0.0", default=None
    )
    bias: Bias = key('centroid error of a camera: "random", or "constant" in a run', '"random"', default=Bias.RANDOM)
    first_image_s: Decimal | None = key(
        "first measurement, before the nominal arrival; without it: the start", "90.0", default=None
    )
    last_image_s: Decimal = key("last measurement, before the nominal arrival", "0.0", default=ZERO)
    miss_probability: Decimal = key("probability that a measurement is lost", "0.0", default=ZERO)
    error_at_nominal_range_y_rad: Decimal | None = _space_key(
        "the same for the angle of y; without it: as for z", "0.00015"
    )
    error_at_zero_range_y_rad: Decimal | None = _space_key(
        "the same for the angle of y; without it: as for z", "0.00023"
    )
    convention: Convention = _space_key('which two angles: "plane", "gimbal" or "cone"', '"plane"', Convention.PLANE)
    error_shape: ErrorShape | None = _space_key('errors in a "box" or a "disc"; the set allows for the box', '"box"')


class RangeSensorTable(Table, owner=RangeSensor):
    """[range_sensor]."""

    period_s: Decimal = key("time between measurements, a multiple of guidance.step_s", "2.0")
    relative_error: Decimal = key("greatest error, relative to the range", "0.05")


class RateSensorTable(Table, owner=RateSensor):
    """[rate_sensor]."""

    period_s: Decimal = key("time between measurements, a multiple of guidance.step_s", "1.0")
    error_rad_s: Decimal = key("greatest error of the line of sight's angular rate", "1e-6")


OPTIONAL_SENSORS: Mapping[str, type[Any]] = {f"{kind.name}_sensor": kind for kind in SENSORS if kind is not AngleSensor}
"""Kinds of sensors that a scenario may leave out, by table and field; keys of a table are the fields of the kind."""


class TargetTable(Table, owner=Target):
    """[target]."""

    manoeuvre: Manoeuvre = key('"none", "constant", "bang-bang", "random-telegraph" or "worst-case"', '"bang-bang"')
    acceleration_m_s2: Decimal = key("its acceleration along z", "0.005")
    switching_period_s: Decimal = key(
        "time between changes of sign; their mean time if random", "10.0", default=Decimal(10)
    )
    acceleration_y_m_s2: Decimal | None = _space_key("its acceleration along y; without it: as along z", "0.005")


class BodyTable(Table, owner=Body):
    """[body]."""

    radius_m: Decimal = key("a miss of at most this radius is a hit", "80.0")


class ThrusterTable(Table, owner=Thruster):
    """[thruster]."""

    budget_m_s: Decimal = key("sum of the absolute values of all impulses", "1000.0")
    least_impulse_m_s: Decimal = key("smaller impulses become zero", "0.25")
    greatest_impulse_m_s: Decimal = key("greater impulses are reduced to this one", "7.5")
    execution_error_relative: Decimal = key("greatest relative error of an executed impulse", "0.0", default=ZERO)
    pointing_error_rad: Decimal = _space_key("greatest error of the direction of an impulse", "0.0", ZERO)
    last_impulse_s: Decimal | None = key(
        "last impulse, before the nominal arrival; without it: no cut-off", "2.0", default=None
    )
    impulses_s: Annotated[tuple[Decimal, ...], PlainValidator(Numbers(None, Number.of(POSITIVE)))] = key(
        "impulses, before the nominal arrival; without it: at every step", "[60.0, 20.0, 7.5]", default=()
    )
    delay_steps: Annotated[int, PlainValidator(Whole(MOST_STEPS, least=0))] = key(
        "number of steps from the decision to the impulse", "0", default=0
    )


class GuidanceTable(Table, owner=SetModel):
    """[guidance]."""

    step_s: Decimal = key("step of observation and control", "0.5")
    strategy: Annotated[str, PlainValidator(_strategy)] = key("name of the guidance strategy", '"symmetric-miss"')
    range_threshold_km: Positive = key("sections nearer than this are removed from the set", "5.0")


class InformationSetTable(Table, owner=SetModel):
    """[information_set]."""

    model: Model = key('"guaranteed", which keeps the true state, or "paper", as published', '"guaranteed"')
    initial_set: InitialSet | None = key(
        'section at t0: "rectangle" in (omega, alpha) or "box" in (z, V)', '"box"', default=None
    )
    sections: Annotated[int, PlainValidator(Whole(MOST_SECTIONS))] = key(
        "number of sections: a uniform grid of ranges over uncertainty.x_km", "29"
    )
    fewest_sections: Annotated[int | None, PlainValidator(Whole(MOST_SECTIONS))] = key(
        "if fewer remain: a new grid of 2 fewest_sections + 1 sections", "5", default=None
    )
    recovery: Recovery = key(
        'after a set became empty: "widened" enlarges it, "none" ends guidance', '"widened"', default=Recovery.WIDENED
    )
    disturbance_m_s2: Decimal = key("bound of the unknown acceleration along z, target included", "0.005")
    disturbance_y_m_s2: Decimal | None = _space_key("the same bound along y; without it: as along z", "0.005")


class NoiseTable(Table):
    """[noise]."""

    kind: NoiseKind = key('"random", or "game": errors chosen against the guidance', '"random"')
    tie: TieRule = key(
        'tie rule of game noise: "upper", "lower", "alternate" or "random"', '"upper"', default=TieRule.UPPER
    )


class ScenarioTables(Table):
    """A whole scenario file."""

    schema_number: Constant = key("version of the file format", str(SCHEMA), alias="schema")
    name: Name = key("name in results and files", '"my-scenario"')
    description: Description = key("a line for `infoset scenarios list`", '"What this scenario is about"', default="")
    sun: SunTable | None = key("the Sun, seen from the spacecraft; without this table: no gravity", "", default=None)
    nominal: NominalTable = key("range and closing speed of the on-board model", "")
    uncertainty: UncertaintyTable = key("initial state of the object as known on board", "")
    dispersion: DispersionTable = key("initial true state, unknown on board", "")
    angle_sensor: AngleSensorTable = key("the line-of-sight sensor", "")
    range_sensor: RangeSensorTable | None = key("the range meter; without this table: none", "", default=None)
    rate_sensor: RateSensorTable | None = key(
        "the sensor of the line of sight's rate; without this table: no such sensor", "", default=None
    )
    target: TargetTable | None = key(
        "how the object accelerates; without this table: no acceleration", "", default=None
    )
    body: BodyTable | None = key("the size of the object; without this table: a point", "", default=None)
    thruster: ThrusterTable = key("the engine", "")
    guidance: GuidanceTable = key("how impulses are chosen", "")
    information_set: InformationSetTable = key("the information set", "")
    noise: NoiseTable = key("how measurement errors are chosen", "")


SPACE_KEYS = frozenset(
    (table, name)
    for table in tables_of(ScenarioTables)
    for name, field in keys_of(ScenarioTables, (table,)).items()
    if field.json_schema_extra == _SPACE
)
"""Tables and keys that only a scenario in space has."""
LATER_KEYS = frozenset(
    [("angle_sensor", name) for name in ("bias", "first_image_s", "last_image_s", "miss_probability")]
    + [("thruster", name) for name in ("last_impulse_s", "impulses_s", "delay_steps")]
)
"""Tables and keys that a written file leaves out if they have their default, so that older files stay as they are."""
