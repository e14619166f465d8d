"""Problem files of kind `pursuit-evasion`; their keys are the fields of `PursuitProblem`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from infoset.limits import Description, Name, NotNegative, Positive
from infoset.rendezvous.pursuit_evasion import Game, Gravity, Player
from infoset.rendezvous.two_body import OrbitalElements

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class State:
    """Position and velocity at the start, in inertial axes, z along the planet's axis."""

    position_m: Vector
    velocity_m_s: Vector


@dataclass(frozen=True, kw_only=True)
class PursuitCraftTable:
    """A craft that starts on an `orbit` or in a `state`; `mass_kg` includes the propellant."""

    mass_kg: Positive
    dry_mass_kg: NotNegative
    thrust_N: NotNegative  # noqa: N815 - the symbol of the unit
    specific_impulse_s: Positive
    orbit: OrbitalElements | None = None
    state: State | None = None

    def __post_init__(self) -> None:
        if self.dry_mass_kg >= self.mass_kg:
            raise ValueError(f"dry_mass_kg: must be less than mass_kg, {self.mass_kg:g}")
        if (self.orbit is None) == (self.state is None):
            raise ValueError("orbit: give either the table orbit or the table state")

    def player(self, gravitational_parameter_m3_s2: float) -> Player:
        """Return the player."""
        if self.state is not None:
            start = self.state.position_m, self.state.velocity_m_s
        else:
            assert self.orbit is not None
            (x, y, z), (vx, vy, vz) = (
                vector.tolist() for vector in self.orbit.state(gravitational_parameter_m3_s2)
            )
            start = (x, y, z), (vx, vy, vz)
        return Player(
            *start, self.mass_kg, self.dry_mass_kg, self.thrust_N, self.specific_impulse_s
        )


@dataclass(frozen=True, kw_only=True)
class PursuitProblem:
    """A pursuer that minimizes the time of capture, and an evader that maximizes it.

    A capture is a distance of `capture_radius_m`, zero for the same point. Games up to `longest_s`
    are considered; None is the default of `Game`.
    """

    kind: ClassVar[str] = "pursuit-evasion"

    name: Name = "pursuit"
    description: Description = ""
    capture_radius_m: NotNegative = 0.0
    longest_s: Positive | None = None
    gravity: Gravity
    pursuer: PursuitCraftTable
    evader: PursuitCraftTable

    def __post_init__(self) -> None:
        with np.errstate(all="ignore"):  # numbers that overflow are no orbit
            _ = self.game  # raises ValueError if it is none

    @cached_property
    def game(self) -> Game:
        """The game that is solved."""
        pursuer, evader = (
            craft.player(self.gravity.parameter_m3_s2) for craft in (self.pursuer, self.evader)
        )
        longest_s = math.inf if self.longest_s is None else self.longest_s
        return Game(self.gravity, pursuer, evader, self.capture_radius_m, longest_s)
