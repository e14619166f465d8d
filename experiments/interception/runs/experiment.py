"""`infoset experiment`: simulation, files and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter

from rich.table import Table

from experiments.common.input_file import to_toml
from experiments.common.output import hit_key, outcome_columns, output_of, to_csv, to_json
from experiments.common.screen import (
    Part,
    figure_files,
    number,
    number_table,
    progress_bar,
    quantile_notes,
    say,
    say_warnings,
    show,
    some_runs,
)
from experiments.interception.command import Experiment
from experiments.interception.course import Courses
from experiments.interception.curves import Curve, curve_scenarios
from experiments.interception.published import MANY, SINGLE, printed_single_runs
from experiments.interception.runs.shared import (
    THEOREM_8_NAME,
    allowance,
    b_plane_figures,
    bound_name,
    certificate,
    simulate_all,
    summary_head,
)
from experiments.interception.scenario_file import scenario_warnings, scenario_with
from experiments.interception.strategies import own_strategy
from experiments.interception.study import QUANTILES, SetCounts, game_note, hit_text, set_counts, set_warnings
from infoset import Recovery
from sim import Outcome, Results, Scenario
from sim.parallel import Task
from sim.statistics import shown_quantiles

FIGURE = "figure-4-distributions"
CORRIDOR = "figure-corridor"


def run(options: Experiment) -> None:
    """Simulate the curves, write the files and print the table."""
    scenario = scenario_with(options)
    own = own_strategy(options.strategy, scenario)
    figures = [FIGURE, CORRIDOR, *b_plane_figures(scenario)]
    names = ("scenario.toml", "results.json", "results.csv", *figure_files(*figures))
    with output_of(options, names) as written, progress_bar(options.quiet) as begin:
        warnings = scenario_warnings(scenario)
        say_warnings(warnings, options.quiet)
        if scenario.range_sensor is None:
            say(f"{scenario.name} has no [range_sensor]: curves 1 and 3 only", options.quiet)
        began_s = perf_counter()
        slowest_first = [
            (curve, flown, f"curve {curve}: {flown.noise.value}{' + range sensor' if flown.range_sensor else ''}")
            for curve, flown in reversed(curve_scenarios(scenario))
        ]
        courses = [Courses(flown, options.runs) for _, flown, _ in slowest_first] if options.out is not None else []
        tasks = [
            Task(flown, range(options.runs), options.seed, strategy=own, progress=begin(title))
            for _, flown, title in slowest_first
        ]
        if courses:
            tasks = [replace(task, observe=course.observe) for task, course in zip(tasks, courses, strict=True)]
        results = simulate_all(tasks)
        elapsed_s = perf_counter() - began_s
        curves = [
            Curve(curve, flown.noise, flown.range_sensor is not None, result)
            for (curve, flown, _), result in zip(slowest_first, results, strict=True)
        ][::-1]
        summary = {
            **summary_head(scenario, warnings, own),
            "seed": options.seed,
            "runs": options.runs,
            "elapsed_s": elapsed_s,
            "curves": [
                {
                    **_key(curve),
                    **hit_key(curve.results.hits),
                    **burns_key(scenario, curve.results),
                    **outcome_columns(curve.results),
                }
                for curve in curves
            ],
            "notes": [game_note(scenario)],
        }
        written.save("scenario.toml", to_toml(scenario))
        written.save("results.json", to_json(summary), "--json")
        if written.wants("--csv"):
            written.save("results.csv", _csv(curves), "--csv")
        if options.out is not None:
            from experiments.interception.figures.commands import draw_experiment

            written.draw(figures, draw_experiment(scenario, curves, courses[::-1]), begin("figure"))
    show(_parts(scenario, curves), options.quiet, stdout_taken=written.stdout_taken)


def _key(curve: Curve) -> dict[str, int | str | bool]:
    return {"published_curve": curve.number, "noise": curve.noise.value, "range_sensor": curve.range_sensor}


def _csv(curves: Sequence[Curve]) -> str:
    columns = [curve.results.to_dict() for curve in curves]
    rows = [
        [*_key(curve).values(), *values]
        for curve, by_name in zip(curves, columns, strict=True)
        for values in zip(*by_name.values(), strict=True)
    ]
    return to_csv((*_key(curves[0]), *columns[0]), rows)


def _parts(scenario: Scenario, curves: Sequence[Curve]) -> list[Part]:
    table, levels = number_table("curve", "quantity", *QUANTILES, left=2), [*QUANTILES.values()]
    enlarged = scenario.set_model.recovery is Recovery.WIDENED
    endings = {
        Outcome.BUDGET_SPENT: "too little of the impulse budget was left",
        Outcome.DIVERGED: "the closest approach was farther than the nominal range",
    }
    notes = []
    for curve in curves:
        results = curve.results
        bounds, of_theorem_8 = results.guaranteed_miss_m.compressed(), results.theorem_8_miss_m.compressed()
        rows = (
            (f"{curve.number} {curve.noise.value}", "miss, m", results.miss_m),
            ("  + range sensor" if curve.range_sensor else "", "impulse, m/s", results.impulse_m_s),
        )
        for title, quantity, values in rows:
            table.add_row(title, quantity, *(number(value) for value in shown_quantiles(values, levels)))
        (median,) = shown_quantiles(bounds, [0.5]) if len(bounds) else (None,)
        table.add_row("", bound_name(scenario), "", number(median))
        if len(of_theorem_8):
            table.add_row("", THEOREM_8_NAME, "", number(shown_quantiles(of_theorem_8, [0.5])[0]))
        lines = [
            f"in {some_runs(count)} {text} ({outcome.value})"
            for outcome, text in endings.items()
            if (count := results.outcomes.count(outcome))
        ]
        hits = hit_text(results.hits, scenario)
        notes.append(f"curve {curve.number}: " + "; ".join([*([hits] if hits else []), certificate(results), *lines]))
    counts = sum((set_counts(curve.results.truth_kept, curve.results.set_emptied) for curve in curves), SetCounts())
    if counts.set_emptied:
        notes.append(f"an empty set {'was enlarged, and guidance continued' if enlarged else 'ended guidance'}")
    notes += set_warnings(scenario.information_set.model, counts)
    notes.append(f"{game_note(scenario)}; infoset compare shows the worst of all tie rules")
    if allowed := allowance(scenario):
        notes.append(allowed)
    if scenario.name in (MANY, SINGLE):
        figures = "; ".join(
            f"{noise} noise: miss {miss} m, impulse {fuel} m/s" for noise, (miss, fuel) in printed_single_runs().items()
        )
        notes.append(f"paper (one run from z = -8 km, no range sensor): {figures}")
    runs = len(curves[0].results)
    notes += quantile_notes(runs, levels)
    burns = [burn_table(scenario, curves)] if scenario.thruster.impulses_s else []
    title = (
        f"{scenario.name}: quantiles of {some_runs(runs)} per curve; game noise with the tie rule {scenario.tie.value}"
    )
    return [title, table, *burns, *notes]


LEVELS = {"p50_m_s": 0.5, "p99_m_s": 0.99}
"""Levels of the quantiles of a burn, by key in JSON."""


def burns_key(scenario: Scenario, results: Results) -> dict[str, list[dict[str, float | None]]]:
    """Return the key `burns` of a curve in JSON: for each burn its time, quantiles of its size, and its share.

    The share is that of all impulses of all runs; None without any impulse. No key without a schedule.
    """
    if results.burns_m_s is None:
        return {}
    whole = float(results.burns_m_s.sum())
    arrival_s, step_s = scenario.nominal_arrival_s, scenario.set_model.step_s
    return {
        "burns": [
            {
                "before_arrival_s": arrival_s - step * step_s,
                **dict(zip(LEVELS, shown_quantiles(sizes, [*LEVELS.values()]), strict=True)),
                "share": float(sizes.sum()) / whole if whole > 0.0 else None,
            }
            for step, sizes in zip(scenario.impulse_steps or [], results.burns_m_s.T, strict=True)
        ]
    }


def burn_table(scenario: Scenario, curves: Sequence[Curve]) -> Table:
    """Return the table of the burns of all curves."""
    table = number_table("curve", "burn, s before arrival", "p50, m/s", "p99, m/s", "share of impulse, %", left=1)
    for curve in curves:
        for burn in burns_key(scenario, curve.results).get("burns", []):
            share = burn["share"]
            table.add_row(
                f"{curve.number} {curve.noise.value}{' + range sensor' if curve.range_sensor else ''}",
                f"{burn['before_arrival_s']:g}",
                *(number(burn[key]) for key in LEVELS),
                number(None if share is None else 100.0 * share),
            )
    return table
