"""Compare the time of engagements between two checkouts: `python -m benchmarks.in_turn OLD NEW`.

Both simulate batches of 200 engagements of `asteroid-1997` in turn, so that other programs and the
state of the caches affect both alike. The script prints the median processor time of a batch, and
the median and the quartiles of the ratios of two batches that follow each other. Medians of 40
pairs scatter by 1 to 2 %.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
from pathlib import Path

_BATCHES = """
import sys, time
from dataclasses import replace
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim.simulate import simulate_runs

scenario = replace(load_scenario("asteroid-1997"), noise=NoiseKind(sys.argv[2]))
if sys.argv[1] == "without":
    scenario = replace(scenario, range_sensor=None)
simulate_runs(scenario, 200, seed=1)
print("ready", flush=True)
for _ in sys.stdin:
    start = time.process_time()
    simulate_runs(scenario, 200, seed=1)
    print(1e3 * (time.process_time() - start), flush=True)
"""


def started(checkout: Path, *arguments: str) -> subprocess.Popen[str]:
    """Return a process that simulates a batch for each line that it reads, after its first
    batch.
    """
    process = subprocess.Popen(
        [sys.executable, "-c", _BATCHES, *arguments],
        cwd=checkout,
        env=os.environ | {"PYTHONPATH": str(checkout)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    batch_ms(process, ask=False)
    return process


def batch_ms(process: subprocess.Popen[str], *, ask: bool = True) -> str:
    """Return the next line of a process, after asking for a batch."""
    assert process.stdin is not None
    assert process.stdout is not None
    if ask:
        process.stdin.write("\n")
        process.stdin.flush()
    return process.stdout.readline()


def main() -> None:
    """Print the times and ratios."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument(
        "--pairs", type=int, default=40, help="batches of each checkout (default: %(default)s)"
    )
    given = parser.parse_args()
    print("range sensor | noise  | old, ms  new, ms | new / old: median  quartiles")
    for sensor in ("with", "without"):
        for noise in ("random", "game"):
            pair = [
                started(checkout.resolve(), sensor, noise) for checkout in (given.old, given.new)
            ]
            times = [[float(batch_ms(process)) for process in pair] for _ in range(given.pairs)]
            for process in pair:
                process.communicate()
            old, new = (statistics.median(column) for column in zip(*times, strict=True))
            low, middle, high = statistics.quantiles([after / before for before, after in times])
            print(
                f"{sensor:12} | {noise:6} | {old:7.1f}  {new:7.1f} | {middle:17.3f}  {low:.3f} to "
                f"{high:.3f}"
            )


if __name__ == "__main__":
    main()
