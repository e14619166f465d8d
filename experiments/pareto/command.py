"""infoset pareto: several craft meet at least energy; which meeting, what it costs each, and what coalitions say."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from experiments.common.options import Html, Json, Out, Overwrite, ProblemName, Quiet

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from experiments.pareto.file import ParetoProblem
    from rendezvous.pareto import BoundCheck, Coalitions, DurationSweep, EncounterSolution

FIGURES = ("figure-trajectories", "figure-controls", "figure-front", "figure-costs")
MOST_SAMPLES = 10_001
NOTHING = 1e-9
"""Of the greatest component of a choice: less than that is told as zero."""
SWEEP = (0.5, 2.0, 31)
"""Durations looked at, from the least to the greatest in parts of the given one, and how many."""


@dataclass(frozen=True, eq=False)
class Found:
    """Everything the command tells."""

    problem: ParetoProblem
    solution: EncounterSolution
    selections: Mapping[str, Any]
    coalitions: Coalitions | None
    bounds: tuple[BoundCheck, ...]
    peaks_m_s2: tuple[float, ...]
    impulses_m_s: tuple[float, ...]
    sweep: DurationSweep
    samples: int


def pareto(
    problem: ProblemName = "pareto-2008",
    prefer: Annotated[
        str | None,
        typer.Option(
            "--prefer", metavar="NAME=VALUE,..", help="A meeting you would like, to be moved to the nearest best one."
        ),
    ] = None,
    samples: Annotated[
        int, typer.Option("--samples", metavar="N", help="Times at which flights are given, from start to meeting.")
    ] = 31,
    out: Out = None,
    json_: Json = None,
    html: Html = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Find where several craft should meet so that nobody can do better without another doing worse.

    Each craft flies at least energy; the meeting minimises the weighted sum of what it costs them beyond their own
    cheapest meetings. Other choices, coalitions and the bound on the control are told beside it. Without --out,
    --json or --html nothing is written.
    """
    from experiments.common.options import whole_number
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_json, write_file
    from experiments.common.page_document import page_path
    from experiments.common.screen import figure_files, progress_bar, tell_of_compiling_rendezvous
    from experiments.pareto.file import load_pareto

    page_path("--html", html)
    whole_number("--samples", samples, 2, MOST_SAMPLES, 31)
    given = load_pareto(problem)
    preferred = None if prefer is None else _preferred(prefer, given)
    files = ("results.json", *figure_files(*FIGURES))
    with checked_destinations(folder=out, names=files, files={"--json": json_, "--html": html}, overwrite=overwrite):
        tell_of_compiling_rendezvous(quiet, visits=False)
        with progress_bar(quiet) as begin:
            found = _find(given, preferred, samples, begin("meetings and coalitions"))
        json_text = to_json(_summary(found))
        deliver(json_, json_text, overwrite=overwrite)
        if html is not None:
            from experiments.pareto.page import pareto_page

            write_file(html, pareto_page(given.name, found.solution, found.selections), overwrite=overwrite)
        if out is not None:
            _fill(out, found, json_text, overwrite, quiet)
    if not quiet:
        _show(found, str(json_) == STDOUT)


def _preferred(text: str, problem: ParetoProblem) -> Any:
    """Read a meeting that a person would like: a value for every free component."""
    import math

    import numpy as np

    from experiments.common.errors import InputError
    from experiments.common.toml_values import LARGEST, shown
    from experiments.pareto.file import TERMINAL

    keys = [TERMINAL[each.name.lower()] for each in problem.encounter.free]
    example = "--prefer " + ",".join(f"{key}=0" for key in keys)
    values: dict[str, float] = {}
    for part in text.split(","):
        key, mark, number = part.partition("=")
        if not mark or key.strip() not in keys or key.strip() in values:
            raise InputError(
                f"--prefer: give each of {', '.join(keys)} once, found {shown(part.strip())}; for example {example}"
            )
        try:
            values[key.strip()] = float(number)
        except ValueError:
            raise InputError(f"--prefer: {shown(number)} is no number; for example {example}") from None
    missing = [key for key in keys if key not in values]
    if missing:
        raise InputError(f"--prefer: {' and '.join(missing)} is missing; for example {example}")
    if not all(math.isfinite(each) and abs(each) <= LARGEST for each in values.values()):
        raise InputError(f"--prefer: values must be finite and of ordinary size; for example {example}")
    return np.array([values[key] for key in keys])


