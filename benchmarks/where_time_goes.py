"""Where the time of an engagement goes: by part, by section-step, and how many vertices there are.

    python benchmarks/where_time_goes.py                     # random noise, 50 and 200 engagements at once
    python benchmarks/where_time_goes.py --noise game --together 400

Parts are timed by wrapping the kernels and the methods that call them, each without what it calls; the best of some
rounds is shown. The wrapping itself is a few per cent, told as part of the interpreter's.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from experiments import load_scenario
from guidance import NoiseKind
from infoset import information_set, section_passes
from sim import Scenario
from sim.draws import draw
from sim.engagement import Engagements
from sim.kepler import KeplerMotion

ROUNDS = 8
SECTION_STEPS = "prediction, cut and summary of the sections"
REGRIDS = "new grids of sections, and their ends"
IMPULSES = "impulses of the sections"
TRUTH_SECTION = "the truth's own section and its margin"
TRUTH = "the truth's motion"
DRAWS = "random numbers"
REST = "the interpreter, NumPy, and what is not named"


@dataclass
class Clock:
    """Seconds by part, and section-steps, of one flight."""

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    section_steps: int = 0
    inside: list[float] = field(default_factory=list)

    def timed(self, part: Callable[..., str], work: Callable[..., Any]) -> Callable[..., Any]:
        """Do the work, and count it without what is counted inside it."""

        def wrapped(*given: Any) -> Any:
            name = part(*given)
            self.inside.append(0.0)
            began_s = time.perf_counter()
            done = work(*given)
            elapsed_s = time.perf_counter() - began_s
            self.seconds[name] += elapsed_s - self.inside.pop()
            if self.inside:
                self.inside[-1] += elapsed_s
            return done

        return wrapped

    def measured(self, work: Callable[..., Any]) -> Callable[..., Any]:
        """Count the sections of a measurement, then time it."""

        def part(behind: Any, measured: Any, _stale: Any, _heights: Any, *others: Any) -> str:
            sections = others[3]
            if sections.labels.shape[1] == 1:
                return TRUTH_SECTION
            self.section_steps += int((sections.living & (measured | behind)[:, None]).sum())
            return SECTION_STEPS

        return self.timed(part, work)

    def watch(self) -> None:
        """Put clocks round the kernels and the truth's motion."""
        section_passes.step_all = self.measured(section_passes.step_all)
        for owner, names, part in (
            (section_passes, ("widest_all",), SECTION_STEPS),
            (section_passes, ("margins_all",), TRUTH_SECTION),
            (section_passes, ("make_room_all", "start_all"), REGRIDS),
            (information_set, ("refine_all",), REGRIDS),
            (section_passes, ("shift_all",), IMPULSES),
            (KeplerMotion, ("sight", "advance", "fire", "arrival_s"), TRUTH),
        ):
            for name in names:
                setattr(owner, name, self.timed(lambda *_, part=part: part, getattr(owner, name)))


def vertices(scenario: Scenario, together: int) -> tuple[float, float, int]:
    """Least and greatest mean number of vertices of a living section over the steps, and the greatest of any."""
    flight = Engagements(scenario, draw(scenario, range(together), 0), guarantee=False)
    means, greatest = [], 0
    while flight.flying:
        flight.advance()
        sections = flight._information._stack.sections
        marks = sections.marks[sections.living.ravel()]
        if len(marks):
            count = marks[:, 0, 1] - marks[:, 0, 0] + marks[:, 1, 1] - marks[:, 1, 0]
            means.append(float(count.mean()))
            greatest = max(greatest, int(count.max()))
    return min(means), max(means), greatest


def show(scenario: Scenario, together: int, clock: Clock) -> None:
    """Fly some rounds, and print the quickest."""
    best_s, parts, steps = float("inf"), dict[str, float](), 1
    for _ in range(ROUNDS):
        clock.seconds.clear()
        clock.section_steps = 0
        began_s = time.perf_counter()
        drawn = draw(scenario, range(together), 0)
        clock.seconds[DRAWS] = time.perf_counter() - began_s
        flight = Engagements(scenario, drawn, guarantee=False)
        while flight.flying:
            flight.advance()
        flight.results(np.arange(together))
        elapsed_s = time.perf_counter() - began_s
        if elapsed_s < best_s:
            best_s, parts, steps = elapsed_s, dict(clock.seconds), clock.section_steps
    parts[REST] = best_s - sum(parts.values())
    lines = [
        f"{together} engagements at once: {1e3 * best_s / together:.2f} ms each, {together / best_s:.0f} a second",
        *(
            f"  {1e3 * spent_s / together:6.2f} ms  {100.0 * spent_s / best_s:3.0f} %  {part}"
            for part, spent_s in sorted(parts.items(), key=lambda each: -each[1])
        ),
        f"  {1e9 * parts[SECTION_STEPS] / steps:.0f} ns a section-step, of which there are {steps / together:.0f}",
    ]
    sys.stdout.write("\n".join(lines) + "\n")


def main() -> None:
    """Print it for each size of batch."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--noise", choices=[kind.value for kind in NoiseKind], default=NoiseKind.RANDOM.value)
    parser.add_argument("--together", type=int, nargs="+", default=[50, 200])
    given = parser.parse_args()
    scenario = replace(load_scenario("asteroid-1997"), range_sensor=None, noise=NoiseKind(given.noise))
    least, most, greatest = vertices(scenario, max(given.together))
    sys.stdout.write(f"vertices of a section: {least:.0f} to {most:.0f} on average over a flight, {greatest} at most\n")
    clock = Clock()
    clock.watch()
    for together in given.together:
        show(scenario, together, clock)


if __name__ == "__main__":
    main()
