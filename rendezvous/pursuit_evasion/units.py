"""Units in which the game is solved: its own length, time and mass, so that mu is one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rendezvous.orbital_elements import semi_major_axis_m
from rendezvous.pursuit_evasion._pair import Pair
from rendezvous.pursuit_evasion._side import Craft
from rendezvous.pursuit_evasion.game import Game, Gravity, Player

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Units:
    """What one is.

    Parameters
    ----------
    length_m : float
        The pursuer's semi-major axis at the start.
    time_s : float
        Of a radian of a circular orbit of that size.
    mass_kg : float
        The pursuer's at the start.
    """

    length_m: float
    time_s: float
    mass_kg: float

    @property
    def speed_m_s(self) -> float:
        """Return the unit of speed."""
        return self.length_m / self.time_s

    def scaled(self, position_m: object, velocity_m_s: object) -> Floats:
        """Return a state in these units.

        Parameters
        ----------
        position_m, velocity_m_s : array_like, shape (3,)

        Returns
        -------
        ndarray, shape (6,)
        """
        position, velocity = np.asarray(position_m, dtype=np.float64), np.asarray(velocity_m_s, dtype=np.float64)
        return np.concatenate([position / self.length_m, velocity / self.speed_m_s])


def units_of(game: Game) -> Units:
    """Return the units that suit a game.

    Parameters
    ----------
    game : Game

    Returns
    -------
    Units
    """
    mu = game.gravity.parameter_m3_s2
    length = semi_major_axis_m(np.array(game.pursuer.position_m), np.array(game.pursuer.velocity_m_s), mu)
    return Units(length, float(np.sqrt(length**3 / mu)), game.pursuer.mass_kg)


def scaled_craft(player: Player, gravity: Gravity, units: Units) -> Craft:
    """Return a player as a nondimensional craft.

    Parameters
    ----------
    player : Player
    gravity : Gravity
    units : Units

    Returns
    -------
    Craft
    """
    force = units.mass_kg * units.length_m / units.time_s**2
    return Craft(
        start=units.scaled(player.position_m, player.velocity_m_s),
        thrust=player.thrust_n / force,
        mass=player.mass_kg / units.mass_kg,
        flow=player.flow_kg_s * units.time_s / units.mass_kg,
        mu=gravity.parameter_m3_s2 * units.time_s**2 / units.length_m**3,
        oblateness=gravity.oblateness_m5_s2 * units.time_s**2 / units.length_m**5,
    )


def scaled_pair(game: Game, units: Units) -> Pair:
    """Return both players as nondimensional sides.

    Parameters
    ----------
    game : Game
    units : Units

    Returns
    -------
    Pair
    """
    return Pair(scaled_craft(game.pursuer, game.gravity, units), scaled_craft(game.evader, game.gravity, units))
