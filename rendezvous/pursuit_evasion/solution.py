"""Solution of a game: its verdict, and the capture."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pursuit_evasion._pair import Node
from infoset.rendezvous.pursuit_evasion.game import Game, Units


class CertificateVerdict(Enum):
    """End of the game."""

    CAPTURED = "captured"
    """The pursuer reaches the evader, at the capture time if both are optimal."""
    ESCAPES = "escapes"
    """The evader keeps away for the longest duration or, if its acceleration is not less than the
    pursuer's, until the pursuer's propellant is spent.
    """
    PROPELLANT_EXHAUSTED = "propellant-exhausted"
    """The evader's propellant is spent before the capture, or the pursuer's, although its
    acceleration is greater.
    """
    BRANCH_NOT_CERTIFIED = "branch-not-certified"
    """The extremals are no saddle from some duration on: nothing is claimed."""


@dataclass(frozen=True)
class PlayerEnd:
    """One player at the end of the game, in the inertial frame.

    `propellant_kg` is the propellant spent. `costate_at_start`, shape (6,), is (lambda_r, lambda_v)
    at t = 0 in the units of the solution, scaled so that the Hamiltonian is one: H_f = 1 of Wang's
    slides, "Optimal control".
    """

    propellant_kg: float
    position_m: Floats
    velocity_m_s: Floats
    costate_at_start: Floats


@dataclass(frozen=True)
class DistanceCurve:
    """The distance l that the evader can keep at each duration T, both of shape (n,).

    Durations rise; that of a change of branch occurs twice, with the distances of both branches.

    `min_curvature`, shape (n,), is the lesser eigenvalue of the Hessian of h_P - h_E + l across nu,
    in units of length: a saddle while it is positive.
    """

    duration_s: Floats
    distance_m: Floats
    min_curvature: Floats


@dataclass(frozen=True)
class Capture:
    """A capture in which both players are extremal.

    Parameters
    ----------
    position_m : ndarray, shape (3,)
        Position of the evader at the capture time.
    direction : ndarray, shape (3,)
        nu, the direction along which both players reach the maximum distance; with a capture
        radius, the direction from the pursuer to the evader. It is that of lambda_rP at the end,
        which equals -lambda_rE.
    closing_speed_m_s : float
        Speed at which the distance falls.
    curvature : ndarray, shape (2,)
        Eigenvalues of the Hessian of h_P - h_E on the plane normal to nu, in units of length,
        ascending; not from the slides.
    residual : float
        Error of the start states and of r_E - r_P = R nu, in units of length and speed: below 1e-9.
    extremal : Node
        The extremal, nondimensional; an initial guess for similar games.
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
class CaptureSolution:
    """A game with its verdict; `units` are those of nondimensional values.

    There is a `capture` if the verdict is `captured`, and also if the branch ends in one that is no
    saddle, with the verdict `branch-not-certified`. The continuation changed `branch_changes`
    times to a branch that keeps the evader farther away. `curve` contains the distances along the
    branch, and `looked_at_s` is the longest duration that was solved; `exhausted` is the player
    without propellant at that time, pursuer or evader.
    """

    game: Game
    units: Units
    verdict: CertificateVerdict
    capture: Capture | None
    branch_changes: int
    curve: DistanceCurve
    looked_at_s: float
    exhausted: str | None = None
