"""Numbers of papers, read from `experiments/printed`, and their comparison with ours.

A file has the title of a paper, remarks about misprints that are not in its numbers, and tables. Each line of a table
is a number: its name, and its digits as printed or the fields of `PrintedNumber`. Fields that many numbers share stand
once, in their table or in ``[defaults]``; a note is a key of ``[notes]``.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
from importlib import resources

Progress = Callable[[float], None]


class Origin(Enum):
    """Where the number comes from that ours is compared with."""

    PRINTED = "paper"
    """The paper prints it."""
    OTHER = "other implementation"
    """Another implementation computed it; the paper prints no such number."""
    EXACT = "closed form"
    """It is the exact value of a closed form."""


class Verdict(Enum):
    """Result of the comparison of a printed number with ours."""

    AGREED = "agreed"
    """Ours is the printed number, to the last digit."""
    MISPRINT = "misprint"
    """The correct number is known, and it is ours, or that of the other model if there is one."""
    EXPLAINED = "explained by another model"
    """The numbers differ, and a model other than that of the paper's equations gives the printed number."""
    NOT_EXPLAINED = "not explained"
    """The numbers differ for an unknown reason."""
    DISAGREED = "disagreed"
    """The numbers should agree and do not."""


@dataclass(frozen=True)
class Band:
    """An interval of numbers."""

    lowest: float
    highest: float

    def __contains__(self, value: float) -> bool:
        """Whether a number lies in the interval; a number that is not finite does not."""
        return self.lowest <= value <= self.highest

    @classmethod
    def of_digits(cls, text: str, units: float, beyond: float = 0.0) -> Band:
        """Return the numbers that differ from printed digits by some units of the last digit, plus `beyond`."""
        # A few ulp more, so that a number on the boundary is inside.
        half_width = (units * last_digit(text) + beyond) * (1.0 + 1e-9)
        return cls(float(text) - half_width, float(text) + half_width)


@dataclass(frozen=True)
class PrintedNumber:
    """A number of a paper.

    Parameters
    ----------
    source : str
        Table, equation or section.
    printed : str
        Digits as printed, or of the number of another `origin`.
    corrected : str or None
        The correct number, if the printed one is known to be a misprint.
    unexplained : float
        Largest difference for an unknown reason, in units of the last digit; 0 if the numbers should agree.
    note : str
        Explanation of a misprint, or what was tried to explain a difference.
    tolerance : float
        Largest error of the digits, in units of the last one: 0.5 if rounded, 1 if a paper rounds some numbers and
        truncates others, or if the last of ten or more digits has the error of another computation.
    agrees : (float, float) or None
        Interval in which a number agrees, if it is another one than that of the digits.
    """

    source: str
    name: str
    printed: str
    corrected: str | None = None
    unexplained: float = 0.0
    note: str = ""
    origin: Origin = Origin.PRINTED
    tolerance: float = 0.5
    agrees: tuple[float, float] | None = None

    @property
    def value(self) -> float:
        """Return the printed number."""
        return float(self.printed)


@dataclass(frozen=True)
class Ours:
    """Our number in place of a printed one.

    Parameters
    ----------
    value : float or None
        None if the computation has no result.
    other : float or None
        The number of the other model with which the paper's number was probably computed, if one is known.
    beyond : float
        Added to the tolerance, for the rounding of the inputs of the computation.
    spread : Band or None
        Interval of most of our values, if ours is the median of many runs and the printed number is one run. The
        printed number must then lie in this interval.
    """

    value: float | None
    other: float | None = None
    beyond: float = 0.0
    spread: Band | None = None


@dataclass(frozen=True)
class Comparison:
    """A printed number and ours."""

    number: PrintedNumber
    ours: Ours

    @property
    def band(self) -> Band:
        """Return the interval in which the numbers agree."""
        number, ours = self.number, self.ours
        if ours.spread is not None:
            return ours.spread
        return Band(*number.agrees) if number.agrees else Band.of_digits(number.printed, number.tolerance, ours.beyond)

    @property
    def verdict(self) -> Verdict:
        """Return the result of the comparison."""
        number, ours, value = self.number, self.ours, self.ours.value
        if value is None or not abs(value) < float("inf"):
            return Verdict.DISAGREED
        if number.corrected is not None:
            right = Band.of_digits(number.corrected, number.tolerance, ours.beyond)
            return Verdict.MISPRINT if (value if ours.other is None else ours.other) in right else Verdict.DISAGREED
        if (value if ours.spread is None else number.value) in self.band:
            return Verdict.AGREED
        if ours.other is not None and ours.other in self.band:
            return Verdict.EXPLAINED
        known = value in Band.of_digits(number.printed, number.unexplained)
        return Verdict.NOT_EXPLAINED if known else Verdict.DISAGREED


@dataclass(frozen=True)
class Paper:
    """The numbers of a paper by source, and remarks about other misprints."""

    name: str
    title: str
    remarks: tuple[str, ...]
    tables: Mapping[str, tuple[PrintedNumber, ...]]

    def compare(self, ours: Mapping[str, Iterable[Ours | float | None]]) -> tuple[Comparison, ...]:
        """Compare every number of the paper; ours are by source too, in the same order."""
        return tuple(
            Comparison(number, value if isinstance(value, Ours) else Ours(None if value is None else float(value)))
            for source, numbers in self.tables.items()
            for number, value in zip(numbers, ours[source], strict=True)
        )


@dataclass(frozen=True)
class Reproduction:
    """A paper compared with our numbers, and the name and hash of each problem or scenario."""

    paper: Paper
    problems: tuple[tuple[str, str], ...]
    numbers: tuple[Comparison, ...]

    def count(self, verdict: Verdict) -> int:
        """Return how many numbers have a verdict."""
        return sum(each.verdict is verdict for each in self.numbers)


def read_paper(name: str) -> Paper:
    """Read the numbers of a paper."""
    text = resources.files("experiments").joinpath("printed", f"{name}.toml").read_text(encoding="utf-8")
    data = tomllib.loads(text)
    tables: dict[str, tuple[PrintedNumber, ...]] = {}
    for table in data["tables"]:
        shared = data.get("defaults", {}) | table
        numbers = shared.pop("numbers")
        for number_name, digits in numbers.items():
            known = shared | ({"printed": digits} if isinstance(digits, str) else digits)
            known |= {"note": data["notes"][known["note"]]} if "note" in known else {}
            known["origin"] = Origin(known.get("origin", Origin.PRINTED))
            number = PrintedNumber(name=number_name, **known)
            tables[number.source] = (*tables.get(number.source, ()), number)
    return Paper(name, data["title"], tuple(data["remarks"]), tables)


def last_digit(text: str) -> float:
    """Return one unit of the last digit of a number: 0.0001 for ``0.0690``."""
    exponent = Decimal(text).as_tuple().exponent
    if not isinstance(exponent, int):
        raise ValueError(f"{text} is not a finite number")
    return float(Decimal(1).scaleb(exponent))
