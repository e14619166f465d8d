"""Linear relative motion about an orbit: circular, elliptic, frozen, and any A(t); with frames that name their axes."""

from rendezvous.relative_motion.clohessy_wiltshire import ClohessyWiltshire
from rendezvous.relative_motion.constant import ConstantMotion
from rendezvous.relative_motion.elliptic_orbit import EllipticOrbit
from rendezvous.relative_motion.frames import HILL, ORBITAL, ORBITAL_INTERLEAVED, Axis, Frame, StateOrder
from rendezvous.relative_motion.linear_motion import LinearMotion, Segment
from rendezvous.relative_motion.time_varying import TimeVaryingMotion
from rendezvous.relative_motion.tschauner_hempel import TschaunerHempel

__all__ = [
    "HILL",
    "ORBITAL",
    "ORBITAL_INTERLEAVED",
    "Axis",
    "ClohessyWiltshire",
    "ConstantMotion",
    "EllipticOrbit",
    "Frame",
    "LinearMotion",
    "Segment",
    "StateOrder",
    "TimeVaryingMotion",
    "TschaunerHempel",
]
