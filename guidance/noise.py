"""The kinds of measurement noise."""

from __future__ import annotations

from enum import Enum


class NoiseKind(Enum):
    """How nature chooses the measurement errors within their bounds."""

    RANDOM = "random"
    GAME = "game"


class TieRule(Enum):
    """Which extreme the game noise keeps when both are equally bad."""

    UPPER = "upper"
    LOWER = "lower"
    ALTERNATE = "alternate"
    RANDOM = "random"
