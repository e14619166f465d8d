"""Requirements of a study, and whether a sample meets them: met, not met, or undecided."""

from __future__ import annotations

import bisect
import functools
import math
import re
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats, Integers
from infoset.limits import Checked, Fraction, Positive
from infoset.sim.miss_cause import MissCause
from infoset.sim.statistics import estimate_hits, number_text, order_statistics, shows
from infoset.sim.stopping_rule import DIGITS, QUANTITIES, QuantileName

CONFIDENCE = 0.95
"""Confidence of all intervals and decisions: the usual level, which commands print."""
MAX_RUNS_NEEDED = 1_000_000
"""Maximum of `RequirementVerdict.runs_needed`. Chosen: more runs mean that the estimate is at
the bound.
"""
_TAIL = 0.5 * (1.0 - CONFIDENCE)
_CAUSES = "|".join(cause.value for cause in MissCause)
_FORM = re.compile(
    rf"\s*(?:(?:hit|no-(?P<cause>{_CAUSES}))\s*>=?\s*(?P<share>{DIGITS})"
    rf"|(?P<quantity>\w+)(?:\s+p(?P<level>{DIGITS}))?\s*<\s*(?P<bound>{DIGITS}))\s*"
)
_DEFAULT_LEVEL = "99"
"""Quantile, in percent, of a requirement that names none: the largest one of the tables that usual
numbers of runs show."""
_BISECTIONS = 50
"""Bisections for an end of an interval: 2^-50 is near the rounding of a share."""
_MOST_RUNS = 2**60
"""More runs than any share needs: a share below 1 is at most 1 - 2^-53."""
_SAMPLE_SIZES = 2000
"""Number of sizes that `runs_needed` tries first, 0.7 % apart: sizes between two are tried next."""


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
    """

    quantile: QuantileName
    bound: Positive

    def __str__(self) -> str:
        return f"{self.quantile}<{number_text(self.bound)}"

    @property
    def share(self) -> float:
        """Share of the runs that must be below the bound."""
        return self.quantile.level

    @property
    def quantity(self) -> str:
        """Column of the results that it uses."""
        return self.quantile.quantity

    def numbers(self, column: Any) -> Floats:
        """Return the values of the quantity in a table of runs.

        A run without a value does not satisfy the bound.
        """
        return np.asarray(column.to_numpy(np.float64, na_value=np.inf))

    def holds(self, values: Floats) -> Flags:
        """Return for each of the quantity's `values` whether it is below the bound."""
        return np.asarray(values < self.bound)


@dataclass(frozen=True)
class HitRequirement(Checked):
    """A lower bound of the probability of a hit, or of no miss with one cause.

    It is written `hit>=0.95`, or `no-engine>=0.99` for a cause.

    Parameters
    ----------
    share : float
        Minimum share of the runs that hit, or that hit or miss because of something else, between 0
        and 1.
    cause : MissCause or None
        None is any miss.
    """

    share: Fraction
    cause: MissCause | None = None

    def __str__(self) -> str:
        return f"{self.name}>={number_text(self.share)}"

    @property
    def name(self) -> str:
        """Name of the required event."""
        return "hit" if self.cause is None else f"no-{self.cause.value}"

    @property
    def quantity(self) -> str:
        """Column of the results that it uses."""
        return "hit" if self.cause is None else "cause"

    @property
    def bound(self) -> float:
        """Bound of the probability."""
        return self.share

    def numbers(self, column: Any) -> Floats:
        """Return 1 for runs of a table that hit, or do not have the cause, and 0 for the others."""
        if self.cause is not None:
            return np.asarray(column != self.cause.value, dtype=np.float64)
        return np.asarray(column.to_numpy(np.float64, na_value=0.0))

    def holds(self, values: Floats) -> Flags:
        """Return whether the `values` of runs are 1."""
        return np.asarray(values > 0.0)


AnyRequirement = Requirement | HitRequirement


def parse_requirement(text: str) -> AnyRequirement:
    """Read a requirement; raise ValueError for another text.

    The text `miss_m<10` without a quantile means the 99 % quantile, and `hit>0.95` means
    `hit>=0.95`.
    """
    match = _FORM.fullmatch(text)
    if match is None:
        raise ValueError(
            "must be hit>=SHARE, no-CAUSE>=SHARE or QUANTITY pLEVEL<BOUND, for example "
            '"hit>=0.95" or "miss_m p99<10", '
            f"with a cause of {_CAUSES.replace('|', ', ')}, and a quantity of "
            f"{', '.join(QUANTITIES)}; found {text[:100]!r}"
        )
    if match["share"] is not None:
        cause = MissCause(match["cause"]) if match["cause"] else None
        return HitRequirement(float(match["share"]), cause)
    quantile = QuantileName.of_percent(match["quantity"], match["level"] or _DEFAULT_LEVEL)
    return Requirement(quantile, float(match["bound"]))


