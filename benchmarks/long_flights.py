"""Cost of long flights: time, vertices, sections and memory against the number of steps; table of
docs/measured/performance.md.

    python -m benchmarks.long_flights
    python -m benchmarks.long_flights --strategies symmetric-miss,patient,kalman
    python -m benchmarks.long_flights --rate-error 1e-7

The flight is `dart-2022`, 4 h, with steps of 144, 14.4 and 1.44 s, one image at every step, and an
engine of the same acceleration. Times are processor times of one thread, with the guaranteed miss,
of one engagement in a batch of 40.
"""

from __future__ import annotations

import argparse
import sys
import time
import tracemalloc
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from infoset import RateSensor
from infoset.experiments import load_scenario
from infoset.sim import Scenario, simulate
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.scenario import of_model

STEPS = (100, 1000, 10_000)
ACCELERATION_M_S2 = 0.006
BATCH, SMALL_BATCH = 40, 4


@dataclass(frozen=True)
class Cost:
    """Cost of flights with some number of steps.

    Parameters
    ----------
    step_us, arrival_ms : float
        Processor time of a step of an engagement, microseconds, up to the first label that leaves;
        and of all that follows, and of the margins of the true state, milliseconds.
    mean_vertices, max_vertices : float
        Vertices of a section along one axis, mean over the flight and maximum.
    max_sections : int
        Maximum number of sections of an engagement.
    memory_mb : float
        Memory of an engagement, megabytes: maximum traced memory of a batch, divided by its size.
    miss_m, guaranteed_miss_m : float
        Medians.
    sound : bool
        Whether the set contained the true state in all runs, and no miss exceeded the guaranteed
        miss.
    """

    step_us: float
    arrival_ms: float
    mean_vertices: float
    max_vertices: int
    max_sections: int
    memory_mb: float
    miss_m: float
    guaranteed_miss_m: float
    sound: bool


def of_steps(scenario: Scenario, steps: int) -> Scenario:
    """Return the scenario with another number of steps. A rate sensor measures at each of them."""
    step_s = scenario.nominal_arrival_s / steps
    rate_sensor = scenario.rate_sensor and replace(scenario.rate_sensor, period_s=step_s)
    sensor = replace(scenario.set_model.angle_sensor, period_s=step_s)
    return replace(
        scenario,
        rate_sensor=rate_sensor,
        **of_model(replace(scenario.set_model, step_s=step_s, angle_sensor=sensor)),
        thruster=replace(scenario.thruster, max_impulse_m_s=ACCELERATION_M_S2 * step_s),
    )


def vertices(flight: Engagements) -> NDArray[np.int64]:
    """Return the numbers of vertices of all feasible sections."""
    state = flight._information._state
    records = state.sections.chains.records.reshape(-1, 2)
    feasible = np.tile(state.feasible.ravel(), len(state.laws))
    counts = (records["end"] - records["begin"])[: feasible.size]
    return np.asarray(counts.sum(axis=1)[feasible])


def cost(scenario: Scenario, steps: int) -> Cost:
    """Simulate a batch and measure its cost."""
    longer = of_steps(scenario, steps)
    simulate(longer, 1 if steps > STEPS[0] else 2)
    flight = Engagements(longer, draw(longer, range(BATCH), 1))
    most_vertices = 0
    most_sections = 0
    means = []
    spent_s = 0.0
    steps_before_arrival = 0
    while flight.flying:
        began_s = time.process_time()
        flight.advance()
        elapsed_s = time.process_time() - began_s
        if flight._information._state.some_left.any():
            break
        spent_s += elapsed_s
        steps_before_arrival = flight.step
        if flight.step % (steps // 50) == 0:
            counts = vertices(flight)
            means.append(counts.mean())
            most_vertices = max(most_vertices, int(counts.max()))
            most_sections = max(most_sections, int(flight._information.section_counts.max()))

    # The step in which the first label leaves belongs to the arrival.
    began_s = time.process_time() - elapsed_s
    while flight.flying:
        flight.advance()
    results = flight.results(np.arange(BATCH))
    arrival_s = time.process_time() - began_s

    tracemalloc.start()
    simulate(longer, SMALL_BATCH)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    return Cost(
        step_us=1e6 * spent_s / (BATCH * steps_before_arrival),
        arrival_ms=1e3 * arrival_s / BATCH,
        mean_vertices=float(np.mean(means)),
        max_vertices=most_vertices,
        max_sections=most_sections,
        memory_mb=peak / SMALL_BATCH / 1e6,
        miss_m=float(np.median(results.miss_m)),
        guaranteed_miss_m=float(np.median(results.guaranteed_miss_m.compressed())),
        sound=bool(results.truth_kept.all() and results.phi_held.filled(False).all()),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--strategies", default="symmetric-miss")
    parser.add_argument("--scenario", default="dart-2022")
    parser.add_argument(
        "--rate-error", type=float, help="error of a rate sensor, rad/s; without one if absent"
    )
    options = parser.parse_args()
    sys.stdout.write(
        "| strategy | steps | a step, us | arrival, ms | whole flight, us a step | vertices, "
        "mean / most | sections | memory, MB | miss, m | guaranteed miss, m | sound |\n"
        + "|---" * 11
        + "|\n"
    )
    for strategy in options.strategies.split(","):
        scenario = replace(load_scenario(options.scenario), strategy=strategy)
        if options.rate_error is not None:
            scenario = replace(
                scenario, rate_sensor=RateSensor(scenario.set_model.step_s, options.rate_error)
            )
        for steps in STEPS:
            of = cost(scenario, steps)
            whole = of.step_us + 1e3 * of.arrival_ms / steps
            sys.stdout.write(
                f"| {strategy} | {steps} | {of.step_us:.1f} | {of.arrival_ms:.1f} | {whole:.1f} | "
                f"{of.mean_vertices:.0f} / {of.max_vertices} | {of.max_sections} | "
                f"{of.memory_mb:.1f} | {of.miss_m:.1f} | {of.guaranteed_miss_m:.1f} | "
                f"{'yes' if of.sound else 'no'} |\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
