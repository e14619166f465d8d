"""The problem of Shorikov and Goranov (2021), and random ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from infoset.rendezvous.reachability import (
    MotionModel,
    ReachabilityProblem,
    ThrustShape,
    discretised,
    motion_of,
)
from infoset.rendezvous.relative_motion import EllipticOrbit

Paper = Callable[..., ReachabilityProblem]

SOLVED = 1e-10
"""The relative tolerance at which the convex programs' solver stops, whatever the order of its
operations.
"""
ORBIT = EllipticOrbit.of_size(1e7, 0.1, 3.986004418e14)


def printed(number: str) -> object:
    """A printed solution, to half a unit of its last digit and the solver's tolerance."""
    value = float(number)
    last_digit = 10.0 ** -len(number.partition(".")[2])
    return pytest.approx(value, abs=0.5 * last_digit + SOLVED * abs(value))


@pytest.fixture(scope="session")
def orbit() -> EllipticOrbit:
    return ORBIT


@pytest.fixture(scope="session")
def paper() -> Paper:
    """The paper's problem, with other models, periods, bounds on the thrust and thrust shapes."""

    def make(
        model: MotionModel = MotionModel.FROZEN,
        periods: int = 4,
        period_s: float = 180.0,
        bound: float = 1.0,
        thrust: ThrustShape = ThrustShape.BOX,
    ) -> ReachabilityProblem:
        transition, control = discretised(motion_of(ORBIT, model), periods, period_s, 0.15)
        return ReachabilityProblem(
            transition,
            control,
            np.array([-2540.0, -2650.0, 2120.0, 2.0, 3.0, 3.0]),
            np.array([3000.0] * 3 + [7.5] * 3),
            np.full(3, bound),
            thrust,
        )

    return make


@pytest.fixture(scope="session")
def random_problem() -> Callable[[int, int], ReachabilityProblem]:
    """A random system of a dimension, sometimes singular or not controllable."""

    def make(seed: int, size: int) -> ReachabilityProblem:
        generator = np.random.default_rng(seed)
        group = int(generator.integers(1, 3)) if size > 3 else int(generator.integers(1, size + 1))
        periods = int(generator.integers(1, 4 if size > 4 else 5))
        transition = np.eye(size) + 0.4 * generator.standard_normal((periods, size, size))
        if seed % 4 == 0:
            transition[0, :, 0] = 0.0
        return ReachabilityProblem(
            transition,
            0.5 * generator.standard_normal((periods, size, group)),
            generator.uniform(-0.5, 0.5, size),
            np.full(size, 2.0) * generator.uniform(1.0, 2.0, size),
            generator.uniform(0.5, 1.5, group),
        )

    return make
