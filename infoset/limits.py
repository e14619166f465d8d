"""Limits of numbers: declared once, at the field of a dataclass, for its constructor and for file
readers.
"""

from __future__ import annotations

import types
from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats

MAXIMUM = 1e60
"""Maximum absolute value of any number: products of a few such numbers do not overflow."""
MINIMUM = 1e-110
"""Minimum value of a number that must be positive: its square is not zero."""


class _Rule(ABC):
    """What values of a field must be; readers of files check it too."""

    @abstractmethod
    def problem(self, value: Any) -> str | None:
        """Return why a value is refused, or None."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Return the schema of a field for readers of files: its type, and this rule for each of
        its values.
        """
        from pydantic_core import core_schema

        is_pair = source == tuple[float, float]

        def checked(value: Any) -> Any:
            problem = next(
                filter(None, map(self.problem, value if isinstance(value, tuple) else (value,))),
                None,
            )
            if problem is None and is_pair and value[0] > value[1]:
                problem = "must be a pair [minimum, maximum], and is reversed"
            if problem is not None:
                raise ValueError(problem)
            return value

        return core_schema.no_info_after_validator_function(checked, handler(source))


@dataclass(frozen=True)
class Limits(_Rule):
    """Limits of a number.

    Parameters
    ----------
    above, minimum, below, maximum : float or None
        Ends of the interval; `above` and `below` are excluded. None is no limit but `MAXIMUM`.
    whole : bool
        Whether the number must be an integer; `MAXIMUM` does not apply to integers.
    """

    above: float | None = None
    minimum: float | None = None
    below: float | None = None
    maximum: float | None = None
    whole: bool = False

    def problem(self, value: object) -> str | None:
        """Return why a number is outside the limits, or None."""
        number: Any = value
        if not (self.whole or -MAXIMUM <= number <= MAXIMUM):  # NaN is neither
            return f"must be finite, at most {MAXIMUM:g} in size"
        if self.above is not None and not number > self.above:
            return f"must be greater than {self.above:g}"
        if self.above == 0.0 and number < MINIMUM:
            return f"must be at least {MINIMUM:g}"
        if self.minimum is not None and number < self.minimum:
            return f"must be at least {self.minimum:g}"
        if self.below is not None and number >= self.below:
            return f"must be less than {self.below:g}"
        if self.maximum is not None and number > self.maximum:
            return f"must be at most {self.maximum:g}"
        return None

    def need(self, name: str, value: object) -> None:
        """Raise an error, which starts with `name`, if a value is not a number within these limits.

        TypeError for a value that is not a float or an integer, or not an integer where it must be
        one (a bool is neither), ValueError for one outside the limits.
        """
        kinds = (
            (int, np.integer) if self.whole else (int, float, np.integer)
        )  # single precision would round
        if isinstance(value, bool) or not isinstance(value, kinds):
            wanted = "an integer" if self.whole else "a real number, a float or an integer"
            raise TypeError(f"{name} must be {wanted}: got {shown(value)}")
        problem = self.problem(value)
        if problem is not None:
            raise ValueError(f"{name} {problem}: got {shown(value)}")


NUMBER = Limits()
POSITIVE = Limits(above=0.0)
NOT_NEGATIVE = Limits(minimum=0.0)
FRACTION = Limits(above=0.0, below=1.0)
PART = Limits(minimum=0.0, below=1.0)
WHOLE = Limits(minimum=0, whole=True)
COUNT = Limits(minimum=1, whole=True)

LONGEST_NAME, LONGEST_DESCRIPTION = 100, 300


@dataclass(frozen=True)
class Line(_Rule):
    """One line of printable text; `names_files` if files are named after it."""

    longest: int
    names_files: bool = False

    def problem(self, value: str) -> str | None:
        """Return why a text is not such a line, or None."""
        if len(value) > self.longest:
            return f"must have at most {self.longest} characters"
        if not value.isprintable():
            return "must be one line without control characters"
        if self.names_files and (
            value[:1] in ("", "-", ".", " ") or set('/\\:*?"<>|$') & set(value)
        ):
            return 'must begin with a letter or a digit, without any of / \\ : * ? " < > | $, because files have this name'
        return None


Name = Annotated[str, Line(LONGEST_NAME, names_files=True)]
Description = Annotated[str, Line(LONGEST_DESCRIPTION)]
Number = Annotated[float, NUMBER]
Positive = Annotated[float, POSITIVE]
NotNegative = Annotated[float, NOT_NEGATIVE]
Fraction = Annotated[float, FRACTION]
Part = Annotated[float, PART]


