"""The tables and keys of a scenario file, and what each value may be.

Numbers stay decimal here, as written: they are rounded once, when they become SI.
"""

from __future__ import annotations

import difflib
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
from typing import Annotated, Any, Generic, TypeVar

from pydantic import BaseModel, ConfigDict, Field, PlainValidator
from pydantic_core import PydanticCustomError

import guidance
from guidance.noise import NoiseKind, TieRule
from infoset.model import InitialSet, Model
from sim.scenario import Manoeuvre

SCHEMA = 1
LARGEST = Decimal("1e15")
SMALLEST = Decimal("1e-100")
SPEED_OF_LIGHT_KM_S = Decimal("299792.458")
MOST_SECTIONS = 10_000
LONGEST_NAME = 100
LONGEST_DESCRIPTION = 300
LONGEST_SHOWN = 60

DecimalPair = tuple[Decimal, Decimal]
Choice = TypeVar("Choice", bound=Enum)


def shown(value: object) -> str:
    """Return a TOML value as a short piece of a message, whatever its size and depth."""
    text = "an array of many values"
    if isinstance(value, bool):
        text = "true" if value else "false"
    elif isinstance(value, str):
        text = '"' + "".join(c if c.isprintable() else "?" for c in value[: LONGEST_SHOWN + 1]) + '"'
    elif isinstance(value, dict):
        text = "a table"
    elif isinstance(value, list):
        if len(value) <= 4:
            text = "[" + ", ".join("[...]" if isinstance(item, list) else shown(item) for item in value) + "]"
    else:
        text = str(value).lower().replace("infinity", "inf")
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."


def nearest(word: str, known: list[str]) -> str | None:
    """Return the known word most like this one, or None if nothing is like it."""
    found = difflib.get_close_matches(word[:LONGEST_NAME], known, n=1, cutoff=0.6)
    return found[0] if found else None


def wrong(problem: str, remedy: str = "") -> PydanticCustomError:
    """Return the error of a value that may not be; without a remedy the key's example becomes one."""
    return PydanticCustomError("scenario", "{problem}", {"problem": problem, "remedy": remedy})


@dataclass(frozen=True)
class _Number:
    """A finite number within limits; `above` and `below` are not themselves allowed, `least` and `most` are."""

    above: Decimal | None = None
    least: Decimal | None = None
    below: Decimal | None = None
    most: Decimal | None = None

    def problem(self, value: object) -> str | None:
        """Return what is wrong with a value, or None."""
        if isinstance(value, bool) or not isinstance(value, int | Decimal):
            return "must be a number"
        number = Decimal(value)
        if not number.is_finite():
            return "must be a finite number"
        if number.copy_abs() > LARGEST:
            return f"must be at most {LARGEST:g} in size"
        if 0 < number.copy_abs() < SMALLEST:
            return f"must be 0 or at least {SMALLEST:g} in size"
        if self.above is not None and number <= self.above:
            return f"must be greater than {self.above}"
        if self.least is not None and number < self.least:
            return f"must be at least {self.least}"
        if self.below is not None and number >= self.below:
            return f"must be less than {self.below}"
        if self.most is not None and number > self.most:
            return f"must be at most {self.most}"
        return None

    def __call__(self, value: object) -> Decimal:
        problem = self.problem(value)
        if problem is not None or not isinstance(value, int | Decimal):
            raise wrong(problem or "must be a number", "write it without quotes" if isinstance(value, str) else "")
        return Decimal(value)


