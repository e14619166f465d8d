"""The game: two craft with thrust, in a planet's gravity, and the distance that counts as capture.

It is the game of Wang's slides (Bauman University), after Shen and Casalino, Journal of Guidance,
Control, and Dynamics 41(8), 2018, p. 1823. Its nondimensional form has units of length, time and
mass for which mu is one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from infoset.rendezvous.pursuit_evasion._pair import ExtremalCraft, Pair
from infoset.rendezvous.two_body import orbit_fault, semi_major_axis_m

Vector = tuple[float, float, float]

STANDARD_GRAVITY_M_S2 = 9.80665
"""Standard acceleration of gravity, exact by definition: CGPM, 1901."""
LONGEST_REVOLUTIONS = 15.0
"""Default of the longest duration of a game, in revolutions of the pursuer; chosen: a day or so in
low orbits."""


@dataclass(frozen=True)
class Gravity:
    """Gravity of the planet.

    `planet_radius_m` is the minimum allowed distance from the centre; zero for no limit. `j2` is
    the second zonal harmonic, about the z axis, which refers to `equatorial_radius_m`; zero for a
    sphere. J2 is not in the slides: without it gravity is that of their first equation, -mu r /
    |r|^3.

    Raises
    ------
    ValueError
        If J2 is without its radius.
    """

    parameter_m3_s2: float
    planet_radius_m: float
    j2: float = 0.0
    equatorial_radius_m: float = 0.0

    def __post_init__(self) -> None:
        _need(self.j2 == 0.0 or self.equatorial_radius_m > 0.0, "J2 needs the equatorial radius")

    @property
    def oblateness_m5_s2(self) -> float:
        """Return mu J2 R^2 / 2."""
        return 0.5 * self.parameter_m3_s2 * self.j2 * self.equatorial_radius_m**2


@dataclass(frozen=True)
class Player:
    """A craft with full thrust in any direction, until its propellant is spent.

    Its state is in an inertial frame whose z axis is the planet's. A craft with no thrust coasts;
    one with an infinite specific impulse has a constant mass.

    r' = v, v' = g + (T/m) u, m' = -T/c (Wang's slides, "Modelling of the motion"), c the specific
    impulse times standard gravity: the slides write the former for c.

    Raises
    ------
    ValueError
        If the dry mass is not below the mass.
    """

    position_m: Vector
    velocity_m_s: Vector
    mass_kg: float
    dry_mass_kg: float
    thrust_n: float
    specific_impulse_s: float

    def __post_init__(self) -> None:
        _need(self.dry_mass_kg < self.mass_kg, "the dry mass must be at least 0 and below the mass")

    @property
    def flow_kg_s(self) -> float:
        """Return the mass flow at full thrust."""
        return self.thrust_n / (self.specific_impulse_s * STANDARD_GRAVITY_M_S2)

    @property
    def burn_time_s(self) -> float:
        """Return the time until the propellant is spent; infinite without mass flow."""
        if not self.flow_kg_s > 0.0:
            return math.inf
        return (self.mass_kg - self.dry_mass_kg) / self.flow_kg_s

    @property
    def acceleration_m_s2(self) -> float:
        """Return the maximum acceleration of its thrust at the start."""
        return self.thrust_n / self.mass_kg


@dataclass(frozen=True)
class Game:
    """A pursuer that minimises the capture time and an evader that maximises it.

    `capture_radius_m` is the distance that counts as capture; zero for a point. `longest_s` is the
    longest duration considered; infinite for 15 revolutions of the pursuer.

    Wang's slides, "Modelling of the motion": the payoff is t_f, at which r_P = r_E; the capture
    radius is ours.

    Raises
    ------
    ValueError
        If the pursuer has no thrust, an orbit is not an ellipse or intersects the planet, or the
        distance at the start is within the capture radius.
    """

    gravity: Gravity
    pursuer: Player
    evader: Player
    capture_radius_m: float = 0.0
    longest_s: float = math.inf

    def __post_init__(self) -> None:
        _need(self.pursuer.thrust_n > 0.0, "the pursuer's thrust must be positive")
        for name, player in (("pursuer", self.pursuer), ("evader", self.evader)):
            state = np.array(player.position_m), np.array(player.velocity_m_s)
            fault = orbit_fault(*state, self.gravity.parameter_m3_s2, self.gravity.planet_radius_m)
            _need(fault is None, f"{name}: {fault}")
        _need(self.distance_m > 0.0, "pursuer and evader are at the same position")
        _need(
            self.distance_m > self.capture_radius_m,
            "the evader is within the capture radius at the start",
        )

    @property
    def distance_m(self) -> float:
        """Return the distance of the two at the start."""
        return float(np.linalg.norm(np.subtract(self.evader.position_m, self.pursuer.position_m)))


def _need(holds: bool | np.bool_, message: str) -> None:
    if not holds:
        raise ValueError(message)


@dataclass(frozen=True)
class Units:
    """Units of a game: the pursuer's semi-major axis and mass at the start, and a time.

    The unit of time is a radian of a circular orbit of that size.
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
    pursuer: ExtremalCraft
    evader: ExtremalCraft
    radius: float
    latest: float

    @property
    def pair(self) -> Pair:
        """Both sides."""
        return Pair(self.pursuer, self.evader)


def units_of(game: Game) -> Units:
    """Return the units that suit a game."""
    mu = game.gravity.parameter_m3_s2
    length = semi_major_axis_m(
        np.array(game.pursuer.position_m), np.array(game.pursuer.velocity_m_s), mu
    )
    return Units(length, float(np.sqrt(length**3 / mu)), game.pursuer.mass_kg)


def scaled_craft(player: Player, gravity: Gravity, units: Units) -> ExtremalCraft:
    """Return a player as a nondimensional craft."""
    force = units.mass_kg * units.length_m / units.time_s**2
    state_units = np.repeat([units.length_m, units.speed_m_s], 3)
    return ExtremalCraft(
        start=np.array([*player.position_m, *player.velocity_m_s]) / state_units,
        thrust=player.thrust_n / force,
        mass=player.mass_kg / units.mass_kg,
        flow=player.flow_kg_s * units.time_s / units.mass_kg,
        mu=gravity.parameter_m3_s2 * units.time_s**2 / units.length_m**3,
        oblateness=gravity.oblateness_m5_s2 * units.time_s**2 / units.length_m**5,
    )


def scaled_game(game: Game, units: Units | None = None) -> ScaledGame:
    """Return a nondimensional game; without `units` those of `units_of` are used."""
    units = units or units_of(game)
    return ScaledGame(
        units,
        pursuer=scaled_craft(game.pursuer, game.gravity, units),
        evader=scaled_craft(game.evader, game.gravity, units),
        radius=game.capture_radius_m / units.length_m,
        latest=horizon_s(game) / units.time_s,
    )


def horizon_s(game: Game) -> float:
    """Return the longest duration of a game, s.

    It ends when a player's propellant is spent, or at the limit of the game.
    """
    longest = game.longest_s
    if not np.isfinite(longest):
        longest = 2.0 * np.pi * LONGEST_REVOLUTIONS * units_of(game).time_s
    # The acceleration of a craft without dry mass is infinite at the end of its propellant: its
    # game ends 0.1 % earlier, as in `feedback`.
    burns = [
        player.burn_time_s * (1.0 if player.dry_mass_kg > 0.0 else 0.999)
        for player in (game.pursuer, game.evader)
    ]
    return float(min(longest, *burns))
