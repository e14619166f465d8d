"""The distance from which a camera sees a body, by the magnitude of the body."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from infoset.limits import Checked, Limits

AU_M = 149_597_870_700.0
"""Astronomical unit, m: exact, by the definition of 2012."""
SLOPE = 0.15
"""Slope parameter G of bodies whose parameter is not known: the value of the Minor Planet
Center."""
FACTOR_PER_MAGNITUDE = 10.0**0.2
"""Factor of the distance for a difference of one magnitude: the brightness falls with its
square."""
_CONSTANTS = ((3.332, 0.631, 0.986), (1.862, 1.218, 0.238))
"""A, B and C of the phase functions 1 and 2 (Bowell and others 1989)."""
MAGNITUDE = Limits(minimum=-30.0, maximum=60.0)
"""Limits of a magnitude: from that of the Sun to that of a grain of dust."""
PHASE_DEG = Limits(minimum=0.0, maximum=120.0)
"""Limits of a phase angle, deg: the function was fitted to smaller ones (Bowell and others
1989)."""


@dataclass(frozen=True)
class Magnitude(Checked):
    """Brightness of a body and the limit of a camera.

    Parameters
    ----------
    absolute : float
        Absolute magnitude H, 5 log10(1329 km / (D sqrt(p))) for the diameter D and the geometric
        albedo p.
    limit : float
        Faintest magnitude that the camera sees in an image for guidance.
    phase_deg : float
        Phase angle, between the Sun and the camera seen from the body, deg.
    """

    absolute: Annotated[float, MAGNITUDE]
    limit: Annotated[float, MAGNITUDE]
    phase_deg: Annotated[float, PHASE_DEG]

    def distance_m(self, sun_distance_m: float) -> float:
        """Return the distance of the camera at which the body has the limiting magnitude, m.

        `sun_distance_m` is the distance r of the body from the Sun. The distance d of the camera
        follows from V = H + 5 log10(r d) + q(phase), with V = `limit`, and r and d in au.
        """
        fainter = self.limit - self.absolute - phase_magnitude(self.phase_deg)
        product_au2 = math.pow(FACTOR_PER_MAGNITUDE, fainter)
        return product_au2 / (sun_distance_m / AU_M) * AU_M


def phase_magnitude(phase_deg: float) -> float:
    """Return how much fainter a body is at a phase angle than at zero, magnitudes.

    References
    ----------
    Bowell, Hapke, Domingue, Lumme, Peltoniemi and Harris (1989), Application of photometric models
    to asteroids, in Asteroids II, equations (A4) and (A5), with G = `SLOPE`.
    """
    phase = math.radians(phase_deg)
    tangent = math.tan(0.5 * phase)
    sine = math.sin(phase)
    near = math.exp(-90.56 * tangent**2)
    denominator = 0.119 + 1.341 * sine - 0.754 * sine**2

    functions = []
    for a, b, c in _CONSTANTS:
        of_small_angles = 1.0 - c * sine / denominator
        of_large_angles = math.exp(-a * tangent**b)
        functions.append(near * of_small_angles + (1.0 - near) * of_large_angles)
    first, second = functions
    # A magnitude is -2.5 log10 of the brightness, by definition.
    return -2.5 * math.log10((1.0 - SLOPE) * first + SLOPE * second)
