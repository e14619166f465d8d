"""Published numbers compared with computed ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
from typing import Any

Progress = Callable[[float], None]

ROUNDED = 0.5
"""Error of a rounded number, in units of its last printed digit."""
CUT_OR_ROUNDED = 1.0
"""The same if a paper rounds some numbers and truncates others."""

COMPUTED = 1.0
"""The same for a reference value of ten or more digits, whose last digit has the error of another computation."""


class Origin(Enum):
    """Where the number comes from that ours is compared with."""

    PRINTED = "paper"
    """The paper prints it."""
    OTHER = "other implementation"
    """Another implementation computed it; the paper prints no such number."""
    EXACT = "closed form"
    """It is the exact value of a closed form."""


class Verdict(Enum):
    """Result of the comparison of a published number with ours."""

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
        """Return the numbers that a printed number stands for.

        The half width is `units` of the last digit, plus `beyond` for the rounding of the inputs of the computation.
        """
        # A few ulp more, so that a number on the boundary is inside.
        half_width = (units * last_digit(text) + beyond) * (1.0 + 1e-9)
        return cls(float(text) - half_width, float(text) + half_width)


@dataclass(frozen=True)
class PublishedNumber:
    """A published number and ours.

    Parameters
    ----------
    source : str
        Table or equation.
    printed : str
        Digits as printed, or of the number of another `origin`.
    ours : float or None
        None if the computation has no result.
    band : Band
        Interval in which ours agrees with the printed number.
    other : float or None
        The number of the other model with which the paper's number was probably computed, if one is known.
    right : Band or None
        Interval in which ours, or `other` if it is given, must lie although the printed number is a different one.
    corrected : str or None
        The correct number, if known.
    unexplained : bool
        Whether the numbers are known to differ for an unknown reason.
    note : str
        Explanation of a misprint, or what was tried to explain a difference.
    spread : Band or None
        Interval of most of our values, if ours is the median of many runs and the printed number is one run. The
        printed number must then lie in this interval.
    """

    paper: str
    source: str
    name: str
    printed: str
    ours: float | None
    band: Band
    other: float | None = None
    right: Band | None = None
    corrected: str | None = None
    unexplained: bool = False
    note: str = ""
    spread: Band | None = None
    origin: Origin = Origin.PRINTED

    @property
    def verdict(self) -> Verdict:
        """Return the result of the comparison."""
        if self.ours is None or not abs(self.ours) < float("inf"):
            return Verdict.DISAGREED
        if self.right is not None:
            known = Verdict.NOT_EXPLAINED if self.unexplained else Verdict.MISPRINT
            return known if (self.ours if self.other is None else self.other) in self.right else Verdict.DISAGREED
        if float(self.printed) in self.spread if self.spread is not None else self.ours in self.band:
            return Verdict.AGREED
        if self.other is not None and self.other in self.band:
            return Verdict.EXPLAINED
        return Verdict.NOT_EXPLAINED if self.unexplained else Verdict.DISAGREED


@dataclass(frozen=True)
class Reproduction:
    """All numbers of a paper, the name and hash of each problem or scenario, and remarks about other misprints."""

    paper: str
    title: str
    problems: tuple[tuple[str, str], ...]
    numbers: tuple[PublishedNumber, ...]
    remarks: tuple[str, ...]

    def count(self, verdict: Verdict) -> int:
        """Return how many numbers have a verdict."""
        return sum(each.verdict is verdict for each in self.numbers)


@dataclass(frozen=True)
class Reference:
    """A paper, the rounding of its numbers in units of the last printed digit, and their origin."""

    paper: str
    units: float = ROUNDED
    origin: Origin = Origin.PRINTED

    def number(
        self,
        source: str,
        name: str,
        printed: str,
        ours: float | None,
        *,
        corrected: str | None = None,
        beyond: float = 0.0,
        **known: Any,
    ) -> PublishedNumber:
        """Return a number whose tolerance is the rounding of the last digit of `printed`, or of `corrected`.

        `beyond` is added to the tolerance, for the rounding of the inputs of the computation; `known` are further
        fields of `PublishedNumber`.
        """
        band = Band.of_digits(printed, self.units, beyond)
        right = None if corrected is None else Band.of_digits(corrected, self.units, beyond)
        found = None if ours is None else float(ours)
        known |= {"right": right, "corrected": corrected, "origin": self.origin}
        return PublishedNumber(self.paper, source, name, printed, found, band, **known)

    def numbers(self, source: str, printed: Mapping[str, str], ours: Iterable[float | None]) -> list[PublishedNumber]:
        """Return the numbers of a table, printed ones by name."""
        pairs = zip(printed.items(), ours, strict=True)
        return [self.number(source, name, text, value) for (name, text), value in pairs]


def last_digit(text: str) -> float:
    """Return one unit of the last digit of a number: 0.0001 for ``0.0690``."""
    exponent = Decimal(text).as_tuple().exponent
    if not isinstance(exponent, int):
        raise ValueError(f"{text} is not a finite number")
    return float(Decimal(1).scaleb(exponent))
