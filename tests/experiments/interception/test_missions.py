"""The built-in missions of impactors: the guarantee holds, and they hit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import simulate


@pytest.mark.parametrize(
    "noise",
    [
        NoiseKind.RANDOM,
        NoiseKind.GAME,
        pytest.param(NoiseKind.GAUSSIAN, marks=pytest.mark.thorough),
        pytest.param(NoiseKind.CORRELATED, marks=pytest.mark.thorough),
    ],
)
@pytest.mark.parametrize("name", ["dart-2022", "haiv-2013"])
def test_an_impactor_hits_and_its_guarantee_holds(name: str, noise: NoiseKind) -> None:
    scenario = replace(load_scenario(name), noise=noise)
    results = simulate(scenario, runs=3)
    assert results.truth_kept.all()
    assert not results.set_emptied.any()
    assert (results.miss_m <= results.guaranteed_miss_m).all()
    assert np.ma.getdata(results.hit).all()
    assert scenario.certain_radius_m is not None
    assert results.guaranteed_miss_m.max() < scenario.certain_radius_m


@pytest.mark.thorough
def test_three_impulses_meet_the_requirement_of_deep_impact() -> None:
    results = simulate(load_scenario("deep-impact-2005"), runs=1)
    assert results.truth_kept.all()
    assert (results.miss_m <= results.guaranteed_miss_m).all()
    assert results.miss_m.max() < 700.0
    burns_m_s = results.burns_m_s
    assert burns_m_s is not None
    assert burns_m_s.shape == (1, 3)
    assert burns_m_s.sum(axis=1) == pytest.approx(results.impulse_m_s)
