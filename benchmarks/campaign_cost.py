"""Time of a campaign as a function of its runs, and of a run as a function of its sections.

`python benchmarks/campaign_cost.py --out DIR` prints the fitted straight lines and the maximum
deviation from them, and writes figure-campaign-cost.pdf and .png.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from infoset.experiments import load_scenario
from infoset.experiments.common.figure_style import (
    CURVE_LOOKS,
    legend_below,
    letters,
    style,
    subplots,
)
from infoset.experiments.common.output import Output
from infoset.guidance import NoiseKind
from infoset.sim import Campaign, Scenario, simulate
from infoset.sim.scenario import of_model

RUNS = (128, 256, 512, 1024, 2048)
SECTIONS = (15, 29, 58, 116, 232)
ROUNDS = 3
BATCHES = 2


def campaign_s(scenario: Scenario, runs: int) -> float:
    """Return the shortest time of a campaign in several rounds, s."""
    times = []
    for _ in range(ROUNDS):
        with tempfile.TemporaryDirectory() as folder:
            began_s = time.perf_counter()
            Campaign(scenario, runs, Path(folder) / "campaign", guarantee=False).run(workers=1)
            times.append(time.perf_counter() - began_s)
    return min(times)


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    out: Path = parser.parse_args().out
    paper = replace(load_scenario("asteroid-1997"), range_sensor=None)
    with style():
        figure, ((left, right),) = subplots(80.0, 1, 2)
        for noise in (NoiseKind.RANDOM, NoiseKind.GAME):
            scenario = replace(paper, noise=noise)
            simulate(scenario, 64)
            look = CURVE_LOOKS[1 if noise is NoiseKind.RANDOM else 4]
            by_runs = [campaign_s(scenario, runs) for runs in RUNS]
            model = scenario.set_model
            by_sections = [
                campaign_s(
                    replace(scenario, **of_model(replace(model, sections=count), scenario)),
                    64 * BATCHES,
                )
                / (64 * BATCHES)
                for count in SECTIONS
            ]
            for axes, ticks, values, name in (
                (left, RUNS, np.array(by_runs), "time of a campaign in s, n runs"),
                (right, SECTIONS, 1e3 * np.array(by_sections), "time of a run in ms, n sections"),
            ):
                rise, fixed = np.polyfit(ticks, values, 1)
                line = fixed + rise * np.array(ticks)
                off = float(np.abs(values / line - 1.0).max())
                print(
                    f"{noise.value}: {name}: {fixed:.3g} + {rise:.3g} n, within {off:.0%}: "
                    f"{np.round(values, 3)}"
                )
                axes.plot(
                    ticks, values, linestyle="", marker="o", markersize=4.0, color=look["color"]
                )
                axes.plot(ticks, line, label=f"{noise.value} noise", **look)
        for axes, ticks, label in (
            (left, RUNS, "runs"),
            (right, SECTIONS, "sections at the start"),
        ):
            axes.set_xlim(0.0, 1.05 * ticks[-1])
            axes.set_ylim(bottom=0.0)
            axes.set_xlabel(label)
        left.set_ylabel("time, s")
        right.set_ylabel("time per run, ms")
        letters((left, right), ["a campaign, 29 sections", f"a run, of {64 * BATCHES}"])
        legend_below(figure, 2, title="points: measured, lines: fitted")
    out.mkdir(parents=True, exist_ok=True)
    Output(out, {}, overwrite=True).figure("figure-campaign-cost", figure)


if __name__ == "__main__":
    main()
