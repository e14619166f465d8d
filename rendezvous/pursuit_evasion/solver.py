"""Solving the game: the branch of extremals from T -> 0, changed for a better one where it folds, and other routes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rendezvous.pursuit_evasion._branch import MOST_WORK, Ending, follow
from rendezvous.pursuit_evasion._capture import capture_of, horizon_s, near
from rendezvous.pursuit_evasion._pair import Node
from rendezvous.pursuit_evasion._scan import greater
from rendezvous.pursuit_evasion.fallbacks import solve_by_homotopy, solve_by_linear_game
from rendezvous.pursuit_evasion.game import Game
from rendezvous.pursuit_evasion.solution import Capture, DistanceCurve, Route, Solution, Verdict
from rendezvous.pursuit_evasion.units import Units, scaled_pair, units_of

Floats = NDArray[np.float64]

_MOST_BRANCHES = 6


def solve(game: Game, *, change_branch: bool = True, all_directions: bool = False) -> Solution:
    """Solve a game without a guess.

    Parameters
    ----------
    game : Game
    change_branch : bool, optional
        Whether to look for another branch where the first one folds; seconds each.
    all_directions : bool, optional
        Whether to look, at the capture too, for a branch that keeps the evader farther away.

    Returns
    -------
    Solution

    Notes
    -----
    The game of Wang's slides, after Shen and Casalino (2018); they shoot forward from a guess, which is not done here.
    At each duration the evader takes the branch with the greatest distance l; capture is the first time at which that
    is the capture radius. 20 to 40 ms a revolution. A capture whose residual is not below 1e-9 is none: the verdict is
    then that the branch is not certified.
    """
    units = units_of(game)
    pair = scaled_pair(game, units)
    radius = game.capture_radius_m / units.length_m
    latest = horizon_s(game) / units.time_s
    first = pair.begin(latest)
    if first is None:
        empty = DistanceCurve(np.zeros(0), np.zeros(0), np.zeros(0))
        return Solution(game, units, Verdict.BRANCH_NOT_CERTIFIED, None, Route.CONTINUATION, empty, 0.0)
    nodes: list[Node] = []
    branch = follow(pair, first, radius, latest)
    changes, work = 0, branch.work
    while branch.ending in (Ending.CAPTURE, Ending.FOLD) and changes < _MOST_BRANCHES:
        if not (change_branch if branch.ending is Ending.FOLD else all_directions):
            break
        better = greater(pair, branch.last)
        if better is None:
            break
        nodes += branch.nodes if branch.ending is Ending.FOLD else branch.nodes[:-1]
        branch = follow(pair, better, radius, latest, MOST_WORK - work)
        changes, work = changes + 1, work + branch.work
    nodes += branch.nodes
    route = Route.SWITCHED if changes else Route.CONTINUATION
    curve = DistanceCurve(
        np.array([node.duration for node in nodes]) * units.time_s,
        np.array([node.distance for node in nodes]) * units.length_m,
        np.array([node.curvature[0] + node.distance for node in nodes]),
    )
    looked_at_s = branch.last.duration * units.time_s
    if branch.ending is Ending.CAPTURE:
        capture = capture_of(game, units, branch.last)
        verdict = Verdict.CAPTURED if capture.is_local_saddle else Verdict.BRANCH_NOT_CERTIFIED
        return Solution(game, units, verdict, capture, route, curve, looked_at_s)
    if branch.ending is Ending.TIME:
        verdict, exhausted = _uncaptured(game)
        return Solution(game, units, verdict, None, route, curve, looked_at_s, exhausted)
    asked = change_branch and branch.ending is Ending.FOLD
    fallback, other = _by_another_route(game) if asked else (None, None)
    return Solution(game, units, Verdict.BRANCH_NOT_CERTIFIED, None, route, curve, looked_at_s, None, fallback, other)


def solve_near(game: Game, units: Units, guess: Node) -> Capture | None:
    """Solve a game near one that is solved.

    Parameters
    ----------
    game : Game
    units : Units
        Of the solved game: the guess is in them.
    guess : Node

    Returns
    -------
    Capture or None
        A local saddle; None where Newton's method does not lead to one whose residual is below 1e-9.

    Notes
    -----
    Two milliseconds. Whether there is an earlier capture is not looked at.
    """
    found = near(game, units, guess)
    return None if found is None else capture_of(game, units, found)


def _by_another_route(game: Game) -> tuple[Capture | None, Route | None]:
    """Return what the first route that leads anywhere finds, and which one it is."""
    for route, solved_by in ((Route.HOMOTOPY, solve_by_homotopy), (Route.LINEAR_GAME, solve_by_linear_game)):
        capture = solved_by(game)
        if capture is not None:
            return capture, route
    return None, None


def _uncaptured(game: Game) -> tuple[Verdict, str | None]:
    """Say why there is no capture by the end of the time looked at."""
    pursuer, evader = game.pursuer, game.evader
    end_s = horizon_s(game)
    slack = 1.0 - 2e-3
    if evader.burn_time_s * slack <= end_s and evader.burn_time_s < pursuer.burn_time_s:
        return Verdict.PROPELLANT_EXHAUSTED, "evader"
    spent = "pursuer" if pursuer.burn_time_s * slack <= end_s else None
    stronger = pursuer.acceleration_m_s2 > evader.acceleration_m_s2
    return (Verdict.PROPELLANT_EXHAUSTED if spent and stronger else Verdict.ESCAPES), spent
