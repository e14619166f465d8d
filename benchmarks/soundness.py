"""Does the guaranteed model keep its word? Fly every kind of noise from everywhere in B x D, and count what breaks.

    python -m benchmarks.soundness --engagements 200000
    python -m benchmarks.soundness --engagements 200000 --hostile      # execution errors of 2 %, a manoeuvring target
    python -m benchmarks.soundness --engagements 200000 --random rate  # random scenarios, each with a rate sensor
    python -m benchmarks.soundness --engagements 100000 --random       # random scenarios without one

Counted are engagements whose truth left its own section (by any amount), whose set was lost, whose true miss exceeded
Phi, and those without a Phi. All must be zero; a warning ends the run. Engagements of one batch have noise of every
kind, real Kepler truth, V_x anywhere in D.
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

from benchmarks.random_scenarios import random_scenario
from experiments.interception.scenario_file import load_scenario
from guidance import GameNoise, LineOfSight, MeasurementNoise, NoiseKind, RandomNoise, TieRule
from guidance.pair_noise import middle
from infoset import InformationSetView, InitialSet, Model
from sim import Manoeuvre, Outcome, Scenario, Target
from sim.draws import Draws, draw
from sim.engagement import Engagements

Floats = NDArray[np.float64]
BATCH = 80
KINDS = ("random", "game, upper", "game, lower", "game, alternate", "game, random", "extremal", "constant", "pair")


@dataclass(frozen=True)
class BoundedPairNoise:
    """Engagements 2 k and 2 k + 1 are shown the angle between their two, as far as both bounds allow."""

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Floats]:
        """Show each the middle."""
        measured = {}
        for name, sensor in sight.sensors.items():
            true, bound = sensor.true_value(sight), sensor.bound(sight)
            measured[name] = true.copy() if name == "range" else np.clip(middle(true), true - bound, true + bound)
        return measured


@dataclass(frozen=True)
class MixedNoise:
    """Engagement b has noise number b modulo how many there are, in pairs."""

    parts: tuple[MeasurementNoise, ...]

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Floats]:
        """Ask all, and give to each engagement its own."""
        kind = kind_of(sight.alpha_rad.size)
        given = [part.measure(sight, predicted) for part in self.parts]
        return {name: np.choose(kind, [measured[name] for measured in given]) for name in sight.sensors}


def kind_of(batch: int) -> NDArray[np.int64]:
    """Number of the noise of each engagement."""
    return np.arange(batch) // 2 % len(KINDS)


def every_noise(draws: Draws) -> MixedNoise:
    """One noise of each kind."""
    signs = np.where(draws.tie >= 0.0, 1.0, -1.0)
    # Half of them at the bound, half anywhere.
    bias = np.where(np.arange(len(signs)) % 4 < 2, signs[:, 0], draws.tie[:, 0])
    constant = np.broadcast_to(bias[:, None], signs.shape)
    extremal = {name: np.where(errors >= 0.0, 1.0, -1.0) for name, errors in draws.errors.items()}
    constants = {name: errors[:, :1] + np.zeros_like(signs) for name, errors in extremal.items()}
    return MixedNoise(
        (
            RandomNoise(draws.errors),
            *(GameNoise(tie, draws.tie) for tie in (TieRule.UPPER, TieRule.LOWER, TieRule.ALTERNATE, TieRule.RANDOM)),
            RandomNoise({**extremal, "angle": signs}),
            RandomNoise({**constants, "angle": constant}),
            BoundedPairNoise(),
        )
    )


def guaranteed(scenario: Scenario, hostile: bool) -> Scenario:
    """The scenario with the guaranteed model and starts anywhere in B x D."""
    model = replace(scenario.set_model, kind=Model.GUARANTEED, initial_set=InitialSet.BOX)
    # Draws hold choices between ties for this noise alone; those are used as what else is random here.
    scenario = replace(scenario, set_model=model, dispersion=model.bounds, noise=NoiseKind.GAME, tie=TieRule.RANDOM)
    if not hostile:
        return scenario
    target = Target(Manoeuvre.WORST_CASE, model.disturbance_m_s2)
    return replace(scenario, thruster=replace(scenario.thruster, execution_error_relative=0.02), target=target)


@dataclass(frozen=True)
class Count:
    """What broke, of how many."""

    engagements: int = 0
    outside: int = 0
    lost: int = 0
    above: int = 0
    unknown: int = 0

    def __add__(self, other: Count) -> Count:
        return Count(*(a + b for a, b in zip(vars(self).values(), vars(other).values(), strict=True)))


def fly(scenario: Scenario, first: int, batch: int, seed: int) -> Count:
    """Fly some engagements, of every noise."""
    draws = draw(scenario, range(first, first + batch), seed)
    if draws.execution is not None and first // batch % 2:
        draws = replace(draws, execution=np.where(draws.execution >= 0.0, 1.0, -1.0))
    if scenario.target is not None:
        manoeuvres = [each for each in Manoeuvre if each is not Manoeuvre.NONE]
        target = replace(scenario.target, manoeuvre=manoeuvres[first // batch % len(manoeuvres)])
        scenario = replace(scenario, target=target)
    flight = Engagements(scenario, draws, noise=every_noise(draws))
    while flight.flying:
        flight.advance()
    results = flight.results(np.arange(first, first + batch))
    phi = results.guaranteed_miss_m
    return Count(
        batch,
        int((results.truth_margin_m < 0.0).sum()),
        results.outcomes.count(Outcome.SET_LOST),
        int((results.miss_m > phi.filled(np.inf)).sum()),
        int(np.ma.getmaskarray(phi).sum()),
    )


def scenarios(hostile: bool) -> list[Scenario]:
    """The built-in scenarios, each without and with its range meter."""
    given = [guaranteed(load_scenario(name), hostile) for name in ("asteroid-1997", "comet-fast")]
    return [replace(each, range_sensor=sensor) for each in given for sensor in (None, each.range_sensor)]


def fly_batch(number: int, hostile: bool, seed: int) -> Count:
    """Fly batch `number`: one in eight is of the comet, which takes three times the steps."""
    flown = scenarios(hostile)
    often = [each for each in flown if each.name == "asteroid-1997"]
    rarely = [each for each in flown if each.name != "asteroid-1997"]
    chosen = rarely[number // 8 % len(rarely)] if number % 8 == 7 else often[number % len(often)]
    return fly(chosen, number * BATCH, BATCH, seed)


def fly_random_batch(number: int, rate_sensor: bool, seed: int) -> Count:
    """Fly batch `number` of a random scenario of its own."""
    return fly(random_scenario(seed * 1_000_000 + number, rate_sensor=rate_sensor), number * BATCH, BATCH, seed)


def main() -> None:
    """Fly, count and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--engagements", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--hostile", action="store_true", help="execution errors of 2 %% and a manoeuvring target")
    parser.add_argument("--random", nargs="?", const="plain", choices=("plain", "rate"), help="random scenarios")
    parser.add_argument("--first", type=int, default=0, metavar="BATCH", help="number of the first batch")
    parser.add_argument("--workers", type=int, default=1)
    given = parser.parse_args()
    warnings.simplefilter("error")
    began = time.perf_counter()
    total = Count()
    with ThreadPoolExecutor(given.workers) as pool:
        numbers = range(given.first, given.first - (-given.engagements // BATCH))
        if given.random is None:
            jobs = [pool.submit(fly_batch, number, given.hostile, given.seed) for number in numbers]
        else:
            jobs = [pool.submit(fly_random_batch, number, given.random == "rate", given.seed) for number in numbers]
        for number, job in enumerate(jobs):
            count = job.result()
            if count != Count(count.engagements):
                sys.stdout.write(f"batch {numbers[number]}: {count}\n")
            total += count
            if number % 50 == 49 or number == len(jobs) - 1:
                sys.stdout.write(f"{total} {time.perf_counter() - began:.0f} s\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
