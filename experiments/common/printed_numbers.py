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
    """Ours is the printed number, to the last digit (`PrintedNumber.tolerance`) or in its interval
    `agrees`; or the printed number is of one run, and a narrow interval of our runs contains it.
    """
    POSSIBLE = "possible"
    """The printed number is of one run, and lies in an interval of our runs that is too wide to
    confirm it.
    """
    MISPRINT = "misprint"
    """The correct number is known, and it is ours, or the number of the other model."""
    EXPLAINED = "explained by another model"
    """The numbers differ, and another model than the paper's equations gives the printed number."""
    NOT_EXPLAINED = "not explained"
    """The numbers differ for an unknown reason."""
    DISAGREED = "disagreed"
    """The numbers should agree and do not, or the computation has no result."""


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
        Explanation of a misprint, or attempts to explain a difference.
    tolerance : float
        Largest error of the digits, in units of the last one: 0.5 if rounded, 1 if a paper rounds
        some numbers and truncates others, or if the last of ten or more digits has the error of
        another computation.
    agrees : (float, float) or None
        Interval in which a number agrees, if it does not follow from the digits.
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
        differ by less than a factor of 2. Its ends are positive.
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
        """Return the interval in which the numbers agree.

        With `spread` it must contain the printed number, otherwise ours. It is about the printed
        digits even if they are a misprint; the verdict then uses the corrected digits.
        """
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
            return self._verdict_of_misprint(number.corrected)

        if ours.spread is not None:
            if _within(number.value, self.band):
                return self._verdict_of_one_run()
        elif _within(ours.value, self.band):
            return NumberVerdict.AGREED
        return self._verdict_of_difference()

    def _verdict_of_difference(self) -> NumberVerdict:
        """Return whether the difference is explained, or known but not explained."""
        other = self.ours.other
        if other is not None and _within(other, self.band):
            return NumberVerdict.EXPLAINED
        if _within(self.ours.value, interval(self.number.printed, self.number.unexplained)):
            return NumberVerdict.NOT_EXPLAINED
        return NumberVerdict.DISAGREED

    def _verdict_of_misprint(self, corrected: str) -> NumberVerdict:
        """Return whether our number is the correct one.

        If there is a number of another model, it is compared instead of ours.
        """
        value = self.ours.value
        if self.ours.other is not None:
            value = self.ours.other
        if _within(value, interval(corrected, self.number.tolerance, self.ours.beyond)):
            return NumberVerdict.MISPRINT
        return NumberVerdict.DISAGREED

    def _verdict_of_one_run(self) -> NumberVerdict:
        """Return whether the interval of our runs confirms a printed number in it."""
        low, high = self.band
        if high < 2.0 * low:
            return NumberVerdict.AGREED
        return NumberVerdict.POSSIBLE


@dataclass(frozen=True)
class Paper:
    """The numbers of a paper by source, and remarks about other misprints.

    `options` are the options of commands, by source.
    """

    name: str
    title: str
    remarks: tuple[str, ...]
    tables: Mapping[str, tuple[PrintedNumber, ...]]
    options: Mapping[str, Mapping[str, Any]]

    def compare(self, ours: Mapping[str, Sequence[Ours | float]]) -> tuple[NumberComparison, ...]:
        """Compare every number of the paper; ours are by source too, in the same order."""
        compared = []
        for source, numbers in self.tables.items():
            for number, value in zip(numbers, ours[source], strict=True):
                known = value if isinstance(value, Ours) else Ours(float(value))
                compared.append(NumberComparison(number, known))
        return tuple(compared)


def read_paper(name: str) -> Paper:
    """Read the numbers of a paper."""
    file = resources.files("infoset.experiments").joinpath("printed", f"{name}.toml")
    data = tomllib.loads(file.read_text(encoding="utf-8"))
    tables: dict[str, tuple[PrintedNumber, ...]] = {}
    options: dict[str, Mapping[str, Any]] = {}

    for table in data["tables"]:
        shared = data.get("defaults", {}) | table
        options.setdefault(table["source"], shared.pop("options", {}))
        for number_name, digits in shared.pop("numbers").items():
            own = {"printed": digits} if isinstance(digits, str) else digits
            known = shared | own
            if "note" in known:
                known["note"] = data["notes"][known["note"]]
            number = PrintedNumber(name=number_name, **known)
            tables[number.source] = (*tables.get(number.source, ()), number)

    return Paper(name, data["title"], tuple(data["remarks"]), tables, options)


def interval(digits: str, units: float, beyond: float = 0.0) -> tuple[float, float]:
    """Return the interval of numbers that differ from digits by some units of the last one.

    `beyond` is added to the half width.
    """
    # A billionth more: a number on the boundary is inside although both are rounded in binary (for
    # digits up to six; with more, the rounding is greater than this billionth).
    half_width = (units * last_digit(digits) + beyond) * (1.0 + 1e-9)
    return float(digits) - half_width, float(digits) + half_width


def last_digit(digits: str) -> float:
    """Return one unit of the last digit of a number: 0.0001 for ``0.0690``."""
    exponent = Decimal(digits).as_tuple().exponent
    assert isinstance(exponent, int)  # a finite number
    return float(Decimal(1).scaleb(exponent))


def _within(value: float, ends: tuple[float, float]) -> bool:
    return ends[0] <= value <= ends[1]
