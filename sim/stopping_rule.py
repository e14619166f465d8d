"""When a campaign may stop: the confidence interval of a quantile is narrow enough."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoset.limits import Fraction, Positive, check_fields
from sim.statistics import estimate_quantiles

Floats = NDArray[np.float64]

QUANTITIES = ("miss_m", "impulse_m_s", "guaranteed_miss_m")
GROWTH = 1.05
"""Between two looks the sample grows by this factor at least: looking after every chunk would cost O(N^2)."""

_QUANTILE = r"\s*(?P<quantity>\w+)\s+p(?P<level>\d{1,2}(?:\.\d{1,6})?)\s*"
_NUMBER = r"\s*(?P<number>\d{1,15}(?:\.\d{1,15})?(?:[eE][+-]?\d{1,3})?)\s*"


@dataclass(frozen=True)
class QuantileName:
    """A quantile of a quantity, written `miss_m p99`.

    Parameters
    ----------
    quantity : str
        One of `QUANTITIES`.
    level : float
        Between 0 and 1.

    Raises
    ------
    TypeError, ValueError
        If there is no such quantity, or the level is out of its range.
    """

    quantity: str
    level: Fraction

    def __post_init__(self) -> None:
        check_fields(self)
        if self.quantity not in QUANTITIES:
            raise ValueError(f"there is no quantity {self.quantity[:40]}; choose one of: {', '.join(QUANTITIES)}")

    def __str__(self) -> str:
        """As it is written."""
        return f"{self.quantity} {level_name(self.level)}"

    @classmethod
    def parse(cls, text: str) -> QuantileName:
        """Read `miss_m p99`.

        Parameters
        ----------
        text : str

        Returns
        -------
        QuantileName

        Raises
        ------
        ValueError
            If it is written otherwise.
        """
        found = re.fullmatch(_QUANTILE, text[:100])
        if found is None:
            raise ValueError('must be a quantity and a quantile, for example "miss_m p99"')
        return _quantile(found)


@dataclass(frozen=True)
class StoppingRule:
    """Stop when the confidence interval of a quantile is narrower than a width, written `miss_m p99 ci<0.5`.

    Parameters
    ----------
    quantile : QuantileName
    width : float
        In the unit of the quantity.
    confidence : float
        Of the interval, in (0, 1).

    Raises
    ------
    TypeError, ValueError
        If the width or the confidence is out of its range.
    """

    quantile: QuantileName
    width: Positive
    confidence: Fraction = 0.95

    def __post_init__(self) -> None:
        check_fields(self)

    def __str__(self) -> str:
        """As it is written."""
        return f"{self.quantile} ci<{self.width:g}"

    @classmethod
    def parse(cls, text: str) -> StoppingRule:
        """Read `miss_m p99 ci<0.5`.

        Parameters
        ----------
        text : str

        Returns
        -------
        StoppingRule

        Raises
        ------
        ValueError
            If it is written otherwise.
        """
        found = re.fullmatch(rf"{_QUANTILE}\s+ci\s*<{_NUMBER}", text[:100])
        if found is None:
            raise ValueError('must be a quantity, a quantile and a width, for example "miss_m p99 ci<0.5"')
        width = float(found["number"])
        if not 0.0 < width < math.inf:
            raise ValueError("the width of the confidence interval must be greater than 0")
        return cls(_quantile(found), width)

    def met_by(self, sample: Floats) -> bool:
        """Whether a sample is large enough."""
        if not sample.size:
            return False
        (found,) = estimate_quantiles(sample, [self.quantile.level], self.confidence)
        return found.width is not None and found.width < self.width


@dataclass(frozen=True)
class Requirement:
    """What a quantile must stay under, written `miss_m p99<10`.

    Parameters
    ----------
    quantile : QuantileName
    bound : float
        In the unit of the quantity.

    Raises
    ------
    TypeError, ValueError
        If the bound is not positive.
    """

    quantile: QuantileName
    bound: Positive

    def __post_init__(self) -> None:
        check_fields(self)

    def __str__(self) -> str:
        """As it is written."""
        return f"{self.quantile}<{self.bound:g}"

    @classmethod
    def parse(cls, text: str) -> Requirement:
        """Read `miss_m p99<10`.

        Parameters
        ----------
        text : str

        Returns
        -------
        Requirement

        Raises
        ------
        ValueError
            If it is written otherwise.
        """
        found = re.fullmatch(rf"{_QUANTILE}<{_NUMBER}", text[:100])
        if found is None:
            raise ValueError('must be a quantity, a quantile and a bound, for example "miss_m p99<10"')
        bound = float(found["number"])
        if not 0.0 < bound < math.inf:
            raise ValueError("the bound must be greater than 0")
        return cls(_quantile(found), bound)


class Watch:
    """Looks at the chunks of a campaign in their order, as far as they are there without a gap, and says when to stop.

    Parameters
    ----------
    rule : StoppingRule
    groups : int
        Into how many samples each chunk is split: one a noise. The rule must be met by each.
    read : callable
        Returns the samples of a chunk, one a group.
    chunks : int
        How many chunks there are.

    Notes
    -----
    It looks after certain numbers of chunks only, which do not depend on who flew them or when: so the campaign stops
    at the same run on one worker and on a hundred, in one session and in ten. O(N log N) over a campaign.
    """

    def __init__(self, rule: StoppingRule, groups: int, read: Callable[[int], list[Floats]], chunks: int) -> None:
        self._rule = rule
        self._read = read
        self._chunks = chunks
        self._samples: list[list[Floats]] = [[] for _ in range(groups)]
        self._seen = 0
        self._looks = _looks(chunks)
        self._next = next(self._looks)

    def met(self, finished: Callable[[int], bool]) -> int | None:
        """Look at what is new.

        Parameters
        ----------
        finished : callable
            Whether a chunk is there.

        Returns
        -------
        int or None
            After how many chunks to stop; None: not yet.
        """
        while self._seen < self._chunks and finished(self._seen):
            for sample, values in zip(self._samples, self._read(self._seen), strict=True):
                sample.append(values)
            self._seen += 1
            if self._seen == self._next:
                self._next = next(self._looks)
                self._samples = [[np.concatenate(sample)] for sample in self._samples]
                if all(self._rule.met_by(sample[0]) for sample in self._samples):
                    return self._seen
        return None


def level_name(level: float) -> str:
    """Return a level as a name: p99 of 0.99, p99.9 of 0.999."""
    return f"p{round(100.0 * level, 8):g}"


def _looks(chunks: int) -> Iterator[int]:
    """After how many chunks the samples are looked at."""
    count = 0
    while True:
        count = max(count + 1, math.ceil(GROWTH * count))
        yield count if count < chunks else chunks


def _quantile(found: re.Match[str]) -> QuantileName:
    quantity, level = found["quantity"], float(found["level"]) / 100.0
    if not 0.0 < level < 1.0:
        raise ValueError("the quantile must lie between p0 and p100, for example p99")
    return QuantileName(quantity, level)