def check_fields(owner: object) -> None:
    """Check the values of a dataclass against the annotations of its fields; raise TypeError or
    ValueError.

    Numbers are annotated with `Limits`, intervals are pairs (minimum, maximum) of such numbers,
    ``tuple[float, ...]`` is any number of them; enumerations, other dataclasses and text are
    checked by type. The message has the name of the field, the value, and what is allowed.

    NumPy's numbers are replaced by Python's, so that equal dataclasses are written to files as
    equal text.
    """
    kind: Any = type(owner)
    for field, hint in _hints(kind).items():
        value = getattr(owner, field)
        _check(f"{kind.__name__}: {field}", value, hint)
        plain = plain_number(value)
        if plain is not value:
            object.__setattr__(owner, field, plain)


def plain_number(value: Any) -> Any:
    """Return a number of NumPy, or a tuple with such numbers, as Python's numbers; other values as
    they are.
    """
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple):
        plain = tuple(map(plain_number, value))
        if any(after is not before for after, before in zip(plain, value, strict=True)):
            return plain
    return value


class Checked:
    """A dataclass whose constructor refuses values of wrong types and outside the limits of their
    fields.
    """

    def __post_init__(self) -> None:
        check_fields(self)


@cache
def _hints(owner: type) -> dict[str, Any]:
    hints = get_type_hints(owner, include_extras=True)
    return {field.name: hints[field.name] for field in fields(owner)}


def _check(name: str, value: Any, hint: Any) -> None:
    if get_origin(hint) in (Union, types.UnionType):
        if value is None:
            return
        (hint,) = (kind for kind in get_args(hint) if kind is not types.NoneType)
    inner, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    limits = next((note for note in notes if isinstance(note, Limits)), None)
    if limits is None:
        if isinstance(inner, type) and not isinstance(value, inner):
            raise TypeError(f"{name} must be of the type {inner.__name__}: got {shown(value)}")
        return
    if get_origin(inner) is not tuple:
        limits.need(name, value)
        return
    is_pair = get_args(inner)[1:] != (...,)
    if not isinstance(value, tuple) or (is_pair and len(value) != 2):
        wanted = "pair (minimum, maximum)" if is_pair else "tuple of numbers"
        raise TypeError(f"{name} must be a {wanted}: got {shown(value)}")
    for number in value:
        limits.need(name, number)
    if is_pair and value[0] > value[1]:
        raise ValueError(
            f"{name} must be a pair (minimum, maximum), and is reversed: got {shown(value)}"
        )


def real_values(name: str, value: ArrayLike) -> Floats:
    """Return an array of real numbers, finite or not, of any shape; `name` is for the message.

    A TypeError is raised if it is masked, complex, or does not hold numbers, a ValueError if its
    rows have different lengths.
    """
    try:
        values = value if isinstance(value, np.ndarray) else np.asarray(value)
    except ValueError:
        raise ValueError(
            f"{name} must be an array, its rows of equal length: got {shown(value)}"
        ) from None
    if isinstance(values, np.ma.MaskedArray):
        raise TypeError(f"{name} must be real numbers, not masked: got {shown(value)}")
    if values.dtype.kind not in "fiu":
        raise TypeError(
            f"{name} must be real numbers, not of the type {values.dtype}: got {shown(value)}"
        )
    return np.asarray(values, dtype=np.float64)


def real_array(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Floats:
    """Return finite real numbers as an array of a shape, from such an array or from one number for
    all elements.

    A TypeError is raised as by `real_values`, a ValueError if a number is not finite, or the shape
    is different.
    """
    values = real_values(name, value)
    if values.shape not in ((), shape):
        raise ValueError(
            f"{name} must be a number or have the shape {shape}: got the shape {values.shape}"
        )
    if not np.isfinite(values).all():
        raise ValueError(f"{name} must be finite: got {shown(value)}")
    return values if values.shape == shape else np.ascontiguousarray(np.broadcast_to(values, shape))


def flags(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Flags:
    """Return flags as an array of a shape, or a single flag for all elements.

    A TypeError is raised if they are not of the type bool, or masked, a ValueError if the shape is
    different.
    """
    values = np.asarray(value)
    if isinstance(value, np.ma.MaskedArray) or values.dtype != np.bool_:
        raise TypeError(f"{name} must be True, False or an array of them: got {shown(value)}")
    if values.shape not in ((), shape):
        raise ValueError(
            f"{name} must be a flag or have the shape {shape}: got the shape {values.shape}"
        )
    return values


def shown(value: object) -> str:
    """Return a value as text on one line, for a message; long texts are truncated."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else f"{text[:77]}..."
