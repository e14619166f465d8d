"""`infoset experiment`: simulation, files and tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

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
from infoset.experiments.interception.command import NEEDED, Experiment
from infoset.experiments.interception.course import Courses
from infoset.experiments.interception.remedy import Remedy, find_remedies
from infoset.experiments.interception.runs.shared import (
    Work,
    allowance,
    b_plane_figures,
    bound_name,
    certificate,
    simulate_all,
    work_of,
)
from infoset.experiments.interception.scenario_file import scenario_with
from infoset.experiments.interception.strategies import (
    NOISES,
    OwnNoise,
    chosen_noise,
    own_strategy,
)
from infoset.experiments.interception.study import (
    QUANTILES,
    USUAL_REQUIREMENT,
    Curve,
    SetCounts,
    case_title,
    certain_hits_text,
    curve_scenarios,
    hit_text,
    is_of_paper,
    miss_text,
    needed_notes,
    noise_notes,
    outlook_text,
    redrawn_text,
    set_counts,
    set_warnings,
    summary,
    wrong_images_text,
)
from infoset.guidance import NoiseKind, Strategy
from infoset.sim import Results, Scenario
from infoset.sim.columns import csv_text
from infoset.sim.parallel import Task
from infoset.sim.requirement import least_runs
from infoset.sim.scenario import strategy_name
from infoset.sim.statistics import shown_quantiles

FIGURE = "figure-distributions"
FIGURE_OF_PAPER = "figure-4-distributions"
CORRIDOR = "figure-corridor"
LEVELS = {"p50_m_s": 0.5, "p99_m_s": 0.99}
"""Levels of the quantiles of an impulse, by key in JSON."""
MAX_IMPULSE_ROWS = 20
"""Maximum number of impulses of a curve in the table: four curves then fill two screens."""


class _ChosenNoise(NamedTuple):
    """The noise of the curves 1 and 2: its name, and the noise of a Python file or None.

    `kind` is the noise of the scenarios of these curves, which a noise of a Python file replaces.
    """

    name: str
    own: OwnNoise | None
    kind: NoiseKind


def run(options: Experiment) -> None:
    """Simulate the curves, write the files and print the table."""
    if options.runs == NEEDED:
        # `watched`: as in `needed_notes`, enough also if runs are added after a look at results.
        options = replace(options, runs=least_runs(USUAL_REQUIREMENT.share, watched=True))
    scenario = scenario_with(options)
    own = own_strategy(options.strategy)
    noise = _noise_of(options, scenario)
    noises = [*dict.fromkeys((noise.name, NoiseKind.GAME.value))]
    figures = [
        FIGURE_OF_PAPER if is_of_paper(scenario) else FIGURE,
        CORRIDOR,
        *b_plane_figures(scenario, noises),
    ]

    notes = []
    if scenario.body is not None:
        notes = needed_notes(USUAL_REQUIREMENT, options.runs)
    files = ["results.csv", *figure_files(*figures)]
    with work_of(options, scenario, files, notes=notes) as work:
        if scenario.range_sensor is None:
            cases = f"{noise.name} and game noise only"
            if is_of_paper(scenario):
                cases = "curves 1 and 3 only"
            say(f"{scenario.name} has no [range_sensor]: {cases}", options.quiet)

        flights = _flights(options, scenario, own, noise, work)
        results = simulate_all([flight.task for flight in flights])
        curves = [
            Curve(flight.curve, flight.noise, flight.task.scenario.range_sensor is not None, result)
            for flight, result in zip(flights, results, strict=True)
        ]
        # The slowest flights began first; the results are in the order of the paper.
        flights.reverse()
        curves.reverse()

        remedies: dict[int, list[Remedy]] = {curve.number: [] for curve in curves}
        if options.remedy and scenario.body is not None:
            for flight, curve in zip(flights, curves, strict=True):
                progress = work.begin(f"remedies of {curve.title(scenario)}")
                remedies[curve.number] = find_remedies(flight.task, curve.results, progress)

        work.save(
            {
                "strategy": strategy_name(scenario, own),
                "seed": options.seed,
                "runs": options.runs,
                "curves": [
                    _curve_json(scenario, curve, remedies[curve.number] if options.remedy else None)
                    for curve in curves
                ],
                "notes": noise_notes(scenario, noises),
            }
        )
        work.written.save("results.csv", _csv(scenario, curves), "--csv")
        if options.out is not None:
            from infoset.experiments.interception.figures.commands import draw_experiment

            courses = [flight.course for flight in flights]
            work.written.draw(
                figures, draw_experiment(scenario, curves, courses), work.begin("figure")
            )

    show(_parts(scenario, curves, remedies), options.quiet or work.written.stdout_taken)


def _noise_of(options: Experiment, scenario: Scenario) -> _ChosenNoise:
    """Return the noise of the curves 1 and 2.

    The default is the noise of the scenario, or random noise if that is the game noise, which the
    curves 3 and 4 have.
    """
    default = scenario.noise
    if default is NoiseKind.GAME:
        default = NoiseKind.RANDOM
    names = [name for name in NOISES if name != NoiseKind.GAME.value]
    chosen = chosen_noise(options.noise or default.value, names)
    if isinstance(chosen, str):
        return _ChosenNoise(chosen, None, NoiseKind(chosen))
    return _ChosenNoise(chosen.name, chosen, NoiseKind.RANDOM)


class _Flight(NamedTuple):
    """The runs of one curve that are simulated, and their courses."""

    curve: int
    noise: str
    task: Task
    course: Courses


def _flights(
    options: Experiment,
    scenario: Scenario,
    own: Strategy | None,
    noise: _ChosenNoise,
    work: Work,
) -> list[_Flight]:
    """Return the runs of the curves, the slowest first, each with its progress bar."""
    flights = []
    for curve, flown in reversed(curve_scenarios(scenario, noise.kind)):
        is_game = flown.noise is NoiseKind.GAME
        name = NoiseKind.GAME.value if is_game else noise.name
        title = case_title(name, flown.range_sensor is not None)
        if is_of_paper(scenario):
            title = f"curve {curve}: {title}"
        course = Courses(flown, options.runs)
        task = Task(
            flown,
            range(options.runs),
            options.seed,
            noise=None if is_game else noise.own,  # None is the noise of the scenario
            strategy=own,
            progress=work.begin(title),
            observe=course.observe if options.out is not None else None,
        )
        flights.append(_Flight(curve, name, task, course))

    return flights


def _curve_json(
    scenario: Scenario, curve: Curve, remedies: Sequence[Remedy] | None
) -> dict[str, object]:
    """Return the results of a curve in JSON; `remedies` is None if they are not wanted."""
    results = curve.results
    keys = _key(scenario, curve) | hit_key(results.hits, results.missed)
    if results.redrawn_share is not None:
        keys["redrawn_share"] = results.redrawn_share
    keys |= impulses_key(scenario, results)
    if remedies is not None:
        keys["remedies"] = remedies
    return keys | outcome_columns(results)


def _key(scenario: Scenario, curve: Curve) -> dict[str, Any]:
    """Return the keys that identify a curve; only curves of the paper have a number."""
    key: dict[str, Any] = {}
    if is_of_paper(scenario):
        key["published_curve"] = curve.number
    return key | {"noise": curve.noise, "range_sensor": curve.range_sensor}


def _csv(scenario: Scenario, curves: Sequence[Curve]) -> str:
    names = [*_key(scenario, curves[0]), *curves[0].results.to_dict()]
    rows = []
    for curve in curves:
        key = _key(scenario, curve).values()
        for values in zip(*curve.results.to_dict().values(), strict=True):
            rows.append([*key, *values])
    return csv_text(names, rows)


def _parts(
    scenario: Scenario, curves: Sequence[Curve], remedies: Mapping[int, Sequence[Remedy]]
) -> Iterator[Part]:
    """Yield the quantiles, the impulses, and lines about hits, sets and noises."""
    runs = len(curves[0].results)
    yield (
        f"{scenario.name}: quantiles of {some_runs(runs)} per {_heading(scenario)}; game noise "
        f"with the tie rule {scenario.tie.value}"
    )
    yield _quantile_table(scenario, curves)

    times = 0
    if scenario.thruster.is_scheduled:
        times = len(scenario.impulse_steps or ())
    if times > MAX_IMPULSE_ROWS:
        yield f"impulses at {times} times: --json has the quantiles of each"
    elif times:
        yield impulse_table(scenario, curves)

    counts = SetCounts()
    for curve in curves:
        results = curve.results
        counts += set_counts(results.truth_kept, results.set_emptied)
        yield from _curve_lines(scenario, curve)
        yield from (f"{curve.title(scenario)}: {remedy}" for remedy in remedies[curve.number])

    if started := redrawn_text(curves[0].results.redrawn_share):
        yield started
    yield from set_warnings(scenario.information_set, counts)
    yield from noise_notes(scenario, dict.fromkeys(curve.noise for curve in curves))
    if allowed := allowance(scenario):
        yield allowed
    yield from quantile_notes(runs, [*QUANTILES.values()])


def _quantile_table(scenario: Scenario, curves: Sequence[Curve]) -> Table:
    """Return the table of the quantiles of the miss, the impulse and the bound of each curve."""
    table = number_table(_heading(scenario), "quantity", *QUANTILES, left=2)
    for curve in curves:
        results = curve.results
        head = curve.noise
        if is_of_paper(scenario):
            head = f"{curve.number} {curve.noise}"
        ranging = "  + range sensor" if curve.range_sensor else ""
        table.add_row(head, "miss, m", *map(number, summary(results.miss_m).values()))
        table.add_row(ranging, "impulse, m/s", *map(number, summary(results.impulse_m_s).values()))
        if results.guaranteed_miss_m.count():
            bounds = summary(results.guaranteed_miss_m.compressed())
            table.add_row("", bound_name(scenario), *map(number, bounds.values()))

    return table


def _curve_lines(scenario: Scenario, curve: Curve) -> Iterator[str]:
    """Yield lines about the hits, the sets, the outcomes and the misses of a curve."""
    results = curve.results
    title = curve.title(scenario)
    sets = set_counts(results.truth_kept, results.set_emptied)
    held = results.phi_held.compressed()
    outcomes = Counter(outcome.value for outcome in results.outcomes)
    lines = [
        hit_text(results.hits, scenario),
        certain_hits_text(results, scenario),
        certificate(sets, int(held.sum()), len(held)),
        *(f"{outcome}: {count}" for outcome, count in outcomes.items()),
    ]
    yield f"{title}: {'; '.join(filter(None, lines))}"
    if outlook := outlook_text(results.hits):
        yield f"{title}: {outlook}"
    if causes := miss_text(results.missed, len(results), scenario):
        yield f"{title}: {causes}"
    if proved := wrong_images_text(results, scenario):
        yield f"{title}: {proved}"


def _heading(scenario: Scenario) -> str:
    """Return the name of a sample of the experiment, which is a curve only in the paper."""
    return "curve" if is_of_paper(scenario) else "noise"


def impulses_key(scenario: Scenario, results: Results) -> dict[str, list[dict[str, float | None]]]:
    """Return the key `impulses` of a curve in JSON; no key without a schedule of impulses.

    Each impulse has its time, quantiles of its size over all runs, zeros included, and its share of
    the sum of all impulses of all runs, None if this sum is 0. A quantile that the runs do not show
    is None.
    """
    if results.burns_m_s is None:
        return {}
    whole = float(results.burns_m_s.sum())
    impulses = []

    for step, sizes in zip(scenario.impulse_steps or [], results.burns_m_s.T, strict=True):
        impulse: dict[str, float | None] = {
            "before_arrival_s": scenario.nominal_arrival_s - step * scenario.set_model.step_s
        }
        impulse |= zip(LEVELS, shown_quantiles(sizes, [*LEVELS.values()]), strict=True)
        impulse["share"] = float(sizes.sum()) / whole if whole > 0.0 else None
        impulses.append(impulse)

    return {"impulses": impulses}


def impulse_table(scenario: Scenario, curves: Sequence[Curve]) -> Table:
    """Return the table of the impulses of a schedule, of all curves."""
    titles = ("impulse, s before arrival", "p50, m/s", "p99, m/s", "share of impulse, %")
    table = number_table(_heading(scenario), *titles, left=1)
    for curve in curves:
        case = case_title(curve.noise, curve.range_sensor)
        if is_of_paper(scenario):
            case = f"{curve.number} {case}"
        for impulse in impulses_key(scenario, curve.results).get("impulses", []):
            share = impulse["share"]
            table.add_row(
                case,
                f"{impulse['before_arrival_s']:g}",
                *(number(impulse[key]) for key in LEVELS),
                number(None if share is None else 100.0 * share),
            )

    return table
