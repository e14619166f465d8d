"""Limits of numbers, declared once, at the field of a dataclass.

Its constructor and the readers of files check them.
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
    """A condition on the values of a field; constructors and readers of files check it."""

    @abstractmethod
    def problem(self, value: Any) -> str | None:
        """Return why a value is refused, or None."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Return the schema of a field for readers of files: its type, and this rule.

        Each value of a tuple is checked.
        """
        from pydantic_core import core_schema

        is_pair = source == tuple[float, float]

        def checked(value: Any) -> Any:
            for one in value if isinstance(value, tuple) else (value,):
                problem = self.problem(one)
                if problem is not None:
                    raise ValueError(problem)
            if is_pair and value[0] > value[1]:
                raise ValueError("must be a pair [minimum, maximum], and is reversed")
            return value

        return core_schema.no_info_after_validator_function(checked, handler(source))


@dataclass(frozen=True)
class Limits(_Rule):
    """Limits of a number.

    Parameters
    ----------
    above, minimum, below, maximum : float or None
        Ends of the interval; `above` and `below` are excluded. None is no limit but `MAXIMUM`. With
        `above` = 0 a number must be at least `MINIMUM`.
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
        return self._problem_below(number) or self._problem_above(number)

    def _problem_below(self, number: Any) -> str | None:
        """Return why a number is below the interval, or None."""
        if self.above is not None and not number > self.above:
            return f"must be greater than {self.above:g}"
        if self.above == 0.0 and number < MINIMUM:
            return f"must be at least {MINIMUM:g}"
        if self.minimum is not None and number < self.minimum:
            return f"must be at least {self.minimum:g}"
        return None

    def _problem_above(self, number: Any) -> str | None:
        """Return why a number is above the interval, or None."""
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
        kinds: tuple[type, ...] = (int, np.integer)
        wanted = "an integer"
        if not self.whole:
            kinds = (float, *kinds)  # not np.float32: single precision would round
            wanted = "a real number, a float or an integer"
        if isinstance(value, bool) or not isinstance(value, kinds):
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
WRONG = Limits(minimum=0, maximum=3, whole=True)
"""Number q of measurements that may be wrong.

With the default of 2q + 2 classes there are more than `infoset.model.MAX_SETS` sets from q = 4 on.
The same maximum is chosen for ranges, which need no sets and would allow more (Theorem 10).
"""

LONGEST_NAME = 100
"""Maximum length of a name: files named after it stay below 255 characters, their limit."""
LONGEST_DESCRIPTION = 300
"""Maximum length of a description: three lines of a screen."""
NO_FIRST = ("", "-", ".", " ")
"""Beginnings that a name of files must not have: of options, of hidden files, and nothing."""
NOT_IN_NAMES = set('/\\:*?"<>|$')
"""Characters that file systems or shells refuse or interpret in names of files."""
LONGEST_SHOWN = 80
"""Maximum length of a value in a message: a line of a terminal."""


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
        if self.names_files and (value[:1] in NO_FIRST or NOT_IN_NAMES & set(value)):
            return (
                'must begin with a letter or a digit, without any of / \\ : * ? " < > | $, because '
                "files have this name"
            )
        return None


Name = Annotated[str, Line(LONGEST_NAME, names_files=True)]
Description = Annotated[str, Line(LONGEST_DESCRIPTION)]
Number = Annotated[float, NUMBER]
Positive = Annotated[float, POSITIVE]
NotNegative = Annotated[float, NOT_NEGATIVE]
Fraction = Annotated[float, FRACTION]
Part = Annotated[float, PART]


def check_fields(owner: object) -> None:
    """Check the values of a dataclass against the annotations of its fields.

    A TypeError or a ValueError is raised for a value that they do not allow.

    Numbers are annotated with `Limits`, intervals are pairs (minimum, maximum) of such numbers, and
    ``tuple[float, ...]`` is any number of them. Enumerations, other dataclasses and text are
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
    """Return a number of NumPy, or a tuple with such numbers, as Python's numbers.

    Other values are returned unchanged.
    """
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, tuple):
        plain = tuple(map(plain_number, value))
        if any(after is not before for after, before in zip(plain, value, strict=True)):
            return plain
    return value


class Checked:
    """A dataclass whose constructor checks the types and the limits of its fields."""

    def __post_init__(self) -> None:
        check_fields(self)


@cache
def _hints(owner: type) -> dict[str, Any]:
    """Return the annotations of the fields of a dataclass."""
    hints = get_type_hints(owner, include_extras=True)
    return {field.name: hints[field.name] for field in fields(owner)}


def _check(name: str, value: Any, hint: Any) -> None:
    """Raise an error if a value does not fit the annotation of a field."""
    if get_origin(hint) in (Union, types.UnionType):
        if value is None:
            return
        (hint,) = (kind for kind in get_args(hint) if kind is not types.NoneType)

    kind = hint
    limits = None
    if get_origin(hint) is Annotated:
        kind, *notes = get_args(hint)
        limits = next((note for note in notes if isinstance(note, Limits)), None)

    if limits is None:
        if isinstance(kind, type) and not isinstance(value, kind):
            raise TypeError(f"{name} must be of the type {kind.__name__}: got {shown(value)}")
    elif get_origin(kind) is tuple:
        # The arguments of ``tuple[float, ...]`` are float and the ellipsis.
        is_pair = get_args(kind)[1:] != (...,)
        _check_tuple(name, value, limits, is_pair)
    else:
        limits.need(name, value)


def _check_tuple(name: str, value: Any, limits: Limits, is_pair: bool) -> None:
    """Raise an error if a value is not a tuple of numbers within limits, or not a pair."""
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

    A TypeError is raised if the array is masked, complex, or has other elements than numbers, a
    ValueError if its rows have different lengths.
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
    """Return finite real numbers as a float array of a shape.

    `value` is such an array, which is returned itself, not as a copy, if its elements are floats
    (float64); or it is one number for all elements.

    A TypeError is raised as by `real_values`, a ValueError if a number is not finite, or if the
    shape is different.
    """
    values = real_values(name, value)
    if values.shape not in ((), shape):
        raise ValueError(
            f"{name} must be a number or have the shape {shape}: got the shape {values.shape}"
        )
    if not np.isfinite(values).all():
        raise ValueError(f"{name} must be finite: got {shown(value)}")
    if values.shape == shape:
        return values
    return np.ascontiguousarray(np.broadcast_to(values, shape))


def flags(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Flags:
    """Return flags as an array of a shape, or a single flag for all elements as one of shape ().

    A TypeError is raised if they are masked or not of the type bool, a ValueError if the shape is
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
    if len(text) <= LONGEST_SHOWN:
        return text
    # With the three dots it has the maximum length.
    return f"{text[: LONGEST_SHOWN - 3]}..."
