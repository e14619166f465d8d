from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from infoset.arrays import Floats
from infoset.limits import MAXIMUM, MINIMUM
from infoset.sim import QuantileName, Requirement, StoppingRule, estimate_quantiles
from infoset.sim.requirement import HitRequirement, parse_requirement
from infoset.sim.statistics import level_name
from infoset.sim.undecided_cells import CellSample

RULE = StoppingRule(QuantileName("miss_m", 0.5), 0.5)


def test_rules_are_read_and_written() -> None:
    rule = StoppingRule.parse("miss_m p99 ci<0.5")
    assert rule == StoppingRule(QuantileName("miss_m", 0.99), 0.5)
    assert str(rule) == "miss_m p99 ci<0.5"
    assert StoppingRule.parse("  impulse_m_s  p99.9  ci < 1e-1 ").quantile.level == 0.999
    required = parse_requirement("guaranteed_miss_m p50<12.5")
    assert required == Requirement(QuantileName("guaranteed_miss_m", 0.5), 12.5)
    assert str(required) == "guaranteed_miss_m p50<12.5"
    assert QuantileName.of_percent("miss_m", "5") == QuantileName("miss_m", 0.05)
    assert [level_name(each) for each in (0.05, 0.5, 0.99, 0.999, 0.9999)] == [
        "p5",
        "p50",
        "p99",
        "p99.9",
        "p99.99",
    ]
    assert str(parse_requirement("miss_m p99.99995<1e-07")) == "miss_m p99.99995<1e-07"
    assert str(StoppingRule.parse("miss_m p0.5 ci<1234567.5")) == "miss_m p0.5 ci<1234567.5"
    assert QuantileName.of_percent("miss_m", "1e-3") == QuantileName("miss_m", 1e-5)
    assert [level_name(each) for each in (0.001, 1e-5, 1e-20)] == ["p0.1", "p0.001", "p1e-18"]


@given(
    level=st.floats(MINIMUM, 1.0, exclude_max=True)
    | st.decimals("0.01", "99.99", places=2).map(lambda p: float(p / 100)),
    number=st.floats(MINIMUM, MAXIMUM) | st.floats(1e-9, 1e9),
)
def test_the_texts_of_rules_and_requirements_are_exact(level: float, number: float) -> None:
    # A manifest stores these texts.
    quantile = QuantileName("guaranteed_miss_m", level)
    rule = StoppingRule(quantile, number)
    required = Requirement(quantile, number)
    hits = HitRequirement(level)
    assert StoppingRule.parse(str(rule)) == rule
    assert parse_requirement(str(required)) == required
    assert parse_requirement(str(hits)) == hits


@pytest.mark.parametrize(
    "text",
    [
        "",
        "miss_m",
        "miss_m p0 ci<1",
        "miss_m p99 ci<0",
        "miss_m p99 ci<nan",
        "miss_m p99 ci>1",
        "miss p99 ci<1",
        "miss_m p99 ci<0.5" + 90 * " " + "junk",
    ],
)
def test_malformed_rule_is_refused(text: str) -> None:
    with pytest.raises(
        ValueError, match=r"must be|there is no quantity|greater than 0|between p0 and p100"
    ):
        StoppingRule.parse(text)


def samples(chunks: int, size: int) -> list[Floats]:
    return [np.random.default_rng([7, chunk]).exponential(size=size) for chunk in range(chunks)]


def decided_after(rule: StoppingRule, chunks: Sequence[Floats]) -> int | None:
    """Return the number of chunks after which the rule is met."""
    sample = CellSample(rule, len(chunks))
    for number, values in enumerate(chunks, start=1):
        sample.add(values)
        if sample.decided:
            return number
    return None


def test_sample_is_decided_within_5_percent_after_the_rule_is_met() -> None:
    chunks = samples(400, 5)
    met = decided_after(RULE, chunks)
    assert met is not None

    def width(chunks_seen: int) -> float:
        (found,) = estimate_quantiles(np.concatenate(chunks[:chunks_seen]), [0.5])
        return np.inf if found.width is None else found.width

    assert width(met) < 0.5
    first = next(chunks_seen for chunks_seen in range(1, 401) if width(chunks_seen) < 0.5)
    assert first <= met <= 1.05 * first + 2


def test_nan_is_left_out_of_a_sample() -> None:
    assert decided_after(RULE, [np.full(20, 1.0)] * 50) == 1
    assert decided_after(RULE, [np.full(20, np.nan)] * 50) is None


@dataclass(frozen=True)
class _MetBy(StoppingRule):
    size: int = 0

    def met_by(self, sample: Floats) -> bool:
        return sample.size >= self.size


@pytest.mark.parametrize("chunks", [1, 2, 20, 21, 22, 59, 400])
def test_last_chunk_is_always_checked(chunks: int) -> None:
    rule = _MetBy(RULE.quantile, RULE.width, size=chunks)
    assert decided_after(rule, [np.zeros(1)] * chunks) == chunks
