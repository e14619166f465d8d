"""infoset bound: what no strategy can guarantee, and how near strategies come to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.display_units import M_PER_KM
from experiments.common.options import Json, Out, Overwrite, Quiet, Seed, whole_number
from experiments.interception.options import ModelName, ScenarioName, Strategies

if TYPE_CHECKING:
    from pathlib import Path

    from guidance import Strategy
    from sim import Record, Results, Scenario
    from sim.bound import LowerBound, TruthPair
    from sim.pair import PairFlight

FIGURE = "figure-bound"
MOST_EVALUATIONS = 10_000_000


@dataclass(frozen=True)
class Found:
    """What was found for one strategy: its flights of the pairs, each with the pair, and what a search found."""

    name: str
    flights: tuple[tuple[TruthPair, PairFlight], ...]
    searched: Record | None = None

    @property
    def all_results(self) -> list[Results]:
        """Results of all the flights."""
        searched = [] if self.searched is None else [self.searched.result]
        return [*(flight.results for _, flight in self.flights), *searched]

    @property
    def worst(self) -> Results:
        """The flight with the greatest miss."""
        return max(self.all_results, key=lambda results: float(results.miss_m.max()))

    @property
    def worst_miss_m(self) -> float:
        """The greatest miss found, m."""
        return float(self.worst.miss_m.max())

    @property
    def worst_outcome(self) -> str:
        """How the engagement of the greatest miss ended."""
        return self.worst.outcomes[int(self.worst.miss_m.argmax())].value

    def guaranteed_m(self, scenario: Scenario) -> float | None:
        """Return the greatest guaranteed miss of all flights, m; None where the model guarantees nothing."""
        if not scenario.set_model.is_guaranteed:
            return None
        misses = [miss for results in self.all_results for miss in results.guaranteed_miss_m.tolist()]
        return None if None in misses else max(misses)


def bound(
    scenario: ScenarioName = "asteroid-1997",
    strategies: Strategies = None,
    model: ModelName = None,
    budget: Annotated[
        int, typer.Option("--budget", metavar="N", help="Engagements to search for the worst, a strategy; 0: none.")
    ] = 500,
    seed: Seed = 0,
    out: Out = None,
    json_: Json = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Find the miss that no strategy can guarantee to stay below, and fly what shows it.

    Two truths whose measurements can be the same until it is late get the same impulses until then; one of them must
    miss. The bound is the most that this shows; each strategy is flown against such pairs. Without --out or --json
    nothing is written.
    """
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_json
    from experiments.common.screen import figure_files, say_warnings, tell_of_compiling
    from experiments.interception.choices import chosen_strategies, scenario_with
    from experiments.interception.scenario_file import scenario_warnings

    whole_number("--budget", budget, 0, MOST_EVALUATIONS, 500)
    whole_number("--seed", seed, 0, None, 0)
    given = scenario_with(scenario, model=model)
    chosen = chosen_strategies(given, strategies)
    files = ("scenario.toml", "results.json", *figure_files(FIGURE))
    with checked_destinations(folder=out, names=files, files={"--json": json_}, overwrite=overwrite):
        warnings = scenario_warnings(given)
        say_warnings(warnings, quiet)
        tell_of_compiling(quiet)
        lower, found, elapsed_s = _find(given, chosen, budget, seed, quiet)
        json_text = to_json(_summary(given, lower, found, elapsed_s, warnings))
        deliver(json_, json_text, overwrite=overwrite)
        if out is not None:
            _fill(out, given, lower, json_text, overwrite)
    if not quiet:
        _show(given, lower, found, str(json_) == STDOUT)


def _find(
    scenario: Scenario, chosen: Mapping[str, Strategy | None], budget: int, seed: int, quiet: bool
) -> tuple[LowerBound, list[Found], float]:
    import contextlib
    import os
    from dataclasses import replace
    from time import perf_counter

    from experiments.common.errors import InputError
    from experiments.common.screen import need_finite, progress_bar
    from sim.adversary import NothingCountsError, find_worst
    from sim.bound import BoundError, lower_bound
    from sim.pair import fly_pair

    began_s = perf_counter()
    with progress_bar(quiet) as begin:
        try:
            lower = lower_bound(scenario, progress=begin("lower bound"))
        except BoundError as error:
            raise InputError(
                f"{scenario.name}: a linear program of the bound has no solution ({error}); check the units of the "
                "scenario with: infoset scenarios check FILE"
            ) from None
        found = []
        for name, own in chosen.items():
            report, flights = begin(name), []
            flown = scenario if own is not None else replace(scenario, strategy=name)
            for index, pair in enumerate(lower.pairs):
                flight = fly_pair(flown, pair, own)
                need_finite(flight.results)
                flights.append((pair, flight))
                report((index + 1) / len(lower.pairs))
            searched = None
            if budget > 0:
                with contextlib.suppress(NothingCountsError):
                    searched = find_worst(
                        flown,
                        strategy=own,
                        budget=budget,
                        seed=seed,
                        keep_set=not scenario.set_model.is_guaranteed,
                        threads=os.cpu_count() or 1,
                        progress=begin(f"worst against {name}"),
                    ).record(own)
            found.append(Found(name, tuple(flights), searched))
    return lower, found, perf_counter() - began_s


