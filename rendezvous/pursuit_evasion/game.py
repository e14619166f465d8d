"""The game: two craft with thrust, in a planet's gravity, and the distance that counts as capture.

It is that of Wang's slides (Bauman University), after Shen and Casalino, Journal of Guidance, Control, and Dynamics
41(8), 2018, p. 1823.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rendezvous.orbital_elements import perigee_m, semi_major_axis_m

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]

STANDARD_GRAVITY_M_S2 = 9.80665


@dataclass(frozen=True)
class Gravity:
    """Gravity of the planet.

    Parameters
    ----------
    parameter_m3_s2 : float
        Gravitational parameter.
    planet_radius_m : float
        Least allowed distance from the centre; zero for no limit.
    j2 : float
        Second zonal harmonic, about the z axis; zero for a sphere.
    equatorial_radius_m : float
        Radius that J2 refers to.

    Raises
    ------
    ValueError
        If the gravitational parameter is not positive, a radius negative, J2 not small, or without its radius.

    Notes
    -----
    J2 is not in the slides: without it gravity is that of their first equation, -mu r / |r|^3.
    """

    parameter_m3_s2: float
    planet_radius_m: float = 0.0
    j2: float = 0.0
    equatorial_radius_m: float = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        _need(0.0 < self.parameter_m3_s2 < math.inf, "the gravitational parameter must be positive")
        _need(0.0 <= self.planet_radius_m < math.inf, "the radius of the planet must not be negative")
        _need(math.isfinite(self.j2) and abs(self.j2) < 0.1, "J2 must be small: that of the Earth is 1.0826e-3")
        _need(0.0 <= self.equatorial_radius_m < math.inf, "the equatorial radius must not be negative")
        _need(self.j2 == 0.0 or self.equatorial_radius_m > 0.0, "J2 needs the equatorial radius")

    @property
    def oblateness_m5_s2(self) -> float:
        """Return mu J2 R^2 / 2."""
        return 0.5 * self.parameter_m3_s2 * self.j2 * self.equatorial_radius_m**2


@dataclass(frozen=True)
class Player:
    """A craft with full thrust in any direction, until its propellant is spent.

    Parameters
    ----------
    position_m, velocity_m_s : tuple of float
        In an inertial frame whose z axis is the planet's.
    mass_kg, dry_mass_kg : float
        At the start, and without propellant.
    thrust_n : float
        Zero for a craft that coasts.
    specific_impulse_s : float
        Infinite for a craft of constant mass.

    Raises
    ------
    ValueError
        If position or velocity is not finite, mass or specific impulse not positive, the dry mass negative or not below
        the mass, or the thrust negative.

    Notes
    -----
    r' = v, v' = g + (T/m) u, m' = -T/c (Wang's slides, "Modelling of the motion"), c the specific impulse times
    standard gravity: the slides write the former for c.
    """

    position_m: Vector
    velocity_m_s: Vector
    mass_kg: float
    dry_mass_kg: float
    thrust_n: float
    specific_impulse_s: float

    def __post_init__(self) -> None:
        """Check the values."""
        _need(np.isfinite((*self.position_m, *self.velocity_m_s)).all(), "position and velocity must be finite")
        _need(0.0 < self.mass_kg < math.inf, "the mass must be positive")
        _need(0.0 <= self.dry_mass_kg < self.mass_kg, "the dry mass must be at least 0 and below the mass")
        _need(0.0 <= self.thrust_n < math.inf, "the thrust must not be negative")
        _need(self.specific_impulse_s > 0.0, "the specific impulse must be positive")

    @property
    def flow_kg_s(self) -> float:
        """Return the mass flow at full thrust."""
        return self.thrust_n / (self.specific_impulse_s * STANDARD_GRAVITY_M_S2)

    @property
    def burn_time_s(self) -> float:
        """Return the time until the propellant is spent; infinite without mass flow."""
        return (self.mass_kg - self.dry_mass_kg) / self.flow_kg_s if self.flow_kg_s > 0.0 else math.inf

    @property
    def acceleration_m_s2(self) -> float:
        """Return the greatest acceleration of its thrust at the start."""
        return self.thrust_n / self.mass_kg


@dataclass(frozen=True)
class Game:
    """A pursuer that minimises the capture time and an evader that maximises it.

    Parameters
    ----------
    gravity : Gravity
        Gravity of the planet.
    pursuer, evader : Player
        The pursuer's thrust must be positive.
    capture_radius_m : float
        Distance that counts as capture; zero for a point.
    longest_s : float
        Longest duration considered; infinite for 15 revolutions of the pursuer.

    Raises
    ------
    ValueError
        If the pursuer has no thrust, an orbit is not an ellipse or intersects the planet, the distance at the start is
        within the capture radius, or this radius or the longest duration is out of range.

    Notes
    -----
    Wang's slides, "Modelling of the motion": the payoff is t_f, at which r_P = r_E; the capture radius is ours.
    """

    gravity: Gravity
    pursuer: Player
    evader: Player
    capture_radius_m: float = 0.0
    longest_s: float = math.inf

    def __post_init__(self) -> None:
        """Check the values."""
        _need(self.pursuer.thrust_n > 0.0, "the pursuer's thrust must be positive")
        _need(0.0 <= self.capture_radius_m < math.inf, "the capture radius must not be negative")
        _need(self.longest_s > 0.0, "the longest duration must be positive")
        for name, player in (("pursuer", self.pursuer), ("evader", self.evader)):
            state = np.array(player.position_m), np.array(player.velocity_m_s)
            _need(bool(np.any(state[0] != 0.0)), f"the {name} is at the centre of the planet")
            axis = semi_major_axis_m(*state, self.gravity.parameter_m3_s2)
            _need(0.0 < axis < math.inf, f"the {name}'s orbit is not an ellipse: its speed is too high")
            perigee = perigee_m(*state, self.gravity.parameter_m3_s2)
            _need(perigee > 1e-6 * axis, f"the {name} falls along a line through the planet's centre")
            _need(perigee > self.gravity.planet_radius_m, f"the {name}'s orbit reaches into the planet")
        _need(self.distance_m > 0.0, "pursuer and evader are at the same position")
        _need(self.distance_m > self.capture_radius_m, "the evader is within the capture radius at the start")

    @property
    def distance_m(self) -> float:
        """Return the distance of the two at the start."""
        return float(np.linalg.norm(np.subtract(self.evader.position_m, self.pursuer.position_m)))


def _need(holds: bool | np.bool_, message: str) -> None:
    if not holds:
        raise ValueError(message)
