"""`infoset multipoint`: computation, files and tables."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from experiments.common.errors import InputError, input_errors
from experiments.common.output import TRAJECTORIES, output_of, to_json
from experiments.common.screen import figure_files, progress_bar, show
from experiments.multipoint.command import BEST, GIVEN, Multipoint
from experiments.multipoint.figures import draw_control, draw_costates, draw_path, draw_times
from experiments.multipoint.file import MultipointProblem, load_multipoint
from experiments.multipoint.page import multipoint_page
from experiments.multipoint.report import Report, Search, report_json, report_parts, trajectories
from experiments.multipoint.scene import Scene, cost_curves
from rendezvous.multipoint import MOST_TARGETS, best_order, best_order_of_slots, best_times
from rendezvous.piecewise import greatest_control

FIGURES = ("figure-path", "figure-control", "figure-costates", "figure-times")

Progress = Callable[[float], None]


def run(options: Multipoint) -> None:
    """Solve the problem, write the files and print the tables."""
    problem = load_multipoint(options.problem, options.settings)
    search = Search(options.order, options.times or (BEST if problem.tables.times.optimise else GIVEN))
    _check(problem, search)
    with (
        output_of(options, ("problem.toml", "results.json", TRAJECTORIES, *figure_files(*FIGURES))) as written,
        progress_bar(options.quiet) as begin,
    ):
        report = _solve(problem, search, begin(search.title))
        written.save("problem.toml", problem.toml)
        written.save("results.json", to_json(report_json(report)), "--json")
        if written.wants("--csv"):
            written.save(TRAJECTORIES, trajectories(report.scene), "--csv")
        if options.html is not None:
            page = multipoint_page(problem.name, report.scene, problem.greatest_control_m_s2)
            written.deliver("--html", page)
        if options.out is not None:
            drawings = _drawings(report, begin("cost against times"))
            written.draw(drawings, begin("figures"))
    show(report_parts(report), options.quiet, stdout_taken=written.stdout_taken)


def _check(problem: MultipointProblem, search: Search) -> None:
    """Refuse a search that is impossible or too long."""
    targets, times_s = problem.tour.targets.targets, problem.times_s
    if search.order == BEST and len(targets) > MOST_TARGETS:
        raise InputError(
            f"--order best: {len(targets)} targets have {_large(math.factorial(len(targets)))} orders; the search "
            f"takes at most {MOST_TARGETS} targets, with {_large(math.factorial(MOST_TARGETS))} orders and already "
            "some minutes; list fewer targets, or list them in a good order"
        )
    if search.times == BEST:
        problem.limits()
        return
    if times_s is None:
        raise InputError(f"{problem.source}: --times given: needs time_s of every target; add it, or use --times best")
    if search.order == GIVEN:
        leave_s = times_s + problem.tour.dwell_s
        early = np.flatnonzero(times_s[1:] <= leave_s[:-1])
        if len(early):
            at = int(early[0]) + 1
            raise InputError(
                f"{problem.source}: target #{at + 1}.time_s: must be after {leave_s[at - 1]:g} s, when the chaser "
                f"leaves {targets[at - 1].name}, found {times_s[at]:g}; list the targets in order of time"
            )
    if problem.latest_s is not None and times_s.max() > problem.latest_s:
        raise InputError(f"{problem.source}: times.latest_s: is before the last time_s; make it later, or remove it")


def _large(number: int) -> str:
    return f"{number:,}".replace(",", " ") if number < 10**15 else f"{float(min(number, 10**300)):.1e}"


def _solve(problem: MultipointProblem, search: Search, progress: Progress) -> Report:
    with input_errors(problem.source):
        report = _searched(problem, search, progress)
    path = report.scene.path
    problem.need_finite(path.cost, report.objective, path.costate_start, path.arrival_states, path.time_gradient)
    bound = problem.greatest_control_m_s2
    if bound is not None and report.peak_m_s2 > bound:
        raise InputError(
            f"{problem.source}: greatest_control_m_s2: the minimum-energy control reaches {report.peak_m_s2:.6g} "
            f"m/s^2, {report.peak_m_s2 / bound - 1.0:.2%} over the bound of {bound:g} m/s^2; raise it, or give the "
            "visits more time"
        )
    return report


def _searched(problem: MultipointProblem, search: Search, progress: Progress) -> Report:
    tour, order = problem.tour, tuple(range(len(problem.tour.targets.targets)))
    guesses = [] if problem.times_s is None else [np.sort(problem.times_s)]
    evaluations, begun, left_out, unfit = 1, 1, 0, 0
    if search.order == BEST:
        if search.times == BEST:
            best = best_order(tour, problem.limits(), guesses, progress=progress)
        else:
            best = best_order_of_slots(tour, guesses[0], progress=progress)
        order, path, objective, evaluations = best.order, best.path, best.objective, best.evaluations
        begun, left_out, unfit = best.nodes, len(best.lost), best.unfit
    elif search.times == BEST:
        timed = best_times(tour, order, problem.limits(), guesses, progress=progress)
        path, objective, evaluations = timed.path, timed.objective, timed.evaluations
    else:
        assert problem.times_s is not None
        path = tour.fly(order, problem.times_s)
        objective = path.cost + problem.price_per_s * float(problem.times_s[-1])
    return Report(
        problem,
        search,
        Scene(problem.tables.axes, tour, order, path),
        objective,
        evaluations,
        begun,
        left_out,
        unfit,
        peak_m_s2=greatest_control(path.control, path.breaks()),
    )


def _drawings(report: Report, progress: Progress) -> dict[str, Callable[[], Figure]]:
    scene = report.scene
    drawings: tuple[Callable[[], Figure], ...] = (
        partial(draw_path, scene),
        partial(draw_control, scene, report.problem.greatest_control_m_s2),
        partial(draw_costates, scene),
        partial(draw_times, scene, cost_curves(scene, progress)),
    )
    return dict(zip(FIGURES, drawings, strict=True))
