"""Numbers of the 1997 interception in space, with standard errors: the table of
docs/measured/index.md.

    python -m benchmarks.space_numbers --runs 9000 --game-runs 3000
    python -m benchmarks.space_numbers --cost

The runs of a row are divided among three seeds. A standard error is that of a bootstrap over the
runs. `--cost` prints the processor time of a spatial engagement over that of a planar one, both
measured in turn in one process.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from infoset import InitialSet, Model
from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind, TieRule
from infoset.sim import Results, Scenario, simulate
from infoset.sim.results import join
from infoset.sim.scenario import of_model

Floats = NDArray[np.float64]
SEEDS = (1, 2, 3)
LEVELS = (0.1, 0.5, 0.9, 0.99)
RESAMPLES = 400


def in_model(scenario: Scenario, model: Model) -> Scenario:
    """Return the scenario with a model of the set, and the initial set of that model."""
    shape = InitialSet.BOX if model is Model.GUARANTEED else InitialSet.RECTANGLE
    return replace(
        scenario, **of_model(replace(scenario.set_model, model=model, initial_set=shape))
    )


def rows() -> Iterator[tuple[str, Scenario]]:
    """Yield the title and the scenario of each row."""
    spatial = load_scenario("asteroid-1997-space")
    meter = spatial.range_sensor
    spatial = replace(spatial, range_sensor=None)
    yield "random", spatial
    for tie in (TieRule.UPPER, TieRule.ALTERNATE, TieRule.RANDOM):
        yield f"game, {tie.value}", replace(spatial, noise=NoiseKind.GAME, tie=tie)
    # Gravity is the only acceleration, as in the prototype.
    sure = in_model(spatial, Model.GUARANTEED)
    sure = replace(sure, **of_model(replace(sure.set_model, disturbance_m_s2=0.0)))
    ranging = replace(sure, range_sensor=meter)
    anywhere = replace(sure, dispersion=sure.set_model.bounds)
    for title, scenario in (
        ("guaranteed", sure),
        ("guaranteed, range sensor", ranging),
        ("guaranteed, starts in B x D", anywhere),
    ):
        yield f"{title}, random", scenario
        yield f"{title}, game, upper", replace(scenario, noise=NoiseKind.GAME)


def with_error(values: Floats, level: float, random: np.random.Generator) -> str:
    """Return a quantile with its standard error in brackets."""
    chosen = random.integers(len(values), size=(RESAMPLES, len(values)))
    error = np.quantile(values[chosen], level, axis=1).std()
    return f"{np.quantile(values, level):.4g}({error:.2g})"


def line(title: str, results: Results) -> str:
    """Return a row: quantiles of miss and impulse, and the share of runs with the true state always
    in the set.
    """
    random = np.random.default_rng(0)
    miss, impulse = (
        " / ".join(with_error(values, level, random) for level in LEVELS)
        for values in (results.miss_m, results.impulse_m_s)
    )
    known = results.guaranteed_miss_m.compressed() if results.guarantees else np.empty(0)
    phi = f", median Phi {with_error(known, 0.5, random)} m" if len(known) else ""
    return (
        f"{title} ({len(results)}): miss {miss} m, impulse {impulse} m/s, inside "
        f"{results.truth_kept.mean():.1%}{phi}"
    )


def flown(scenario: Scenario, runs: int) -> Results:
    """Simulate runs of three seeds."""
    return join([simulate(scenario, runs // len(SEEDS), seed=seed) for seed in SEEDS])


def cost(runs: int) -> Iterator[str]:
    """Yield the processor time of engagements in space over those in the plane."""
    planar, spatial = (load_scenario(name) for name in ("asteroid-1997", "asteroid-1997-space"))
    for model in Model:
        for noise in (NoiseKind.RANDOM, NoiseKind.GAME):
            pair = [
                replace(in_model(scenario, model), noise=noise) for scenario in (planar, spatial)
            ]
            times: list[list[float]] = [[], []]
            for _ in range(6):
                for scenario, taken in zip(pair, times, strict=True):
                    began = time.process_time()
                    simulate(scenario, runs, seed=1)
                    taken.append(time.process_time() - began)
            plane, space = (1e3 * min(taken) / runs for taken in times)
            yield (
                f"{model.value}, {noise.value}: {plane:.2f} and {space:.2f} ms, ratio "
                f"{space / plane:.2f}"
            )


def main() -> None:
    """Simulate and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=900, help="runs of a row with random noise")
    parser.add_argument("--game-runs", type=int, default=300, help="runs of a row with game noise")
    parser.add_argument(
        "--only", default="", metavar="TEXT", help="only rows whose title begins with this text"
    )
    parser.add_argument(
        "--cost", action="store_true", help="print only the cost of the second axis"
    )
    options = parser.parse_args()
    if options.cost:
        lines = cost(200)
    else:
        lines = (
            line(
                title,
                flown(
                    scenario,
                    options.game_runs if scenario.noise is NoiseKind.GAME else options.runs,
                ),
            )
            for title, scenario in rows()
            if title.startswith(options.only)
        )
    for text in lines:
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
