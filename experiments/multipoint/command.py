"""infoset multipoint: one craft visits several moving targets at least energy; times and order given or best."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from experiments.common.options import Html, Json, Out, Overwrite, ProblemName, Quiet, choice

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from matplotlib.figure import Figure

    from experiments.multipoint.file import MultipointProblem
    from rendezvous.multipoint import Path as FlightPath

FIGURES = ("figure-path", "figure-control", "figure-costates", "figure-times")
GIVEN, BEST = "given", "best"


@dataclass(frozen=True, eq=False)
class Found:
    """Everything the command tells."""

    problem: MultipointProblem
    order: tuple[int, ...]
    path: FlightPath
    objective: float
    evaluations: int
    searched: int
    lost: int
    unfit: int
    best_times: bool
    best_order: bool
    peak_m_s2: float


def multipoint(
    problem: ProblemName = "service-3",
    order: Annotated[
        str | None, typer.Option("--order", metavar="given|best", help="Order as listed, the default, or the best.")
    ] = None,
    times: Annotated[
        str | None,
        typer.Option("--times", metavar="given|best", help="Times of the file, or the best; in place of its choice."),
    ] = None,
    out: Out = None,
    json_: Json = None,
    html: Html = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Visit several moving targets at least energy, by flying past them or meeting them at rest.

    With --order best and --times given the file's times are slots: the first target visited takes the earliest. Without
    --out or --json nothing is written.
    """
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_json, write_file
    from experiments.common.page_document import page_path
    from experiments.common.screen import figure_files, tell_of_compiling_rendezvous
    from experiments.multipoint.file import load_multipoint
    from experiments.multipoint.tables import Axes

    page_path("--html", html)
    given = load_multipoint(problem)
    choices = (GIVEN, BEST)
    best_order = order is not None and choice("--order", order, choices) == BEST
    best_times = given.optimise if times is None else choice("--times", times, choices) == BEST
    _check(given, best_order, best_times)
    files = ("results.json", *figure_files(*FIGURES))
    with checked_destinations(folder=out, names=files, files={"--json": json_, "--html": html}, overwrite=overwrite):
        tell_of_compiling_rendezvous(quiet, nonlinear=given.axes is Axes.INERTIAL)
        found = _find(given, best_order, best_times, quiet)
        json_text = to_json(_summary(found))
        deliver(json_, json_text, overwrite=overwrite)
        if html is not None:
            from experiments.multipoint.page import multipoint_page

            bound = given.greatest_control_m_s2
            shown = multipoint_page(given.name, given.tour, found.order, found.path, given.axes, bound)
            write_file(html, shown, overwrite=overwrite)
        if out is not None:
            _fill(out, found, json_text, overwrite, quiet)
    if not quiet:
        _show(found, str(json_) == STDOUT)


def _check(problem: MultipointProblem, best_order: bool, best_times: bool) -> None:
    """Refuse what cannot be searched, before anything is done."""
    import math

    import numpy as np

    from experiments.common.errors import InputError
    from rendezvous.multipoint import MOST_TARGETS

    targets = problem.tour.targets.targets
    if best_order and len(targets) > MOST_TARGETS:
        raise InputError(
            f"--order best: {len(targets)} targets have {_great(math.factorial(len(targets)))} orders; a search takes "
            f"at most {MOST_TARGETS}, with {_great(math.factorial(MOST_TARGETS))}, which can be minutes already: list "
            "fewer, or in an order that is good"
        )
    if best_times:
        problem.limits()
        return
    if problem.times_s is None:
        missing = "time_s of every target"
        raise InputError(f"{problem.source}: --times given: needs {missing}; add it, or ask for --times best")
    if not best_order:
        leave = problem.times_s + problem.tour.dwell_s
        if (problem.times_s[1:] <= leave[:-1]).any():
            at = int(np.flatnonzero(problem.times_s[1:] <= leave[:-1])[0]) + 1
            raise InputError(
                f"{problem.source}: target #{at + 1}.time_s: must be after {leave[at - 1]:g} s, when "
                f"{targets[at - 1].name} is left, found {problem.times_s[at]:g}; list targets in order of time"
            )
    if problem.latest_s is not None and problem.times_s.max() > problem.latest_s:
        raise InputError(f"{problem.source}: times.latest_s: is before the last time_s; make it later, or remove it")


