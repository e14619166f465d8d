"""What is known of a game once it is solved."""

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
    """How the game ends, as far as is known."""

    CAPTURED = "captured"
    """The pursuer reaches the evader, at the capture time if both play their best."""
    ESCAPES = "escapes"
    """An evader at least as strong keeps away until the pursuer's propellant is spent, or for the time looked at."""
    PROPELLANT_EXHAUSTED = "propellant-exhausted"
    """A player's propellant is spent before a capture that the pursuer's greater thrust would come to."""
    BRANCH_NOT_CERTIFIED = "branch-not-certified"
    """The extremals stop being a saddle before any of this: nothing is claimed."""


class Route(Enum):
    """How an extremal was come by."""

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
        Spent.
    position_m, velocity_m_s : ndarray, shape (3,)
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
    position_m : ndarray, shape (3,)
        Of the evader then.
    direction : ndarray, shape (3,)
        nu, toward which both strive; where there is a capture radius, from the pursuer to the evader. Along lambda_rP
        at the end, which is -lambda_rE.
    closing_speed_m_s : float
    curvature : ndarray, shape (2,)
        Eigenvalues of the Hessian of h_P - h_E on the plane normal to nu, in units of length, ascending.
    pursuer, evader : PlayerEnd
    residual : float
        Of the start states and of r_E - r_P = R nu, in units of length and speed: below 1e-9.
    extremal : Node
        The same, nondimensional; a first guess for games near by.

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
    units : Units
    verdict : Verdict
    capture : Capture or None
        Where the verdict is captured.
    route : Route
        Continuation, or that with a change of branch.
    curve : DistanceCurve
    looked_at_s : float
        How long a game was followed.
    exhausted : str or None
        Whose propellant is spent at that time: pursuer or evader.
    fallback : Capture or None
        Where the branch is not certified: what another route found, without a claim.
    fallback_route : Route or None
        Which one.
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
