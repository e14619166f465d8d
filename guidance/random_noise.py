"""Uniform measurement noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from guidance.scripted_noise import ScriptedNoise


@dataclass(frozen=True)
class RandomNoise(ScriptedNoise):
    """Measurements with errors drawn in advance, uniform within their bounds.

    Parameters
    ----------
    errors : mapping of str to ndarray, shape (B, steps)
        Draws by sensor, uniform in [-1, 1]; the error is the draw times the bound.

    References
    ----------
    Kumkov and Patsko (1997), section 7.
    """

    name: ClassVar[str] = "random"
