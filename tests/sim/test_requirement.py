from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from infoset.arrays import Flags, Floats
from infoset.sim import QuantileName, Requirement, estimate_hits, estimate_quantiles
from infoset.sim.requirement import (
    Decision,
    HitRequirement,
    decides,
    judge,
    least_runs,
    p_values,
    parse_requirement,
    runs_needed,
    share_interval,
)
from infoset.sim.statistics import shows

P99 = Requirement(QuantileName("miss_m", 0.99), 10.0)


@given(
    size=st.integers(1, 400),
    level=st.sampled_from((0.5, 0.9, 0.95, 0.99)),
    bound=st.floats(0.5, 8.0),
    seed=st.integers(0, 2**31),
)
@settings(deadline=None)
def test_a_decision_compares_the_bound_with_the_interval(
    size: int, level: float, bound: float, seed: int
) -> None:
    values = np.random.default_rng(seed).exponential(size=size)
    required = Requirement(QuantileName("miss_m", level), bound)
    verdict = judge(values, required, watched=False)
    (estimate,) = estimate_quantiles(values, [level])
    expected = Decision.UNDECIDED
    if estimate.upper is not None and estimate.upper < bound:
        expected = Decision.MET
    elif estimate.lower is not None and estimate.lower > bound:
        expected = Decision.NOT_MET
    assert verdict.decision is expected
    assert (verdict.lower, verdict.upper) == (estimate.lower, estimate.upper)
    assert verdict.value == (estimate.value if shows(size, level) else None)


def exact_p_value(runs: int, count: int, share: Fraction) -> Fraction:
    """Return the inverse of the mean likelihood ratio of the shares above a share, in rational
    arithmetic.
    """
    # The integral of t^k (1 - t)^(n - k) from q to 1 is a sum over the binomial expansion of (1 -
    # t)^(n - k).
    integral = sum(
        (
            Fraction((-1) ** power * comb(runs - count, power), count + power + 1)
            * (1 - share ** (count + power + 1))
        )
        for power in range(runs - count + 1)
    )
    mean = integral / (1 - share)
    return share**count * (1 - share) ** (runs - count) / mean


@pytest.mark.parametrize(("runs", "count"), [(1, 0), (1, 1), (20, 20), (40, 37), (40, 0)])
def test_watched_p_values_are_inverse_likelihood_ratios(runs: int, count: int) -> None:
    share = Fraction("0.95")
    met, missed = p_values(runs, count, float(share))
    assert float(met) == pytest.approx(min(1.0, float(exact_p_value(runs, count, share))), rel=1e-9)
    below = exact_p_value(runs, runs - count, 1 - share)
    assert float(missed) == pytest.approx(min(1.0, float(below)), rel=1e-9)


@pytest.mark.parametrize("share", [0.5, 0.95, 0.99])
def test_looks_after_every_run_are_wrong_in_at_most_5_percent(share: float) -> None:
    """The fixed-size interval, looked at after every run, is wrong in far more than 5 % of the
    samples.
    """
    size, repeats = 1500, 1000
    counts = np.cumsum(np.random.default_rng(3).random((repeats, size)) < share, axis=1)
    # Many samples have the same count after the same number of runs.
    number, same = np.unique(counts + np.arange(1, size + 1) * (size + 1), return_inverse=True)
    runs = number // (size + 1)
    count = number % (size + 1)
    fixed = np.minimum(binom.sf(count - 1, runs, share), binom.cdf(count, runs, share)) <= 0.025

    def wrong(rejected: Flags) -> float:
        return float(rejected[same.reshape(counts.shape)].any(axis=1).mean())

    assert wrong(decides(runs, count, share)) < 0.05
    assert wrong(fixed) > 0.12


def test_watched_decision_is_not_changed_by_later_runs() -> None:
    values = np.concatenate([np.ones(600), np.full(40, 20.0)])
    decided = judge(values[:600], P99, watched=True)
    later = judge(values, P99, watched=True)
    assert decided.decision is later.decision is Decision.MET
    assert later.upper is not None
    assert later.upper <= P99.bound
    assert judge(values, P99, watched=False).decision is Decision.NOT_MET


