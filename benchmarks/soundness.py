"""Test the guaranteed model: simulate all kinds of noise with starts in all of B x D, and count
violations.

    python -m benchmarks.soundness --engagements 200000
    python -m benchmarks.soundness --engagements 200000 --hostile
    python -m benchmarks.soundness --engagements 200000 --random rate
    python -m benchmarks.soundness --engagements 100000 --random
    python -m benchmarks.soundness --engagements 200000 --space
    python -m benchmarks.soundness --engagements 40000 --camera
    python -m benchmarks.soundness --engagements 40000 --camera scheduled
    python -m benchmarks.soundness --engagements 20000 --gravity
    python -m benchmarks.soundness --engagements 20000 --random --burns

`--hostile` has execution errors of 2 % and a manoeuvring target, `--random` random scenarios, each
with a rate sensor or without one. `--space` is out of the plane, with the Sun anywhere. `--camera`
has random scenarios with a camera, also with a cut-off or times of impulses, and `--gravity` random
scenarios in strong gravity. `--burns` has burns of up to a step, also with `--random rate` and
`--camera`.

Counted are engagements whose true state left its section (by any amount), whose set was lost, whose
true miss exceeded Phi, and those without a Phi. All counts must be zero; a warning ends the run.
Scenarios whose gravity has no bound are refused before the flight, and counted apart. A batch has
all kinds of noise, the true motion is Keplerian, and V_x is anywhere in D.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.random_scenarios import (
    camera_scenario,
    gravity_scenario,
    random_scenario,
    scheduled,
    with_burns,
)
from infoset import AngleSensor, InformationSetView, InitialSet, Model, RateSensor
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import (
    GameNoise,
    LineOfSight,
    MeasurementNoise,
    NoiseKind,
    RandomNoise,
    TieRule,
)
from infoset.sim import Manoeuvre, Outcome, Scenario, Target
from infoset.sim.bound.pair_flight import middle
from infoset.sim.draws import Draws, draw
from infoset.sim.engagement import Engagements
from infoset.sim.scenario import of_model

Floats = NDArray[np.float64]
BATCH, SPACE_BATCH = 80, 160
KINDS = (
    "random",
    "game, upper",
    "game, lower",
    "game, alternate",
    "game, random",
    "extremal",
    "constant",
    "pair",
)


@dataclass(frozen=True)
class BoundedPairNoise:
    """Noise of pairs: engagements 2 k and 2 k + 1 measure their mean, within the bounds."""

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Floats]:
        """Measure the mean of both engagements of a pair."""
        measured = {}
        for name, sensor in sight.sensors.items():
            true = sensor.true_value(sight)
            wanted = sight.alpha_rad if name == "angle" else true
            if name == "range":
                measured[name] = true.copy()
            else:
                measured[name] = sensor.nearest(sight, middle(wanted))
        return measured


@dataclass(frozen=True)
class MixedNoise:
    """Noises of all kinds in one batch: engagements 2 k and 2 k + 1 have kind k, repeated."""

    parts: tuple[MeasurementNoise, ...]

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Floats]:
        """Measure with all kinds, and choose the measurements of each engagement's kind."""
        kind = kind_of(sight.range_m.size)
        measurements = [part.measure(sight, predicted) for part in self.parts]
        return {
            name: np.choose(kind, [measured[name] for measured in measurements])
            for name in sight.sensors
        }


def kind_of(batch: int) -> NDArray[np.int64]:
    """Return the index of the noise of each engagement in `KINDS`."""
    return np.arange(batch) // 2 % len(KINDS)


def every_noise(draws: Draws) -> MixedNoise:
    """Return the noise of a batch, with all kinds."""
    signs = np.where(draws.tie >= 0.0, 1.0, -1.0)
    # Half of the biases are at the bound, the others anywhere.
    bias = np.where(np.arange(signs.shape[-2]) % 4 < 2, signs[..., 0], draws.tie[..., 0])
    constant = np.broadcast_to(bias[..., None], signs.shape)
    extremal = {name: np.where(errors >= 0.0, 1.0, -1.0) for name, errors in draws.errors.items()}
    constants = {name: errors[..., :1] + np.zeros_like(errors) for name, errors in extremal.items()}
    return MixedNoise(
        (
            RandomNoise(draws.errors, draws.bias),
            *(
                GameNoise(tie, draws.tie)
                for tie in (TieRule.UPPER, TieRule.LOWER, TieRule.ALTERNATE, TieRule.RANDOM)
            ),
            RandomNoise({**extremal, "angle": signs}),
            RandomNoise({**constants, "angle": constant}),
            BoundedPairNoise(),
        )
    )


