"""`infoset bound`: computation, files and tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from experiments.common.display_units import M_PER_KM
from experiments.common.errors import InputError
from experiments.common.input_file import to_toml
from experiments.common.output import output_of, to_json
from experiments.common.screen import (
    BeginProgress,
    Part,
    figure_files,
    number,
    number_table,
    progress_bar,
    say_warnings,
    show,
)
from experiments.interception.command import Bound
from experiments.interception.runs.game_value import GameValue, WorstOfStrategy, value_of
from experiments.interception.runs.shared import Progress, WorstMisses, find_worst_misses, need_finite, summary_head
from experiments.interception.scenario_file import scenario_warnings, study_scenario
from experiments.interception.strategies import chosen_strategies
from guidance import Strategy
from sim import BoundError, Scenario
from sim.bound import LowerBound, lower_bound, pair_at
from sim.pair import fly_pair
from sim.truth_pair import TruthPair

FIGURE = "figure-bound"


def run(options: Bound) -> None:
    """Compute the bound, simulate the strategies, write the files and print the tables."""
    scenario, notes = study_scenario(options)
    strategies = chosen_strategies(scenario, options.strategies)
    names = ("scenario.toml", "results.json", *figure_files(FIGURE))
    with output_of(options, names) as written, progress_bar(options.quiet) as begin:
        warnings = scenario_warnings(scenario)
        say_warnings(warnings, options.quiet, notes)
        began_s = perf_counter()
        try:
            lower = lower_bound(scenario, progress=begin("lower bound"))
            nominal = _nominal(scenario)
        except BoundError as error:
            raise InputError(
                f"{scenario.name}: a linear program of the bound has no solution ({error}); check the units of the "
                "scenario with: infoset scenarios check FILE"
            ) from None
        worst = _simulate(scenario, lower, strategies, options, begin)
        value = value_of(scenario, lower, worst)
        summary = {
            **summary_head(scenario, warnings),
            "model": scenario.information_set.model.value,
            "elapsed_s": perf_counter() - began_s,
            **_summary(scenario, lower, nominal, worst),
            "value": value.summary(),
        }
        written.save("scenario.toml", to_toml(scenario))
        written.save("results.json", to_json(summary), "--json")
        if options.out is not None:
            from experiments.interception.figures.bound import draw_bound

            written.figure(FIGURE, draw_bound(scenario, lower, {strategy.name: strategy.worst_m for strategy in worst}))
    show(_parts(scenario, lower, nominal, worst, value, options), options.quiet, stdout_taken=written.stdout_taken)


def _simulate(
    scenario: Scenario,
    lower: LowerBound,
    strategies: Mapping[str, Strategy | None],
    options: Bound,
    begin: BeginProgress,
) -> list[WorstOfStrategy]:
    worst = []
    report = begin("strategies")
    for index, (name, own) in enumerate(strategies.items()):
        flown = scenario if own is not None else replace(scenario, strategy=name)
        flights = [(pair, fly_pair(flown, pair, own)) for pair in lower.pairs]
        for _, flight in flights:
            need_finite(flight.results)
        searched = WorstMisses(None, None)
        if options.budget > 0:
            part = _part_of(report, index, len(strategies))
            searched = find_worst_misses(flown, own, budget=options.budget, seed=options.seed, begin=part)
        report((index + 1) / len(strategies))
        records = tuple(engagement.record(own) for engagement in searched.engagements)
        worst.append(WorstOfStrategy(name, tuple(flights), searched, records))
    return worst


def _part_of(report: Progress, index: int, parts: int) -> BeginProgress:
    """Return the progress of one of several equal parts."""
    return lambda _name: lambda done: report((index + done) / parts)


def _nominal(scenario: Scenario) -> TruthPair:
    """Return the best pair at the nominal range and closing speed, or at the possible ones nearest to them."""
    box = scenario.set_model.bounds
    nominal = ((box.x_m, scenario.nominal_range_m), (box.vx_m_s, -scenario.set_model.closing_speed_m_s))
    label_m, vx_m_s = (min(max(value, minimum), maximum) for (minimum, maximum), value in nominal)
    return pair_at(scenario, label_m, vx_m_s)


def _summary(
    scenario: Scenario, lower: LowerBound, nominal: TruthPair, worst: Sequence[WorstOfStrategy]
) -> dict[str, object]:
    model = scenario.set_model
    spatial: dict[str, object] = {}
    if scenario.is_spatial:
        spatial["disturbance_y_m_s2"] = model.axis("y").disturbance_m_s2
    return {
        "disturbance_m_s2": lower.disturbance_m_s2,
        **spatial,
        "lower_bound_m": lower.bound_m,
        "reached_at": _where(lower.pair, scenario),
        "at_nominal_range": {**_where(nominal, scenario), "bound_m": nominal.bound_m},
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
                "worst_found_m": strategy.worst_m,
                "worst_found_set_kept_m": strategy.set_kept_m,
                "guaranteed_m": strategy.guaranteed_m,
                "worst_over_bound": strategy.over(lower),
                "outcome": strategy.results.outcomes[int(strategy.results.miss_m.argmax())].value,
                "worst_of_pairs_m": strategy.pairs_m,
                **strategy.searched.misses(),
                "flights": [
                    {
                        **_where(pair, scenario),
                        "bound_m": pair.bound_m,
                        "miss_m": flight.results.miss_m.tolist(),
                        **_by_axis("miss", flight.results.lateral_miss.T, scenario),
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
        "motions": 1 if pair.is_single else 2,
        "last_common_step": pair.last_common_step,
        "alike_until_before_arrival_s": _equal_until_s(pair, scenario),
        **_by_axis("apart", np.abs(pair.difference_m[:, -1]), scenario),
    }


def _by_axis(quantity: str, values_m: NDArray[np.float64], scenario: Scenario) -> dict[str, object]:
    """Return values by axis, m, with the names of their keys; nothing in a plane."""
    if not scenario.is_spatial:
        return {}
    return {
        f"{quantity}_{axis}_m": value for axis, value in zip(scenario.set_model.axes, values_m.tolist(), strict=True)
    }


def _equal_until_s(pair: TruthPair, scenario: Scenario) -> float:
    """Return the time from the last equal measurement to arrival, s."""
    return pair.arrival_s - pair.last_common_step * scenario.set_model.step_s


def _parts(
    scenario: Scenario,
    lower: LowerBound,
    nominal: TruthPair,
    worst: Sequence[WorstOfStrategy],
    value: GameValue,
    options: Bound,
) -> Iterator[Part]:
    titles = ("closing speed\nkm/s", "bound\nm", "range at t = 0\nkm", "equal measurements until\ns before arrival")
    bounds = number_table(*titles)
    for pair in lower.pairs:
        bounds.add_row(
            f"{-pair.vx_m_s / M_PER_KM:g}",
            number(pair.bound_m),
            f"{pair.label_m / M_PER_KM:.1f}",
            "one motion" if pair.is_single else f"{_equal_until_s(pair, scenario):.2f}",
        )
    heads = ("pairs\n\nm", "set never\nempty\nm", "also\nempty\nm", "miss /\nbound\n", "guaranteed\n\nm")
    strategies = number_table("strategy", *heads)
    for strategy in worst:
        searched = strategy.searched.misses().values()
        values = (strategy.pairs_m, *searched, strategy.over(lower), strategy.guaranteed_m)
        strategies.add_row(strategy.name, *(number(value) for value in values))
    model = scenario.information_set.model.value
    yield f"{scenario.name}, model {model}: no strategy can guarantee a miss below {number(lower.bound_m)} m"
    yield (
        f"at the range {nominal.label_m / M_PER_KM:.1f} km and closing speed {-nominal.vx_m_s / M_PER_KM:g} km/s, the "
        f"nominal ones: {number(nominal.bound_m)} m"
    )
    for axis in scenario.set_model.axes:
        maximum = scenario.set_model.axis(axis).disturbance_m_s2
        yield f"acceleration of the object along {axis} in these pairs: at most {maximum:.3g} m/s^2"
    yield from (bounds, "", strategies, "")
    yield from value.lines()
    if any(pair.is_single for pair in lower.pairs):
        yield "one motion: a start that all impulses together do not bring nearer, whatever is measured"
    yield "pairs: maximum miss of the states that prove the bound"
    searched_by = (
        f"`infoset adversary` with --objective fixed-truth --model {model} --budget {options.budget} --seed "
        f"{options.seed}"
    )
    found = f"maximum misses found by {searched_by}" if options.budget else "not searched"
    yield f"set never empty, also empty: {found}"
    yield "miss / bound: maximum miss of pairs and search, without sets that became empty, divided by the bound"
    yield "guaranteed: maximum bound Phi on the miss, computed during these engagements"
    if any(strategy.results.set_emptied.any() for strategy in worst):
        hint = "" if scenario.set_model.is_guaranteed else "; try --model guaranteed"
        yield f"in some engagements a measurement contradicted all states of the set, which became empty{hint}"
