"""Values of TOML files: checks, change to SI units, and text for messages.

Numbers stay decimal, as written; the change to SI units rounds them once.
"""

from __future__ import annotations

import types
import typing
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Context, Decimal, InvalidOperation
from enum import Enum, EnumMeta
from numbers import Integral
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from experiments.common.errors import InputError, nearest
from infoset.limits import Limits, limits_of

LARGEST = Decimal("1e15")
SMALLEST = Decimal("1e-100")
LONGEST_NAME = 100
LONGEST_DESCRIPTION = 300
KILO = 3

DecimalPair = tuple[Decimal, Decimal]

_EXACT = Context(prec=60)
_RADIANS_PER_DEGREE = _EXACT.divide(
    Decimal("3.14159265358979323846264338327950288419716939937510582097494459"), Decimal(180)
)


def decimal_of(literal: str) -> Decimal:
    """Read a TOML float as written."""
    try:
        return Decimal(literal)
    except InvalidOperation:  # an exponent beyond what a Decimal holds: zero or infinity, as for a float
        return Decimal(repr(float(literal)))


def si(value: Decimal, power_of_ten: int = 0) -> float:
    """Change the unit of a decimal and round it, once."""
    return float(value.scaleb(power_of_ten, _EXACT))


def radians(degrees: Decimal) -> float:
    """Change degrees to radians and round them, once."""
    return float(_EXACT.multiply(degrees, _RADIANS_PER_DEGREE))


UNITS = {"_km3_s2": ("_m3_s2", 3 * KILO), "_km_s": ("_m_s", KILO), "_km": ("_m", KILO), "_deg": ("_rad", 0)}
"""SI unit and power of ten of the units that end keys; a degree has no power of ten. Any other key is in SI."""


def si_name(name: str) -> str:
    """Return the name of a key in SI: ``distance_m`` of ``distance_km``."""
    return next((name.removesuffix(unit) + of_si for unit, (of_si, _) in UNITS.items() if name.endswith(unit)), name)


def power_of_ten(name: str) -> int:
    """Return the power of ten of the unit of a key."""
    return next((power for unit, (_, power) in UNITS.items() if name.endswith(unit)), 0)


def si_value(name: str, value: Any) -> Any:
    """Return the value of a key in SI; decimals are rounded once, other values stay as they are."""
    if isinstance(value, tuple):
        return tuple(si_value(name, item) for item in value)
    if not isinstance(value, Decimal):
        return value
    return radians(value) if name.endswith("_deg") else si(value, power_of_ten(name))


def si_values(table: BaseModel) -> dict[str, Any]:
    """Return the values of a table in SI by their names in SI."""
    return {si_name(name): si_value(name, value) for name, value in table}


def value_text(name: str, value: Any) -> str:
    """Write an SI value as TOML in the unit of its key."""
    if isinstance(value, Enum | str):
        return quoted_text(value.value if isinstance(value, Enum) else value)
    if isinstance(value, tuple):
        return f"[{', '.join(value_text(name, item) for item in value)}]"
    if isinstance(value, Integral):
        return str(value)
    return degrees_text(value) if name.endswith("_deg") else number_text(value, power_of_ten(name))


def _toml_float(value: Decimal) -> str:
    """Write a decimal as a TOML float, without an exponent where that is short."""
    value = value.normalize(_EXACT)
    if value and not -6 <= value.adjusted() < 9:
        return f"{value:e}"
    text = f"{value:f}"
    return text if "." in text else f"{text}.0"


def number_text(value_si: float, power_of_ten: int = 0) -> str:
    """Write an SI value as the shortest decimal of a unit 10^power_of_ten times as great."""
    value = Decimal(repr(float(value_si)))
    if not value.is_finite():
        raise InputError(f"a file contains finite numbers only, not {value_si}; correct the value")
    return _toml_float(value.scaleb(-power_of_ten, _EXACT))


def degrees_text(value_rad: float) -> str:
    """Write an angle as the shortest decimal of degrees that reads back as the same radians."""
    exact = _EXACT.divide(Decimal(number_text(value_rad)), _RADIANS_PER_DEGREE)
    shorter = (Context(prec=digits).plus(exact) for digits in range(1, 20))
    return _toml_float(next((value for value in shorter if repr(radians(value)) == repr(value_rad)), exact))