@given(hits=st.integers(0, 60), more=st.integers(0, 60))
@settings(deadline=None)
def test_intervals_of_a_share_are_where_the_p_values_are_2_5_percent(hits: int, more: int) -> None:
    runs = max(1, hits + more)
    estimate = estimate_hits(hits, runs)
    lower, upper = share_interval(hits, runs)
    assert lower <= estimate.lower <= estimate.upper <= upper
    for index, end in enumerate((lower, upper)):
        p_value = p_values(runs, hits, end)[index] if 0.0 < end < 1.0 else 0.025
        assert p_value == pytest.approx(0.025, rel=1e-6)
    judged = judge(np.where(np.arange(runs) < hits, 1.0, 0.0), HitRequirement(0.5), watched=False)
    if judged.decision is Decision.UNDECIDED:
        assert (judged.lower, judged.upper) == (estimate.lower, estimate.upper)


def test_hit_requirement_is_decided_after_enough_runs() -> None:
    required = parse_requirement(" hit >= 0.95 ")
    assert required == parse_requirement("hit>0.95") == HitRequirement(0.95)
    assert str(required) == "hit>=0.95"
    hit = np.ones(200)
    assert judge(hit[:71], required, watched=False).decision is Decision.UNDECIDED
    assert judge(hit[:72], required, watched=False).decision is Decision.MET
    assert judge(hit[:104], required, watched=True).decision is Decision.UNDECIDED
    verdict = judge(hit[:105], required, watched=True)
    assert (verdict.decision, verdict.value, verdict.upper) == (Decision.MET, 1.0, 1.0)
    assert verdict.lower is not None
    assert verdict.lower >= 0.95
    assert judge(0.0 * hit[:20], required, watched=True).decision is Decision.NOT_MET


@pytest.mark.parametrize(
    "text", ["guaranteed_miss_m<25", " guaranteed_miss_m < 25 ", "guaranteed_miss_m p99<25"]
)
def test_requirement_without_a_quantile_uses_p99(text: str) -> None:
    required = parse_requirement(text)
    assert required == Requirement(QuantileName("guaranteed_miss_m", 0.99), 25.0)
    assert str(required) == "guaranteed_miss_m p99<25"


@pytest.mark.parametrize(
    "text",
    [
        *(
            "hit",
            "hit<0.95",
            "hit>=1",
            "hit>=0",
            "hit>=95",
            "hit>=nan",
            "hit p50>=0.9",
            "hit=>0.9",
            "hit>=99%",
        ),
        *(
            "",
            "miss_m",
            "miss_m 10",
            "miss_m>10",
            "miss_m<0",
            "miss_m<1e400",
            "miss_m<10 m",
            "miss_m p99<10" + 90 * " " + "junk",
            "miss<10",
            "p99<10",
        ),
        *("miss_m p0<10", "miss_m p100<10", "miss_m p٩٩<10"),
    ],
)
def test_malformed_requirement_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"must be|there is no quantity|must lie between"):
        parse_requirement(text)


def test_runs_without_a_value_do_not_satisfy_the_bound() -> None:
    median = Requirement(QuantileName("guaranteed_miss_m", 0.5), 60.0)
    values = np.where(np.arange(80) % 13, np.inf, 5.0)
    for watched in (True, False):
        verdict = judge(values, median, watched=watched)
        assert (verdict.decision, verdict.known, verdict.runs) == (Decision.NOT_MET, 7, 80)
        assert (verdict.value, verdict.lower, verdict.upper) == (None, 60.0, None)
        most = judge(np.where(np.arange(80) % 13, 5.0, np.inf), median, watched=watched)
        assert (most.decision, most.known, most.value) == (Decision.MET, 73, 5.0)
    few = np.append(np.ones(19), np.inf)
    assert (
        judge(few, Requirement(QuantileName("guaranteed_miss_m", 0.9), 60.0), watched=False).upper
        is None
    )


@pytest.mark.parametrize("values", [[], [math.nan], [1.0, math.nan]])
def test_sample_without_values_or_with_nan_is_refused(values: list[float]) -> None:
    with pytest.raises(ValueError, match="at least one value, and none may be NaN"):
        judge(np.array(values), P99, watched=True)


@pytest.mark.parametrize(("share", "minimum"), [("0.99", 368), ("0.95", 72)])
def test_fixed_number_of_hits_decides_from_the_exact_minimum_on(share: str, minimum: int) -> None:
    assert Decimal(share) ** (minimum - 1) > Decimal("0.025") >= Decimal(share) ** minimum
    required = HitRequirement(float(share))

    fewer = judge(np.ones(minimum - 1), required, watched=False)
    enough = judge(np.ones(minimum), required, watched=False)

    assert fewer.decision is Decision.UNDECIDED
    assert enough.decision is Decision.MET


