"""Random rendezvous problems, from well inside to the edges of feasibility, flat ones included."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from infoset.arrays import Floats
from infoset.rendezvous.reachability import (
    InadmissibleStartError,
    MotionModel,
    ReachabilityProblem,
    ThrustShape,
    between_periods,
    discretised,
    motion_of,
)
from infoset.rendezvous.relative_motion import EllipticOrbit

from .high_precision import Dense, cone_program

MU_M3_S2 = 3.986004418e14
GAPS = (0.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, -1e-9)


def random_rendezvous(seed: int) -> ReachabilityProblem:
    """A problem that may be infeasible, and whose optimum may not be zero."""
    generator = np.random.default_rng([2021, seed])
    while True:
        problem = _drawn(generator)
        if problem is not None:
            return problem


def _drawn(generator: np.random.Generator) -> ReachabilityProblem | None:
    eccentricity = float(generator.choice([0.0, 0.1, generator.uniform(0.0, 0.9)]))
    perigee_m = float(generator.choice([6.8e6, 7.6e6, 9e6, 2e7, 4.2164e7]))
    orbit = EllipticOrbit.of_size(
        perigee_m / (1.0 - eccentricity),
        eccentricity,
        MU_M3_S2,
        float(generator.uniform(-np.pi, np.pi)),
    )
    periods = int(generator.choice([2, 3, 4, 4, 5, 6, 8, 12, 16]))
    period_s = float(
        generator.choice([60.0, 180.0, np.exp(generator.uniform(np.log(30.0), np.log(600.0)))])
    )
    push = float(generator.choice([0.15, 1.0, 0.01]))
    motion = motion_of(orbit, MotionModel(generator.choice(["frozen", "time-varying"])))
    transition, control = discretised(motion, periods, period_s, push)
    size = float(generator.choice([1.0, 1.0, 1e-3, 1e3]))  # from metres to a thousand kilometres
    initial = size * generator.uniform(-1.0, 1.0, 6) * np.array([3000.0] * 3 + [7.5] * 3)
    control = size * control
    bounds = size * np.array([3000.0] * 3 + [7.5] * 3)
    if generator.random() < 0.3:
        bounds = np.maximum(np.abs(initial) * generator.uniform(1.0, 1.4, 6), 1e-3 * bounds)
    if generator.random() < 0.15:
        initial[[2, 5]] = 0.0
    if generator.random() < 0.1:
        control[:, :, int(generator.integers(3))] = 0.0  # an axis without thrust
    thrust = ThrustShape(generator.choice(["box", "box", "ball"]))
    limit = float(np.exp(generator.uniform(np.log(0.03), np.log(3.0))))
    limits = np.full(3, limit)
    if thrust is ThrustShape.BOX and generator.random() < 0.3:
        limits = limit * generator.uniform(0.1, 1.0, 3)
    normals, offsets = None, None
    if generator.random() < 0.15:
        normals, offsets = _cone(generator, initial, periods)
    between = None
    if generator.random() < 0.25:
        between = between_periods(motion, periods, period_s, push, int(generator.integers(1, 4)))
        between[..., 6:] *= size * np.where(np.abs(control).max(axis=(0, 1)) > 0.0, 1.0, 0.0)
    try:
        problem = ReachabilityProblem(
            transition, control, initial, bounds, limits, thrust, normals, offsets, (), between
        )
    except InadmissibleStartError:
        return None
    if generator.random() < 0.5:
        factor = cone_program(Dense(problem), "bound")[
            0
        ]  # by which all bounds are multiplied that zero is just reached
        gap = float(generator.choice(GAPS))
        if 1e-6 < factor < 1e3:
            problem = replace(problem, control_bounds=problem.control_bounds * factor * (1.0 - gap))
    return problem


def _cone(generator: np.random.Generator, initial: Floats, periods: int) -> tuple[Floats, Floats]:
    """A pyramid about the line to the start, from some period on."""
    along = initial[:3] / np.linalg.norm(initial[:3])
    across = np.linalg.svd(along[None, :])[2][1:]
    turns = 2.0 * np.pi * np.arange(8) / 8
    slope = np.tan(generator.uniform(0.1, 0.8))
    rows = np.outer(np.cos(turns), across[0]) + np.outer(np.sin(turns), across[1]) - slope * along
    apex = -generator.uniform(0.0, 0.1) * initial[:3]
    times = np.arange(periods + 1)[:, None]
    offsets = np.where(times >= int(generator.integers(0, periods)), rows @ apex, np.inf)
    return np.hstack([rows, np.zeros((8, 3))]), offsets
