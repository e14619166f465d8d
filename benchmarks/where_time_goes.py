"""Print the time of an engagement by part and per section-step, and the number of vertices of the
sections.

    python benchmarks/where_time_goes.py
    python benchmarks/where_time_goes.py --noise game --together 400

The first line has random noise, and 50 and 200 engagements at once.

Kernels and methods are wrapped in timers. The time of a part does not include other parts that it
calls. The output is that of the fastest round. The timers take a few per cent, which are counted as
time of the interpreter.
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

from infoset.engine import replays, section_passes, set_state
from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import Scenario
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.kepler import KeplerMotion

ROUNDS = 8
SECTION_STEPS = "prediction, cut and summary of the sections"
REGRIDS = "new grids of sections, and their ends"
IMPULSES = "impulses of the sections"
TRUTH_SECTION = "section and margin of the true state"
TRUTH = "true motion"
DRAWS = "random numbers"
REST = "interpreter, NumPy and other code"


@dataclass
class Clock:
    """Seconds by part, and number of section-steps, of one flight."""

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    section_steps: int = 0
    inside: list[float] = field(default_factory=list)

    def timed(self, part: Callable[..., str], work: Callable[..., Any]) -> Callable[..., Any]:
        """Return the function `work` with a timer; the time of timed functions that it calls is not
        included.
        """

        def wrapped(*arguments: Any) -> Any:
            name = part(*arguments)
            self.inside.append(0.0)
            began_s = time.perf_counter()
            result = work(*arguments)
            elapsed_s = time.perf_counter() - began_s
            self.seconds[name] += elapsed_s - self.inside.pop()
            if self.inside:
                self.inside[-1] += elapsed_s
            return result

        return wrapped

    def measured(self, work: Callable[..., Any]) -> Callable[..., Any]:
        """Return the kernel of a measurement with a timer and a count of its sections."""

        def part(measured: Any, *others: Any) -> str:
            sections = others[-2]
            self.section_steps += int(
                (sections.slots["feasible"] & (measured | sections.behind)[:, None]).sum()
            )
            return SECTION_STEPS

        return self.timed(part, work)

    def watch(self) -> None:
        """Add timers to the kernels and to the true motion."""
        section_passes.step_all = self.measured(section_passes.step_all)
        for owner, names, part in (
            (
                section_passes,
                ("widest_all", "extreme_angles_all", "keep_labels_all"),
                SECTION_STEPS,
            ),
            (replays, ("margins_all",), TRUTH_SECTION),
            (section_passes, ("make_room_all", "start_all"), REGRIDS),
            (set_state, ("refine_all",), REGRIDS),
            (section_passes, ("shift_all",), IMPULSES),
            (KeplerMotion, ("sight", "advance", "fire", "arrival_s"), TRUTH),
        ):
            for name in names:
                setattr(owner, name, self.timed(lambda *_, part=part: part, getattr(owner, name)))


def vertices(scenario: Scenario, together: int) -> tuple[float, float, int]:
    """Return the minimum and maximum mean number of vertices of the sections over the steps, and
    the maximum number.
    """
    flight = Engagements(scenario, draw(scenario, range(together), 0), guarantee=False)
    means = []
    maximum = 0
    while flight.flying:
        flight.advance()
        sections = flight._information._state.sections
        records = sections.chains.records.reshape(-1, 2)[sections.slots["feasible"].ravel()]
        if len(records):
            count = (records["end"] - records["begin"]).sum(axis=1)
            means.append(float(count.mean()))
            maximum = max(maximum, int(count.max()))
    return min(means), max(means), maximum


def show(scenario: Scenario, together: int, clock: Clock) -> None:
    """Simulate several rounds and print the times of the fastest."""
    best_s = float("inf")
    parts = dict[str, float]()
    steps = 1
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
            best_s = elapsed_s
            parts = dict(clock.seconds)
            steps = clock.section_steps
    parts[REST] = best_s - sum(parts.values())
    lines = [
        (
            f"{together} engagements at once: {1e3 * best_s / together:.2f} ms each, "
            f"{together / best_s:.0f} per second"
        ),
        *(
            f"  {1e3 * spent_s / together:6.2f} ms  {100.0 * spent_s / best_s:3.0f} %  {part}"
            for part, spent_s in sorted(parts.items(), key=lambda item: -item[1])
        ),
        (
            f"  {1e9 * parts[SECTION_STEPS] / steps:.0f} ns per section-step, "
            f"{steps / together:.0f} steps per engagement"
        ),
    ]
    sys.stdout.write("\n".join(lines) + "\n")


def main() -> None:
    """Print the times for each size of batch."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--noise", choices=[kind.value for kind in NoiseKind], default=NoiseKind.RANDOM.value
    )
    parser.add_argument("--together", type=int, nargs="+", default=[50, 200])
    options = parser.parse_args()
    scenario = replace(
        load_scenario("asteroid-1997"), range_sensor=None, noise=NoiseKind(options.noise)
    )
    minimum, most, maximum = vertices(scenario, max(options.together))
    sys.stdout.write(
        f"vertices of a section: {minimum:.0f} to {most:.0f} on average over a flight, {maximum} "
        "at most\n"
    )
    clock = Clock()
    clock.watch()
    for together in options.together:
        show(scenario, together, clock)


if __name__ == "__main__":
    main()
