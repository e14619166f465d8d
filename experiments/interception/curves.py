"""The four curves of the statistical experiment, numbered as in the paper's figure 4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from guidance import NoiseKind
from sim import Results, Scenario


@dataclass(frozen=True)
class Curve:
    """Curve of the experiment: 1 random noise, 2 random with range sensor, 3 game noise, 4 game with range sensor."""

    number: int
    noise: NoiseKind
    range_sensor: bool
    results: Results


def curve_scenarios(scenario: Scenario) -> Sequence[tuple[int, Scenario]]:
    """Return number and scenario of each curve; without a range sensor only curves 1 and 3."""
    numbered = (
        (1, replace(scenario, noise=NoiseKind.RANDOM, range_sensor=None)),
        (2, replace(scenario, noise=NoiseKind.RANDOM)),
        (3, replace(scenario, noise=NoiseKind.GAME, range_sensor=None)),
        (4, replace(scenario, noise=NoiseKind.GAME)),
    )
    return [(number, flown) for number, flown in numbered if scenario.range_sensor is not None or number in (1, 3)]