@pytest.mark.parametrize(("share", "minimum"), [("0.99", 535), ("0.95", 105)])
def test_runs_needed_are_the_exact_minimum_if_all_runs_satisfy(share: str, minimum: int) -> None:
    exact = Fraction(share)
    assert exact_p_value(minimum - 1, minimum - 1, exact) > Fraction("0.025")
    assert exact_p_value(minimum, minimum, exact) <= Fraction("0.025")

    assert runs_needed(20, 20, float(exact)) == minimum


@pytest.mark.parametrize(
    ("share", "watched", "fixed"),
    [("0.9", 51, 36), ("0.95", 105, 72), ("0.99", 535, 368), ("0.999", 5373, 3688)],
)
def test_least_runs_are_the_exact_minimum(share: str, watched: int, fixed: int) -> None:
    exact = Fraction(share)
    assert exact_p_value(watched, watched, exact) <= Fraction("0.025")
    assert exact_p_value(watched - 1, watched - 1, exact) > Fraction("0.025")
    assert Decimal(share) ** (fixed - 1) > Decimal("0.025") >= Decimal(share) ** fixed

    assert least_runs(float(share), watched=True) == watched
    assert least_runs(float(share), watched=False) == fixed


def test_least_runs_exist_for_every_share() -> None:
    share = 1.0 - 2.0**-53
    # In the limit of small x = 1 - q, with s = n x: s / (exp(s) - 1) = 0.025.
    lower, upper = 1.0, 20.0
    for _ in range(60):
        middle = 0.5 * (lower + upper)
        if middle / math.expm1(middle) > 0.025:
            lower = middle
        else:
            upper = middle
    assert least_runs(share, watched=True) == pytest.approx(lower * 2.0**53, rel=1e-6)


def test_runs_needed_are_none_if_the_estimate_is_at_the_bound() -> None:
    assert runs_needed(19, 20, 0.95) is None


@pytest.mark.parametrize("watched", [True, False])
def test_verdict_has_the_runs_needed_of_watched_runs(watched: bool) -> None:
    assert judge(np.ones(20), P99, watched=watched).runs_needed == 535
    assert judge(np.ones(20), HitRequirement(0.95), watched=watched).runs_needed == 105


@pytest.mark.parametrize(
    ("count", "runs", "share"), [(20, 20, 0.99), (97, 100, 0.95), (180, 200, 0.95)]
)
def test_runs_needed_are_near_the_first_number_that_decides(
    count: int, runs: int, share: float
) -> None:
    needed = runs_needed(count, runs, share)
    assert needed is not None

    sizes = np.arange(runs + 1, 2 * needed)
    first = sizes[decides(sizes, np.round(count / runs * sizes), share).argmax()]

    assert first == pytest.approx(needed, rel=0.15)


@pytest.mark.parametrize("watched", [False, True])
def test_a_wrong_decision_in_a_monotone_row_is_one_in_its_first_wrong_cell(watched: bool) -> None:
    """So a row is right with the confidence of one cell; independent runs give each cell an error
    of its own.

    A run satisfies the bound in the cells whose share exceeds its number: its outcome is monotone
    along the row.
    """
    rows = 2000
    runs = 120
    required = 0.9
    random = np.random.default_rng(4)
    shares = np.linspace(0.9, 0.88, 8)[:, None]  # no cell meets the requirement
    number = np.arange(1, runs + 1)[:, None]
    count = np.arange(runs + 1)
    p_value = (
        p_values(number, np.minimum(number, count), required)[0]
        if watched
        else binom.sf(count - 1, runs, required)
    )
    met = np.broadcast_to(p_value <= 0.025, (runs, runs + 1))

    def wrong(numbers: Floats) -> Flags:
        """Return which cells are met, shape (rows, cells)."""
        counts = np.cumsum(numbers < shares, axis=2)
        after = np.arange(runs) if watched else np.array([runs - 1])
        return np.asarray(met[after, counts[:, :, after]].any(axis=2))

    common = wrong(random.uniform(size=(rows, 1, runs)))
    assert (common.any(axis=1) == common[:, 0]).all()
    assert common.any(axis=1).mean() <= 0.025 + 3.0 * math.sqrt(0.025 / rows)
    independent = wrong(random.uniform(size=(rows, len(shares), runs)))
    assert independent.any(axis=1).mean() > 2.0 * common.any(axis=1).mean() > 0.0
