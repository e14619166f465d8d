"""Search for flights with a great Phi, and compare Phi with the maximum miss of exact sections over
the same labels.

    python -m benchmarks.great_phi
    python -m benchmarks.great_phi --budget 400 --rate-error 1e-6

The first line searches without and with the range sensor, 2000 engagements each.

The search is that of `infoset adversary`, with Phi in place of the miss. For the flights with the
maximum Phi, the section of 200 labels among those that leave in each step is computed at that step,
and the impulses of the flight act on it until its range is zero. The maximum miss of these states,
(10) in docs/guarantee-miss.md for 200 labels a step, is less than the supremum over all labels,
which Phi bounds.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from infoset import InformationSet, InitialSet, Model, RateSensor
from infoset.engine.section_law import section_laws
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import make_strategy
from infoset.sim import Results, Scenario
from infoset.sim.adversary import Objective, _AdversarySearch
from infoset.sim.engagement import Engagements, Step
from infoset.sim.gravity import on_board_model
from infoset.sim.scenario import of_model

Floats = NDArray[np.float64]
LABELS = 200
SHOWN = 6


class PhiSearch(_AdversarySearch):
    """The search of `infoset adversary` with Phi in place of the miss."""

    guarantee = True

    def value_m(self, flight: Engagements, results: Results) -> Floats:
        """Return Phi, m."""
        return results.guaranteed_miss_m.filled(-np.inf)


class Watched:
    """Sets of a flight in the steps in which labels leave, and its impulses."""

    def __init__(self) -> None:
        self.sets: list[tuple[int, InformationSet]] = []
        self.impulses_m_s: list[float] = []

    def observe(self, step: Step) -> None:
        """Keep the set if labels leave after this step, and the impulse."""
        information = step.information.copy()
        self.impulses_m_s.append(float(step.impulse_m_s[0, 0]) if step.flying[0] else 0.0)
        if (
            information._state.lower_label[0] < information._state.min_label_next
            and information._state.computes_phi[0]
        ):
            self.sets.append((step.step, information))

    def max_miss_m(self, scenario: Scenario) -> float:
        """Return the maximum miss of the states of `LABELS` sections a step, by (10)."""
        model = on_board_model(scenario)
        (law,) = section_laws(model)
        maximum = 0.0
        for step, information in self.sets:
            state = information._state
            nearest = state.lower_label[0]
            farthest = min(state.upper_label[0], information._state.min_label_next)
            for label in feasible_labels(information, nearest, farthest):
                vertices = information.section_at(label).polygons[0].polygon()
                if not len(vertices):
                    continue
                tau = label / law.closing_speed - step * law.step
                misses = vertices[:, 1] + vertices[:, 0] * tau
                minimum = misses.min()
                most = misses.max()
                for later, impulse in enumerate(self.impulses_m_s[step:]):
                    left_s = max(tau - later * law.step, 0.0)
                    doubt = abs(impulse) * law.impulse_error
                    minimum = minimum - (impulse + doubt) * left_s
                    most = most - (impulse - doubt) * left_s
                drift = 0.5 * law.disturbance * tau**2
                maximum = max(maximum, most + drift, drift - minimum)
        return maximum * (1.0 + model.speed_error)


def feasible_labels(information: InformationSet, nearest: float, farthest: float) -> Floats:
    """Return `LABELS` labels between the ends of the feasible ones, whose ends are bisected from as
    many labels.
    """

    def is_feasible(label: float) -> bool:
        return len(information.section_at(label).polygons[0].polygon()) > 0

    coarse = np.linspace(nearest, farthest, LABELS)
    feasible = np.flatnonzero([is_feasible(label) for label in coarse])
    if not len(feasible):
        return np.empty(0)
    ends = []
    for last, infeasible in ((feasible[0], feasible[0] - 1), (feasible[-1], feasible[-1] + 1)):
        inside = coarse[last]
        outside = coarse[min(max(infeasible, 0), len(coarse) - 1)]
        for _ in range(40):
            middle = 0.5 * (inside + outside)
            inside, outside = (middle, outside) if is_feasible(middle) else (inside, middle)
        ends.append(inside)
    return np.linspace(ends[0], ends[1], LABELS)


def great_flights(
    scenario: Scenario, budget: int, seed: int, shown: int
) -> Iterator[tuple[float, float, float]]:
    """Search, and yield Phi, the maximum miss of the exact sections and the miss of the best
    flights, m.
    """
    search = PhiSearch(
        scenario, make_strategy(scenario.strategy), Objective.FIXED_TRUTH, seed, keep_set=True
    )
    with ThreadPoolExecutor(1) as pool:
        search.run(budget, pool, None)
    assert search.elite is not None
    for index in range(min(shown, len(search.elite))):
        flight = search.engagements(search.elite.take(slice(index, index + 1)))
        watched = Watched()
        while flight.flying:
            flight.advance(watched.observe)
        results = flight.results(np.arange(1))
        yield (
            float(results.guaranteed_miss_m[0]),
            watched.max_miss_m(search.scenario),
            float(results.miss_m[0]),
        )


def guaranteed(scenario: Scenario, strategy: str) -> Scenario:
    """Return the scenario with the guaranteed model and a strategy."""
    model = replace(scenario.set_model, model=Model.GUARANTEED, initial_set=InitialSet.BOX)
    return replace(scenario, **of_model(model, scenario), strategy=strategy)


def main() -> None:
    """Search with and without the range sensor."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenario", default="asteroid-1997")
    parser.add_argument("--budget", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--strategy", default="least-effort")
    parser.add_argument("--rate-error", type=float, help="add a rate sensor with this error, rad/s")
    options = parser.parse_args()
    scenario = guaranteed(load_scenario(options.scenario), options.strategy)
    if options.rate_error is not None:
        scenario = replace(
            scenario, rate_sensor=RateSensor(scenario.set_model.step_s, options.rate_error)
        )
    for sensor in (None, scenario.range_sensor):
        sys.stdout.write(
            f"{options.strategy}, {'without' if sensor is None else 'with'} the range sensor\n"
        )
        measured = replace(scenario, range_sensor=sensor)
        for phi_m, exact_m, miss_m in great_flights(measured, options.budget, options.seed, SHOWN):
            sys.stdout.write(
                f"Phi {phi_m:.3f} m, exact sections {exact_m:.3f} m, ratio {phi_m / exact_m:.4f}, "
                f"miss {miss_m:.3f} m\n"
            )
            sys.stdout.flush()


if __name__ == "__main__":
    main()
