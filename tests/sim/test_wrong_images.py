"""Flights with wrong images: the guarantee with at most q of them, and what happens with more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from infoset import InformationSet, Model
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Record, Results, Scenario, fly_one
from infoset.sim.draws import draw
from infoset.sim.gravity import on_board_model
from infoset.sim.simulate import simulate_runs
from infoset.sim.wrong_images import WrongImages, WrongRanges, draw_wrong_measurements


def scenario_of(name: str, allowed: int, number: int, noise: NoiseKind) -> Scenario:
    """A scenario in the guaranteed model, from anywhere in the box of starts."""
    scenario = load_scenario(name)
    settings = replace(
        scenario.information_set, model=Model.GUARANTEED, initial_set=None, wrong_images=allowed
    )
    return replace(
        scenario,
        dispersion=scenario.uncertainty,
        information_set=settings,
        noise=noise,
        wrong_images=WrongImages(number, size=(1.05, 1000.0)),
    )


def flown(name: str, allowed: int, number: int, noise: NoiseKind, runs: int) -> Results:
    return simulate_runs(scenario_of(name, allowed, number, noise), runs, seed=5)


@pytest.mark.parametrize(
    ("name", "allowed", "noise", "runs"),
    [
        ("asteroid-1997", 1, NoiseKind.RANDOM, 30),
        ("asteroid-1997", 1, NoiseKind.GAME, 10),
        ("asteroid-1997", 2, NoiseKind.RANDOM, 10),
        ("asteroid-1997-space", 1, NoiseKind.RANDOM, 10),
        # A fault in 0.3 % of the flights is found with 99.6 %. The other cases take several times
        # as long: `benchmarks/wrong_images.py soundness` has 120 to 480 flights of each.
        pytest.param("asteroid-1997", 1, NoiseKind.RANDOM, 1800, marks=pytest.mark.thorough),
        pytest.param("asteroid-1997", 1, NoiseKind.GAME, 400, marks=pytest.mark.thorough),
        pytest.param("asteroid-1997", 2, NoiseKind.RANDOM, 100, marks=pytest.mark.thorough),
        pytest.param("asteroid-1997-space", 1, NoiseKind.RANDOM, 100, marks=pytest.mark.thorough),
        pytest.param("haiv-2013", 1, NoiseKind.RANDOM, 60, marks=pytest.mark.thorough),
        pytest.param("dart-2022", 1, NoiseKind.RANDOM, 20, marks=pytest.mark.thorough),
    ],
)
def test_miss_is_at_most_phi_in_every_flight_with_as_many_wrong_images_as_allowed(
    name: str, allowed: int, noise: NoiseKind, runs: int
) -> None:
    results = flown(name, allowed, allowed, noise, runs)
    assert not results.set_emptied.any()
    assert results.truth_kept.all()
    assert results.phi_held.count() == runs
    assert results.phi_held.all()


def with_wrong_ranges(allowed: int, number: int, noise: NoiseKind, images: int) -> Scenario:
    """The scenario of 1997 with its range sensor, wrong ranges, and perhaps wrong images."""
    scenario = scenario_of("asteroid-1997", images, images, noise)
    assert scenario.range_sensor is not None
    return replace(
        scenario,
        range_sensor=replace(scenario.range_sensor, wrong_measurements=allowed),
        wrong_ranges=WrongRanges(number, size=(1.05, 1000.0)),
    )


@pytest.mark.parametrize(
    ("allowed", "images", "noise", "runs"),
    [
        (1, 0, NoiseKind.RANDOM, 30),
        (1, 0, NoiseKind.GAME, 10),
        (2, 1, NoiseKind.RANDOM, 10),
        pytest.param(1, 0, NoiseKind.RANDOM, 400, marks=pytest.mark.thorough),
        pytest.param(3, 1, NoiseKind.RANDOM, 100, marks=pytest.mark.thorough),
    ],
)
def test_miss_is_at_most_phi_in_every_flight_with_as_many_wrong_ranges_as_allowed(
    allowed: int, images: int, noise: NoiseKind, runs: int
) -> None:
    results = simulate_runs(with_wrong_ranges(allowed, allowed, noise, images), runs, seed=6)
    assert not results.set_emptied.any()
    assert results.truth_kept.all()
    assert results.phi_held.count() == runs
    assert results.phi_held.all()


def test_wrong_ranges_empty_a_set_that_allows_for_none() -> None:
    results = simulate_runs(with_wrong_ranges(0, 1, NoiseKind.RANDOM, 0), 20, seed=6)
    assert results.set_emptied.any()


def test_wrong_ranges_of_a_flight_are_measured_ranges() -> None:
    scenario = with_wrong_ranges(1, 2, NoiseKind.RANDOM, 0)
    errors = draw(scenario, [0, 1], 0).wrong_ranges
    assert errors is not None
    steps = np.flatnonzero(errors.any(axis=0))
    assert ((errors != 0.0).sum(axis=1) == 2).all()
    assert (steps % scenario.set_model.steps_in(2.0) == 0).all()


def test_ranges_without_wrong_ones_do_not_depend_on_the_table() -> None:
    scenario = with_wrong_ranges(0, 0, NoiseKind.RANDOM, 0)
    with_table = simulate_runs(scenario, 5, seed=0)
    without = simulate_runs(replace(scenario, wrong_ranges=None), 5, seed=0)
    np.testing.assert_array_equal(with_table.miss_m, without.miss_m)


def test_wrong_ranges_in_the_model_paper_are_refused() -> None:
    scenario = with_wrong_ranges(1, 1, NoiseKind.RANDOM, 0)
    settings = replace(scenario.information_set, model=Model.PAPER)
    with pytest.raises(ValueError, match=r"range_sensor\.wrong_measurements must be 0"):
        replace(scenario, information_set=settings)


def test_set_that_allows_for_no_wrong_image_loses_its_bound_with_one() -> None:
    results = flown("asteroid-1997", 0, 1, NoiseKind.RANDOM, 30)
    assert results.set_emptied.sum() > 10


def test_flight_with_more_wrong_images_than_allowed_ends() -> None:
    results = flown("asteroid-1997", 1, 4, NoiseKind.RANDOM, 20)
    assert np.isfinite(results.miss_m).all()
    assert results.set_emptied.any()


def test_flights_without_wrong_images_do_not_depend_on_the_table() -> None:
    scenario = scenario_of("asteroid-1997", 1, 0, NoiseKind.RANDOM)
    with_table = simulate_runs(scenario, 5, seed=0)
    without = simulate_runs(replace(scenario, wrong_images=None), 5, seed=0)
    np.testing.assert_array_equal(with_table.miss_m, without.miss_m)


def test_wrong_images_are_images_in_the_interval_of_times() -> None:
    before_s = np.array([5.0, np.nan, 4.0, 3.0, np.nan, 2.0, 1.0, 0.0])
    wrong = WrongImages(3, size=(2.0, 4.0), when_s=(1.0, 4.0))
    errors = draw_wrong_measurements(wrong, before_s, 2, np.random.default_rng(0))
    changed = np.flatnonzero(errors.any(axis=0))
    assert len(changed) == 3
    assert set(changed) <= {2, 3, 5, 6}
    assert (np.abs(errors[:, changed]) >= 2.0).all()
    assert (np.abs(errors[:, changed]) <= 4.0).all()


@pytest.mark.parametrize("when_s", [(100.0, 2.0), (-5.0, 2.0)])
def test_reversed_and_negative_times_of_wrong_images_are_refused(
    when_s: tuple[float, float],
) -> None:
    with pytest.raises(ValueError, match="when_s"):
        WrongImages(3, when_s=when_s)


def test_wrong_images_of_a_run_do_not_depend_on_the_batch() -> None:
    scenario = scenario_of("asteroid-1997", 1, 2, NoiseKind.RANDOM)
    together = draw(scenario, [0, 1, 2], 0).wrong
    alone = draw(scenario, [2], 0).wrong
    assert together is not None
    assert alone is not None
    np.testing.assert_array_equal(together[:, 2], alone[:, 0])


def test_wrong_images_with_a_rate_sensor_are_refused() -> None:
    from infoset import RateSensor

    scenario = scenario_of("asteroid-1997", 1, 0, NoiseKind.RANDOM)
    with pytest.raises(ValueError, match="wrong_images must be 0 with a rate_sensor"):
        replace(scenario, rate_sensor=RateSensor(1.0, 1e-6))


def phi_of_single_images(record: Record) -> float:
    """The maximum Phi of all sets of all images but one: one ordinary set for each image."""
    model = replace(on_board_model(record.scenario), wrong_images=0, image_classes=None)
    count = record.steps
    singles = InformationSet(model, count)
    for step, (alpha, impulse) in enumerate(
        zip(record.measured["angle"], record.impulse_m_s, strict=True)
    ):
        singles.measure_angle(np.repeat(alpha[:, None], count, axis=1), np.arange(count) != step)
        singles.shift(np.repeat(impulse[:, None], count, axis=1))
        singles.drop_below_threshold()
        singles.predict()
    phi_m, exists = singles.guaranteed_miss()
    return float(phi_m[exists].max())


@pytest.mark.parametrize(
    ("classes", "runs"),
    [
        (4, range(3)),
        pytest.param(4, range(40), marks=pytest.mark.thorough),
        pytest.param(8, range(40), marks=pytest.mark.thorough),
    ],
)
def test_phi_after_a_proof_is_that_of_all_sets_of_all_images_but_one(
    classes: int, runs: Sequence[int]
) -> None:
    scenario = scenario_of("asteroid-1997", 1, 1, NoiseKind.RANDOM)
    settings = replace(scenario.information_set, image_classes=classes)
    scenario = replace(
        scenario, information_set=settings, range_sensor=None, strategy="least-effort"
    )
    proved = 0
    for run in runs:
        wrong = draw(scenario, [run], 1).wrong
        assert wrong is not None
        (step,) = np.flatnonzero(wrong[:, 0].any(axis=0)).tolist()
        record = fly_one(scenario, run, seed=1)
        result = record.result
        assert result.wrong_image_proved_s is not None
        if not result.wrong_image_proved_s.count():
            assert record.suspected_s == ()
            continue

        proved += 1
        assert record.time_s[step] in record.suspected_s
        phi_m = float(result.guaranteed_miss_m[0])
        # Phi is at most 0.1 % greater than the exact maximum.
        assert phi_m == pytest.approx(phi_of_single_images(record), rel=1e-3)
    # In 32 % of the flights the wrong image agrees with some state
    # (figures of the prototype; 5 % here, with larger errors).
    assert proved >= 0.6 * len(runs)


def test_results_have_columns_of_proved_wrong_images_only_if_the_set_allows_for_them() -> None:
    names = ["wrong_image_proved_s", "suspected_images", "wrong_image_s"]
    with_one = flown("asteroid-1997", 1, 1, NoiseKind.RANDOM, 3).to_dict()
    assert [name for name in with_one if name in names] == names
    assert not {*names} & {*flown("asteroid-1997", 0, 1, NoiseKind.RANDOM, 1).to_dict()}
    assert not {*names} & {*flown("asteroid-1997", 1, 0, NoiseKind.RANDOM, 1).to_dict()}


def test_suspects_of_a_flight_with_too_many_wrong_images_are_unknown() -> None:
    results = flown("asteroid-1997", 1, 4, NoiseKind.RANDOM, 20)
    assert results.wrong_image_proved_s is not None
    assert results.suspected_images is not None
    emptied = results.set_emptied
    assert (~np.ma.getmaskarray(results.wrong_image_proved_s)[emptied]).all()
    assert np.ma.getmaskarray(results.suspected_images)[emptied].all()
