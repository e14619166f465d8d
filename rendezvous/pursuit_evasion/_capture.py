"""A capture from an extremal, and an extremal from one near by."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rendezvous.pursuit_evasion._branch import polish
from rendezvous.pursuit_evasion._pair import Node
from rendezvous.pursuit_evasion.game import Game, Player
from rendezvous.pursuit_evasion.solution import Capture, PlayerEnd
from rendezvous.pursuit_evasion.units import Units, scaled_pair, units_of

Floats = NDArray[np.float64]

LONGEST_REVOLUTIONS = 15.0
"""How long a game is looked at, at most, where it does not say."""


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
    found = polish(
        scaled_pair(game, units),
        guess.vector,
        guess.duration,
        game.capture_radius_m / units.length_m,
        horizon_s(game) / units.time_s,
    )
    return found if found is not None and found.is_saddle and found.closing > 0.0 else None


def horizon_s(game: Game) -> float:
    """Return how long a game can be followed: until a player's propellant is spent, or as long as it says, s.

    Parameters
    ----------
    game : Game

    Returns
    -------
    float
    """
    longest = game.longest_s
    if not np.isfinite(longest):
        longest = 2.0 * np.pi * LONGEST_REVOLUTIONS * units_of(game).time_s
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
