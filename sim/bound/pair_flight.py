"""Simulation of the two true motions of a lower bound, and the noise that hides the difference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from infoset.arrays import Floats
from infoset.guidance import Strategy
from infoset.guidance.noise import LineOfSight
from infoset.information_set import InformationSetView
from infoset.sensors import BearingSensor, Measurements
from infoset.sim.bound.pair_of_motions import TruthPair
from infoset.sim.draws import Draws
from infoset.sim.engagement import Engagements
from infoset.sim.results import Results
from infoset.sim.scenario import Scenario

STEPS_BEYOND = 2
"""Number of steps after the step with x = 0 for which the target has an acceleration. Chosen: a
flight that needs more raises IndexError. The flights of the pairs of dart-2022 and
asteroid-1997-single need none: they end with 0 as with 8 (measured).
"""


class PairNoise:
    """Measurements that are equal for the two truths of a pair up to a step, and exact after it.

    Engagements 2k and 2k + 1 of a batch are a pair. Both get the same measurements, so a strategy
    that uses nothing else acts alike in both.

    Parameters
    ----------
    last_common_step : int
        Last step in which both truths of a pair are measured at the middle between them.
    wrong_steps : pair of sequences of int
        Steps until then whose image is wrong in the first truth of a pair and exact in the second,
        and the other way round.

    Attributes
    ----------
    max_share : float
        Maximum error so far without these images, in units of its bound; at most 1 if all errors
        are within their bounds.
    wrong_errors : list of ndarray, shape (B,)
        Errors of these images so far, in units of the bound.
    """

    def __init__(
        self,
        last_common_step: int,
        wrong_steps: tuple[Sequence[int], Sequence[int]] = ((), ()),
    ) -> None:
        self.last_common_step = last_common_step
        self.max_share = 0.0
        self.wrong_errors: list[Floats] = []
        wrong_in_first, wrong_in_second = wrong_steps
        self._exact_in = dict.fromkeys(wrong_in_first, 1) | dict.fromkeys(wrong_in_second, 0)

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurements:
        """Measure the same values for each pair, or after the last common step the true ones."""
        if sight.step > self.last_common_step:
            return {name: sensor.true_value(sight) for name, sensor in sight.sensors.items()}

        measured = {}
        for name, sensor in sight.sensors.items():
            true = sensor.true_value(sight)
            is_wrong = name == BearingSensor.name and sight.step in self._exact_in
            if is_wrong:
                # Of each pair of neighbours the first, or the second, engagement.
                of_motion = true[..., self._exact_in[sight.step] :: 2]
                measured[name] = np.repeat(of_motion, 2, axis=-1)
            else:
                measured[name] = middle(true)

            errors = np.abs(sensor.error(sight, measured[name]))
            if is_wrong:
                self.wrong_errors.append(errors.max(axis=0))
            else:
                self.max_share = max(self.max_share, float(errors.max()))
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
    `max_error_share` is the maximum error of a common measurement, in units of its bound, without
    the images of `wrong_errors`, shape (images, 2), which are wrong in one of the two motions.
    """

    results: Results
    impulse_m_s: Floats
    max_error_share: float
    wrong_errors: Floats


def fly_pair(scenario: Scenario, pair: TruthPair, strategy: Strategy | None = None) -> PairFlight:
    """Simulate two motions with the same measurements up to the last common step.

    The default strategy is the scenario's. The pair replaces the noise of the scenario and the
    manoeuvre of its target. For every deterministic strategy, the greater one of the two misses is
    at least `pair.bound_m`.
    """
    acceleration_m_s2 = pair.acceleration_m_s2
    nothing = np.zeros((*acceleration_m_s2.shape[:-1], STEPS_BEYOND))
    target_m_s2 = np.concatenate([acceleration_m_s2, nothing], axis=-1)
    wrong = np.zeros((2, target_m_s2.shape[-1]), dtype=bool)
    for motion, steps in enumerate(pair.wrong_steps):
        wrong[motion, steps] = True
    draws = Draws(
        pair.position_m,
        pair.velocity_m_s,
        {},
        np.zeros_like(target_m_s2),
        wrong_by_noise=wrong,
    )
    wrong_in_first, wrong_in_second = (steps.tolist() for steps in pair.wrong_steps)
    noise = PairNoise(pair.last_common_step, (wrong_in_first, wrong_in_second))

    flight = Engagements(scenario, draws, strategy, noise=noise, target_m_s2=target_m_s2)
    impulses: list[Floats] = []
    while flight.flying:
        flight.advance(lambda step: impulses.append(np.where(step.tracking, step.impulse_m_s, 0.0)))
    return PairFlight(
        results=flight.results(np.arange(2)),
        impulse_m_s=np.array(impulses),
        max_error_share=noise.max_share,
        wrong_errors=np.reshape(noise.wrong_errors, (-1, 2)),
    )
