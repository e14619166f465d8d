"""A published number beside ours, and what follows from the two."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum

Progress = Callable[[float], None]

ROUNDED = 0.5
"""Units of the last printed digit that a rounded number may be off."""
CUT_OR_ROUNDED = 1.0
"""The same where a paper rounds some numbers and cuts others off."""

COMPUTED = 1.0
"""The same of a reference value of ten digits or more, whose own last one has the error of another computation."""


class Verdict(Enum):
    """What a published number beside ours comes to."""

    AGREED = "agreed"
    """Ours is the printed number, to its last digit."""
    MISPRINT = "misprint"
    """It is known what should have been printed, and that is ours."""
    NOT_EXPLAINED = "not explained"
    """The numbers differ, and it is not known why."""
    DISAGREED = "disagreed"
    """The numbers should agree, and do not."""


@dataclass(frozen=True)
class Band:
    """Where a number must lie.

    Parameters
    ----------
    lowest, highest : float
    """

    lowest: float
    highest: float

    def __contains__(self, value: float) -> bool:
        """Whether a number lies there; what is not finite never does."""
        return self.lowest <= value <= self.highest

    @classmethod
    def of_digits(cls, text: str, units: float, beyond: float = 0.0) -> Band:
        """Return the numbers that a text stands for.

        Parameters
        ----------
        text : str
            Digits as printed.
        units : float
            Of its last digit.
        beyond : float
            What is added, for the rounding of what the number was computed from.

        Returns
        -------
        Band
        """
        # A few ulp more, so that a number on the edge is inside.
        half_width = (units * last_digit(text) + beyond) * (1.0 + 1e-9)
        return cls(float(text) - half_width, float(text) + half_width)


@dataclass(frozen=True)
class PublishedNumber:
    """A published number beside ours.

    Parameters
    ----------
    paper : str
    source : str
        Table or equation.
    name : str
        Of what, with its unit.
    printed : str
        Digits as printed.
    ours : float or None
        None where the computation has no answer.
    band : Band
        Where ours must lie to agree with what is printed.
    right : Band or None
        Where ours must lie although the printed number is another one.
    corrected : str or None
        What should have been printed, where that is known.
    unexplained : bool
        Whether it is known to differ without a known reason.
    note : str
        Of a misprint what is right and why; of what is not explained what was tried.
    spread : Band or None
        Where most of ours lie, where ours is the median of many runs and the printed number is one run: that must lie
        there then, in place of ours in the band.
    """

    paper: str
    source: str
    name: str
    printed: str
    ours: float | None
    band: Band
    right: Band | None = None
    corrected: str | None = None
    unexplained: bool = False
    note: str = ""
    spread: Band | None = None

    @property
    def verdict(self) -> Verdict:
        """What it comes to."""
        if self.ours is None or not abs(self.ours) < float("inf"):
            return Verdict.DISAGREED
        known = Verdict.NOT_EXPLAINED if self.unexplained else Verdict.MISPRINT
        if self.right is not None:
            return known if self.ours in self.right else Verdict.DISAGREED
        if float(self.printed) in self.spread if self.spread is not None else self.ours in self.band:
            return Verdict.AGREED
        return Verdict.NOT_EXPLAINED if self.unexplained else Verdict.DISAGREED


@dataclass(frozen=True)
class Reproduction:
    """All numbers of a paper.

    Parameters
    ----------
    paper : str
        Name for the command line.
    title : str
    problems : tuple of (str, str)
        Name and hash of the problems or scenarios that ours were computed from.
    numbers : tuple of PublishedNumber
    remarks : tuple of str
        What is printed wrong or left out beside numbers.
    """

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
    """A paper and how it prints its numbers: makes published numbers of it.

    Parameters
    ----------
    paper : str
    units : float
        Of the last printed digit that ours may be off.
    """

    paper: str
    units: float = ROUNDED

    def number(
        self,
        source: str,
        name: str,
        printed: str,
        ours: float | None,
        *,
        corrected: str | None = None,
        unexplained: bool = False,
        beyond: float = 0.0,
        note: str = "",
    ) -> PublishedNumber:
        """Return a number whose tolerance is that of its last printed digit.

        Parameters
        ----------
        source, name, printed : str
        ours : float or None
        corrected : str or None
            What should have been printed; its own last digit is the tolerance then.
        unexplained : bool
        beyond : float
            Added to the tolerance, for the rounding of what the number was computed from.
        note : str

        Returns
        -------
        PublishedNumber
        """
        band = Band.of_digits(printed, self.units, beyond)
        right = None if corrected is None else Band.of_digits(corrected, self.units, beyond)
        found = None if ours is None else float(ours)
        return PublishedNumber(self.paper, source, name, printed, found, band, right, corrected, unexplained, note)


def last_digit(text: str) -> float:
    """Return one unit of the last digit of a number.

    Parameters
    ----------
    text : str
        For example ``0.0690``, whose last digit is worth 0.0001.

    Returns
    -------
    float
    """
    exponent = Decimal(text).as_tuple().exponent
    if not isinstance(exponent, int):
        raise ValueError(f"{text} is no finite number")
    return float(Decimal(1).scaleb(exponent))