def in_space(scenario: Scenario, number: int) -> Scenario:
    """Return the scenario in space, with another y axis and direction of the Sun by number."""
    random = np.random.default_rng(np.random.SeedSequence(entropy=21, spawn_key=(number,)))
    model = scenario.set_model
    sun = scenario.sun
    sensor = model.angle_sensor
    assert isinstance(sensor, AngleSensor)
    if random.uniform() < 0.25:  # a bound that rises with range
        sensor = replace(
            sensor,
            error_at_nominal_range_rad=sensor.error_at_zero_range_rad,
            error_at_zero_range_rad=sensor.error_at_nominal_range_rad,
        )
    differ = random.uniform() < 0.5
    sensor = replace(
        sensor,
        error_at_nominal_range_y_rad=1.5 * sensor.error_at_nominal_range_rad if differ else None,
        error_at_zero_range_y_rad=0.7 * sensor.constant_error_rad if differ else None,
    )
    box = model.bounds
    widths = 10.0 ** random.uniform(-1.5, 0.5, 2)
    bounds = replace(
        box,
        y_m=(-float(widths[0]) * 1e4, 1e4),
        vy_m_s=(-100.0, float(widths[1]) * 100.0),
    )
    if sun is not None:
        direction = random.uniform(-np.pi, np.pi)
        height = random.uniform(-1.0, 1.0)
        sun = replace(sun, direction_rad=float(direction), elevation_rad=float(np.arcsin(height)))
    known = replace(model, bounds=bounds, angle_sensor=sensor)
    return replace(scenario, sun=sun, dispersion=bounds, **of_model(known))


def guaranteed(scenario: Scenario, hostile: bool) -> Scenario:
    """Return the scenario with the guaranteed model and starts anywhere in B x D."""
    model = replace(scenario.set_model, model=Model.GUARANTEED, initial_set=InitialSet.BOX)
    # Draws contain tie choices only with this noise; they are used as additional random numbers
    # here.
    scenario = replace(
        scenario,
        **of_model(model),
        dispersion=model.bounds,
        noise=NoiseKind.GAME,
        tie=TieRule.RANDOM,
    )
    if not hostile:
        return scenario
    target = Target(Manoeuvre.WORST_CASE, model.disturbance_m_s2)
    pointing = 0.02 if scenario.is_spatial else 0.0
    engine = replace(scenario.thruster, execution_error_relative=0.02, pointing_error_rad=pointing)
    return replace(scenario, thruster=engine, target=target)


@dataclass(frozen=True)
class Count:
    """Numbers of engagements and of violations."""

    engagements: int = 0
    outside: int = 0
    lost: int = 0
    above: int = 0
    unknown: int = 0
    refused: int = 0

    def __add__(self, other: Count) -> Count:
        return Count(
            *(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True))
        )