@dataclass(frozen=True)
class _Pair:
    """An interval [least, greatest] of numbers within limits; a number too, where `fixed` allows one."""

    number: _Number
    fixed: bool = False

    def __call__(self, value: object) -> DecimalPair:
        if self.fixed and not isinstance(value, list):
            if not isinstance(value, int | Decimal) or isinstance(value, bool):
                raise wrong("must be a number or a pair [least, greatest] of numbers")
            return self.number(value), self.number(value)
        if not isinstance(value, list):
            raise wrong("must be a pair [least, greatest] of numbers")
        if len(value) != 2:
            raise wrong(f"must be a pair [least, greatest], not {len(value)} values")
        for end, which in zip(value, ("least", "greatest"), strict=True):
            problem = self.number.problem(end)
            if problem is not None:
                raise wrong(f"the {which} end {problem}")
        least, greatest = (Decimal(end) for end in value)
        if least > greatest:
            raise wrong("is reversed", f"write the lesser end first: [{greatest}, {least}]")
        return least, greatest


@dataclass(frozen=True)
class _Whole:
    """A whole number from 1."""

    most: int

    def __call__(self, value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int):
            raise wrong("must be a whole number")
        if not 1 <= value <= self.most:
            raise wrong(f"must be from 1 to {self.most}")
        return value


@dataclass(frozen=True)
class _OneOf(Generic[Choice]):
    """One of the names of an enumeration."""

    choices: type[Choice]

    def __call__(self, value: object) -> Choice:
        return self.choices(_known_name(value, tuple(choice.value for choice in self.choices)))


@dataclass(frozen=True)
class _Line:
    """A line of printable text."""

    longest: int
    empty: bool
    forbidden: str = ""

    def __call__(self, value: object) -> str:
        if not isinstance(value, str):
            raise wrong("must be text in quotes")
        if not value.strip() and not self.empty:
            raise wrong("must not be empty")
        if len(value) > self.longest:
            raise wrong(f"must be at most {self.longest} characters, not {len(value)}", "shorten it")
        if not value.isprintable():
            raise wrong("must be one line without control characters")
        if any(character in value for character in self.forbidden):
            raise wrong(f"must not hold any of {' '.join(self.forbidden)}", "output files are named after it")
        return value


def _known_name(value: object, names: tuple[str, ...]) -> str:
    """Check that a value is one of these names."""
    if isinstance(value, str) and value in names:
        return value
    guess = nearest(value, list(names)) if isinstance(value, str) else None
    listed = ", ".join(f'"{name}"' for name in names)
    problem = f"must be one of {listed}" if len(names) > 1 else f"must be {listed}"
    raise wrong(problem, f'did you mean "{guess}"?' if guess else "")


def _strategy(value: object) -> str:
    return _known_name(value, tuple(guidance.strategy_names()))


def _key(meaning: str, example: str, **options: Any) -> Any:
    """Describe a key: what the template says of it, and a value as TOML."""
    return Field(description=meaning, examples=[example], **options)


_ZERO, _ONE = Decimal(0), Decimal(1)
_NUMBER = _Number()
_POSITIVE = _Number(above=_ZERO)
_SPEED = _Number(least=-SPEED_OF_LIGHT_KM_S, most=SPEED_OF_LIGHT_KM_S)
_APPROACH = _Number(below=_ZERO, least=-SPEED_OF_LIGHT_KM_S)

Positive = Annotated[Decimal, PlainValidator(_POSITIVE)]
NotNegative = Annotated[Decimal, PlainValidator(_Number(least=_ZERO))]
Fraction = Annotated[Decimal, PlainValidator(_Number(above=_ZERO, below=_ONE))]
ClosingSpeed = Annotated[Decimal, PlainValidator(_Number(above=_ZERO, most=SPEED_OF_LIGHT_KM_S))]
AngleError = Annotated[Decimal, PlainValidator(_Number(above=_ZERO, below=_ONE))]
Degrees = Annotated[Decimal, PlainValidator(_Number(least=Decimal(-360), most=Decimal(360)))]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SunTable(_Table):
    """[sun]."""

    gravitational_parameter_km3_s2: Positive = _key("gravitational parameter of the Sun", "1.324948e11")
    distance_km: Positive = _key("distance of the Sun from the spacecraft at t0", "150.0e6")
    direction_deg: Degrees = _key("direction of the Sun at t0, from the x axis toward z", "90.0")


