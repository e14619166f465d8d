"""What several threads may share: scenarios, sets that do not change, and simulations at the same
time.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from infoset import ConvexPolygons, Model, Polytope
from infoset.sim import Scenario, simulate

THREADS = 4
CUBE = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 2.0) for z in (0.0, 3.0)])


def in_threads(work: Callable[[int], Any]) -> list[Any]:
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(work, range(3 * THREADS)))


def test_simulations_at_the_same_time_share_a_scenario(brief: Scenario) -> None:
    settings = replace(brief.information_set, model=Model.GUARANTEED, initial_set=None)
    scenario = replace(brief, information_set=settings)

    def misses(seed: int) -> tuple[float, ...]:
        return tuple(simulate(scenario, 3, seed=seed).miss_m.tolist())

    assert in_threads(misses) == [misses(seed) for seed in range(3 * THREADS)]


@pytest.mark.parametrize(
    "make",
    [
        lambda: ConvexPolygons.from_box([0.0, 0.0], [1.0, 2.0]),
        lambda: Polytope.from_vertices(CUBE),
    ],
)
def test_threads_share_a_set(make: Callable[[], Any]) -> None:
    """Each thread uses values that a set computes at the first use, and adds the set to itself."""
    shared = make()
    dimension = CUBE.shape[1] if isinstance(shared, Polytope) else 2

    def support(number: int, one: Any) -> float:
        direction = np.cos(np.arange(dimension) + number)
        return float(
            np.squeeze(
                one.support_function(direction) + one.minkowski_sum(one).support_function(direction)
            )
        )

    together = in_threads(lambda number: support(number, shared))
    assert together == [support(number, make()) for number in range(3 * THREADS)]