def quoted_text(text: str) -> str:
    """Write a TOML string on one line."""
    escapes = {"\\": "\\\\", '"': '\\"'}
    return '"' + "".join(escapes.get(c, c if c.isprintable() or c == " " else f"\\U{ord(c):08x}") for c in text) + '"'


WRONG = "wrong"


def wrong(problem: str, remedy: str = "") -> PydanticCustomError:
    """Return the error of an invalid value; without a remedy the message gives the example of the key."""
    return PydanticCustomError(WRONG, "{problem}", {"problem": problem, "remedy": remedy})


@dataclass(frozen=True)
class Number:
    """A finite number within limits: `above` and `below` are excluded, `least` and `most` included."""

    above: Decimal | None = None
    least: Decimal | None = None
    below: Decimal | None = None
    most: Decimal | None = None

    @classmethod
    def of(cls, limits: Limits, power_of_ten: int = 0) -> Number:
        """Return the limits, given in SI, in a unit that is 10^power_of_ten SI units."""
        ends = (limits.above, limits.least, limits.below, limits.most)
        return cls(
            *(None if end is None else Decimal(repr(end)).scaleb(-power_of_ten, _EXACT).normalize() for end in ends)
        )

    def problem(self, value: object) -> str | None:
        """Return the problem of a value, or None."""
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
        """Check and return it."""
        problem = self.problem(value)
        if problem is not None or not isinstance(value, int | Decimal):
            quoted = isinstance(value, str) and value.strip()[:1] in tuple("+-.0123456789")
            raise wrong(problem or "must be a number", "write it without quotes" if quoted else "")
        return Decimal(value)


@dataclass(frozen=True)
class Pair:
    """An interval [least, greatest] of numbers within limits, or a single number if `fixed`."""

    number: Number
    fixed: bool = False

    def __call__(self, value: object) -> DecimalPair:
        """Check and return it."""
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
            raise wrong("is reversed", f"write the smaller value first: [{greatest}, {least}]")
        return least, greatest


@dataclass(frozen=True)
class Numbers:
    """An array of `count` numbers within limits (None: of any length), or one number for all if `one_for_all`."""

    count: int | None
    number: Number
    one_for_all: bool = False

    def __call__(self, value: object) -> tuple[Decimal, ...]:
        """Check and return them."""
        if self.one_for_all and self.count and isinstance(value, int | Decimal) and not isinstance(value, bool):
            return (self.number(value),) * self.count
        if not isinstance(value, list):
            numbers = "numbers" if self.count is None else f"{self.count} numbers"
            raise wrong(f"must be {'a number or ' if self.one_for_all else ''}an array of {numbers}")
        if self.count is not None and len(value) != self.count:
            raise wrong(f"must be an array of {self.count} numbers, not {len(value)}")
        for place, each in enumerate(value, start=1):
            problem = self.number.problem(each)
            if problem is not None:
                raise wrong(f"number {place} of the array {problem}")
        return tuple(Decimal(each) for each in value)


@dataclass(frozen=True)
class Items:
    """An array of `least` to `most` values, each checked by `item`.

    In messages, `noun` names the values, and `numbered` a wrong value by its number.
    """

    item: Callable[[object], Any]
    noun: str
    most: int
    least: int = 1
    numbered: str = "number {} of the array"

    def __call__(self, value: object) -> tuple[Any, ...]:
        """Check and return them."""
        if not isinstance(value, list) or not self.least <= len(value) <= self.most:
            numbers = f"{self.least} to {self.most}" if self.least else f"at most {self.most}"
            raise wrong(f"must be an array of {numbers} {self.noun}")
        return tuple(self._checked(number, item) for number, item in enumerate(value, start=1))

    def _checked(self, number: int, item: object) -> Any:
        try:
            return self.item(item)
        except PydanticCustomError as error:
            context = error.context or {}
            raise wrong(f"{self.numbered.format(number)} {context['problem']}", context["remedy"]) from None


@dataclass(frozen=True)
class Whole:
    """A whole number from `least` to `most`; the message about a greater one gives the `remedy`."""

    most: int
    least: int = 1
    remedy: str = ""

    def __call__(self, value: object) -> int:
        """Check and return it."""
        if isinstance(value, bool) or not isinstance(value, int):
            raise wrong("must be a whole number")
        if not self.least <= value <= self.most:
            raise wrong(f"must be from {self.least} to {self.most}", self.remedy if value > self.most else "")
        return value


