"""What Python code learns of runs in which a guarantee fails: the text of results, and a
warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from infoset import Model, sim
from infoset.arrays import Floats
from infoset.guidance import LineOfSight
from infoset.sim import GuaranteeWarning, Results, Scenario, fly_one

RUNS = 6


class Beyond:
    """A noise whose errors of angles are a multiple of their bounds."""

    def __init__(self, scenario: Scenario, multiple: float) -> None:
        self._error_rad = multiple * float(
            scenario.bearing_sensor.error_bound(scenario.dispersion.x_m[1])
        )

    def measure(self, sight: LineOfSight, _predicted: object) -> Mapping[str, Floats]:
        return {
            name: sensor.true_value(sight) + (self._error_rad if name == "angle" else 0.0)
            for name, sensor in sight.sensors.items()
        }


@pytest.fixture
def guaranteed(brief: Scenario) -> Scenario:
    return replace(
        brief,
        range_sensor=None,
        information_set=replace(brief.information_set, model=Model.GUARANTEED, initial_set=None),
    )


def flown(scenario: Scenario, multiple: float) -> Results:
    return sim.simulate(scenario, RUNS, noise=Beyond(scenario, multiple))


def test_lost_truth_gives_one_warning_at_the_line_of_the_user(guaranteed: Scenario) -> None:
    with pytest.warns(GuaranteeWarning) as caught:
        results = flown(guaranteed, 3.0)

    assert not results.truth_kept.any()
    (warning,) = caught
    expected = (
        f"{guaranteed.name}: in {RUNS} of {RUNS} runs the set lost the true state or became empty"
    )
    assert str(warning.message).startswith(expected)
    assert "an assumption of the model does not hold" in str(warning.message)
    assert warning.filename == __file__
    assert f"; in {RUNS} of {RUNS} runs the set lost the true state or became empty" in repr(
        results
    )


def test_errors_within_their_bounds_give_no_warning(guaranteed: Scenario) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        results = flown(guaranteed, 0.9)
    assert results.failures == ""
    assert "lost" not in repr(results)


def test_the_warning_of_the_model_paper_names_the_other_model(guaranteed: Scenario) -> None:
    paper = replace(
        guaranteed, information_set=replace(guaranteed.information_set, model=Model.PAPER)
    )
    with pytest.warns(
        GuaranteeWarning, match="model paper does not promise .*model = guaranteed does"
    ):
        flown(paper, 3.0)


def test_misses_beyond_phi_are_counted_among_the_known_bounds(guaranteed: Scenario) -> None:
    results = flown(guaranteed, 0.5)
    bounds = results.guaranteed_miss_m.copy()
    bounds[0] = np.ma.masked
    miss_m = results.miss_m.copy()
    miss_m[:3] = results.guaranteed_miss_m[:3] + 1.0

    beyond = replace(results, guaranteed_miss_m=bounds, miss_m=miss_m)

    assert beyond.failures == f"in 2 of {RUNS - 1} runs the miss exceeds the bound Phi"
    assert beyond.failures in repr(beyond)


def test_the_text_of_a_record_says_that_phi_is_exceeded(guaranteed: Scenario) -> None:
    record = fly_one(guaranteed)
    assert "above the bound" not in repr(record)
    miss_m = record.result.guaranteed_miss_m.filled(0.0) + 1.0
    beyond = replace(record, result=replace(record.result, miss_m=miss_m))
    assert repr(beyond).endswith(", miss above the bound Phi>")