class NominalTable(_Table):
    """[nominal]."""

    range_km: Positive = _key("nominal range at t0", "5801.3")
    closing_speed_km_s: ClosingSpeed = _key("closing speed the on-board model believes in", "58.0")


class UncertaintyTable(_Table):
    """[uncertainty]."""

    z_km: Annotated[DecimalPair, PlainValidator(_Pair(_NUMBER))] = _key("offset across the approach", "[-10.0, 10.0]")
    x_km: Annotated[DecimalPair, PlainValidator(_Pair(_POSITIVE))] = _key("range", "[5301.3, 6301.3]")
    vz_km_s: Annotated[DecimalPair, PlainValidator(_Pair(_SPEED))] = _key("speed across", "[-0.1, 0.1]")
    vx_km_s: Annotated[DecimalPair, PlainValidator(_Pair(_APPROACH))] = _key(
        "speed along x; negative, the object approaches", "[-59.0, -57.0]"
    )


class DispersionTable(_Table):
    """[dispersion]."""

    z_km: Annotated[DecimalPair, PlainValidator(_Pair(_NUMBER, fixed=True))] = _key(
        "a pair is a uniform interval, a number is fixed", "[-1.0, 1.0]"
    )
    x_km: Annotated[DecimalPair, PlainValidator(_Pair(_POSITIVE, fixed=True))] = _key("range", "[5701.3, 5901.3]")
    vz_km_s: Annotated[DecimalPair, PlainValidator(_Pair(_SPEED, fixed=True))] = _key("speed across", "[-0.1, 0.1]")
    vx_km_s: Annotated[DecimalPair, PlainValidator(_Pair(_APPROACH, fixed=True))] = _key(
        "speed along x; negative, the object approaches", "[-58.1, -57.9]"
    )


class AngleSensorTable(_Table):
    """[angle_sensor]."""

    period_s: Positive = _key("time between measurements, a multiple of guidance.step_s", "0.5")
    error_at_nominal_range_rad: AngleError = _key("greatest error at nominal.range_km", "0.00015")
    error_at_zero_range_rad: AngleError = _key("greatest error at range zero; a straight line joins both", "0.00023")


class RangeSensorTable(_Table):
    """[range_sensor]."""

    period_s: Positive = _key("time between measurements, a multiple of guidance.step_s", "2.0")
    relative_error: Fraction = _key("greatest error as a part of the range", "0.05")


class RateSensorTable(_Table):
    """[rate_sensor]."""

    period_s: Positive = _key("time between measurements, a multiple of guidance.step_s", "1.0")
    error_rad_s: Positive = _key("greatest error of the line of sight's angular rate", "1e-6")


class TargetTable(_Table):
    """[target]."""

    manoeuvre: Annotated[Manoeuvre, PlainValidator(_OneOf(Manoeuvre))] = _key(
        '"none", "constant", "bang-bang", "random-telegraph" or "worst-case"', '"bang-bang"'
    )
    acceleration_m_s2: NotNegative = _key("its acceleration across", "0.005")
    switching_period_s: Positive = _key(
        "time between changes of side; its mean where they are random", "10.0", default=Decimal(10)
    )


class ThrusterTable(_Table):
    """[thruster]."""

    budget_m_s: NotNegative = _key("sum of the sizes of all impulses", "1000.0")
    least_impulse_m_s: NotNegative = _key("smaller impulses cannot be given", "0.25")
    greatest_impulse_m_s: Positive = _key("nor greater ones", "7.5")
    execution_error_relative: Annotated[Decimal, PlainValidator(_Number(least=_ZERO, below=_ONE))] = _key(
        "an impulse may come out greater or less by this part", "0.0", default=_ZERO
    )


class GuidanceTable(_Table):
    """[guidance]."""

    step_s: Positive = _key("step of observation and control", "0.5")
    strategy: Annotated[str, PlainValidator(_strategy)] = _key("name of the guidance strategy", '"symmetric-miss"')
    range_threshold_km: Positive = _key("hypotheses about to come nearer leave the set", "5.0")


