"""Simulation of the two true motions of a lower bound, and the noise that hides the difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from infoset.arrays import Floats
from infoset.guidance import Strategy
from infoset.guidance.noise import LineOfSight
from infoset.information_set import InformationSetView
from infoset.sensors import Measurements
from infoset.sim.bound.pair_of_motions import TruthPair
from infoset.sim.draws import Draws
from infoset.sim.engagement import Engagements
from infoset.sim.results import Results
from infoset.sim.scenario import Scenario

STEPS_BEYOND = 2
"""Maximum number of simulated steps after the step with x = 0. Chosen: a flight that takes longer
raises IndexError.
"""


class PairNoise:
    """Measurements that are equal for the two truths of a pair up to a step, and exact after it.

    Engagements 2k and 2k + 1 of a batch are a pair. Both get the same measurements, so a strategy
    that uses nothing else acts alike in both.

    Parameters
    ----------
    last_common_step : int
        Last step in which both truths of a pair are measured at the middle between them.

    Attributes
    ----------
    max_share : float
        Maximum error so far, in units of its bound; at most 1 if all errors are within their
        bounds.
    """

    def __init__(self, last_common_step: int) -> None:
        self.last_common_step = last_common_step
        self.max_share = 0.0

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurements:
        """Measure the middle of each pair, or after the last common step the true values."""
        if sight.step > self.last_common_step:
            return {name: sensor.true_value(sight) for name, sensor in sight.sensors.items()}

        measured = {}
        for name, sensor in sight.sensors.items():
            measured[name] = middle(sensor.true_value(sight))
            share = float(np.abs(sensor.error(sight, measured[name])).max())
            self.max_share = max(self.max_share, share)
        return measured


def middle(values: Floats) -> Floats:
    """Return the mean of each pair of neighbours, for both of them; shape (..., B), B even."""
    first = values[..., 0::2]
    second = values[..., 1::2]
    return np.repeat(first + 0.5 * (second - first), 2, axis=-1)


@dataclass(frozen=True)
class PairFlight:
    """Outcome of the flight of a pair.

    Impulses have the shape (steps, C, 2): step, lateral axis, motion.
    `max_error_share` is the maximum error of a common measurement, in units of its bound.
    """

    results: Results
    impulse_m_s: Floats
    max_error_share: float


def fly_pair(scenario: Scenario, pair: TruthPair, strategy: Strategy | None = None) -> PairFlight:
    """Simulate two motions with the same measurements up to the last common step.

    The default strategy is the scenario's. The pair replaces the noise of the scenario and the
    manoeuvre of its target. For every deterministic strategy, the greater one of the two misses is
    at least `pair.bound_m`.
    """
    acceleration_m_s2 = pair.acceleration_m_s2
    nothing = np.zeros((*acceleration_m_s2.shape[:-1], STEPS_BEYOND))
    target_m_s2 = np.concatenate([acceleration_m_s2, nothing], axis=-1)
    draws = Draws(pair.position_m, pair.velocity_m_s, {}, np.zeros_like(target_m_s2))
    noise = PairNoise(pair.last_common_step)

    flight = Engagements(scenario, draws, strategy, noise=noise, target_m_s2=target_m_s2)
    impulses: list[Floats] = []
    while flight.flying:
        flight.advance(lambda step: impulses.append(np.where(step.tracking, step.impulse_m_s, 0.0)))
    return PairFlight(flight.results(np.arange(2)), np.array(impulses), noise.max_share)
