"""Requirements of a study, and whether a sample meets them: met, not met, or undecided."""

from __future__ import annotations

import functools
import math
import re
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats, Integers
from infoset.limits import Checked, Fraction, Positive
from sim.statistics import estimate_hits, min_count, number_text, shows
from sim.stopping_rule import DIGITS, NUMBER, QUANTITIES, QuantileName, parse_quantile

CONFIDENCE = 0.95
MAX_RUNS_NEEDED = 1_000_000
"""Maximum number of runs that `Verdict.runs_needed` names."""
_TAIL = 0.5 * (1.0 - CONFIDENCE)
_HIT = re.compile(rf"\s*hit\s*>=?{NUMBER}")
DEFAULT_QUANTILE = "p99"
"""Quantile of a requirement that names none."""
_WITHOUT_QUANTILE = re.compile(r"^\s*(?P<quantity>\w+)\s*<")
_ALMOST = re.compile(
    rf"\s*(?P<quantity>[a-z]\w*)\s*(?:p?(?P<level>{DIGITS})\s*%?)?\s*(?P<sign>[<>=]=?|[≤≥])\s*(?P<number>{DIGITS})"
    r"\s*(?P<unit>%|[a-z/]*)\s*",
    re.IGNORECASE,
)
"""A requirement with a common mistake: another sign, a percentage, a unit, or a part of a name."""
_STEPS = 50
"""Steps of bisection for an end of an interval."""


class Decision(Enum):
    """Whether a requirement is met."""

    MET = "met"
    NOT_MET = "not-met"
    UNDECIDED = "undecided"
    """The confidence interval contains the bound, or is open on its side: more runs may decide."""

    def __str__(self) -> str:
        return self.value.replace("-", " ")


@dataclass(frozen=True)
class Requirement(Checked):
    """An upper bound of a quantile, written `miss_m p99<10`.

    It is a requirement on a share of the runs: at least 99 % of the misses are less than 10 m.

    Parameters
    ----------
    quantile : QuantileName
        What is bounded.
    bound : float
        In the unit of the quantity.

    Raises
    ------
    TypeError, ValueError
        If the bound is not positive.
    """

    quantile: QuantileName
    bound: Positive

    unknown: ClassVar[float] = math.inf
    """Value of a run without the quantity, for example without a bound Phi: it does not satisfy the bound."""

    def __str__(self) -> str:
        return f"{self.quantile}<{number_text(self.bound)}"

    @classmethod
    def parse(cls, text: str) -> Requirement:
        """Read `miss_m p99<10`, or `miss_m<10`, which is the same; raise ValueError for any other text."""
        example = 'a quantity, a quantile and a bound, for example "miss_m p99<10", or "hit>=0.95"'
        named = _WITHOUT_QUANTILE.sub(rf"\g<quantity> {DEFAULT_QUANTILE}<", text[:100])
        return cls(*parse_quantile(named, f"<{NUMBER}", example, "the bound"))

    @property
    def name(self) -> str:
        """Name of what is bounded."""
        return str(self.quantile)

    @property
    def share(self) -> float:
        """Share of the runs that must be below the bound."""
        return self.quantile.level

    @property
    def quantity(self) -> str:
        """Column of the results that it uses."""
        return self.quantile.quantity

    def holds(self, values: Floats) -> Flags:
        """Return for each of the quantity's `values` whether it is below the bound."""
        return np.asarray(values < self.bound)


@dataclass(frozen=True)
class HitRequirement(Checked):
    """A lower bound of the probability of a hit, written `hit>=0.95`.

    Parameters
    ----------
    share : float
        Minimum share of the runs that hit, between 0 and 1.

    Raises
    ------
    TypeError, ValueError
        If the share is not between 0 and 1.
    """

    share: Fraction

    name: ClassVar[str] = "hit"
    quantity: ClassVar[str] = "hit"
    unknown: ClassVar[float] = 0.0

    def __str__(self) -> str:
        return f"hit>={number_text(self.share)}"

    @property
    def bound(self) -> float:
        """Bound of the probability."""
        return self.share

    def holds(self, values: Floats) -> Flags:
        """Return for each of the `values` of the column, 0 or 1, whether the run hits."""
        return np.asarray(values > 0.0)


