"""`infoset multipoint`: computation, files and tables."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from experiments.common.errors import InputError, input_errors
from experiments.common.input_file import to_toml
from experiments.common.output import TRAJECTORIES, output_of, to_json
from experiments.common.problems import need_finite
from experiments.common.screen import figure_files, progress_bar, show
from experiments.multipoint.command import BEST, GIVEN, Multipoint
from experiments.multipoint.file import MultipointProblem, load_multipoint
from experiments.multipoint.page import multipoint_page
from experiments.multipoint.report import Report, Scene, Search, cost_curves, report_json, report_parts, trajectories
from rendezvous.multipoint import MAX_TARGETS, BestOrder, best_order, best_order_of_slots, best_times
from rendezvous.piecewise import max_control

FIGURES = ("figure-path", "figure-control", "figure-costates", "figure-times")

Progress = Callable[[float], None]


def run(options: Multipoint) -> None:
    """Solve the problem, write the files and print the tables."""
    problem = load_multipoint(options.problem, options.settings)
    search = Search(options.order, options.times or (BEST if problem.optimise_times else GIVEN))
    _check(problem, search)
    with (
        output_of(options, ("problem.toml", "results.json", TRAJECTORIES, *figure_files(*FIGURES))) as written,
        progress_bar(options.quiet) as begin,
    ):
        report = _solve(problem, search, begin(search.title))
        written.save("problem.toml", to_toml(problem))
        written.save("results.json", to_json(report_json(report)), "--json")
        if written.wants("--csv"):
            written.save(TRAJECTORIES, trajectories(report.scene), "--csv")
        if options.html is not None:
            page = multipoint_page(problem.name, report.scene, problem.max_control_m_s2)
            written.deliver("--html", page)
        if options.out is not None:
            from experiments.multipoint.figures import draw_all

            curves = cost_curves(report.scene, begin("cost against times"))
            written.draw(FIGURES, draw_all(report, curves), begin("figures"))
    show(report_parts(report), options.quiet, stdout_taken=written.stdout_taken)


def _check(problem: MultipointProblem, search: Search) -> None:
    """Refuse a search that is impossible or too long."""
    targets, times_s = problem.tour.targets.targets, problem.times_s
    if search.order == BEST and len(targets) > MAX_TARGETS:
        raise InputError(
            f"--order best: {len(targets)} targets have {_large(math.factorial(len(targets)))} orders; the search "
            f"takes at most {MAX_TARGETS} targets, with {_large(math.factorial(MAX_TARGETS))} orders and already "
            "some minutes; list fewer targets, or list them in a good order"
        )
    if search.times == BEST:
        with input_errors(f"{problem.name}: --times best"):
            problem.limits()
        return
    if times_s is None:
        raise InputError(f"{problem.name}: --times given: needs time_s of every target; add it, or use --times best")
    if problem.latest_s is not None and times_s.max() > problem.latest_s:
        raise InputError(f"{problem.name}: times.latest_s: is before the last time_s; make it later, or remove it")


def _large(number: int) -> str:
    return f"{number:,}".replace(",", " ") if number < 10**15 else f"{float(min(number, 10**300)):.1e}"


def _solve(problem: MultipointProblem, search: Search, progress: Progress) -> Report:
    with input_errors(problem.name):
        best = _best(problem, search, progress)
        path, peak = best.path, max_control(best.path.control, best.path.breaks())
    need_finite(problem, path.cost, best.objective, path.costate_start, path.arrival_states, path.time_gradient)
    bound = problem.max_control_m_s2
    if bound is not None and peak > bound:
        raise InputError(
            f"{problem.name}: max_control_m_s2: the minimum-energy control reaches {peak:.6g} m/s^2, "
            f"{peak / bound - 1.0:.2%} over the bound of {bound:g} m/s^2; raise it, or give the visits more time"
        )
    return Report(problem, search, Scene(problem.axes, problem.tour, best.order, path), best, peak)


def _best(problem: MultipointProblem, search: Search, progress: Progress) -> BestOrder:
    tour, order = problem.tour, tuple(range(len(problem.tour.targets.targets)))
    guesses = [] if problem.times_s is None else [np.sort(problem.times_s)]
    if search.order == BEST and search.times == BEST:
        return best_order(tour, problem.limits(), guesses, progress=progress)
    if search.order == BEST:
        return best_order_of_slots(tour, guesses[0], progress=progress)
    if search.times == BEST:
        timed = best_times(tour, order, problem.limits(), guesses, progress=progress)
        return BestOrder(order, timed.path, timed.objective, 1, timed.evaluations)
    assert problem.times_s is not None
    path = tour.fly(order, problem.times_s)
    return BestOrder(order, path, path.cost + problem.price_per_s * float(problem.times_s[-1]), 1, 1)
