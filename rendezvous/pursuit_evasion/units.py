"""Nondimensional form of a game, in units of length, time and mass for which mu is one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rendezvous.pursuit_evasion._pair import Craft, Pair
from rendezvous.pursuit_evasion.game import Game, Gravity, Player
from rendezvous.two_body import semi_major_axis_m

LONGEST_REVOLUTIONS = 15.0
"""Default of the longest duration of a game, in revolutions of the pursuer."""


@dataclass(frozen=True)
class Units:
    """Units of a game: the pursuer's semi-major axis and mass at the start, and the time of a radian of a circular
    orbit of that size.
    """

    length_m: float
    time_s: float
    mass_kg: float

    @property
    def speed_m_s(self) -> float:
        """Return the unit of speed."""
        return self.length_m / self.time_s


@dataclass(frozen=True)
class ScaledGame:
    """A nondimensional game; `latest` is its longest duration."""

    units: Units
    pursuer: Craft
    evader: Craft
    radius: float
    latest: float

    @property
    def pair(self) -> Pair:
        """Both sides."""
        return Pair(self.pursuer, self.evader)


def units_of(game: Game) -> Units:
    """Return the units that suit a game."""
    mu = game.gravity.parameter_m3_s2
    length = semi_major_axis_m(np.array(game.pursuer.position_m), np.array(game.pursuer.velocity_m_s), mu)
    return Units(length, float(np.sqrt(length**3 / mu)), game.pursuer.mass_kg)


def scaled_craft(player: Player, gravity: Gravity, units: Units) -> Craft:
    """Return a player as a nondimensional craft."""
    force = units.mass_kg * units.length_m / units.time_s**2
    return Craft(
        start=np.array([*player.position_m, *player.velocity_m_s]) / np.repeat([units.length_m, units.speed_m_s], 3),
        thrust=player.thrust_n / force,
        mass=player.mass_kg / units.mass_kg,
        flow=player.flow_kg_s * units.time_s / units.mass_kg,
        mu=gravity.parameter_m3_s2 * units.time_s**2 / units.length_m**3,
        oblateness=gravity.oblateness_m5_s2 * units.time_s**2 / units.length_m**5,
    )


def scaled_game(game: Game, units: Units | None = None) -> ScaledGame:
    """Return a nondimensional game; without `units` those of `units_of` are used."""
    units = units or units_of(game)
    pursuer, evader = (scaled_craft(player, game.gravity, units) for player in (game.pursuer, game.evader))
    return ScaledGame(units, pursuer, evader, game.capture_radius_m / units.length_m, horizon_s(game) / units.time_s)


def horizon_s(game: Game) -> float:
    """Return the longest duration of a game, s: the time until a player's propellant is spent, or that of the game."""
    longest = game.longest_s
    if not np.isfinite(longest):
        longest = 2.0 * np.pi * LONGEST_REVOLUTIONS * units_of(game).time_s
    # The acceleration of a craft without dry mass is infinite at the end of its propellant.
    burns = [
        player.burn_time_s * (1.0 if player.dry_mass_kg > 0.0 else 0.999) for player in (game.pursuer, game.evader)
    ]
    return float(min(longest, *burns))