def _find(problem: ParetoProblem, preferred: Any, samples: int, report: Callable[[float], None]) -> Found:
    import numpy as np

    from experiments.common.errors import InputError
    from rendezvous.pareto import (
        Meeting,
        NotCertifiedError,
        NotOptimalError,
        analyse_coalitions,
        check_bound,
        least_greatest_excess,
        least_sum_of_costs,
        nearest_to,
        peak_control,
        solve_encounter,
        sweep_meeting_time,
        total_impulse,
    )
    from rendezvous.pareto.coalitions import MOST_CRAFT

    encounter = problem.encounter
    try:
        solution = solve_encounter(encounter)
    except ValueError as error:
        raise InputError(f"{problem.source}: {error}") from None
    if not (np.isfinite(solution.meeting_state()).all() and np.isfinite(solution.cost_squared()).all()):
        raise InputError(f"{problem.source}: the numbers are so large that results are not finite; check the units")
    selections = {
        "least_group_loss": solution.point,
        "least_sum_of_costs": least_sum_of_costs(solution),
        "least_greatest_excess": least_greatest_excess(solution),
    }
    if preferred is not None:
        try:
            selections["preferred"] = nearest_to(solution, preferred)
        except NotOptimalError as error:
            raise InputError(f"{problem.source}: --prefer: {error}") from None
    report(0.2)
    plans = [solution.plan(index) for index in range(len(solution.costs))]
    common = 6 if encounter.meeting is Meeting.RENDEZVOUS else 3
    bounds: tuple[BoundCheck, ...] = ()
    if problem.greatest_control_m_s2 is not None:
        try:
            bounds = tuple(check_bound(plan, problem.greatest_control_m_s2, common) for plan in plans)
        except NotCertifiedError as error:
            raise InputError(f"{problem.source}: greatest_control_m_s2: {error}") from None
        _refuse_impossible(problem, bounds)
    report(0.4)
    coalitions = analyse_coalitions(solution) if len(plans) <= MOST_CRAFT else None
    report(0.9)
    latest = max(each.start_s for each in encounter.craft)
    durations = latest + (encounter.meeting_s - latest) * np.linspace(*SWEEP)
    return Found(
        problem,
        solution,
        selections,
        coalitions,
        bounds,
        tuple(peak_control(plan) for plan in plans),
        tuple(total_impulse(plan) for plan in plans),
        sweep_meeting_time(encounter, durations),
        samples,
    )


def _refuse_impossible(problem: ParetoProblem, bounds: tuple[BoundCheck, ...]) -> None:
    """Stop where no control within the bound reaches the meeting."""
    from experiments.common.errors import InputError
    from rendezvous.pareto import Feasibility

    bound = problem.greatest_control_m_s2
    worst = max(range(len(bounds)), key=lambda index: bounds[index].least_peak_m_s2)
    if bound is None or bounds[worst].feasibility is not Feasibility.IMPOSSIBLE:
        return
    name, need = problem.encounter.craft[worst].name, bounds[worst].least_peak_m_s2
    raise InputError(
        f"{problem.source}: greatest_control_m_s2: no control of at most {bound:g} m/s^2 brings the craft {name} to "
        f"the meeting; the least that any needs is {need:.6g} m/s^2, {need / bound:.4g} times the bound; raise it, or "
        "make duration_s longer"
    )


