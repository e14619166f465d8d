"""Linear relative motion about an orbit: circular, elliptic, frozen, and any A(t).

Motions about a reference orbit are in Hill's axes, which rotate with it: x radially outward, y
across x in the plane of the orbit, to the side of the motion, z along the orbit's normal, so that
z = x cross y. The origin follows the reference orbit.
"""

from infoset.rendezvous.relative_motion.clohessy_wiltshire import ClohessyWiltshire
from infoset.rendezvous.relative_motion.elliptic_orbit import EllipticOrbit
from infoset.rendezvous.relative_motion.hill_state import hill_state
from infoset.rendezvous.relative_motion.linear_motion import HeldMotion, LinearMotion, Segment
from infoset.rendezvous.relative_motion.time_varying import TimeVaryingMotion
from infoset.rendezvous.relative_motion.tschauner_hempel import TschaunerHempel

__all__ = [
    "ClohessyWiltshire",
    "EllipticOrbit",
    "HeldMotion",
    "LinearMotion",
    "Segment",
    "TimeVaryingMotion",
    "TschaunerHempel",
    "hill_state",
]