def _summary(
    scenario: Scenario, lower: LowerBound, found: Sequence[Found], elapsed_s: float, warnings: Sequence[str]
) -> dict[str, object]:
    from experiments.common.output import library_version
    from experiments.interception.scenario_file import scenario_hash

    return {
        "version": library_version(),
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        **({"warnings": list(warnings)} if warnings else {}),
        "model": scenario.set_model.kind.value,
        "elapsed_s": elapsed_s,
        "disturbance_m_s2": lower.disturbance_m_s2,
        "lower_bound_m": lower.bound_m,
        "reached_at": _where(lower.pair, scenario),
        "by_label": [
            {
                "label_m": each.label_m,
                "closing_speed_m_s": -each.vx_m_s,
                "last_common_step": each.last_common_step,
                "bound_m": each.bound_m,
            }
            for each in lower.by_label
        ],
        "strategies": [
            {
                "name": each.name,
                "worst_found_m": each.worst_miss_m,
                "guaranteed_m": each.guaranteed_m(scenario),
                "worst_over_bound": _worst_over_bound(each, lower),
                "outcome": each.worst_outcome,
                "worst_of_search_m": None if each.searched is None else float(each.searched.result.miss_m[0]),
                "flights": [
                    {
                        **_where(pair, scenario),
                        "bound_m": pair.bound_m,
                        "miss_m": flight.results.miss_m.tolist(),
                        "impulse_m_s": flight.results.impulse_m_s.tolist(),
                        "outcomes": [outcome.value for outcome in flight.results.outcomes],
                        "truth_kept": flight.results.truth_kept.tolist(),
                    }
                    for pair, flight in each.flights
                ],
            }
            for each in found
        ],
    }


def _worst_over_bound(found: Found, lower: LowerBound) -> float | None:
    """How many times the bound the worst is; None where the bound is zero."""
    return found.worst_miss_m / lower.bound_m if lower.bound_m > 0.0 else None


def _where(pair: TruthPair, scenario: Scenario) -> dict[str, object]:
    return {
        "label_m": pair.label_m,
        "closing_speed_m_s": -pair.vx_m_s,
        "last_common_step": pair.last_common_step,
        "alike_until_before_arrival_s": pair.arrival_s - pair.last_common_step * scenario.set_model.step_s,
    }


def _fill(folder: Path, scenario: Scenario, lower: LowerBound, json_text: str, overwrite: bool) -> None:
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures, write_file
    from experiments.interception.figures.bound import draw_bound
    from experiments.interception.scenario_file import scenario_to_toml

    write_file(folder / "scenario.toml", scenario_to_toml(scenario), overwrite=overwrite)
    write_file(folder / "results.json", json_text, overwrite=overwrite)
    figure = draw_bound(scenario, lower)
    with reporting_failures(folder):
        save_figure(figure, folder, FIGURE)


def _show(scenario: Scenario, lower: LowerBound, found: Sequence[Found], stdout_taken: bool) -> None:
    """Print the bound with where it is reached, and the strategies against it."""
    from rich.table import Table
    from rich.text import Text

    from experiments.common.screen import number, table_console
    from sim import Outcome

    reached = Table(box=None, pad_edge=False)
    for title in ("closing speed\nkm/s", "bound\nm", "at label\nkm", "alike until, s\nbefore arrival"):
        reached.add_column(title, justify="right")
    for pair in lower.pairs:
        alike_s = pair.arrival_s - pair.last_common_step * scenario.set_model.step_s
        row = (-pair.vx_m_s / M_PER_KM, pair.bound_m, pair.label_m / M_PER_KM, alike_s)
        reached.add_row(f"{row[0]:g}", number(row[1]), f"{row[2]:.1f}", f"{row[3]:.2f}")
    table = Table("strategy", box=None, pad_edge=False)
    for title in ("worst found\nm", "worst\n/ bound", "guaranteed\nthen, m"):
        table.add_column(title, justify="right")
    table.add_column("outcome")
    for each in found:
        table.add_row(
            each.name,
            number(each.worst_miss_m),
            number(_worst_over_bound(each, lower)),
            number(each.guaranteed_m(scenario)),
            each.worst_outcome,
        )
    console = table_console(stdout_taken)
    said = f"no strategy can guarantee a miss below {number(lower.bound_m)} m"
    console.print(Text(f"{scenario.name}, model {scenario.set_model.kind.value}: {said}"), soft_wrap=True)
    console.print(
        Text(f"whatever it does; the truth may accelerate along z by {lower.disturbance_m_s2:.3g} m/s^2"),
        soft_wrap=True,
    )
    console.print(reached)
    console.print()
    console.print(table)
    console.print(
        Text("worst found: by flying the pairs above, and by the search of: infoset adversary"), soft_wrap=True
    )
    if any(each.worst_outcome == Outcome.SET_LOST.value for each in found):
        said = "set-lost: some measurement left the model without a state"
        if not scenario.set_model.is_guaranteed:
            said += "; try --model guaranteed"
        console.print(Text(said), soft_wrap=True)