def fly(scenario: Scenario, first: int, batch: int, seed: int, *, burns: bool = False) -> Count:
    """Simulate a batch of engagements with all kinds of noise, and with burns in place of impulses
    if the scenario allows them.
    """
    if burns:
        try:
            scenario = with_burns(scenario, first // batch)
        except ValueError:
            return Count(refused=batch)
    draws = draw(scenario, range(first, first + batch), seed)
    if draws.execution is not None and first // batch % 2:
        draws = replace(draws, execution=np.where(draws.execution >= 0.0, 1.0, -1.0))
    if scenario.target is not None:
        manoeuvres = [manoeuvre for manoeuvre in Manoeuvre if manoeuvre is not Manoeuvre.NONE]
        target = replace(scenario.target, manoeuvre=manoeuvres[first // batch % len(manoeuvres)])
        scenario = replace(scenario, target=target)
    if draws.pointing is not None and first // batch % 2:
        draws = replace(draws, pointing=np.where(draws.pointing >= 0.0, 1.0, -1.0))
    flight = Engagements(scenario, draws, noise=every_noise(draws))
    while flight.flying:
        flight.advance()
    results = flight.results(np.arange(first, first + batch))
    phi = results.guaranteed_miss_m
    return Count(
        batch,
        int((results.truth_margin_m < 0.0).sum()),
        results.outcomes.count(Outcome.SET_EMPTY),
        int((results.miss_m > phi.filled(np.inf)).sum()),
        int(np.ma.getmaskarray(phi).sum()),
    )


def scenarios(hostile: bool) -> list[Scenario]:
    """Return the built-in scenarios, without and with the range sensor."""
    built_in = [
        guaranteed(load_scenario(name), hostile) for name in ("asteroid-1997", "comet-fast")
    ]
    return [
        replace(scenario, range_sensor=sensor)
        for scenario in built_in
        for sensor in (None, scenario.range_sensor)
    ]


def fly_batch(number: int, hostile: bool, seed: int) -> Count:
    """Simulate batch `number`: one in eight is of the comet, which takes three times as many
    steps.
    """
    built_in = scenarios(hostile)
    often = [scenario for scenario in built_in if scenario.name == "asteroid-1997"]
    rarely = [scenario for scenario in built_in if scenario.name != "asteroid-1997"]
    chosen = rarely[number // 8 % len(rarely)] if number % 8 == 7 else often[number % len(often)]
    return fly(chosen, number * BATCH, BATCH, seed)


def fly_space_batch(number: int, hostile: bool, seed: int) -> Count:
    """Simulate batch `number` out of the plane: some have a range sensor, a comet or rates."""
    scenario = load_scenario("comet-fast" if number % 32 == 7 else "asteroid-1997")
    sensor = scenario.range_sensor if number // 8 % 2 else None
    scenario = replace(scenario, rate_sensor=RateSensor(1.0, 5e-8) if number % 128 == 5 else None)
    return fly(
        guaranteed(in_space(replace(scenario, range_sensor=sensor), number), hostile),
        number * SPACE_BATCH,
        SPACE_BATCH,
        seed,
    )


def fly_random_batch(number: int, rate_sensor: bool, seed: int, *, burns: bool = False) -> Count:
    """Simulate batch `number`, which has a random scenario."""
    return fly(
        random_scenario(seed * 1_000_000 + number, rate_sensor=rate_sensor),
        number * BATCH,
        BATCH,
        seed,
        burns=burns,
    )


def fly_camera_batch(
    number: int, seed: int, *, has_schedule: bool = False, burns: bool = False
) -> Count:
    """Simulate batch `number`, which has a random scenario with a camera, and a random schedule of
    impulses.
    """
    scenario = camera_scenario(seed * 1_000_000 + number)
    if has_schedule:
        scenario = scheduled(scenario, number)
    return fly(scenario, number * BATCH, BATCH, seed, burns=burns)


def fly_gravity_batch(number: int, seed: int) -> Count:
    """Simulate batch `number`, which has a random scenario in strong gravity, unless that is
    refused.
    """
    try:
        scenario = gravity_scenario(seed * 1_000_000 + number)
    except ValueError:
        return Count(refused=BATCH)
    return fly(guaranteed(scenario, hostile=False), number * BATCH, BATCH, seed)


def main() -> None:
    """Simulate, count and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--engagements", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--hostile", action="store_true", help="execution errors of 2 %% and a manoeuvring target"
    )
    parser.add_argument(
        "--random", nargs="?", const="plain", choices=("plain", "rate"), help="random scenarios"
    )
    parser.add_argument("--space", action="store_true", help="out of the plane")
    kinds = ("plain", "scheduled")
    parser.add_argument(
        "--camera", nargs="?", const="plain", choices=kinds, help="random scenarios with a camera"
    )
    parser.add_argument("--gravity", action="store_true", help="random scenarios in strong gravity")
    parser.add_argument(
        "--burns", action="store_true", help="burns that take time, for --random and --camera"
    )
    parser.add_argument(
        "--first", type=int, default=0, metavar="BATCH", help="number of the first batch"
    )
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args()
    warnings.simplefilter("error")
    began = time.perf_counter()
    total = Count()
    with ThreadPoolExecutor(options.workers) as pool:
        batch = SPACE_BATCH if options.space else BATCH
        numbers = range(options.first, options.first - (-options.engagements // batch))
        if options.camera:
            has_schedule = options.camera == "scheduled"
            jobs = [
                pool.submit(
                    fly_camera_batch,
                    number,
                    options.seed,
                    has_schedule=has_schedule,
                    burns=options.burns,
                )
                for number in numbers
            ]
        elif options.gravity:
            jobs = [pool.submit(fly_gravity_batch, number, options.seed) for number in numbers]
        elif options.random is None:
            fly_one_batch = fly_space_batch if options.space else fly_batch
            jobs = [
                pool.submit(fly_one_batch, number, options.hostile, options.seed)
                for number in numbers
            ]
        else:
            rate = options.random == "rate"
            jobs = [
                pool.submit(fly_random_batch, number, rate, options.seed, burns=options.burns)
                for number in numbers
            ]
        for number, job in enumerate(jobs):
            count = job.result()
            if count != Count(count.engagements, refused=count.refused):
                sys.stdout.write(f"batch {numbers[number]}: {count}\n")
            total += count
            if number % 50 == 49 or number == len(jobs) - 1:
                sys.stdout.write(f"{total} {time.perf_counter() - began:.0f} s\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
