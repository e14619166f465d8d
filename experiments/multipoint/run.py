"""`infoset multipoint`: computation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.problem_command import ProblemCommand
from infoset.experiments.common.screen import BeginProgress
from infoset.experiments.multipoint.command import Multipoint
from infoset.experiments.multipoint.file import MultipointProblem
from infoset.experiments.multipoint.page import multipoint_page
from infoset.experiments.multipoint.report import (
    ImposedBound,
    MultipointReport,
    report_json,
    report_lines,
    trajectories,
)
from infoset.rendezvous.bounded_control import BoundTooSmallError
from infoset.rendezvous.multipoint import (
    MAX_TARGETS,
    BestOrder,
    Tour,
    best_order,
    best_order_of_slots,
    best_times,
    bound_visits,
    needed_bound,
)
from infoset.rendezvous.multipoint.segments import LinearPath
from infoset.rendezvous.piecewise import max_control


def solve(
    problem: MultipointProblem, options: Multipoint, begin: BeginProgress
) -> MultipointReport:
    """Return the path of minimum energy, with the order and the times of the options."""
    times = options.times or ("best" if problem.optimise_times else "given")
    count = len(problem.target)
    times_s = problem.times_s
    bound = problem.max_control_m_s2
    if options.order == "best" and count > MAX_TARGETS:
        raise InputError(
            f"--order best: takes at most {MAX_TARGETS} targets, and {problem.name} has {count}"
        )
    if times == "given" and times_s is None:
        raise InputError(
            f"{problem.name}: --times given: needs time_s of every target; add it, or use --times "
            "best"
        )
    if (
        times == "given"
        and problem.latest_s is not None
        and times_s is not None
        and times_s.max() > problem.latest_s
    ):
        raise InputError(
            f"{problem.name}: times.latest_s: is before the last time_s; make it later, or remove "
            "it"
        )

    best = _best(problem, options.order == "best", times == "best", begin("orders and times"))
    peak = max_control(best.path.control, best.path.breaks())
    if bound is None or peak <= bound:
        return MultipointReport(problem, options.order, times, best, peak)

    bounded, least = _within_bound(problem, best, peak, bound, times == "best")
    imposed = ImposedBound(bound, least, best.path.cost, peak)
    bounded_peak = max_control(bounded.path.control, bounded.path.breaks())
    return MultipointReport(problem, options.order, times, bounded, bounded_peak, imposed)


def _within_bound(
    problem: MultipointProblem, best: BestOrder, peak: float, bound: float, times_are_free: bool
) -> tuple[BestOrder, float]:
    """Return the visits with the bound imposed, and the smallest possible bound.

    The latter is the smallest bound at the times of `best`.
    """
    tour = problem.tour
    path = best.path
    key = f"{problem.name}: max_control_m_s2"
    if not (isinstance(tour, Tour) and isinstance(path, LinearPath)):
        raise InputError(
            f"{key}: the minimum-energy control reaches {peak:.6g} m/s^2, {peak / bound - 1.0:.2%} "
            f"over the bound of {bound:g} m/s^2, and under the gravity of one point the bound is "
            "checked but not imposed; raise it, or give the visits more time"
        )
    least = needed_bound(path)
    guesses = [] if problem.times_s is None else [np.sort(problem.times_s)]
    limits = problem.limits() if times_are_free else None
    try:
        return bound_visits(tour, best, bound, limits, guesses), least
    except BoundTooSmallError:
        where = "at the best times without a bound" if times_are_free else "at these times"
        if bound < least:
            raise InputError(
                f"{key}: no control of at most {bound:g} m/s^2 makes the visits {where}; at least "
                f"{least:.6g} m/s^2 is needed; raise it, or give the visits more time"
            ) from None
        # The search with a bound needs some room above the smallest possible one; a thousandth is
        # advised.
        raise InputError(
            f"{key}: {bound:g} m/s^2 is too close to the smallest possible bound {where}, "
            f"{least:.6g} m/s^2; raise it to {1.001 * least:.6g} m/s^2, or give the visits more "
            "time"
        ) from None


def _best(
    problem: MultipointProblem,
    order_is_free: bool,
    times_are_free: bool,
    progress: Callable[[float], None],
) -> BestOrder:
    """Return the best visits; an order or times that are not free are those of the file.

    If the order is free and the times are not, the times of the file are sorted by size. If the
    times are free, those of the file are only a start of the search.
    """
    tour = problem.tour
    order = tuple(range(len(problem.target)))
    guesses = [] if problem.times_s is None else [np.sort(problem.times_s)]
    if order_is_free and times_are_free:
        return best_order(tour, problem.limits(), guesses, progress=progress)
    price_per_s = 0.0 if problem.times is None else problem.times.price_per_s
    if order_is_free:
        # The times are given, and with them the price: it does not change the best order. `solve`
        # has checked that there are times.
        best = best_order_of_slots(tour, guesses[0], progress=progress)
        return replace(best, objective=best.objective + price_per_s * float(guesses[0][-1]))
    if times_are_free:
        timed = best_times(tour, order, problem.limits(), guesses, progress=progress)
        return BestOrder(
            order,
            timed.path,
            timed.objective,
            nodes=1,
            evaluations=timed.evaluations,
            time_search=timed.search,
        )
    assert problem.times_s is not None
    path = tour.fly(order, problem.times_s)
    objective = path.cost + price_per_s * float(problem.times_s[-1])
    return BestOrder(order, path, objective, nodes=1, evaluations=1)


COMMAND = ProblemCommand(
    owner=MultipointProblem,
    solve=solve,
    to_json=report_json,
    to_csv=trajectories,
    lines=report_lines,
    to_html=multipoint_page,
    figures="infoset.experiments.multipoint.figures",
    figure_names=("figure-path", "figure-control"),
)
run = COMMAND.run
