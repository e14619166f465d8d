"""Misses and bounds with wrong images, for the table of docs/wrong-images.md.

python -m benchmarks.wrong_images [--runs 60] [--seed 1]
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np

from infoset import Model, load_scenario
from infoset.sim import Scenario, WrongImages
from infoset.sim.simulate import simulate_runs

CASES = ((0, None, 0), (0, None, 1), (1, 4, 0), (1, 4, 1), (1, 8, 1), (2, 5, 2))
"""Wrong images that the set allows for, classes, and simulated wrong images of each flight."""


def case(allowed: int, classes: int | None, number: int) -> Scenario:
    """Return the scenario of 1997, from anywhere in its box of starts, without the range sensor."""
    published = load_scenario("asteroid-1997")
    settings = replace(
        published.information_set,
        model=Model.GUARANTEED,
        initial_set=None,
        wrong_images=allowed,
        image_classes=classes,
    )
    return replace(
        published,
        range_sensor=None,
        strategy="least-effort",
        dispersion=published.uncertainty,
        information_set=settings,
        wrong_images=WrongImages(number, size=(1.3, 1000.0)),
    )


def main() -> None:
    """Print a row of the table for each case."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    for allowed, classes, number in CASES:
        results = simulate_runs(case(allowed, classes, number), options.runs, seed=options.seed)
        miss = " / ".join(f"{value:.2g}" for value in np.quantile(results.miss_m, (0.5, 0.9, 1.0)))
        phi = float(np.median(results.guaranteed_miss_m.compressed()))
        false = int((~results.phi_held.filled(True)).sum())
        sys.stdout.write(
            f"| {allowed}, {classes} classes | {number} | {miss} | {phi:.1f} | "
            f"{results.phi_held.count()}, {false} of them false |\n"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    main()
