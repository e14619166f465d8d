"""Quantiles as text, and the rule that stops a campaign by the width of a quantile's interval."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np

from infoset.arrays import Floats
from infoset.limits import Checked, Fraction, Positive, check_fields
from infoset.sim.statistics import estimate_quantiles, level_name, number_text

QUANTITIES = ("miss_m", "impulse_m_s", "guaranteed_miss_m")
"""Columns of results whose quantiles are estimated."""
DIGITS = r"[0-9]{1,20}(?:\.[0-9]{1,25})?(?:[eE][+-]?[0-9]{1,3})?"
"""A number as text, without a sign and of limited length: any finite one from zero on that
`number_text` writes."""
_RULE = re.compile(
    rf"\s*(?P<quantity>\w+)\s+p(?P<percent>{DIGITS})\s+ci\s*<\s*(?P<width>{DIGITS})\s*"
)


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
        If the quantity is unknown, or the level is out of its range.
    """

    quantity: str
    level: Fraction

    def __post_init__(self) -> None:
        check_fields(self)
        if self.quantity not in QUANTITIES:
            raise ValueError(
                f"there is no quantity {self.quantity[:40]}; choose one of: {', '.join(QUANTITIES)}"
            )

    def __str__(self) -> str:
        return f"{self.quantity} {level_name(self.level)}"

    @classmethod
    def of_percent(cls, quantity: str, percent: str) -> QuantileName:
        """Return the quantile of a level in percent, as text."""
        return cls(quantity, float(Decimal(percent) / 100))


@dataclass(frozen=True)
class StoppingRule(Checked):
    """Stop when the confidence interval of a quantile is narrow enough: `miss_m p99 ci<0.5`.

    Parameters
    ----------
    quantile : QuantileName
        Quantile whose interval is compared with the width.
    width : float
        Limit of the width of the interval, in the unit of the quantity.
    confidence : float
        Confidence of the interval, in (0, 1).
    """

    quantile: QuantileName
    width: Positive
    confidence: Fraction = 0.95

    def __str__(self) -> str:
        return f"{self.quantile} ci<{number_text(self.width)}"

    @classmethod
    def parse(cls, text: str) -> StoppingRule:
        """Read `miss_m p99 ci<0.5`.

        Raises
        ------
        ValueError
            For any other text.
        """
        match = _RULE.fullmatch(text)
        if match is None:
            raise ValueError(
                'must be a quantity, a quantile and a width, for example "miss_m p99 ci<0.5"'
            )
        return cls(
            QuantileName.of_percent(match["quantity"], match["percent"]), float(match["width"])
        )

    @property
    def quantity(self) -> str:
        """Column of the results with the quantity."""
        return self.quantile.quantity

    def numbers(self, column: Any) -> Floats:
        """Return the values of the quantity in a table of runs, NaN if unknown."""
        return np.asarray(column.to_numpy(np.float64, na_value=np.nan))

    def met_by(self, sample: Floats) -> bool:
        """Return whether the interval of a finite sample is narrower than the width.

        It is not if the sample is empty, or too small to bound both sides.
        """
        if not sample.size:
            return False
        (estimate,) = estimate_quantiles(sample, [self.quantile.level], self.confidence)
        return estimate.width is not None and estimate.width < self.width
