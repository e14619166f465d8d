"""Three long periods in low orbit, between whose impulses constraints may be broken."""

from __future__ import annotations

import numpy as np

from infoset.arrays import Floats
from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous.reachability import AffinePlan, Coasting, OutputProblem, PathLimits
from tests.rendezvous.reachability.arch_rendezvous import corners
from tests.rendezvous.reachability.leo_rendezvous import (
    GRAVITY,
    PERIGEE_M,
    hill,
    orbit_of,
    rendezvous,
)

HOP_S = 900.0
HOPS = 3
RATE = float(np.sqrt(GRAVITY / PERIGEE_M**3))
"""Mean motion, rad/s."""
BELOW = -np.eye(6)[:1]
"""The normal of constraints on the depth below the orbit."""


def hop() -> OutputProblem:
    """Three impulses 15 minutes apart in low orbit, from 1000 m behind to 150 m behind."""
    error = np.repeat([10.0, 0.01], 3)
    return rendezvous(orbit_of(), period_s=HOP_S, limit=2.0, periods=HOPS, error=error)


def limits(offset_m: float, normals: Floats = BELOW, instants: int = 16) -> PathLimits:
    flight = Coasting(orbit_of(), HOP_S, HOPS, 1, instants)
    return PathLimits(flight, normals, np.full((HOPS, len(normals)), offset_m))


def highest(plan: AffinePlan, normals: Floats) -> float:
    """The largest normals . state of 200 flights at 201 instants of each period."""
    problem = plan.problem
    times = np.linspace(0.0, HOP_S, 201)
    inner = np.array([hill(RATE, float(time_s)) for time_s in times])
    largest = -np.inf
    assert isinstance(problem.start, Zonotope)
    for sign in corners(200, 6 + 2 * 3 * HOPS, 4):
        start, execution, noise = np.split(sign, [6, 6 + 3 * HOPS])
        state = problem.start.centre + start @ problem.start.generators
        outputs = list[Floats]()
        controls = list[Floats]()
        for t in range(HOPS):
            outputs.append(state[:3] + noise.reshape(-1, 3)[t])
            controls.append(plan.control(np.array(outputs), np.array(controls)))
            state = state.copy()
            state[3:] += controls[t] + 1e-3 * execution.reshape(-1, 3)[t]
            path = inner @ state
            largest = max(largest, float((path @ normals.T).max()))
            state = path[-1]
    return largest
