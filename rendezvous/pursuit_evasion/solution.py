"""Solution of a game: its verdict, and the capture."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from rendezvous.pursuit_evasion._pair import Node
from rendezvous.pursuit_evasion.game import Game
from rendezvous.pursuit_evasion.units import Units

Floats = NDArray[np.float64]


class Verdict(Enum):
    """End of the game."""

    CAPTURED = "captured"
    """The pursuer reaches the evader, at the capture time if both are optimal."""
    ESCAPES = "escapes"
    """An evader at least as strong keeps away until the pursuer's propellant is spent, or for the longest duration."""
    PROPELLANT_EXHAUSTED = "propellant-exhausted"
    """A player's propellant is spent before the capture, although the pursuer's acceleration is greater."""
    BRANCH_NOT_CERTIFIED = "branch-not-certified"
    """The extremals are no saddle from some duration on: nothing is claimed."""


class Route(Enum):
    """Method that found an extremal."""

    CONTINUATION = "continuation in the duration"
    SWITCHED = "continuation, with a change to a branch that keeps the evader farther away"
    HOMOTOPY = "homotopy in the evader's thrust"
    LINEAR_GAME = "linear game as a first guess"


@dataclass(frozen=True)
class PlayerEnd:
    """One player at the end of the game.

    Parameters
    ----------
    propellant_kg : float
        Propellant spent.
    position_m, velocity_m_s : ndarray, shape (3,)
        In the inertial frame.
    costate_at_start : ndarray, shape (6,)
        lambda_r, lambda_v at t = 0 in the units of the solution, scaled so that the Hamiltonian is one: H_f = 1 of
        Wang's slides, "Optimal control".
    """

    propellant_kg: float
    position_m: Floats
    velocity_m_s: Floats
    costate_at_start: Floats


@dataclass(frozen=True)
class DistanceCurve:
    """The distance l that the evader can keep at each duration.

    Parameters
    ----------
    duration_s, distance_m : ndarray, shape (n,)
        T, rising, and l.
    least_curvature : ndarray, shape (n,)
        Lesser eigenvalue of the Hessian of h_P - h_E + l across nu, in units of length: a saddle while it is positive.
    """

    duration_s: Floats
    distance_m: Floats
    least_curvature: Floats


@dataclass(frozen=True)
class Capture:
    """A capture in which both players are extremal.

    Parameters
    ----------
    time_s : float
        Capture time.
    position_m : ndarray, shape (3,)
        Position of the evader at that time.
    direction : ndarray, shape (3,)
        nu, the direction along which both players reach the greatest distance; with a capture radius, the direction
        from the pursuer to the evader. It is that of lambda_rP at the end, which equals -lambda_rE.
    closing_speed_m_s : float
        Speed at which the distance falls.
    curvature : ndarray, shape (2,)
        Eigenvalues of the Hessian of h_P - h_E on the plane normal to nu, in units of length, ascending.
    pursuer, evader : PlayerEnd
        Both players.
    residual : float
        Error of the start states and of r_E - r_P = R nu, in units of length and speed: below 1e-9.
    extremal : Node
        The extremal, nondimensional; an initial guess for similar games.

    Notes
    -----
    The conditions at the end of Wang's slides, "Optimal control", after Shen and Casalino (2018); the curvature is not
    from there.
    """

    time_s: float
    position_m: Floats
    direction: Floats
    closing_speed_m_s: float
    curvature: Floats
    pursuer: PlayerEnd
    evader: PlayerEnd
    residual: float
    extremal: Node

    @property
    def is_local_saddle(self) -> bool:
        """Whether closing speed and curvature, with the capture radius, are those of a saddle."""
        return self.extremal.is_saddle and self.closing_speed_m_s > 0.0


@dataclass(frozen=True)
class Solution:
    """A game with its verdict.

    Parameters
    ----------
    game : Game
        The game.
    units : Units
        Units of the nondimensional values.
    verdict : Verdict
        End of the game.
    capture : Capture or None
        Capture, if the verdict is `captured`.
    route : Route
        Continuation, with or without a change of branch.
    curve : DistanceCurve
        Distances along the branch.
    looked_at_s : float
        Longest duration that was solved.
    exhausted : str or None
        Player without propellant at that time: pursuer or evader.
    fallback : Capture or None
        Capture by another route, which is not claimed to be the first one, if the branch is not certified.
    fallback_route : Route or None
        Route of the fallback.
    """

    game: Game
    units: Units
    verdict: Verdict
    capture: Capture | None
    route: Route
    curve: DistanceCurve
    looked_at_s: float
    exhausted: str | None = None
    fallback: Capture | None = None
    fallback_route: Route | None = None