AnyRequirement = Requirement | HitRequirement


def parse_requirement(text: str) -> AnyRequirement:
    """Read `miss_m p99<10` or `hit>=0.95`, which may be written `hit>0.95`; raise ValueError for any other text."""
    match = _HIT.fullmatch(text[:100])
    try:
        if match is None:
            return Requirement.parse(text)
        share = float(match["number"])
        if not 0.0 < share < 1.0:
            raise ValueError(f"the share of hits must be between 0 and 1, found {match['number']}")
        return HitRequirement(share)
    except ValueError as error:
        mistake = _mistake(text[:100])
        raise ValueError(mistake or (f"{error}; for example hit>=0.95" if match else str(error))) from None


def _mistake(text: str) -> str | None:
    """Return what is wrong with a requirement that is almost right, and the corrected text; None if not recognized."""
    match = _ALMOST.fullmatch(text)
    if match is None:
        return None
    name, level, sign, number, unit = match.group("quantity", "level", "sign", "number", "unit")
    name = name.lower()
    faults = []
    if name.startswith("hit"):
        if "<" in sign:
            return f'hits must be bounded from below: write for example "hit>=0.95", found {text.strip()!r}'
        share = float(number) / (100.0 if unit == "%" or float(number) >= 50.0 else 1.0)
        if share == 1.0:
            reason = "the share of hits must be less than 1, because no number of runs shows that all engagements hit"
            return f'{reason}: write "hit>=0.99", found {text.strip()!r}'
        if level or not 0.0 < share < 1.0 or unit not in ("", "%"):
            return None
        corrected = str(HitRequirement(float(f"{share:.12g}")))
        if share != float(number):
            faults.append("the share of hits must be a number between 0 and 1")
    else:
        quantity = next((known for known in QUANTITIES if known.startswith(name)), None)
        if quantity is None or not float(number) > 0.0:
            return None
        own_unit = "m/s" if quantity.endswith("_m_s") else "m"
        if unit not in ("", own_unit):
            return f"the bound of {quantity} must be a number in {own_unit}, without its unit, found {text.strip()!r}"
        corrected = f"{quantity} {f'p{level}' if level else DEFAULT_QUANTILE}<{number}"
        try:
            Requirement.parse(corrected)
        except ValueError:
            return None
        if quantity != name:
            faults.append(f"the quantity must be {quantity}")
        if ">" in sign:
            faults.append(f"{quantity} must be bounded from above, with <")
        if unit:
            faults.append("the bound must be written without its unit, which is that of the quantity")
    faults = faults or ["the form must be QUANTITY pLEVEL<BOUND or hit>=SHARE"]
    return f'{"; ".join(faults)}: write "{corrected}", found {text.strip()!r}'


@dataclass(frozen=True)
class Verdict:
    """The decision of a sample about a requirement, with the estimate and its interval.

    Parameters
    ----------
    decision : Decision
        Met if the interval is on the right side of the bound, not met if it is on the wrong side.
    value : float or None
        The required quantile of the sample, in its unit, or the share of hits; None if the sample does not show it
        (`sim.statistics.shows`), or if too many runs have no value.
    lower, upper : float or None
        Ends of its 95 % confidence interval; None if the sample is too small to bound that side.
    runs_needed : int or None
        Approximate number of runs that decide with `watched=True`, if the share of runs that satisfy the bound stays
        the same; None if it is over `MAX_RUNS_NEEDED`, because the estimate is at the bound.
    known : int
        Runs with a value of the quantity; the others do not satisfy the bound.
    quantile, bound : float or None
        The required quantile and its bound, in the same unit. For hits, the quantile of the miss at the required share,
        and the radius of the body; `judge` knows neither. The quantile is None if the sample does not show it.
    """

    decision: Decision
    runs: int
    value: float | None
    lower: float | None
    upper: float | None
    runs_needed: int | None
    known: int
    quantile: float | None = None
    bound: float | None = None


