"""Hits of a body with a size, apart from how an engagement ended."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.sim import Body, Outcome, Scenario, simulate


@pytest.fixture(scope="module")
def published() -> Scenario:
    return load_scenario("asteroid-1997")


def test_hits_are_the_misses_of_at_most_the_radius(brief: Scenario) -> None:
    misses = simulate(brief, 6).miss_m
    results = simulate(replace(brief, body=Body(float(np.sort(misses)[3]))), 6)
    np.testing.assert_array_equal(results.miss_m, misses)
    assert not results.hit.mask.any()
    assert results.hits is not None
    assert (results.hits.hits, results.hits.runs) == (4, 6)
    np.testing.assert_array_equal(results.hit, misses <= np.sort(misses)[3])
    assert "4 hit" in repr(results)
    assert results.take(np.array([0, 1])).hit.tolist() == results.hit.tolist()[:2]
    assert results.to_dict()["hit"] == results.hit.tolist()


def test_an_arrival_far_away_is_a_miss_and_an_empty_set_may_hit(published: Scenario) -> None:
    """Commit 652bf7c called the first "intercepted", and only the second not."""
    weak = replace(
        published,
        range_sensor=None,
        thruster=replace(published.thruster, min_impulse_m_s=0.01, max_impulse_m_s=0.02),
        body=Body(80.0),
    )
    far = simulate(weak, 2)
    assert far.miss_m.min() > 80.0
    assert far.outcomes == (Outcome.ARRIVED, Outcome.ARRIVED)
    assert far.hit.tolist() == [False, False]
    assert far.set_emptied.tolist() == [False, False]
    near = simulate(replace(published, body=Body(80.0)), 20)
    emptied = np.array([outcome is Outcome.SET_EMPTY for outcome in near.outcomes])
    assert emptied.any()
    assert near.hit[emptied & (near.miss_m < 80.0)].all()
    np.testing.assert_array_equal(near.set_emptied, emptied)


def test_a_diverged_run_with_an_empty_set_is_counted_as_both(published: Scenario) -> None:
    results = simulate(replace(published, nominal_range_m=1.0), 20)
    assert Outcome.DIVERGED in results.outcomes
    assert results.set_emptied.any()


def test_a_body_is_smaller_than_the_min_range(published: Scenario) -> None:
    with pytest.raises(
        ValueError,
        match=r"body\.radius_m must be less than the minimum possible range, 5.3013e\+06 m",
    ):
        replace(published, body=Body(6e6))
