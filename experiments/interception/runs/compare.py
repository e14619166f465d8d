"""`infoset compare`: simulation, files and tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from rich.table import Table

from infoset.experiments.common.output import hit_key
from infoset.experiments.common.screen import (
    Part,
    figure_files,
    number,
    number_table,
    parts_of,
    quantile_notes,
    show,
    some_runs,
)
from infoset.experiments.interception.command import Compare
from infoset.experiments.interception.runs.shared import b_plane_figures, simulate_all, work_of
from infoset.experiments.interception.scenario_file import study_scenario
from infoset.experiments.interception.strategies import chosen_noises, chosen_strategies
from infoset.experiments.interception.study import (
    QUANTILES,
    Comparison,
    SetCounts,
    compared_scenarios,
    comparisons,
    miss_text,
    noise_notes,
    percent,
    scenario_title,
    set_counts,
    set_warnings,
    summary,
)
from infoset.guidance import NoiseKind
from infoset.sim import Scenario
from infoset.sim.columns import Cell, csv_text
from infoset.sim.parallel import Task

FIGURE = "figure-comparison"
NEAR = 0.1
"""Relative difference of quantiles up to which strategies count as equally good.

The 90 % quantile of some hundred runs has an interval of about this size.
"""
TIES = "for each run, the worst of the four tie rules"
COLUMNS = (
    "run",
    "miss_m",
    "impulse_m_s",
    "outcome",
    "truth_kept",
    "set_emptied",
    "hit",
    "cause",
    "miss_y_m",
    "miss_z_m",
    "b_dot_t_m",
    "b_dot_r_m",
)
"""Columns of the CSV after strategy, noise and tie rule; those that results lack are left out."""


def run(options: Compare) -> None:
    """Simulate the strategies, write the files and print the table."""
    scenario, notes = study_scenario(options)
    strategies = chosen_strategies(scenario, options.strategies)
    noises = chosen_noises(options.noise)
    figures = [FIGURE, *b_plane_figures(scenario, noises)]

    with work_of(options, scenario, ["results.csv", *figure_files(*figures)], notes=notes) as work:
        wanted = compared_scenarios(scenario, strategies, noises)
        # Each strategy has a progress bar, of which its scenarios are equal parts.
        # All strategies have the same number of scenarios, in the order of the strategies.
        count = len(wanted) // len(strategies)
        reports = [report for name in strategies for report in parts_of(work.begin(name), count)]
        tasks = [
            Task(
                flown,
                range(options.runs),
                options.seed,
                noise=noises[noise],
                strategy=strategies[strategy],
                progress=report,
            )
            for ((strategy, noise, _), flown), report in zip(wanted.items(), reports, strict=True)
        ]
        compared = comparisons(dict(zip(wanted, simulate_all(tasks), strict=True)))

        work.save(
            {
                "seed": options.seed,
                "runs": options.runs,
                "strategies": [_summary(comparison) for comparison in compared],
                "notes": noise_notes(scenario, noises, TIES),
            }
        )
        work.written.save("results.csv", _csv(compared), "--csv")
        if options.out is not None:
            from infoset.experiments.interception.figures.commands import draw_compared

            work.written.draw(figures, draw_compared(scenario, compared), work.begin("figure"))

    show(_parts(scenario, compared), options.quiet or work.written.stdout_taken)


def _summary(comparison: Comparison) -> dict[str, object]:
    """Return the results of a strategy with a noise in JSON."""
    keys: dict[str, object] = {
        "name": comparison.strategy,
        "noise": comparison.noise,
        "miss_m": summary(comparison.worst("miss_m")),
        "impulse_m_s": summary(comparison.worst("impulse_m_s")),
        **hit_key(comparison.hits, comparison.missed),
        "truth_kept": int(comparison.worst("truth_kept").sum()),
        "set_emptied": int(comparison.worst("set_emptied").sum()),
        "phi_held": None,
    }
    phi_held = comparison.worst("phi_held")
    if phi_held.count():
        keys["phi_held"] = int(phi_held.sum())

    results = comparison.results.values()
    keys["outcomes"] = Counter(outcome.value for each in results for outcome in each.outcomes)
    keys["ties"] = {
        tie.value: {"miss_m": summary(each.miss_m), "impulse_m_s": summary(each.impulse_m_s)}
        for tie, each in comparison.results.items()
        if tie is not None
    }
    return keys


def _csv(compared: Sequence[Comparison]) -> str:
    known = next(iter(compared[0].results.values())).to_dict()  # all have the same columns
    names = [name for name in COLUMNS if name in known]
    rows: list[list[Cell]] = []
    for comparison in compared:
        for tie, results in comparison.results.items():
            columns = results.to_dict()
            head = [comparison.strategy, comparison.noise, None if tie is None else tie.value]
            for values in zip(*(columns[name] for name in names), strict=True):
                rows.append([*head, *values])
    return csv_text(("strategy", "noise", "tie", *names), rows)


def _parts(scenario: Scenario, compared: Sequence[Comparison]) -> Iterator[Part]:
    """Yield the quantiles, the sets and hits, and how they depend on the noise, for the screen."""
    noises = list(dict.fromkeys(comparison.noise for comparison in compared))
    by_noise = sorted(compared, key=lambda each: noises.index(each.noise))
    runs = len(compared[0].worst("miss_m"))
    head = f"{scenario_title(scenario)}: quantiles of {some_runs(runs)}"
    if NoiseKind.GAME.value in noises:
        head += f"; game noise: {TIES}"
    yield head
    yield _quantile_table(by_noise)
    yield ""
    yield f"of the {some_runs(runs)}:"
    yield _set_table(scenario, by_noise)

    for comparison in compared:
        if comparison.hits is not None and (causes := miss_text(comparison.missed, runs, scenario)):
            yield f"{comparison.noise} noise, {comparison.strategy}: {causes}"
    if len(noises) > 1:
        yield ""
        yield "what depends on the noise, 90 % quantile of the miss, m:"
        yield _by_noise(compared, noises)
        yield _best(compared, noises)
    yield from noise_notes(scenario, noises, TIES)
    yield from quantile_notes(runs, [*QUANTILES.values()])
    counts = sum(map(_set_counts, compared), SetCounts())
    yield from set_warnings(scenario.information_set, counts)


def _quantile_table(compared: Sequence[Comparison]) -> Table:
    """Return the table of the quantiles of the miss and the impulse."""
    table = number_table("noise", "strategy", "quantity", *QUANTILES, left=3)
    for comparison in compared:
        miss = summary(comparison.worst("miss_m")).values()
        impulse = summary(comparison.worst("impulse_m_s")).values()
        table.add_row(comparison.noise, comparison.strategy, "miss, m", *map(number, miss))
        table.add_row("", "", "impulse, m/s", *map(number, impulse))
    return table


def _set_table(scenario: Scenario, compared: Sequence[Comparison]) -> Table:
    """Return the table of the sets, and of the hits if the body has a size."""
    titles = ["true state in the\nset at every step", "set became\nempty"]
    if scenario.body is not None:
        hit = "hit"
        if scenario.body.is_sphere_around_aim:
            hit = f"hit: miss at\nmost {scenario.certain_radius_m:g} m"
        titles += [hit, "95 % CI\nof a hit"]
    table = number_table("noise", "strategy", *titles, left=2)

    for comparison in compared:
        counts = _set_counts(comparison)
        row = [
            f"{count} ({percent(count / counts.runs)})"
            for count in (counts.truth_kept, counts.set_emptied)
        ]
        hits = comparison.hits
        if hits is not None:
            row.append(f"{hits.hits} ({percent(hits.probability)})")
            row.append(f"{percent(hits.lower)} to {percent(hits.upper)}")
        table.add_row(comparison.noise, comparison.strategy, *row)

    return table


def _set_counts(comparison: Comparison) -> SetCounts:
    return set_counts(comparison.worst("truth_kept"), comparison.worst("set_emptied"))


def _by_noise(compared: Sequence[Comparison], noises: Sequence[str]) -> Table:
    """Return a table of the 90 % quantile of the miss by strategy and noise.

    The last column is the ratio of the extremes of a strategy; unknown if the minimum is 0, or the
    runs are too few to show the quantile.
    """
    table = number_table("strategy", *noises, "maximum / minimum")
    for name in dict.fromkeys(comparison.strategy for comparison in compared):
        values = [
            summary(each.worst("miss_m"))["p90"] for each in compared if each.strategy == name
        ]
        known = [value for value in values if value is not None]
        ratio = None
        if known and min(known) > 0.0:
            ratio = max(known) / min(known)
        table.add_row(name, *map(number, (*values, ratio)))
    return table


def _best(compared: Sequence[Comparison], noises: Sequence[str]) -> str:
    """Return a line with the strategies whose 90 % quantile of the miss is near the least.

    They are those that are near with every noise; if there are none, the strategies of each noise.
    A quantile counts here also if the runs are too few to show it.
    """
    near = {}
    for noise in noises:
        quantiles = {
            each.strategy: np.quantile(each.worst("miss_m"), 0.9)
            for each in compared
            if each.noise == noise
        }
        limit = (1.0 + NEAR) * min(quantiles.values())
        near[noise] = [name for name, value in quantiles.items() if value <= limit]

    within = f"within {NEAR:.0%} of the least in these runs"
    always = [name for name in near[noises[0]] if all(name in names for names in near.values())]
    if always:
        return f"{within} with every noise: {', '.join(always)}"

    by_noise = "; ".join(f"{', '.join(names)} with {noise}" for noise, names in near.items())
    return f"the best strategy depends on the noise; {within}: {by_noise}"