@dataclass(frozen=True)
class RequirementVerdict:
    """The decision of a sample about a requirement, with the estimate and its interval.

    Parameters
    ----------
    decision : Decision
        Met if the interval is on the right side of the bound, not met if it is on the wrong side.
    value : float or None
        The required quantile of the sample, in its unit, or the share of hits; None if the sample
        does not show it (`infoset.sim.statistics.shows`), or if too many runs have no value.
    lower, upper : float or None
        Ends of its 95 % confidence interval; None if the sample is too small to bound that side.
    runs_needed : int or None
        Approximate number of runs that decide with `watched=True`, if the share of runs that
        satisfy the bound stays the same; None if it is over `MAX_RUNS_NEEDED`, because the estimate
        is at the bound. It is `runs` if the sample decides.
    known : int
        Runs with a value of the quantity; the others do not satisfy the bound. All runs for a
        `HitRequirement`.
    """

    decision: Decision
    runs: int
    value: float | None
    lower: float | None
    upper: float | None
    runs_needed: int | None
    known: int


def judge(values: Floats, requirement: AnyRequirement, *, watched: bool) -> RequirementVerdict:
    """Return whether a sample meets a requirement, with 95 % confidence.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The required quantity, in the order of the runs: `requirement.numbers`.
    watched : bool
        Whether the number of runs may depend on the values, because runs were added after a look at
        them. False: the number of runs was fixed before.

    Raises
    ------
    ValueError
        If there is no value, or a value is NaN.

    Notes
    -----
    Let K of n runs satisfy the bound, and q be the required share. The requirement is met if the
    hypothesis that the true share is at most q is rejected, and not met if the hypothesis that it
    is at least q is rejected, each at the level 2.5 %. With a fixed n the tests are the exact
    binomial tests. They are equivalent to a comparison of the bound with the interval of order
    statistics of `estimate_quantiles`, or with the Clopper-Pearson interval.

    Repeated looks at such an interval until it decides would make errors more frequent than 5 %. If
    `watched`, the tests are a confidence sequence, which holds for all n at once: the
    likelihood ratio of a uniform mixture of all shares above (below) q to the share q exceeds 40 at
    any n with a probability of at most 2.5 % if the true share is at most (at least) q. The first n
    that decides is final: more runs never change a decision.

    References
    ----------
    Robbins (1970), Statistical methods related to the law of the iterated logarithm. Howard,
    Ramdas, McAuliffe, Sekhon (2021), Time-uniform, nonparametric, nonasymptotic confidence
    sequences, Annals of Statistics 49(2).
    """
    size = values.size
    if not size or np.isnan(values).any():
        raise ValueError("a requirement needs at least one value, and none may be NaN")
    holding = np.cumsum(requirement.holds(values), dtype=np.int64)
    if isinstance(requirement, Requirement):
        estimate = _estimated_quantile(values, requirement.share, watched)
    else:
        estimate = _estimated_share(int(holding[-1]), size, watched)
    value, lower, upper = estimate
    known = int(np.isfinite(values).sum())

    decision = _decision(holding, requirement.share, watched)
    if decision is Decision.UNDECIDED:
        needed = runs_needed(int(holding[-1]), size, requirement.share)
        return RequirementVerdict(decision, size, value, lower, upper, needed, known)

    # A decision at an earlier run stays valid, although the last interval may contain the bound
    # again. The interval is below the bound if a quantile meets it, or a share of hits does not.
    if (decision is Decision.MET) == isinstance(requirement, Requirement):
        upper = requirement.bound if upper is None else min(upper, requirement.bound)
    else:
        lower = requirement.bound if lower is None else max(lower, requirement.bound)
    return RequirementVerdict(decision, size, value, lower, upper, size, known)


class _Estimate(NamedTuple):
    """`value`, `lower` and `upper` of `RequirementVerdict`."""

    value: float | None
    lower: float | None
    upper: float | None


def _estimated_quantile(values: Floats, level: float, watched: bool) -> _Estimate:
    """Return a quantile, if the sample shows it, between the order statistics that enclose it.

    An end is None if its rank is beyond the sample.
    """
    size = values.size
    first, last = _ranks(size, level, watched)
    ordered = np.sort(values)
    value = None
    if shows(size, level):
        with np.errstate(invalid="ignore"):  # infinite values
            value = _finite(np.quantile(ordered, level))
    lower = _finite(ordered[first - 1]) if first >= 1 else None
    upper = _finite(ordered[last - 1]) if last <= size else None
    return _Estimate(value, lower, upper)


def _estimated_share(count: int, size: int, watched: bool) -> _Estimate:
    estimate = estimate_hits(count, size, CONFIDENCE)
    if watched:
        return _Estimate(estimate.probability, *share_interval(count, size))
    return _Estimate(estimate.probability, estimate.lower, estimate.upper)