def _summary(found: Found) -> dict[str, object]:
    from experiments.common.output import library_version
    from rendezvous.pareto import distances

    solution, encounter = found.solution, found.problem.encounter
    excess, cost = solution.excess(), solution.cost_squared()
    return {
        "version": library_version(),
        "problem": found.problem.name,
        "problem_hash": found.problem.hash,
        "units": {
            "axes": "x against the motion, y radially outward, z along the orbit's normal",
            "costate_at_meeting": "m/s^3 of the position's three, m/s^2 of the velocity's",
            "matrix": "m^2/s^3 over the units of two free components",
            "distances": "m/s^1.5",
        },
        "meeting_time_s": encounter.meeting_s,
        "meet": encounter.meeting.value,
        "free": [each.name.lower() for each in encounter.free],
        "meeting": _named_state(solution, solution.point),
        "craft": [
            {
                "name": each.craft.name,
                "weight": each.craft.weight,
                "ideal": _named_state(solution, each.ideal),
                "ideal_cost_squared_m2_s3": each.ideal_cost_squared,
                "cost_squared_m2_s3": float(cost[index]),
                "excess_m2_s3": float(excess[index]),
                "impulse_m_s": found.impulses_m_s[index],
                "peak_control_m_s2": found.peaks_m_s2[index],
                "costate_at_meeting": solution.plan(index).costate.tolist(),
                **(_bound_summary(found, index) if found.bounds else {}),
            }
            for index, each in enumerate(solution.costs)
        ],
        "group_loss_m2_s3": float(solution.group_loss()),
        "matrix": [each.matrix.tolist() for each in solution.costs[: 1 if solution.same_matrix else None]],
        **({"distances": distances(solution).tolist()} if solution.same_matrix else {}),
        "selections": {
            name: {
                "meeting": _named_state(solution, point),
                "cost_squared_m2_s3": solution.cost_squared(point).tolist(),
                "excess_m2_s3": solution.excess(point).tolist(),
                "group_loss_m2_s3": float(solution.group_loss(point)),
            }
            for name, point in found.selections.items()
        },
        **_coalition_summary(found),
        "sweep": {
            "meeting_time_s": found.sweep.meeting_s.tolist(),
            "group_loss_m2_s3": found.sweep.group_loss.tolist(),
            "cost_squared_m2_s3": found.sweep.cost_squared.tolist(),
            "ideal_cost_squared_m2_s3": found.sweep.ideal_cost_squared.tolist(),
        },
        "samples": [_sampled(found, index) for index in range(len(encounter.craft))],
    }


def _named_state(solution: EncounterSolution, point: Any) -> dict[str, float]:
    """Return a meeting by component; of an intercept only the position is common."""
    from experiments.pareto.file import TERMINAL

    state = solution.meeting_state(point)[: solution.encounter.common]
    return {key: float(value) for key, value in zip(TERMINAL.values(), state, strict=False)}


def _bound_summary(found: Found, index: int) -> dict[str, object]:
    check = found.bounds[index]
    return {
        "greatest_control_m_s2": found.problem.greatest_control_m_s2,
        "least_peak_control_m_s2": check.least_peak_m_s2,
        "feasibility": check.feasibility.value,
    }


def _coalition_summary(found: Found) -> dict[str, object]:
    coalitions = found.coalitions
    if coalitions is None:
        return {"coalitions": {}, "shapley_m2_s3": [], "transfers_m2_s3": [], "core": None}
    names = [each.craft.name for each in found.solution.costs]
    return {
        "coalitions": {
            "+".join(names[member] for member in each.members): {
                "excess_m2_s3": each.excess,
                "regret_m2_s3": each.regret,
            }
            for each in coalitions.coalitions
        },
        "shapley_m2_s3": coalitions.shapley.tolist(),
        "transfers_m2_s3": coalitions.transfers.tolist(),
        "core": {"verdict": coalitions.core.value, "reason": coalitions.core.reason},
    }


def _sampled(found: Found, index: int) -> dict[str, object]:
    samples = found.solution.plan(index).sample(found.samples)
    return {
        "name": found.solution.costs[index].craft.name,
        "time_s": samples.time_s.tolist(),
        "position_m": samples.state[:, :3].tolist(),
        "velocity_m_s": samples.state[:, 3:].tolist(),
        "control_m_s2": samples.control_m_s2.tolist(),
    }


