"""Random numbers of a batch of runs. Each run has its own streams, independent of the batch."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance import NoiseKind, TieRule
from infoset import StateBox
from sim.scenario import Scenario

Floats = NDArray[np.float64]

START, TIE, EXECUTION, TARGET = 0, 3, 5, 6
"""Streams of a run; each kind of sensor has its own as well (`Sensor.stream`)."""
MOST_STEPS = 100_000
"""Greatest number of steps of a flight; all random numbers are drawn before it starts."""


@dataclass(frozen=True)
class Draws:
    """Random numbers of a batch of B engagements.

    Parameters
    ----------
    position_m, velocity_m_s : ndarray, shape (B, 2)
        True relative (z, x) and (V_z, V_x) at t = 0.
    errors : mapping of str to ndarray, shape (B, steps)
        Measurement errors by sensor, uniform in [-1, 1], in units of their bounds.
    tie : ndarray, shape (B, steps)
        Choices between ties, uniform in [-1, 1]; zeros if the scenario does not choose at random.
    execution, target : ndarray, shape (B, steps), or None
        Errors of the impulses in units of their bound, and the target's changes of side, uniform in [-1, 1]; None
        is zero.
    """

    position_m: Floats
    velocity_m_s: Floats
    errors: Mapping[str, Floats]
    tie: Floats
    execution: Floats | None = None
    target: Floats | None = None

    @property
    def steps(self) -> int:
        """Number of steps for which numbers are drawn."""
        return int(self.tie.shape[1])


def draw(scenario: Scenario, runs: Sequence[int], seed: int) -> Draws:
    """Return the random numbers of some runs; run k has the same numbers in every call with the same seed.

    Raises
    ------
    ValueError
        If a flight takes more than `MOST_STEPS` steps.
    """
    steps = greatest_number_of_steps(scenario)
    box = scenario.dispersion
    starts = np.stack([generator(seed, run, START).uniform(size=4) for run in runs])

    def uniform(stream: int) -> Floats:
        return np.stack([generator(seed, run, stream).uniform(-1.0, 1.0, size=steps) for run in runs])

    nothing = np.broadcast_to(0.0, (len(runs), steps))
    lower, upper = corners(box)
    states = lower + (upper - lower) * starts
    return Draws(
        states[:, :2],
        states[:, 2:],
        errors={name: uniform(sensor.stream) for name, sensor in scenario.sensors.items()},
        tie=uniform(TIE) if scenario.noise is NoiseKind.GAME and scenario.tie is TieRule.RANDOM else nothing,
        execution=uniform(EXECUTION) if scenario.thruster.execution_error_relative > 0.0 else None,
        target=uniform(TARGET) if scenario.target is not None else None,
    )


def corners(box: StateBox) -> tuple[Floats, Floats]:
    """Return least and greatest (z, x, V_z, V_x) of a box."""
    intervals = np.array([box.z_m, box.x_m, box.vz_m_s, box.vx_m_s], dtype=np.float64)
    return intervals[:, 0], intervals[:, 1]


def generator(seed: int, run: int, stream: int) -> np.random.Generator:
    """Return the random generator of one stream of one run."""
    return np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(run, stream)))


def greatest_number_of_steps(scenario: Scenario) -> int:
    """Return the number of steps after which every start of the dispersion has passed its closest approach.

    Raises
    ------
    ValueError
        If they are more than `MOST_STEPS`.
    """
    box = scenario.dispersion
    slowest = min(-box.vx_m_s[0], -box.vx_m_s[1])
    steps = box.x_m[1] / (slowest * scenario.set_model.step_s)
    if not 0.0 < steps <= MOST_STEPS * (1.0 + 1e-9):
        raise ValueError(
            f"a flight may take at most {MOST_STEPS} steps: {box.x_m[1]:g} m at {slowest:g} m/s in steps of "
            f"{scenario.set_model.step_s:g} s are {steps:.3g}; lengthen the step"
        )
    return math.ceil(1.01 * box.x_m[1] / (slowest * scenario.set_model.step_s)) + 2