def judge(values: Floats, requirement: AnyRequirement, *, watched: bool) -> Verdict:
    """Return whether a sample meets a requirement, with 95 % confidence.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The required quantity, in the order of the runs. It is `requirement.unknown` in runs without a value.
    watched : bool
        Whether the number of runs may depend on the values, because runs were added after a look at them. False: the
        number of runs was fixed before.

    Raises
    ------
    ValueError
        If there is no value, or a value is NaN.

    Notes
    -----
    Let K of n runs satisfy the bound, and q be the required share. The requirement is met if the hypothesis that the
    true share is at most q is rejected, and not met if the hypothesis that it is at least q is rejected, each at the
    level 2.5 %. With a fixed n the tests are the exact binomial ones. They are equivalent to a comparison of the bound
    with the interval of order statistics of `estimate_quantiles`, or with the Clopper-Pearson interval.

    Repeated looks at such an interval until it decides would make errors more frequent than 5 %. If `watched`, the
    tests are those of a confidence sequence, which holds for all n at once: the likelihood ratio of a uniform mixture
    of all shares above (below) q to the share q exceeds 40 at any n with a probability of at most 2.5 % if the true
    share is at most (at least) q. The first n that decides is final: more runs never change a decision.

    References
    ----------
    Robbins (1970), Statistical methods related to the law of the iterated logarithm. Howard, Ramdas, McAuliffe, Sekhon
    (2021), Time-uniform, nonparametric, nonasymptotic confidence sequences, Annals of Statistics 49(2).
    """
    size, share = values.size, requirement.share
    if not size or np.isnan(values).any():
        raise ValueError("a requirement needs at least one value, and none may be NaN")
    holding = np.cumsum(requirement.holds(values))
    fewest_met, most_missed = critical_counts(size, share, watched=watched)
    value: float | None
    lower: float | None
    upper: float | None
    compared: tuple[float | None, float | None] = None, None
    if isinstance(requirement, Requirement):
        with np.errstate(invalid="ignore"):  # infinite values
            value = _finite(np.quantile(values, share)) if shows(size, share) else None
        compared = value, requirement.bound
        lower, upper = _quantile_interval(values, int(fewest_met[-1]), int(most_missed[-1]))
    else:
        estimate = estimate_hits(int(holding[-1]), size, CONFIDENCE)
        value, lower, upper = estimate.probability, estimate.lower, estimate.upper
        if watched:
            lower, upper = share_interval(int(holding[-1]), size)
    known = int(np.isfinite(values).sum())
    looks = holding if watched else holding[-1:]
    met, missed = looks >= fewest_met, looks <= most_missed
    decided = np.flatnonzero(met | missed)
    if not decided.size:
        needed = runs_needed(int(holding[-1]), size, share)
        return Verdict(Decision.UNDECIDED, size, value, lower, upper, needed, known, *compared)
    decision = Decision.MET if met[decided[0]] else Decision.NOT_MET
    # A decision at an earlier run stays valid, although the last interval may contain the bound again.
    if (decision is Decision.MET) == isinstance(requirement, Requirement):
        upper = requirement.bound if upper is None else min(upper, requirement.bound)
    else:
        lower = requirement.bound if lower is None else max(lower, requirement.bound)
    return Verdict(decision, size, value, lower, upper, size, known, *compared)


def _quantile_interval(values: Floats, fewest_met: int, most_missed: int) -> tuple[float | None, float | None]:
    """Return the order statistics that enclose a quantile."""
    ordered = np.sort(values)
    lower = _finite(ordered[most_missed]) if most_missed >= 0 else None
    return lower, _finite(ordered[fewest_met - 1]) if fewest_met <= values.size else None


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def share_interval(count: int, runs: int) -> tuple[float, float]:
    """Return the 95 % confidence interval of a share after `runs` runs of a confidence sequence (`judge`)."""

    def end(index: int, inside: float, outside: float) -> float:
        for _ in range(_STEPS):
            middle = 0.5 * (inside + outside)
            if p_values(runs, count, middle, watched=True)[index] > _TAIL:
                inside = middle
            else:
                outside = middle
        return outside

    share = count / runs
    return end(0, share, 0.0) if count else 0.0, end(1, share, 1.0) if count < runs else 1.0


