"""Solving the game: the branch of extremals from T -> 0, changed for a better one where it folds, and other routes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rendezvous.pursuit_evasion._branch import Ending, follow, polish
from rendezvous.pursuit_evasion._pair import FINE, Node
from rendezvous.pursuit_evasion._scan import greater
from rendezvous.pursuit_evasion.game import Game, Player
from rendezvous.pursuit_evasion.solution import Capture, DistanceCurve, PlayerEnd, Route, Solution, Verdict
from rendezvous.pursuit_evasion.units import Units, scaled_pair, units_of

Floats = NDArray[np.float64]

LONGEST_REVOLUTIONS = 50.0
"""How long a game is looked at where neither propellant nor the game itself sets an end."""

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
    At each duration the evader takes the branch with the greatest distance l; capture is the first time at which that
    is the capture radius. 20 to 40 ms a revolution.
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
    changes = 0
    while branch.ending is not Ending.TIME and changes < _MOST_BRANCHES:
        if not (change_branch if branch.ending is Ending.FOLD else all_directions):
            break
        better = greater(pair, branch.last)
        if better is None:
            break
        nodes += branch.nodes if branch.ending is Ending.FOLD else branch.nodes[:-1]
        branch = follow(pair, better, radius, latest)
        changes += 1
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
    return Solution(game, units, Verdict.BRANCH_NOT_CERTIFIED, None, route, curve, looked_at_s)


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
        A local saddle; None where Newton's method does not lead to one.

    Notes
    -----
    Two milliseconds. Whether there is an earlier capture is not looked at.
    """
    found = near(game, units, guess)
    return None if found is None else capture_of(game, units, found)


def near(game: Game, units: Units, guess: Node) -> Node | None:
    """Find the extremal of a game near one that is known, without all that is told of it.

    Parameters
    ----------
    game : Game
    units : Units
    guess : Node

    Returns
    -------
    Node or None
        With positive closing speed and curvature.
    """
    found = scaled_pair(game, units).solve(
        guess.vector,
        guess.duration,
        game.capture_radius_m / units.length_m,
        time_free=True,
        tolerance=FINE,
        latest=horizon_s(game) / units.time_s,
    )
    return found if found is not None and found.is_saddle and found.closing > 0.0 else None


def solve_by_homotopy(game: Game, steps: int = 4) -> Capture | None:
    """Solve a game by raising the evader's thrust from zero.

    Parameters
    ----------
    game : Game
    steps : int, optional
        Of the thrust, to begin with; halved where Newton's method fails.

    Returns
    -------
    Capture or None
        A local saddle, whose time says nothing of earlier captures.
    """
    units = units_of(game)
    still = _with_thrust(game, 0.0)
    latest = horizon_s(still) / units.time_s
    first = scaled_pair(still, units).begin(latest)
    if first is None:
        return None
    branch = follow(scaled_pair(still, units), first, game.capture_radius_m / units.length_m, latest)
    if branch.ending is not Ending.CAPTURE:
        return None
    node, done, step = branch.last, 0.0, 1.0 / steps
    while done < 1.0 and step > 1e-3:
        to = min(1.0, done + step)
        found = near(_with_thrust(game, to), units, node)
        if found is None:
            step *= 0.5
            continue
        node, done = found, to
    if done < 1.0:
        return None
    fine = polish(scaled_pair(game, units), node.vector, node.duration, node.distance, horizon_s(game) / units.time_s)
    return None if fine is None else capture_of(game, units, fine)


def horizon_s(game: Game) -> float:
    """Return how long a game can be followed: until a player's propellant is spent, or as long as it says, s.

    Parameters
    ----------
    game : Game

    Returns
    -------
    float
    """
    longest = min(game.longest_s, 2.0 * np.pi * LONGEST_REVOLUTIONS * units_of(game).time_s)
    # Not to the last drop of a craft without dry mass: its acceleration would be infinite.
    burns = [
        player.burn_time_s * (1.0 if player.dry_mass_kg > 0.0 else 0.999) for player in (game.pursuer, game.evader)
    ]
    return float(min(longest, *burns))


def capture_of(game: Game, units: Units, node: Node) -> Capture:
    """Return an extremal in SI units.

    Parameters
    ----------
    game : Game
    units : Units
    node : Node

    Returns
    -------
    Capture
    """
    time_s = node.duration * units.time_s

    def end(player: Player, state: Floats, costate: Floats) -> PlayerEnd:
        return PlayerEnd(
            propellant_kg=player.flow_kg_s * time_s,
            position_m=state[:3] * units.length_m,
            velocity_m_s=state[3:] * units.speed_m_s,
            costate_at_start=costate / node.closing,
        )

    return Capture(
        time_s=time_s,
        position_m=node.evader[:3] * units.length_m,
        direction=node.nu,
        closing_speed_m_s=node.closing * units.speed_m_s,
        curvature=node.curvature,
        pursuer=end(game.pursuer, node.pursuer, node.costates[0]),
        evader=end(game.evader, node.evader, -node.costates[1]),
        residual=node.residual,
        extremal=node,
    )


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


def _with_thrust(game: Game, share: float) -> Game:
    return replace(game, evader=replace(game.evader, thrust_n=share * game.evader.thrust_n))