@dataclass(frozen=True)
class Line:
    """A line of printable text."""

    longest: int
    empty: bool
    forbidden: str = ""
    begins_badly: str = ""

    def __call__(self, value: object) -> str:
        """Check and return it."""
        if not isinstance(value, str):
            raise wrong("must be text in quotes")
        if not value.strip() and not self.empty:
            raise wrong("must not be empty")
        if len(value) > self.longest:
            raise wrong(f"must be at most {self.longest} characters, not {len(value)}", "shorten it")
        if not value.isprintable():
            raise wrong("must be one line without control characters")
        if any(character in value for character in self.forbidden):
            raise wrong(f"must not contain any of {' '.join(self.forbidden)}", "output files are named after it")
        if value[:1] and value[0] in self.begins_badly:
            raise wrong("must begin with a letter or a digit", "output files are named after it")
        return value


def known_name(value: object, names: tuple[str, ...]) -> str:
    """Check that a value is one of these names."""
    if isinstance(value, str) and value in names:
        return value
    guess = nearest(value, names) if isinstance(value, str) else None
    listed = ", ".join(f'"{name}"' for name in names)
    problem = f"must be one of {listed}" if len(names) > 1 else f"must be {listed}"
    raise wrong(problem, f'did you mean "{guess}"?' if guess else "")


def key(meaning: str, *examples: str, **options: Any) -> Any:
    """Describe a key: its meaning for the template, and examples as TOML.

    The example of an optional key is its default. Several examples are for the first tables that have the key, such as
    the first two craft.
    """
    return Field(description=meaning, examples=list(examples), **options)


ZERO, ONE = Decimal(0), Decimal(1)
NUMBER = Number()
POSITIVE = Number(above=ZERO)

Positive = Annotated[Decimal, PlainValidator(POSITIVE)]
NotNegative = Annotated[Decimal, PlainValidator(Number(least=ZERO))]
Fraction = Annotated[Decimal, PlainValidator(Number(above=ZERO, below=ONE))]
Eccentricity = Annotated[Decimal, PlainValidator(Number(least=ZERO, below=ONE))]
Degrees = Annotated[Decimal, PlainValidator(Number(least=Decimal(-360), most=Decimal(360)))]
Vector = Annotated[tuple[Decimal, ...], PlainValidator(Numbers(3, NUMBER))]
Name = Annotated[str, PlainValidator(Line(LONGEST_NAME, empty=False, forbidden='/\\:*?"<>|$', begins_badly="-."))]
Description = Annotated[str, PlainValidator(Line(LONGEST_DESCRIPTION, empty=True))]


Constant = Annotated[Any, PlainValidator(lambda value: value)]
"""A value that `experiments.common.toml_file.read_tables` checks: ``schema`` and ``kind``."""


class Table(BaseModel):
    """A table of a file; unknown keys are errors, members of enumerations are written by value.

    Numbers have the limits that the dataclass `owner` declares for the fields of their names in SI.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    _owner: ClassVar[type | None] = None

    def __init_subclass__(cls, owner: type | None = None, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls._owner = owner

    @field_validator("*", mode="before")
    @classmethod
    def _checked(cls, value: object, info: ValidationInfo) -> object:
        name = str(info.field_name)
        field = cls.model_fields[name]
        hint = field.annotation
        kinds = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
        if cls._owner is not None and Decimal in kinds and not field.metadata:
            return Number.of(limits_of(cls._owner, si_name(name)), power_of_ten(name))(value)
        kind: Any = next((kind for kind in kinds if isinstance(kind, EnumMeta)), None)
        return value if kind is None else kind(known_name(value, tuple(member.value for member in kind)))

    def si(self, name: str) -> Any:
        """Return the value of a key in SI, or None if the file does not have it."""
        return si_value(name, getattr(self, name))

    def si_numbers(self, *names: str) -> list[float]:
        """Return the numbers of keys and arrays in SI, one after another."""
        values = (self.si(name) for name in names)
        return [number for value in values for number in (value if isinstance(value, tuple) else [value])]
