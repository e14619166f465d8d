"""`infoset bound`: computation, files and tables."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter

from rich.console import Console
from rich.table import Table

from experiments.common.display_units import M_PER_KM
from experiments.common.errors import InputError
from experiments.common.output import output_of, to_json
from experiments.common.screen import (
    BeginProgress,
    figure_files,
    number,
    print_lines,
    progress_bar,
    say_warnings,
    table_console,
)
from experiments.interception.choices import chosen_strategies, scenario_with
from experiments.interception.commands.bound import Bound
from experiments.interception.figures.bound import draw_bound
from experiments.interception.runs.shared import need_finite, summary_head
from experiments.interception.scenario_file import scenario_to_toml, scenario_warnings
from guidance import Strategy
from sim import Outcome, Record, Results, Scenario
from sim.adversary import NothingCountsError, find_worst
from sim.bound import BoundError, LowerBound, TruthPair, lower_bound
from sim.pair import PairFlight, fly_pair

FIGURE = "figure-bound"


@dataclass(frozen=True)
class WorstOfStrategy:
    """Simulations of one strategy against the pairs of the bound, and the worst engagement of a search."""

    name: str
    flights: tuple[tuple[TruthPair, PairFlight], ...]
    searched: Record | None = None

    @property
    def all_results(self) -> list[Results]:
        """Results of all simulations."""
        searched = [] if self.searched is None else [self.searched.result]
        return [*(flight.results for _, flight in self.flights), *searched]

    @property
    def worst(self) -> Results:
        """Results with the greatest miss."""
        return max(self.all_results, key=lambda results: float(results.miss_m.max()))

    @property
    def miss_m(self) -> float:
        """Greatest miss, m."""
        return float(self.worst.miss_m.max())

    @property
    def outcome(self) -> Outcome:
        """Outcome of the engagement with the greatest miss."""
        return self.worst.outcomes[int(self.worst.miss_m.argmax())]

    def guaranteed_m(self, scenario: Scenario) -> float | None:
        """Return the greatest guaranteed miss of all simulations, m; None if the model has no guarantee."""
        if not scenario.set_model.is_guaranteed:
            return None
        misses = [miss for results in self.all_results for miss in results.guaranteed_miss_m.tolist()]
        return None if None in misses else max(misses)

    def over(self, lower: LowerBound) -> float | None:
        """Return the greatest miss divided by the bound; None if the bound is zero."""
        return self.miss_m / lower.bound_m if lower.bound_m > 0.0 else None


def run(options: Bound) -> None:
    """Compute the bound, simulate the strategies, write the files and print the tables."""
    scenario = scenario_with(options.scenario, model=options.model)
    strategies = chosen_strategies(scenario, options.strategies)
    with (
        output_of(options, ("scenario.toml", "results.json", *figure_files(FIGURE))) as written,
        progress_bar(options.quiet) as begin,
    ):
        say_warnings(scenario_warnings(scenario), options.quiet)
        began_s = perf_counter()
        try:
            lower = lower_bound(scenario, progress=begin("lower bound"))
        except BoundError as error:
            raise InputError(
                f"{scenario.name}: a linear program of the bound has no solution ({error}); check the units of the "
                "scenario with: infoset scenarios check FILE"
            ) from None
        worst = _simulate(scenario, lower, strategies, options, begin)
        summary = {
            **summary_head(scenario),
            "model": scenario.set_model.kind.value,
            "elapsed_s": perf_counter() - began_s,
            **_summary(scenario, lower, worst),
        }
        written.save("scenario.toml", scenario_to_toml(scenario))
        written.save("results.json", to_json(summary), "--json")
        if options.out is not None:
            written.figure(FIGURE, draw_bound(scenario, lower))
    if not options.quiet:
        _show(table_console(written.stdout_taken), scenario, lower, worst)


def _simulate(
    scenario: Scenario,
    lower: LowerBound,
    strategies: Mapping[str, Strategy | None],
    options: Bound,
    begin: BeginProgress,
) -> list[WorstOfStrategy]:
    worst = []
    for name, own in strategies.items():
        report, flights = begin(name), []
        flown = scenario if own is not None else replace(scenario, strategy=name)
        for i, pair in enumerate(lower.pairs):
            flight = fly_pair(flown, pair, own)
            need_finite(flight.results)
            flights.append((pair, flight))
            report((i + 1) / len(lower.pairs))
        searched = None
        if options.budget > 0:
            with contextlib.suppress(NothingCountsError):
                searched = find_worst(
                    flown,
                    strategy=own,
                    budget=options.budget,
                    seed=options.seed,
                    keep_set=not scenario.set_model.is_guaranteed,
                    threads=os.cpu_count() or 1,
                    progress=begin(f"worst against {name}"),
                ).record(own)
        worst.append(WorstOfStrategy(name, tuple(flights), searched))
    return worst


def _summary(scenario: Scenario, lower: LowerBound, worst: Sequence[WorstOfStrategy]) -> dict[str, object]:
    return {
        "disturbance_m_s2": lower.disturbance_m_s2,
        "lower_bound_m": lower.bound_m,
        "reached_at": _where(lower.pair, scenario),
        "by_label": [
            {
                "label_m": label.label_m,
                "closing_speed_m_s": -label.vx_m_s,
                "last_common_step": label.last_common_step,
                "bound_m": label.bound_m,
            }
            for label in lower.by_label
        ],
        "strategies": [
            {
                "name": strategy.name,
                "worst_found_m": strategy.miss_m,
                "guaranteed_m": strategy.guaranteed_m(scenario),
                "worst_over_bound": strategy.over(lower),
                "outcome": strategy.outcome.value,
                "worst_of_search_m": None if strategy.searched is None else float(strategy.searched.result.miss_m[0]),
                "flights": [
                    {
                        **_where(pair, scenario),
                        "bound_m": pair.bound_m,
                        "miss_m": flight.results.miss_m.tolist(),
                        "impulse_m_s": flight.results.impulse_m_s.tolist(),
                        "outcomes": [outcome.value for outcome in flight.results.outcomes],
                        "truth_kept": flight.results.truth_kept.tolist(),
                    }
                    for pair, flight in strategy.flights
                ],
            }
            for strategy in worst
        ],
    }


def _where(pair: TruthPair, scenario: Scenario) -> dict[str, object]:
    return {
        "label_m": pair.label_m,
        "closing_speed_m_s": -pair.vx_m_s,
        "last_common_step": pair.last_common_step,
        "alike_until_before_arrival_s": _equal_until_s(pair, scenario),
    }


def _equal_until_s(pair: TruthPair, scenario: Scenario) -> float:
    """Return the time from the last equal measurement to arrival, s."""
    return pair.arrival_s - pair.last_common_step * scenario.set_model.step_s


def _show(console: Console, scenario: Scenario, lower: LowerBound, worst: Sequence[WorstOfStrategy]) -> None:
    bounds = Table(box=None, pad_edge=False)
    for title in (
        "closing speed\nkm/s",
        "bound\nm",
        "range at t = 0\nkm",
        "equal measurements until\ns before arrival",
    ):
        bounds.add_column(title, justify="right")
    for pair in lower.pairs:
        bounds.add_row(
            f"{-pair.vx_m_s / M_PER_KM:g}",
            number(pair.bound_m),
            f"{pair.label_m / M_PER_KM:.1f}",
            f"{_equal_until_s(pair, scenario):.2f}",
        )
    strategies = Table("strategy", box=None, pad_edge=False)
    for title in ("worst miss\nm", "worst miss\n/ bound", "guaranteed\nmiss, m"):
        strategies.add_column(title, justify="right")
    strategies.add_column("outcome")
    for strategy in worst:
        values = (strategy.miss_m, strategy.over(lower), strategy.guaranteed_m(scenario))
        strategies.add_row(strategy.name, *(number(value) for value in values), strategy.outcome.value)
    print_lines(
        console,
        [
            f"{scenario.name}, model {scenario.set_model.kind.value}: no strategy can guarantee a miss below "
            f"{number(lower.bound_m)} m",
            f"acceleration of the object along z in these pairs: at most {lower.disturbance_m_s2:.3g} m/s^2",
        ],
    )
    console.print(bounds, "", strategies, sep="\n")
    notes = ["worst miss: the greatest miss in simulations of these pairs and in a search (see: infoset adversary)"]
    if any(strategy.outcome is Outcome.SET_LOST for strategy in worst):
        hint = "" if scenario.set_model.is_guaranteed else "; try --model guaranteed"
        notes.append(f"set-lost: a measurement contradicted all states of the set{hint}")
    print_lines(console, notes)