def _great(number: int) -> str:
    return f"{number:,}".replace(",", " ") if number < 10**15 else f"{float(min(number, 10**300)):.1e}"


def _find(problem: MultipointProblem, best_order: bool, best_times: bool, quiet: bool) -> Found:
    import numpy as np

    from experiments.common.errors import InputError
    from experiments.common.screen import progress_bar
    from rendezvous import multipoint as core
    from rendezvous.greatest_control import greatest_control

    tour, listed = problem.tour, tuple(range(len(problem.tour.targets.targets)))
    guesses = [] if problem.times_s is None else [np.sort(problem.times_s)]
    try:
        with progress_bar(quiet) as begin:
            if best_order and best_times:
                best = core.best_order(tour, problem.limits(), guesses, progress=begin("orders and times"))
                told = (best.order, best.path, best.objective, best.evaluations, best.nodes, len(best.lost), best.unfit)
            elif best_order:
                best = core.best_order_of_slots(tour, guesses[0], progress=begin("orders"))
                told = (best.order, best.path, best.objective, best.evaluations, best.nodes, len(best.lost), best.unfit)
            elif best_times:
                timed = core.best_times(tour, listed, problem.limits(), guesses, progress=begin("times"))
                told = (listed, timed.path, timed.objective, timed.evaluations, 1, 0, 0)
            else:
                assert problem.times_s is not None
                path = tour.fly(listed, problem.times_s)
                told = (listed, path, path.cost + problem.price_per_s * float(problem.times_s[-1]), 1, 1, 0, 0)
    except ValueError as error:
        raise InputError(f"{problem.source}: {error}") from None
    order, path, objective, evaluations, searched, lost, unfit = told
    numbers = (path.cost, objective, path.costate_start, path.arrival_states, path.time_gradient)
    if not all(np.isfinite(each).all() for each in numbers):
        raise InputError(f"{problem.source}: the numbers are so large that results are not finite; check the units")
    peak = greatest_control(path.control, path.breaks())
    bound = problem.greatest_control_m_s2
    if bound is not None and peak > bound:
        raise InputError(
            f"{problem.source}: greatest_control_m_s2: the minimum-energy control reaches {peak:.6g} m/s^2, "
            f"{peak / bound - 1.0:.2%} over the bound of {bound:g} m/s^2; raise it, or give the visits more time"
        )
    return Found(problem, order, path, objective, evaluations, searched, lost, unfit, best_times, best_order, peak)


def _summary(found: Found) -> dict[str, object]:
    from experiments.common.output import library_version
    from experiments.multipoint.tables import Axes

    path, problem = found.path, found.problem
    names = [problem.tour.targets.targets[each].name for each in found.order]
    hill = problem.axes is Axes.HILL
    return {
        "version": library_version(),
        "problem": problem.name,
        "problem_hash": problem.hash,
        "units": "m, s; " + ("x radial, y along the motion, z along the orbit's normal" if hill else "inertial axes"),
        "order_chosen": BEST if found.best_order else GIVEN,
        "times_chosen": BEST if found.best_times else GIVEN,
        "cost_m2_s3": path.cost,
        **({"cost_with_price_m2_s3": found.objective} if problem.price_per_s > 0.0 else {}),
        "order": names,
        "times_s": path.nodes.arrive_s.tolist(),
        "time_gradient_m2_s4": path.time_gradient.tolist(),
        "nodes": [_node(found, index, name) for index, name in enumerate(names)],
        "costate0": {
            "position_m_s3": path.costate_start[:3].tolist(),
            "velocity_m_s2": path.costate_start[3:].tolist(),
        },
        "peak_control_m_s2": found.peak_m_s2,
        "evaluations": found.evaluations,
        "orders_begun": found.searched,
        "orders_left_out": found.lost,
        "orders_that_do_not_fit": found.unfit,
    }


