"""Numbers of papers, read from `experiments/printed`, and their comparison with ours.

A file has the title of a paper, remarks about misprints that are not in its numbers, and tables.
Each line of a table is a number: its name, and its digits as printed or the fields of
`PrintedNumber`. Fields that many numbers share stand once, in their table or in ``[defaults]``; a
note is a key of ``[notes]``. A table may have ``options`` of a command: the names of its numbers
are then keys of the results of this command.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
from importlib import resources
from typing import Any

Progress = Callable[[float], None]


class NumberVerdict(Enum):
    """Result of the comparison of a printed number with ours."""

    AGREED = "agreed"
    """Ours is the printed number, to the last digit."""
    POSSIBLE = "possible"
    """The printed number is that of one run, and runs of ours have it; their interval is too wide
    to confirm it.
    """
    MISPRINT = "misprint"
    """The correct number is known, and it is ours, or that of the other model if there is one."""
    EXPLAINED = "explained by another model"
    """The numbers differ, and a model other than that of the paper's equations gives the printed
    number.
    """
    NOT_EXPLAINED = "not explained"
    """The numbers differ for an unknown reason."""
    DISAGREED = "disagreed"
    """The numbers should agree and do not."""


@dataclass(frozen=True)
class PrintedNumber:
    """A number of a paper.

    Parameters
    ----------
    source : str
        Table, equation or section.
    printed : str
        Digits as printed.
    corrected : str or None
        The correct number, if the printed one is known to be a misprint.
    unexplained : float
        Largest difference for an unknown reason, in units of the last digit; 0 if the numbers
        should agree.
    note : str
        Explanation of a misprint, or what was tried to explain a difference.
    tolerance : float
        Largest error of the digits, in units of the last one: 0.5 if rounded, 1 if a paper rounds
        some numbers and truncates others, or if the last of ten or more digits has the error of
        another computation.
    agrees : (float, float) or None
        Interval in which a number agrees, if it is another one than that of the digits.
    """

    source: str
    name: str
    printed: str
    corrected: str | None = None
    unexplained: float = 0.0
    note: str = ""
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
    value : float
        NaN if the computation has no result.
    other : float or None
        The number of the other model with which the paper's number was probably computed, if one is
        known.
    beyond : float
        Added to the tolerance, for the rounding of the inputs of the computation.
    spread : (float, float) or None
        Interval of most of our values, if ours is the median of many runs and the printed number is
        one run. The printed number must then lie in this interval, which confirms it if its ends
        differ by less than a factor of 2.
    """

    value: float
    other: float | None = None
    beyond: float = 0.0
    spread: tuple[float, float] | None = None


@dataclass(frozen=True)
class NumberComparison:
    """A printed number and ours."""

    number: PrintedNumber
    ours: Ours

    @property
    def band(self) -> tuple[float, float]:
        """Return the interval in which the numbers agree."""
        number = self.number
        ours = self.ours
        return (
            ours.spread or number.agrees or interval(number.printed, number.tolerance, ours.beyond)
        )

    @property
    def verdict(self) -> NumberVerdict:
        """Return the result of the comparison."""
        number = self.number
        ours = self.ours
        if not math.isfinite(ours.value):
            return NumberVerdict.DISAGREED
        if number.corrected is not None:
            value = ours.value if ours.other is None else ours.other
            is_right = _within(value, interval(number.corrected, number.tolerance, ours.beyond))
            return NumberVerdict.MISPRINT if is_right else NumberVerdict.DISAGREED
        low, high = self.band
        if _within(ours.value if ours.spread is None else number.value, self.band):
            return (
                NumberVerdict.AGREED
                if ours.spread is None or high < 2.0 * low
                else NumberVerdict.POSSIBLE
            )
        if ours.other is not None and _within(ours.other, self.band):
            return NumberVerdict.EXPLAINED
        known = _within(ours.value, interval(number.printed, number.unexplained))
        return NumberVerdict.NOT_EXPLAINED if known else NumberVerdict.DISAGREED


@dataclass(frozen=True)
class Paper:
    """The numbers of a paper by source, options of commands by source, and remarks about other
    misprints.
    """

    name: str
    title: str
    remarks: tuple[str, ...]
    tables: Mapping[str, tuple[PrintedNumber, ...]]
    options: Mapping[str, Mapping[str, Any]]

    def compare(self, ours: Mapping[str, Sequence[Ours | float]]) -> tuple[NumberComparison, ...]:
        """Compare every number of the paper; ours are by source too, in the same order."""
        return tuple(
            NumberComparison(number, value if isinstance(value, Ours) else Ours(float(value)))
            for source, numbers in self.tables.items()
            for number, value in zip(numbers, ours[source], strict=True)
        )


def read_paper(name: str) -> Paper:
    """Read the numbers of a paper."""
    text = (
        resources.files("infoset.experiments")
        .joinpath("printed", f"{name}.toml")
        .read_text(encoding="utf-8")
    )
    data = tomllib.loads(text)
    tables: dict[str, tuple[PrintedNumber, ...]] = {}
    options: dict[str, Mapping[str, Any]] = {}
    for table in data["tables"]:
        shared = data.get("defaults", {}) | table
        options.setdefault(table["source"], shared.pop("options", {}))
        for number_name, digits in shared.pop("numbers").items():
            known = shared | ({"printed": digits} if isinstance(digits, str) else digits)
            known |= {"note": data["notes"][known["note"]]} if "note" in known else {}
            number = PrintedNumber(name=number_name, **known)
            tables[number.source] = (*tables.get(number.source, ()), number)
    return Paper(name, data["title"], tuple(data["remarks"]), tables, options)


def interval(digits: str, units: float, beyond: float = 0.0) -> tuple[float, float]:
    """Return the interval of numbers that differ from digits by some units of the last one, plus
    `beyond`.
    """
    # A few ulp more, so that a number on the boundary is inside.
    half_width = (units * last_digit(digits) + beyond) * (1.0 + 1e-9)
    return float(digits) - half_width, float(digits) + half_width


def last_digit(digits: str) -> float:
    """Return one unit of the last digit of a number: 0.0001 for ``0.0690``."""
    exponent = Decimal(digits).as_tuple().exponent
    assert isinstance(exponent, int)  # a finite number
    return float(Decimal(1).scaleb(exponent))


def _within(value: float, ends: tuple[float, float]) -> bool:
    return ends[0] <= value <= ends[1]
