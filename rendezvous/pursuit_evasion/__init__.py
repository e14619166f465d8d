"""The orbital pursuit-evasion game with free final time: solution, certificate and feedback.

Game and conditions are those of Wang Yanxin's slides (Bauman University), after Shen and Casalino,
Journal of Guidance, Control, and Dynamics 41(8), 2018, p. 1823, with misprints corrected. The
method of solution and the certificate are not from these sources.
"""

from infoset.rendezvous.pursuit_evasion.certificate import Certificate, Deviation, certify
from infoset.rendezvous.pursuit_evasion.feedback import Ended, Observation, PursuitFlight, fly
from infoset.rendezvous.pursuit_evasion.game import Game, Gravity, Player, Units
from infoset.rendezvous.pursuit_evasion.paths import (
    CaptureHistory,
    PathError,
    PlayerHistory,
    history,
    orbital_axes,
)
from infoset.rendezvous.pursuit_evasion.solution import (
    Capture,
    CaptureSolution,
    CertificateVerdict,
    DistanceCurve,
    PlayerEnd,
)
from infoset.rendezvous.pursuit_evasion.solver import solve
from infoset.rendezvous.pursuit_evasion.steering import Policy, RandomSteering, Steering

__all__ = [
    "Capture",
    "CaptureHistory",
    "CaptureSolution",
    "Certificate",
    "CertificateVerdict",
    "Deviation",
    "DistanceCurve",
    "Ended",
    "Game",
    "Gravity",
    "Observation",
    "PathError",
    "Player",
    "PlayerEnd",
    "PlayerHistory",
    "Policy",
    "PursuitFlight",
    "RandomSteering",
    "Steering",
    "Units",
    "certify",
    "fly",
    "history",
    "orbital_axes",
    "solve",
]