def _node(found: Found, index: int, name: str) -> dict[str, object]:
    nodes, jumps = found.path.nodes, found.path.jumps
    state = found.path.arrival_states[index]
    met = bool(nodes.rendezvous[index])
    return {
        "name": name,
        "meet": "rendezvous" if met else "flyby",
        "position_m": state[:3].tolist(),
        "velocity_m_s": state[3:].tolist(),
        "target_velocity_m_s": nodes.arrive[index, 3:].tolist(),
        "leave_s": float(nodes.leave_s[index]),
        "jump_m_s3": jumps[index, :3].tolist(),
        **({"velocity_jump_m_s2": jumps[index, 3:].tolist()} if met else {}),
    }


def _fill(folder: Path, found: Found, json_text: str, overwrite: bool, quiet: bool) -> None:
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures, write_file
    from experiments.common.screen import progress_bar
    from experiments.multipoint.curves import cost_curves
    from experiments.multipoint.figures import Scene, draw_control, draw_costates, draw_path, draw_times

    write_file(folder / "results.json", json_text, overwrite=overwrite)
    with progress_bar(quiet) as begin, reporting_failures(folder):
        scene = Scene(found.problem.axes, found.problem.tour, found.order, found.path)
        curves = cost_curves(scene.tour, scene.order, scene.path, begin("cost against times"))
        report = begin("figures")
        drawings: tuple[Callable[[], Figure], ...] = (
            lambda: draw_path(scene),
            lambda: draw_control(scene, found.problem.greatest_control_m_s2),
            lambda: draw_costates(scene),
            lambda: draw_times(scene, curves),
        )
        for index, (name, draw) in enumerate(zip(FIGURES, drawings, strict=True)):
            save_figure(draw(), folder, name)
            report((index + 1) / len(FIGURES))


def _show(found: Found, stdout_taken: bool) -> None:
    import numpy as np
    from rich.table import Table
    from rich.text import Text

    from experiments.common.screen import table_console

    path, problem = found.path, found.problem
    console = table_console(stdout_taken)
    console.print(Text(f"{problem.name}: I = {path.cost:.8g} m^2/s^3, peak |u| {found.peak_m_s2:.4g} m/s^2"))
    table = Table("target", "meet", box=None, pad_edge=False)
    for title in ("time\ns", "relative speed\nm/s", "dI/dt\nm^2/s^4", "|jump|\nm/s^3"):
        table.add_column(title, justify="right")
    relative = np.linalg.norm(path.arrival_states[:, 3:] - path.nodes.arrive[:, 3:], axis=1)
    for index, target in enumerate(found.order):
        described = problem.tour.targets.targets[target]
        row: tuple[Any, ...] = (
            f"{path.nodes.arrive_s[index]:.10g}",
            f"{0.0 if path.nodes.rendezvous[index] else relative[index]:.5g}",
            f"{path.time_gradient[index]:.4g}",
            f"{np.linalg.norm(path.jumps[index, :3]):.4g}",
        )
        table.add_row(Text(described.name), described.meet.value, *row)
    console.print(table)
    if found.best_order or found.best_times:
        said = f"{found.evaluations} paths computed"
        if found.best_order:
            said += f", {found.searched} beginnings of orders looked at"
            said += f", {found.lost} of them left out, for no trajectory was found" if found.lost else ""
            said += f"; {found.unfit} orders do not fit the times" if found.unfit else ""
        console.print(Text(said + "; a local minimum of the times" if found.best_times else said), soft_wrap=True)