class InformationSetTable(_Table):
    """[information_set]."""

    model: Annotated[Model, PlainValidator(_OneOf(Model))] = _key(
        '"paper", as published, or "guaranteed", which never loses the truth', '"paper"'
    )
    initial_set: Annotated[InitialSet | None, PlainValidator(_OneOf(InitialSet))] = _key(
        'a section at t0: "rectangle" in (omega, alpha) or "box" in (z, V)', '"rectangle"', default=None
    )
    sections: Annotated[int, PlainValidator(_Whole(MOST_SECTIONS))] = _key(
        "ranges the set is stored at, a uniform grid over uncertainty.x_km", "29"
    )
    fewest_sections: Annotated[int | None, PlainValidator(_Whole(MOST_SECTIONS))] = _key(
        "fewer left: the grid is made anew with 2 fewest_sections + 1", "5", default=None
    )
    disturbance_m_s2: NotNegative = _key("bound of the unknown acceleration across, or of the target's", "0.005")


class NoiseTable(_Table):
    """[noise]."""

    kind: Annotated[NoiseKind, PlainValidator(_OneOf(NoiseKind))] = _key(
        '"random", or "game": errors chosen against the guidance', '"random"'
    )
    tie: Annotated[TieRule, PlainValidator(_OneOf(TieRule))] = _key(
        'the game keeps of equals: "upper", "lower", "alternate", "random"',
        '"upper"',
        default=TieRule.UPPER,
    )


class ScenarioTables(_Table):
    """A whole scenario file."""

    schema_number: Annotated[int, PlainValidator(lambda value: value)] = _key(
        "version of this form of file", str(SCHEMA), alias="schema"
    )
    name: Annotated[str, PlainValidator(_Line(LONGEST_NAME, empty=False, forbidden='/\\:*?"<>|'))] = _key(
        "what results and files are called", '"my-scenario"'
    )
    description: Annotated[str, PlainValidator(_Line(LONGEST_DESCRIPTION, empty=True))] = _key(
        "a line for `infoset scenarios list`", '"What this scenario is about"', default=""
    )
    sun: SunTable | None = _key("the Sun, seen from the spacecraft; without the table: free space", "", default=None)
    nominal: NominalTable = _key("where the object is expected", "")
    uncertainty: UncertaintyTable = _key("what is known on board of the start", "")
    dispersion: DispersionTable = _key("where the truth starts, unknown on board", "")
    angle_sensor: AngleSensorTable = _key("the line-of-sight sensor", "")
    range_sensor: RangeSensorTable | None = _key("the range meter; without the table: none", "", default=None)
    rate_sensor: RateSensorTable | None = _key(
        "the sensor of the line of sight's rate; without the table: none", "", default=None
    )
    target: TargetTable | None = _key("how the object accelerates; without the table: not at all", "", default=None)
    thruster: ThrusterTable = _key("the engine", "")
    guidance: GuidanceTable = _key("how impulses are chosen", "")
    information_set: InformationSetTable = _key("how hypotheses are kept", "")
    noise: NoiseTable = _key("how measurement errors are chosen", "")


TABLES: dict[str, type[BaseModel]] = {
    "sun": SunTable,
    "nominal": NominalTable,
    "uncertainty": UncertaintyTable,
    "dispersion": DispersionTable,
    "angle_sensor": AngleSensorTable,
    "range_sensor": RangeSensorTable,
    "rate_sensor": RateSensorTable,
    "target": TargetTable,
    "thruster": ThrusterTable,
    "guidance": GuidanceTable,
    "information_set": InformationSetTable,
    "noise": NoiseTable,
}


def keys_of(table: str | None) -> dict[str, Any]:
    """Return the keys of a table (None: the top of the file) as written, with what is known of each."""
    model = ScenarioTables if table is None else TABLES[table]
    return {field.alias or name: field for name, field in model.model_fields.items()}
