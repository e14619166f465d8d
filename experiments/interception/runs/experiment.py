"""`infoset experiment`: simulation, files and tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from rich.table import Table

from infoset.experiments.common.output import hit_key, outcome_columns
from infoset.experiments.common.screen import (
    Part,
    figure_files,
    number,
    number_table,
    quantile_notes,
    say,
    show,
    some_runs,
)
from infoset.experiments.interception.command import Experiment
from infoset.experiments.interception.course import Courses
from infoset.experiments.interception.remedy import Remedy, find_remedies
from infoset.experiments.interception.runs.shared import (
    allowance,
    b_plane_figures,
    bound_name,
    certificate,
    simulate_all,
    work_of,
)
from infoset.experiments.interception.scenario_file import scenario_with
from infoset.experiments.interception.strategies import NOISES, chosen_noise, own_strategy
from infoset.experiments.interception.study import (
    QUANTILES,
    Curve,
    SetCounts,
    case_title,
    curve_scenarios,
    hit_text,
    is_of_paper,
    miss_text,
    noise_notes,
    outlook_text,
    redrawn_text,
    set_counts,
    set_warnings,
    summary,
)
from infoset.guidance import NoiseKind
from infoset.sim import Results, Scenario
from infoset.sim.columns import csv_text
from infoset.sim.parallel import Task
from infoset.sim.scenario import strategy_name
from infoset.sim.statistics import shown_quantiles

FIGURE, FIGURE_OF_PAPER = "figure-distributions", "figure-4-distributions"
CORRIDOR = "figure-corridor"
LEVELS = {"p50_m_s": 0.5, "p99_m_s": 0.99}
"""Levels of the quantiles of a burn, by key in JSON."""
MAX_BURN_ROWS = 20
"""Maximum number of burns of a curve in the table: the four curves of an experiment are two
screens.
"""


def run(options: Experiment) -> None:
    """Simulate the curves, write the files and print the table."""
    scenario = scenario_with(options)
    own = own_strategy(options.strategy)
    of_file = scenario.noise if scenario.noise is not NoiseKind.GAME else NoiseKind.RANDOM
    noise = chosen_noise(
        options.noise or of_file.value, [name for name in NOISES if name != NoiseKind.GAME.value]
    )
    name, own_noise, kind = (
        (noise, None, NoiseKind(noise))
        if isinstance(noise, str)
        else (noise.name, noise, NoiseKind.RANDOM)
    )
    names = {1: name, 2: name, 3: NoiseKind.GAME.value, 4: NoiseKind.GAME.value}
    figures = [
        FIGURE_OF_PAPER if is_of_paper(scenario) else FIGURE,
        CORRIDOR,
        *b_plane_figures(scenario, dict.fromkeys(names.values())),
    ]
    with work_of(options, scenario, ["results.csv", *figure_files(*figures)]) as work:
        if scenario.range_sensor is None:
            cases = (
                "curves 1 and 3 only" if is_of_paper(scenario) else f"{name} and game noise only"
            )
            say(f"{scenario.name} has no [range_sensor]: {cases}", options.quiet)
        slowest_first = [
            (
                curve,
                flown,
                _progress_title(
                    scenario, curve, case_title(names[curve], flown.range_sensor is not None)
                ),
            )
            for curve, flown in reversed(curve_scenarios(scenario, kind))
        ]
        courses = [Courses(flown, options.runs) for _, flown, _ in slowest_first]
        tasks = [
            Task(
                *(flown, range(options.runs), options.seed),
                noise=own_noise if names[curve] == name else None,
                strategy=own,
                progress=work.begin(title),
                observe=course.observe if options.out is not None else None,
            )
            for (curve, flown, title), course in zip(slowest_first, courses, strict=True)
        ]
        results = simulate_all(tasks)
        curves = [
            Curve(curve, names[curve], flown.range_sensor is not None, result)
            for (curve, flown, _), result in zip(slowest_first, results, strict=True)
        ][::-1]
        remedies: dict[int, list[Remedy]] = {curve.number: [] for curve in curves}
        if options.remedy and scenario.body is not None:
            for task, curve in zip(tasks[::-1], curves, strict=True):
                found = find_remedies(
                    task, curve.results, work.begin(f"remedies of {curve.title(scenario)}")
                )
                remedies[curve.number] = found
        work.save(
            {
                "strategy": strategy_name(scenario, own),
                "seed": options.seed,
                "runs": options.runs,
                "curves": [
                    {
                        **_key(scenario, curve),
                        **hit_key(curve.results.hits, curve.results.missed),
                        **(
                            {"redrawn_share": share}
                            if (share := curve.results.redrawn_share) is not None
                            else {}
                        ),
                        **burns_key(scenario, curve.results),
                        **({"remedies": remedies[curve.number]} if options.remedy else {}),
                        **outcome_columns(curve.results),
                    }
                    for curve in curves
                ],
                "notes": noise_notes(scenario, dict.fromkeys(names.values())),
            }
        )
        work.written.save("results.csv", _csv(scenario, curves), "--csv")
        if options.out is not None:
            from infoset.experiments.interception.figures.commands import draw_experiment

            work.written.draw(
                figures, draw_experiment(scenario, curves, courses[::-1]), work.begin("figure")
            )
    show(_parts(scenario, curves, remedies), options.quiet or work.written.stdout_taken)


def _progress_title(scenario: Scenario, curve: int, case: str) -> str:
    return f"curve {curve}: {case}" if is_of_paper(scenario) else case


def _key(scenario: Scenario, curve: Curve) -> dict[str, int | str | bool]:
    key: dict[str, int | str | bool] = {"noise": curve.noise, "range_sensor": curve.range_sensor}
    return {"published_curve": curve.number, **key} if is_of_paper(scenario) else key


def _csv(scenario: Scenario, curves: Sequence[Curve]) -> str:
    rows = [
        [*_key(scenario, curve).values(), *values]
        for curve in curves
        for values in zip(*curve.results.to_dict().values(), strict=True)
    ]
    return csv_text((*_key(scenario, curves[0]), *curves[0].results.to_dict()), rows)


def _parts(
    scenario: Scenario, curves: Sequence[Curve], remedies: Mapping[int, Sequence[Remedy]]
) -> Iterator[Part]:
    table = number_table(_heading(scenario), "quantity", *QUANTILES, left=2)
    runs = len(curves[0].results)
    for curve in curves:
        results = curve.results
        head = f"{curve.number} {curve.noise}" if is_of_paper(scenario) else curve.noise
        table.add_row(head, "miss, m", *map(number, summary(results.miss_m).values()))
        ranging = "  + range sensor" if curve.range_sensor else ""
        table.add_row(ranging, "impulse, m/s", *map(number, summary(results.impulse_m_s).values()))
        if results.guaranteed_miss_m.count():
            bounds = summary(results.guaranteed_miss_m.compressed())
            table.add_row("", bound_name(scenario), *map(number, bounds.values()))
    yield (
        f"{scenario.name}: quantiles of {some_runs(runs)} per {_heading(scenario)}; game noise "
        f"with the tie rule {scenario.tie.value}"
    )
    yield table
    burns = len(scenario.impulse_steps or ()) if scenario.thruster.is_scheduled else 0
    if burns > MAX_BURN_ROWS:
        yield f"impulses at {burns} times: --json has the quantiles of each"
    elif burns:
        yield burn_table(scenario, curves)
    counts = SetCounts()
    for curve in curves:
        results = curve.results
        sets = set_counts(results.truth_kept, results.set_emptied)
        held = results.phi_held.compressed()
        counts += sets
        outcomes = Counter(outcome.value for outcome in results.outcomes)
        lines = [hit_text(results.hits, scenario), certificate(sets, int(held.sum()), len(held))]
        lines += [f"{outcome}: {count}" for outcome, count in outcomes.items()]
        title = curve.title(scenario)
        yield f"{title}: {'; '.join(filter(None, lines))}"
        if outlook := outlook_text(results.hits):
            yield f"{title}: {outlook}"
        if causes := miss_text(results.missed, runs, scenario):
            yield f"{title}: {causes}"
        yield from (f"{title}: {remedy}" for remedy in remedies[curve.number])
    if started := redrawn_text(curves[0].results.redrawn_share):
        yield started
    yield from set_warnings(scenario.information_set.model, counts)
    yield from noise_notes(scenario, dict.fromkeys(curve.noise for curve in curves))
    if allowed := allowance(scenario):
        yield allowed
    yield from quantile_notes(runs, [*QUANTILES.values()])


def _heading(scenario: Scenario) -> str:
    """Return what a sample of the experiment is called: the paper's word only for its scenarios."""
    return "curve" if is_of_paper(scenario) else "noise"


def burns_key(scenario: Scenario, results: Results) -> dict[str, list[dict[str, float | None]]]:
    """Return the key `burns` of a curve in JSON: for each burn its time, quantiles of its size, and
    its share.

    The share is that of all impulses of all runs; None without any impulse. No key without a
    schedule.
    """
    if results.burns_m_s is None:
        return {}
    whole = float(results.burns_m_s.sum())
    arrival_s = scenario.nominal_arrival_s
    step_s = scenario.set_model.step_s
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
    table = number_table(
        _heading(scenario),
        "burn, s before arrival",
        "p50, m/s",
        "p99, m/s",
        "share of impulse, %",
        left=1,
    )
    for curve in curves:
        for burn in burns_key(scenario, curve.results).get("burns", []):
            share = burn["share"]
            case = case_title(curve.noise, curve.range_sensor)
            table.add_row(
                f"{curve.number} {case}" if is_of_paper(scenario) else case,
                f"{burn['before_arrival_s']:g}",
                *(number(burn[key]) for key in LEVELS),
                number(None if share is None else 100.0 * share),
            )
    return table