def _decision(holding: Integers, share: float, watched: bool) -> Decision:
    """Return the first decision of a sample; without `watched`, the decision of all its runs.

    `holding` is the number of the first 1, 2, ..., n runs that satisfy the bound.
    """
    size = len(holding)
    if watched:
        at_most, at_least = p_values(np.arange(1, size + 1), holding, share)
        met = at_most <= _TAIL
        missed = at_least <= _TAIL
    else:
        # One value each: only the number of all runs is tested.
        first, last = _ranks(size, share, watched)
        met = holding[-1:] >= last
        missed = holding[-1:] < first
    decided = np.flatnonzero(met | missed)
    if not decided.size:
        return Decision.UNDECIDED
    return Decision.MET if met[decided[0]] else Decision.NOT_MET


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


@functools.lru_cache(maxsize=64)
def _ranks(size: int, share: float, watched: bool) -> tuple[int, int]:
    """Return the ranks of the order statistics that enclose a quantile, as `order_statistics`.

    The requirement is met if at least as many runs as the second rank satisfy the bound, and not
    met if fewer than the first do.
    """
    if not watched:
        return order_statistics(size, share, CONFIDENCE)
    # For each number of runs that satisfy the bound: small ones reject the requirement, large ones
    # meet it.
    met, missed = p_values(size, np.arange(size + 1), share)
    return int((missed <= _TAIL).sum()), int((met > _TAIL).sum())


def share_interval(count: int, runs: int) -> tuple[float, float]:
    """Return the 95 % confidence interval of a share by the confidence sequence of `judge`.

    Its lower end is 0 for a count of 0, and its upper end 1 for a count of all runs.
    """

    def end(index: int, outside: float) -> float:
        """Return the end toward `outside`, where the p-value of an index is the tail."""
        inside = count / runs
        for _ in range(_BISECTIONS):
            middle = 0.5 * (inside + outside)
            if p_values(runs, count, middle)[index] > _TAIL:
                inside = middle
            else:
                outside = middle
        return outside

    lower = end(0, 0.0) if count else 0.0
    upper = end(1, 1.0) if count < runs else 1.0
    return lower, upper


def decides(runs: ArrayLike, count: ArrayLike, share: float) -> Flags:
    """Return whether the confidence sequence of `judge` decides a requirement.

    `count` of `runs` satisfy its bound.
    """
    return np.asarray(np.minimum(*p_values(runs, count, share)) <= _TAIL)


def p_values(runs: ArrayLike, count: ArrayLike, share: ArrayLike) -> tuple[Floats, Floats]:
    """Return the p-values of the hypotheses that the true share is at most, and at least, a share.

    `count` of n `runs` satisfy the bound; it may be fractional. The p-values are inverse likelihood
    ratios, and hold for all numbers of runs at once: see `judge`.
    """
    from scipy.special import betainc, betaln  # slow to load, and few commands need it

    n, k, q = (np.asarray(values, dtype=np.float64) for values in (runs, count, share))
    # The likelihood at q by the mean of the likelihood over the shares above q: their length is
    # 1 - q, and the integral an incomplete beta function. Likewise below q.
    likelihood = k * np.log(q) + (n - k) * np.log1p(-q) - betaln(k + 1.0, n - k + 1.0)
    with np.errstate(divide="ignore", over="ignore"):
        above = np.log1p(-q) + likelihood - np.log(betainc(n - k + 1.0, k + 1.0, 1.0 - q))
        below = np.log(q) + likelihood - np.log(betainc(k + 1.0, n - k + 1.0, q))
        return np.exp(np.minimum(above, 0.0)), np.exp(np.minimum(below, 0.0))


def runs_needed(count: int, runs: int, share: float) -> int | None:
    """Return the approximate number of runs that decide a requirement with `watched=True`.

    It is greater than `runs`, which do not decide. None is more than `MAX_RUNS_NEEDED`. If all runs
    satisfy the bound so far, it is the minimum number that can decide.
    """

    def deciding(sizes: Integers) -> Integers:
        return sizes[decides(sizes, count / runs * sizes, share) & (sizes > runs)]

    sizes = np.unique(np.geomspace(1, MAX_RUNS_NEEDED, _SAMPLE_SIZES).astype(np.int64))
    enough = deciding(sizes)
    if not enough.size:
        return None
    before = sizes[max(int(np.searchsorted(sizes, enough[0])) - 1, 0)]
    return int(deciding(np.arange(before, enough[0] + 1))[0])


def least_runs(share: float, *, watched: bool) -> int:
    """Return the minimum number of runs that can decide that a required share is met.

    All of them satisfy the bound then. `watched` is an argument of `judge`. A number that is fixed
    before is the least n with share^n <= 2.5 %.
    """
    if not watched:
        return math.ceil(math.log(_TAIL) / math.log(share))
    return bisect.bisect_left(
        range(_MOST_RUNS), True, lo=1, key=lambda runs: bool(decides(runs, runs, share))
    )
