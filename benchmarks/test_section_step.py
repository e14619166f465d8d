"""One step of the sections: the engine compared with shapely objects in a loop and with shapely's
vectorised calls.

The step is that of the paper: shear (one step of the motion), sum with the segment of the
disturbance, cut by an angle measurement, and the extremes of the predicted miss. The sections are
those of 50 engagements after 60 steps. Both versions with shapely are optimised; for example, they
take the hull of a line through all corners, because an object for each corner would take five times
as long as the whole step. Times are processor times.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import shapely
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from shapely.geometry import LineString, Polygon

from infoset import InformationSet, SetModel
from infoset.sim import Scenario, simulate
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements, Step

Floats = NDArray[np.float64]
Check = Callable[[str, float, float, str], None]

ENGAGEMENTS = 50
STEP = 60
STRETCH = 10
FAR = 1e6
OVER_OBJECTS, OVER_VECTORISED = 200.0, 100.0
WHOLE, WHOLE_TARGET = 200, 100.0


@dataclass(frozen=True)
class Flight:
    """Information sets after some steps, the angles of the next step, and the same sections as
    shapely objects.

    The engine is timed over several steps (angles and impulses), so that the sets are in the
    processor's cache as in an engagement; a new copy is not.
    """

    model: SetModel
    information: InformationSet
    alpha_rad: Floats
    stretch: list[tuple[Floats, Floats]]
    polygons: list[Polygon]
    range_m: Floats
    centre_m: Floats
    half_width_m: Floats

    def batch(self) -> tuple[tuple[InformationSet], dict[str, object]]:
        """Return copies of the sets for a round, because the engine's step changes its
        arguments.
        """
        return (self.information.copy(),), {}


@pytest.fixture(scope="module")
def flight(curve: Scenario) -> Flight:
    engagements = Engagements(curve, draw(curve, range(ENGAGEMENTS), seed=0))
    caught: list[InformationSet] = []
    stretch: list[tuple[Floats, Floats]] = []

    def catch(step: Step) -> None:
        if step.step == STEP:
            caught.append(step.information.copy())
            caught[0].shift(step.impulse_m_s)
        elif step.step > STEP and "angle" in step.measured:
            stretch.append((step.measured["angle"], step.impulse_m_s))

    while engagements.step <= STEP + STRETCH:
        engagements.advance(catch)
    (information,), alpha_rad = caught, stretch[0][0]
    model = curve.set_model
    sections = [(b, section) for b in range(ENGAGEMENTS) for section in information.sections(b)]
    range_m = (
        np.array([section.range_m for _, section in sections])
        - model.closing_speed_m_s * model.step_s
    )
    bound = np.asarray(model.angle_sensor.error_bound(range_m))
    return Flight(
        model=model,
        information=information,
        alpha_rad=alpha_rad,
        stretch=stretch,
        polygons=[Polygon(section.polygons[0].polygon()) for _, section in sections],
        range_m=range_m,
        centre_m=alpha_rad[[b for b, _ in sections]] * range_m,
        half_width_m=bound * range_m,
    )


def step_engine(information: InformationSet, alpha_rad: Floats) -> None:
    """Step every section of the batch."""
    information.predict()
    information.measure_angle(alpha_rad)


def fly_stretch(information: InformationSet, stretch: list[tuple[Floats, Floats]]) -> None:
    """Step every section of the batch several times, impulses included."""
    for alpha_rad, impulse_m_s in stretch:
        step_engine(information, alpha_rad)
        information.shift(impulse_m_s)


def step_objects(flight: Flight) -> Floats:
    """Step over shapely objects in a loop; return the extremes (minimum, maximum) of z + V x/e."""
    model = flight.model
    half = np.array(
        [model.disturbance_m_s2 * model.step_s, 0.5 * model.disturbance_m_s2 * model.step_s**2]
    )
    extremes = np.full((len(flight.polygons), 2), np.nan)
    for i, polygon in enumerate(flight.polygons):
        corners = shapely.get_coordinates(polygon)
        corners[:, 1] += model.step_s * corners[:, 0]
        grown = LineString(np.concatenate([corners + half, corners - half])).convex_hull
        centre = flight.centre_m[i]
        half_width = flight.half_width_m[i]
        cut = grown.intersection(shapely.box(-FAR, centre - half_width, FAR, centre + half_width))
        if not cut.is_empty:
            left = shapely.get_coordinates(cut)
            misses = left[:, 1] + left[:, 0] * (flight.range_m[i] / model.closing_speed_m_s)
            extremes[i] = misses.min(), misses.max()
    return extremes


def step_vectorised(flight: Flight, polygons: NDArray[np.object_]) -> Floats:
    """Step over an array of shapely polygons with shapely's vectorised calls; return the
    extremes.
    """
    model = flight.model
    half = np.array(
        [model.disturbance_m_s2 * model.step_s, 0.5 * model.disturbance_m_s2 * model.step_s**2]
    )
    corners, owner = shapely.get_coordinates(polygons, return_index=True)
    corners[:, 1] += model.step_s * corners[:, 0]
    order = np.argsort(np.concatenate([owner, owner]), kind="stable")
    both = np.concatenate([corners + half, corners - half])[order]
    grown = shapely.convex_hull(shapely.linestrings(both, indices=np.repeat(owner, 2)))
    bands = shapely.box(
        -FAR, flight.centre_m - flight.half_width_m, FAR, flight.centre_m + flight.half_width_m
    )
    cut = shapely.intersection(grown, bands)
    left, owner = shapely.get_coordinates(cut, return_index=True)
    misses = left[:, 1] + left[:, 0] * (flight.range_m / model.closing_speed_m_s)[owner]
    extremes = np.full((len(polygons), 2), np.nan)
    first = np.flatnonzero(np.diff(owner, prepend=-1))
    extremes[owner[first], 0] = np.minimum.reduceat(misses, first)
    extremes[owner[first], 1] = np.maximum.reduceat(misses, first)
    return extremes


def seconds(benchmark: BenchmarkFixture) -> float:
    """Return the median time of a round, s."""
    assert benchmark.stats is not None
    return float(benchmark.stats.stats.median)


@pytest.fixture(scope="module")
def median_s() -> dict[str, float]:
    """Median times of the benchmarks of one flight, for the ratios."""
    return {}


@pytest.mark.benchmark(group="section-step", timer=time.process_time)
def test_engine(
    benchmark: BenchmarkFixture, flight: Flight, curve: Scenario, median_s: dict[str, float]
) -> None:
    benchmark.pedantic(
        lambda information: fly_stretch(information, flight.stretch),
        setup=flight.batch,
        rounds=100,
        warmup_rounds=5,
    )
    median_s[f"engine {curve.noise.value}"] = seconds(benchmark) / STRETCH
    benchmark.extra_info["ns_per_section"] = (
        1e9 * seconds(benchmark) / STRETCH / len(flight.polygons)
    )


@pytest.mark.benchmark(group="section-step", timer=time.process_time)
def test_shapely_objects(
    benchmark: BenchmarkFixture, flight: Flight, curve: Scenario, median_s: dict[str, float]
) -> None:
    benchmark.pedantic(step_objects, args=(flight,), rounds=5, warmup_rounds=1)
    median_s[f"objects {curve.noise.value}"] = seconds(benchmark)


@pytest.mark.benchmark(group="section-step", timer=time.process_time)
def test_shapely_vectorised(
    benchmark: BenchmarkFixture, flight: Flight, curve: Scenario, median_s: dict[str, float]
) -> None:
    polygons = np.array(flight.polygons, dtype=object)
    benchmark.pedantic(step_vectorised, args=(flight, polygons), rounds=10, warmup_rounds=1)
    median_s[f"vectorised {curve.noise.value}"] = seconds(benchmark)


def test_ratios(
    flight: Flight, curve: Scenario, median_s: dict[str, float], at_least: Check
) -> None:
    noise = curve.noise.value
    sections = len(flight.polygons)
    if len([key for key in median_s if key.endswith(f" {noise}")]) < 3:
        pytest.skip("the ratio needs all three benchmarks")
    engine = median_s[f"engine {noise}"]
    vertices = np.mean([len(polygon.exterior.coords) - 1 for polygon in flight.polygons])
    sort = (
        f"{noise}, {sections} sections of {vertices:.0f} vertices, {1e9 * engine / sections:.0f} "
        "ns each"
    )
    at_least(
        f"section-step compared with objects ({sort})",
        median_s[f"objects {noise}"] / engine,
        OVER_OBJECTS,
        "x",
    )
    at_least(
        f"section-step compared with vectorised ({sort})",
        median_s[f"vectorised {noise}"] / engine,
        OVER_VECTORISED,
        "x",
    )


def test_whole_engagements(
    flight: Flight, curve: Scenario, median_s: dict[str, float], at_least: Check
) -> None:
    noise = curve.noise.value
    if f"objects {noise}" not in median_s:
        pytest.skip("the ratio needs the benchmark of shapely objects")
    draws = draw(curve, range(WHOLE), seed=0)
    sections = []
    counted = Engagements(curve, draws)
    while counted.flying:
        counted.advance(
            lambda step: sections.append(int(step.information.section_counts[step.tracking].sum()))
        )
    times = []
    for _ in range(3):
        began_s = time.process_time()
        simulate(curve, WHOLE)
        times.append(time.process_time() - began_s)
    objects_s = median_s[f"objects {noise}"] / len(flight.polygons) * sum(sections)
    sort = (
        f"{noise}, {WHOLE / min(times):.0f} engagements per second, {sum(sections) / WHOLE:.0f} "
        "section-steps each"
    )
    at_least(
        f"whole engagements compared with their section-steps as objects ({sort})",
        objects_s / min(times),
        WHOLE_TARGET,
        "x",
    )


def test_all_three_do_the_same_step(flight: Flight) -> None:
    polygons = np.array(flight.polygons, dtype=object)
    objects = step_objects(flight)
    vectorised = step_vectorised(flight, polygons)
    np.testing.assert_allclose(vectorised, objects, rtol=1e-9)
    information = flight.information.copy()
    step_engine(information, flight.alpha_rad)
    miss = information.predicted_miss()
    drift = (
        0.5 * flight.model.disturbance_m_s2 * (flight.range_m / flight.model.closing_speed_m_s) ** 2
    )
    owner = np.repeat(np.arange(ENGAGEMENTS), flight.information.section_counts)
    for b in np.flatnonzero(miss.exists):
        mine = owner == b
        np.testing.assert_allclose(
            np.nanmax((vectorised[:, 1] + drift)[mine]), miss.upper_m[b], rtol=1e-6, atol=1e-3
        )
        np.testing.assert_allclose(
            np.nanmin((vectorised[:, 0] - drift)[mine]), miss.lower_m[b], rtol=1e-6, atol=1e-3
        )
