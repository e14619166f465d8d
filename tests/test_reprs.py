"""Problems and results at a prompt: a few lines, with their sizes or their main number."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from experiments import load_multipoint, load_pareto, load_pursuit, load_rendezvous
from rendezvous import multipoint, pareto, pursuit_evasion, reachability


def reachable() -> reachability.Solution:
    return reachability.solve(load_rendezvous("rendezvous-2021").problem)


def encounter() -> pareto.EncounterSolution:
    return pareto.solve_encounter(load_pareto("pareto-2008").encounter)


def best_order() -> multipoint.BestOrder:
    problem = load_multipoint("service-2")
    return multipoint.best_order(problem.tour, problem.limits())


def pursuit() -> pursuit_evasion.Solution:
    return pursuit_evasion.solve(load_pursuit("geo-pursuit").game)


SHOWN: list[tuple[Callable[[], object], str]] = [
    (lambda: load_rendezvous("approach-cone").problem, "6 states and 3 controls in 12 periods: thrust in a box"),
    (reachable, "minimum terminal norm"),
    (lambda: reachable().optimal, "a set of dimension 6, minimum terminal norm"),
    (lambda: reachable().sets, "exact sets in blocks of 4, 2 states"),
    (lambda: encounter().encounter, "craft=<3 items>, meeting_s=30"),
    (lambda: encounter().costs[0], "effort_slope=<shape (6, 2)>"),
    (lambda: encounter().plan(0).sample(100), "state=<shape (100, 6)>"),
    (lambda: pareto.sweep_meeting_time(load_pareto("pareto-2008").encounter, [20.0, 30.0]), "points=<shape (2, 2)>"),
    (best_order, "path=Path(...)"),
    (lambda: best_order().path, "motion=ClohessyWiltshire(rate_rad_s=0.00113)"),
    (lambda: load_multipoint("service-5").tour, "targets=DriftingTargets(...)"),
    (lambda: load_multipoint("asteroid-tour").tour, "targets=KeplerTargets(...)"),
    (pursuit, "pursuit: captured, capture after"),
    (lambda: pursuit().game, "capture_radius_m=0"),
    (lambda: pursuit().capture, "pursuer=PlayerEnd(...)"),
    (lambda: pursuit_evasion.certify(pursuit()), "no_conjugate_point=True"),
    (lambda: pursuit_evasion.history(pursuit(), 50).pursuer, "position_m=<shape (50, 3)>"),
    (encounter, "rendezvous of 3 craft at 30 s: group loss"),
]


@pytest.mark.parametrize(("make", "shown"), SHOWN, ids=[shown for _, shown in SHOWN])
def test_a_problem_or_result_is_shown_in_few_lines(make: Callable[[], object], shown: str) -> None:
    text = repr(make())
    assert shown in text
    assert len(text) < 500
    assert len(text.splitlines()) <= 3
