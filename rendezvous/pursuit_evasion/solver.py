"""Solution of the game: the branch of extremals from T -> 0, and a change of branch at folds."""

from __future__ import annotations

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pursuit_evasion._branch import MAX_WORK, Ending, follow
from infoset.rendezvous.pursuit_evasion._pair import Node
from infoset.rendezvous.pursuit_evasion._scan import greater
from infoset.rendezvous.pursuit_evasion.game import Game, Player, Units, horizon_s, scaled_game
from infoset.rendezvous.pursuit_evasion.solution import (
    Capture,
    CaptureSolution,
    CertificateVerdict,
    DistanceCurve,
    PlayerEnd,
)

_MAX_BRANCHES = 6
"""Largest number of changes of branch; chosen: each search takes seconds.

Eight random games have the same captures from 1 to 24; without a change one with a fold has none
(measured).
"""


def solve(
    game: Game, *, change_branch: bool = True, all_directions: bool = False
) -> CaptureSolution:
    """Solve a game without a guess.

    `change_branch` searches for another branch at a fold; each search takes seconds.
    `all_directions` searches also at the capture for a branch that keeps the evader farther away.

    Notes
    -----
    The game is that of Wang's slides, after Shen and Casalino (2018), who shoot forward from a
    guess. At each duration the evader takes the branch with the maximum distance l; the capture is
    the first time at which l is the capture radius. Cost: 10 to 15 ms per revolution. A capture
    whose residual is not below 1e-9 is rejected: the verdict is then that the branch is not
    certified.
    """
    scaled = scaled_game(game)
    units = scaled.units
    pair = scaled.pair
    radius = scaled.radius
    latest = scaled.latest
    first = pair.begin(latest, radius)
    if first is None:
        empty = DistanceCurve(np.zeros(0), np.zeros(0), np.zeros(0))
        return CaptureSolution(
            game, units, CertificateVerdict.BRANCH_NOT_CERTIFIED, None, 0, empty, 0.0
        )

    nodes: list[Node] = []
    branch = follow(pair, first, radius, latest)
    changes = 0
    work = branch.work
    while branch.ending in (Ending.CAPTURE, Ending.FOLD) and changes < _MAX_BRANCHES:
        # The search at a fold and that at a capture have an option each.
        if not (change_branch if branch.ending is Ending.FOLD else all_directions):
            break
        better = greater(pair, branch.last)
        if better is None:
            break
        # A capture from which a better branch goes on is not part of the curve.
        nodes += branch.nodes if branch.ending is Ending.FOLD else branch.nodes[:-1]
        branch = follow(pair, better, radius, latest, MAX_WORK - work)
        changes += 1
        work += branch.work
    nodes += branch.nodes

    curve = DistanceCurve(
        np.array([node.duration for node in nodes]) * units.time_s,
        np.array([node.distance for node in nodes]) * units.length_m,
        np.array([node.curvature[0] + node.distance for node in nodes]),
    )
    looked_at_s = branch.last.duration * units.time_s
    if branch.ending is Ending.CAPTURE:
        capture = _capture(game, units, branch.last)
        verdict = CertificateVerdict.BRANCH_NOT_CERTIFIED
        if capture.is_local_saddle:
            verdict = CertificateVerdict.CAPTURED
        return CaptureSolution(game, units, verdict, capture, changes, curve, looked_at_s)
    if branch.ending is Ending.TIME:
        verdict, exhausted = _uncaptured(game)
        return CaptureSolution(game, units, verdict, None, changes, curve, looked_at_s, exhausted)
    return CaptureSolution(
        game, units, CertificateVerdict.BRANCH_NOT_CERTIFIED, None, changes, curve, looked_at_s
    )


def _capture(game: Game, units: Units, node: Node) -> Capture:
    """Return the capture at the end of an extremal, in SI."""
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
        # An extremal has minus the costate of the evader (`_extremal`).
        evader=end(game.evader, node.evader, -node.costates[1]),
        residual=node.residual,
        extremal=node,
    )


def _uncaptured(game: Game) -> tuple[CertificateVerdict, str | None]:
    """Return the verdict if there is no capture within the examined time."""
    pursuer = game.pursuer
    evader = game.evader
    end_s = horizon_s(game)
    # More than the 0.999 of `horizon_s`, by which a game ends before its propellant.
    slack = 1.0 - 2e-3
    if evader.burn_time_s * slack <= end_s and evader.burn_time_s < pursuer.burn_time_s:
        return CertificateVerdict.PROPELLANT_EXHAUSTED, "evader"
    spent = "pursuer" if pursuer.burn_time_s * slack <= end_s else None
    if spent and pursuer.acceleration_m_s2 > evader.acceleration_m_s2:
        return CertificateVerdict.PROPELLANT_EXHAUSTED, spent
    return CertificateVerdict.ESCAPES, spent