def _fill(folder: Path, found: Found, json_text: str, overwrite: bool, quiet: bool) -> None:
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures, write_file
    from experiments.common.screen import progress_bar
    from experiments.pareto.figures import draw_controls, draw_costs, draw_front, draw_trajectories

    write_file(folder / "results.json", json_text, overwrite=overwrite)
    solution = found.solution
    drawings: tuple[Callable[[], Figure], ...] = (
        lambda: draw_trajectories(solution),
        lambda: draw_controls(solution, found.problem.greatest_control_m_s2),
        lambda: draw_front(solution, found.selections, found.sweep),
        lambda: draw_costs(solution, found.coalitions, found.impulses_m_s),
    )
    with progress_bar(quiet) as begin, reporting_failures(folder):
        report = begin("figures")
        for index, (name, draw) in enumerate(zip(FIGURES, drawings, strict=True)):
            save_figure(draw(), folder, name)
            report((index + 1) / len(FIGURES))


def _show(found: Found, stdout_taken: bool) -> None:
    from rich.table import Table
    from rich.text import Text

    from experiments.common.screen import number, table_console
    from rendezvous.pareto import Feasibility

    solution, encounter = found.solution, found.problem.encounter
    console = table_console(stdout_taken)
    where = ", ".join(f"{key} = {value:.6g}" for key, value in _named_state(solution, solution.point).items())
    console.print(
        Text(f"{found.problem.name}: {encounter.meeting.value} at {encounter.meeting_s:g} s: {where}"), soft_wrap=True
    )
    table = Table("craft", box=None, pad_edge=False)
    for title in ("ideal J*^2\nm^2/s^3", "J^2\nm^2/s^3", "excess\nm^2/s^3", "impulse\nm/s", "peak |u|\nm/s^2"):
        table.add_column(title, justify="right")
    excess, cost = solution.excess(), solution.cost_squared()
    for index, each in enumerate(solution.costs):
        row = (each.ideal_cost_squared, cost[index], excess[index], found.impulses_m_s[index], found.peaks_m_s2[index])
        table.add_row(Text(each.craft.name), *(number(float(value)) for value in row))
    console.print(table)
    console.print(Text(f"group loss {float(solution.group_loss()):.6g} m^2/s^3"))
    for index, check in enumerate(found.bounds):
        if check.feasibility is Feasibility.ANOTHER_CONTROL:
            bound, name = found.problem.greatest_control_m_s2 or 0.0, encounter.craft[index].name
            said = (
                f"{name}: the minimum-energy control exceeds the bound {bound:g} m/s^2 by "
                f"{check.peak_m_s2 / bound - 1.0:.2%}; another control meets it, with a peak of at least "
                f"{check.least_peak_m_s2:.6g} m/s^2"
            )
            console.print(Text(said), soft_wrap=True)
    console.print()
    chosen = Table("choice", box=None, pad_edge=False)
    for name in (each.name.lower() for each in encounter.free):
        chosen.add_column(f"{name}, {'m' if len(name) == 1 else 'm/s'}", justify="right")
    scale = max(float(abs(point).max()) for point in found.selections.values())
    chosen.add_column("group loss\nm^2/s^3", justify="right")
    for name, point in found.selections.items():
        values = (f"{value if abs(value) > NOTHING * scale else 0.0:.6g}" for value in point)
        chosen.add_row(name.replace("_", " "), *values, number(float(solution.group_loss(point))))
    console.print(chosen)
    if found.coalitions is not None:
        shares = ", ".join(
            f"{each.craft.name} {number(float(value))}"
            for each, value in zip(solution.costs, found.coalitions.shapley, strict=True)
        )
        console.print(Text(f"Shapley value of the excess: {shares}"), soft_wrap=True)
        console.print(Text(found.coalitions.core.reason), soft_wrap=True)
    else:
        console.print(Text("coalitions are not listed: there are too many of so many craft"))
