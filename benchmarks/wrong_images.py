"""Misses and bounds with wrong images, for docs/wrong-images.md.

    python -m benchmarks.wrong_images table [--runs 60] [--seed 1]
    python -m benchmarks.wrong_images placings [--runs 480] [--seed 1]
    python -m benchmarks.wrong_images soundness [--flights 4000] [--seed 1]

`table` prints the table of the page, `placings` the misses with one wrong image by the set and by
Kalman filters with and without an innovation gate. `soundness` counts violations of the guarantee
with all kinds of noise of `benchmarks.soundness`; all counts except that of the flights must be
zero.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.soundness import every_noise, guaranteed
from infoset import load_scenario
from infoset.guidance import Kalman, Strategy
from infoset.sim import Results, Scenario, WrongImages
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.results import join
from infoset.sim.simulate import simulate_runs

CASES = ((0, None, 0), (0, None, 1), (1, 4, 0), (1, 4, 1), (1, 8, 1), (2, 5, 2))
"""Wrong images that the set allows for, classes, and simulated wrong images of each flight."""
GATES = (3.0, 4.0, 5.0)
"""Innovation gates of the Kalman filters, in standard deviations."""
LATE_S = (0.0, 25.0)
"""Times before the arrival of half of the placed wrong images: the last quarter of the flight, in
which an error matters most.
"""
BATCH = 48
"""Flights of a batch: `every_noise` has eight kinds in pairs."""


@dataclass(frozen=True)
class Case:
    """A scenario whose guarantee is tested.

    Parameters
    ----------
    name : str
        Built-in scenario.
    allowed, classes : int
        Wrong images that the set allows for, and classes.
    share : float
        Share of the flights.
    has_range_sensor : bool
        Whether the range sensor of the scenario is used.
    """

    name: str
    allowed: int
    classes: int
    share: float
    has_range_sensor: bool = False


SOUND = (
    Case("asteroid-1997", 1, 4, 0.45),
    Case("asteroid-1997", 1, 6, 0.08),
    Case("asteroid-1997", 2, 5, 0.08),
    Case("asteroid-1997-space", 1, 4, 0.12),
    # Gravity of the Sun and a range sensor.
    Case("own-scenario", 1, 4, 0.12, has_range_sensor=True),
    Case("haiv-2013", 1, 4, 0.08),
    Case("deep-impact-2005", 1, 4, 0.04),
    Case("dart-2022", 1, 4, 0.03),
)


def with_wrong_images(
    scenario: Scenario,
    allowed: int,
    classes: int | None,
    number: int,
    size: tuple[float, float] = (1.3, 1000.0),
    when_s: tuple[float, float] | None = None,
) -> Scenario:
    """Return a scenario whose set allows for wrong images, and whose flights have some."""
    settings = replace(scenario.information_set, wrong_images=allowed, image_classes=classes)
    wrong = WrongImages(number, size=size, when_s=when_s)
    return replace(scenario, information_set=settings, wrong_images=wrong)


def of_1997() -> Scenario:
    """Return the scenario of 1997, from anywhere in its box of starts, without the range sensor."""
    published = load_scenario("asteroid-1997")
    scenario = replace(published, range_sensor=None, strategy="least-effort")
    return replace(guaranteed(scenario, hostile=False), noise=published.noise)


def quantiles(results: Results) -> str:
    """Return the median, the 90 % quantile and the maximum of the misses."""
    return " / ".join(f"{value:.2g}" for value in np.quantile(results.miss_m, (0.5, 0.9, 1.0)))


def bounds(results: Results) -> str:
    """Return the median of Phi, the number of flights with a Phi, and how many do not hold."""
    phi_m = results.guaranteed_miss_m.compressed()
    median = f"{np.median(phi_m):.1f}" if phi_m.size else "-"
    false = int((~results.phi_held.filled(True)).sum())
    return f"{median} | {phi_m.size}, {false} of them false"


def write(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def print_table(runs: int, seed: int) -> None:
    """Print a row of the table for each case."""
    for allowed, classes, number in CASES:
        scenario = with_wrong_images(of_1997(), allowed, classes, number)
        results = simulate_runs(scenario, runs, seed=seed)
        case = f"{allowed}, {classes} classes | {number}"
        write(f"| {case} | {quantiles(results)} | {bounds(results)} |")


def placed(
    allowed: int, classes: int | None, strategy: Strategy | str, runs: int, seed: int
) -> Results:
    """Return flights with one wrong image at any time, and as many in the last quarter."""
    parts = []
    for when_s in (None, LATE_S):
        scenario = with_wrong_images(of_1997(), allowed, classes, 1, when_s=when_s)
        parts.append(simulate_runs(scenario, runs // 2, seed=seed, strategy=strategy))
    return join(parts)


def print_placings(runs: int, seed: int) -> None:
    """Print a row for each way to treat one wrong image."""
    ways: list[tuple[str, int, int | None, Strategy | str]] = [
        ("set that allows for one, four classes", 1, 4, "least-effort"),
        ("set that allows for one, eight classes", 1, 8, "least-effort"),
        ("set that allows for none", 0, None, "least-effort"),
        ("Kalman", 0, None, Kalman()),
    ]
    ways += [
        (f"Kalman, gate of {gate:g} sigma", 0, None, Kalman(gate_sigma=gate)) for gate in GATES
    ]
    for name, allowed, classes, strategy in ways:
        results = placed(allowed, classes, strategy, runs, seed)
        # The filters do not use the set: its bound says nothing about them.
        phi = bounds(results) if isinstance(strategy, str) else "- | -"
        impulse = float(np.median(results.impulse_m_s))
        write(f"| {name} | {quantiles(results)} | {phi} | {impulse:.0f} |")


def flights(case: Case, count: int, seed: int) -> Iterator[Results]:
    """Fly batches with 0 to q wrong images of each flight, and all kinds of noise."""
    scenario = load_scenario(case.name)
    if scenario.range_sensor is not None and not case.has_range_sensor:
        scenario = replace(scenario, range_sensor=None, strategy="least-effort")
    scenario = guaranteed(scenario, hostile=False)
    for first in range(0, count, BATCH):
        number = first // BATCH % (case.allowed + 1)
        wrong = with_wrong_images(scenario, case.allowed, case.classes, number, size=(1.05, 1000.0))
        runs = np.arange(first, first + BATCH)
        draws = draw(wrong, runs.tolist(), seed)
        flight = Engagements(wrong, draws, noise=every_noise(draws))
        while flight.flying:
            flight.advance()
        yield flight.results(runs)


def print_soundness(count: int, seed: int) -> None:
    """Count the violations of the guarantee in each case."""
    for case in SOUND:
        number = max(BATCH, round(case.share * count / BATCH) * BATCH)
        results = join(list(flights(case, number, seed)))
        phi_m = results.guaranteed_miss_m
        above = int((results.miss_m > phi_m.filled(np.inf)).sum())
        unknown = int(np.ma.getmaskarray(phi_m).sum())
        outside = int((results.truth_margin_m < 0.0).sum())
        write(
            f"| {case.name}, q = {case.allowed}, G = {case.classes} | {len(results.runs)} "
            f"| {above} | {unknown} | {outside} | {results.miss_m.max():.3g} | {phi_m.max():.3g} |"
        )


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("table", "placings", "soundness"))
    parser.add_argument("--runs", type=int, help="flights of each row of a table")
    parser.add_argument("--flights", type=int, default=4000, help="flights of all rows")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if options.what == "table":
        print_table(options.runs or 60, options.seed)
    elif options.what == "placings":
        print_placings(options.runs or 480, options.seed)
    else:
        print_soundness(options.flights, options.seed)


if __name__ == "__main__":
    main()