def critical_counts(size: int, share: float, *, watched: bool) -> tuple[Integers, Integers]:
    """Return the numbers of runs that satisfy a bound, with a required share, at which a requirement is decided.

    The requirement is met from the first number on (one more than the number of runs if no number decides), and not met
    up to the second one (-1 if no number decides). With `watched` both are arrays for 1, 2, ..., `size` runs, those of
    the confidence sequence; otherwise they have the shape (1,), for `size` runs. They are read-only.
    """
    if not watched:
        return _critical_counts(size, size, share, watched)
    # Powers of two, so that samples of different sizes share the computed counts.
    fewest_met, most_missed = _critical_counts(1, 1 << (size - 1).bit_length(), share, watched)
    return fewest_met[:size], most_missed[:size]


@functools.lru_cache(maxsize=32)
def _critical_counts(first: int, last: int, share: float, watched: bool) -> tuple[Integers, Integers]:
    runs = np.arange(first, last + 1)
    fewest_met = min_count(runs, lambda count: p_values(runs, count, share, watched=watched)[0] <= _TAIL)
    most_missed = min_count(runs, lambda count: p_values(runs, count, share, watched=watched)[1] > _TAIL) - 1
    for counts in (fewest_met, most_missed):
        counts.setflags(write=False)
    return fewest_met, most_missed


def p_values(runs: ArrayLike, count: ArrayLike, share: ArrayLike, *, watched: bool) -> tuple[Floats, Floats]:
    """Return the p-values of the hypotheses that the true share is at most, and at least, a given share.

    `count` is the number of those of n `runs` that satisfy the bound; it may be fractional. If `watched`, the values
    hold for all numbers of runs at once; then they are inverse likelihood ratios: see `judge`.
    """
    from scipy.special import betainc, betaln  # slow to load, and few commands need it

    n, k, q = (np.asarray(values, dtype=np.float64) for values in (runs, count, share))
    if not watched:
        # Where no run (every run) satisfies the bound, k or more (k or fewer) are certain.
        with np.errstate(invalid="ignore"):
            at_least = np.where(k > 0, betainc(np.maximum(k, 1e-300), n - k + 1.0, q), 1.0)
            at_most = np.where(k < n, betainc(np.maximum(n - k, 1e-300), k + 1.0, 1.0 - q), 1.0)
        return at_least, at_most
    # The integral of the likelihood over the shares above q is an incomplete beta function; likewise below q.
    likelihood = k * np.log(q) + (n - k) * np.log1p(-q) - betaln(k + 1.0, n - k + 1.0)
    with np.errstate(divide="ignore", over="ignore"):
        above = np.log1p(-q) + likelihood - np.log(betainc(n - k + 1.0, k + 1.0, 1.0 - q))
        below = np.log(q) + likelihood - np.log(betainc(k + 1.0, n - k + 1.0, q))
        return np.exp(np.minimum(above, 0.0)), np.exp(np.minimum(below, 0.0))


def runs_needed(count: int, runs: int, share: float) -> int | None:
    """Return the approximate number of runs that decide a requirement with `watched=True`; see `Verdict`.

    None is more than `MAX_RUNS_NEEDED`. If all runs satisfy the bound so far, it is the minimum number that can decide.
    """

    def deciding(sizes: Integers) -> Integers:
        values = p_values(sizes, count / runs * sizes, share, watched=True)
        return sizes[(np.minimum(*values) <= _TAIL) & (sizes > runs)]

    sizes = np.unique(np.geomspace(1, MAX_RUNS_NEEDED, 2000).astype(np.int64))
    enough = deciding(sizes)
    if not enough.size:
        return None
    before = sizes[max(int(np.searchsorted(sizes, enough[0])) - 1, 0)]
    return int(deciding(np.arange(before, enough[0] + 1))[0])
