"""Reachable rendezvous: the paper's case, long horizons, and forward sets compared with two
polytope libraries.

Times are processor times, the shortest of several rounds, so that other work on the machine has
little effect.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from benchmarks.conftest import LINES
from infoset.experiments.reachability.command import Reach
from infoset.experiments.reachability.run import COMMAND
from infoset.geometry.polytope import Polytope
from infoset.rendezvous.reachability import (
    MotionModel,
    ReachabilityProblem,
    SetKind,
    discretised,
    motion_of,
    solve,
)
from infoset.rendezvous.reachability.problem import StateBlock
from infoset.rendezvous.relative_motion import EllipticOrbit
from tests.rendezvous.reachability.rationals import rational_sets

Floats = NDArray[np.float64]
Check = Callable[[str, float, float, str], None]

PAPER_S, LONG_S = 0.5, 2.5
MERGE = 1e-7


def best_s(work: Callable[[], object], rounds: int) -> float:
    times = []
    for _ in range(rounds):
        began = time.process_time()
        work()
        times.append(time.process_time() - began)
    return min(times)


def paper(periods: int) -> ReachabilityProblem:
    """Return the paper's problem of 720 s with another number of periods."""
    orbit = EllipticOrbit.of_size(1e7, 0.1, 3.986004418e14)
    transition, control = discretised(
        motion_of(orbit, MotionModel.FROZEN), periods, 720.0 / periods, 0.15
    )
    start = np.array([-2540.0, -2650.0, 2120.0, 2.0, 3.0, 3.0])
    return ReachabilityProblem(
        transition, control, start, np.array([3000.0] * 3 + [7.5] * 3), np.ones(3)
    )


def test_the_papers_case_with_its_report(under: Check) -> None:
    def work() -> None:
        COMMAND.to_json(COMMAND.report(Reach()))

    under("the paper's case: sets, ranges, six simulated controls", best_s(work, 7), PAPER_S, "s")


def test_axis_supports_of_the_tube_at_64_periods(under: Check) -> None:
    problem = paper(64)
    under(
        "axis supports of the tube at T = 64, with the optimum",
        best_s(lambda: solve(problem).sets.bounds(SetKind.TUBE), 3),
        LONG_S,
        "s",
    )


@pytest.mark.parametrize("periods", [4, 16, 32])
def test_axis_supports_grow_slowly(under: Check, periods: int) -> None:
    problem = paper(periods)
    taken = best_s(lambda: solve(problem).sets.bounds(SetKind.TUBE), 3)
    under(f"axis supports of the tube at T = {periods}", taken, LONG_S, "s")


@pytest.mark.parametrize("periods", [8, 16, 64])
def test_both_routes_end_in_time(under: Check, periods: int) -> None:
    problem = paper(periods)
    began = time.process_time()
    solution = solve(problem)
    taken = time.process_time() - began
    under(f"T = {periods}: {solution.route.value} ({solution.reason[:60]})", taken, 7.0, "s")


def own_step(block: StateBlock, vertices: Floats, period: int) -> Floats:
    hull = Polytope.from_vertices(_moved(block, vertices, period))
    return hull.cut(block.normals, upper=block.offsets[period + 1]).vertices


def cdd_step(block: StateBlock, vertices: Floats, period: int) -> Floats:
    """Compute a forward set with the package `cdd`: generators, half-spaces, then generators of the
    intersection.
    """
    import cdd

    points = _moved(block, vertices, period)
    generators = cdd.matrix_from_array(
        np.column_stack([np.ones(len(points)), points]).tolist(), rep_type=cdd.RepType.GENERATOR
    )
    halves = cdd.copy_inequalities(cdd.polyhedron_from_matrix(generators))
    rows = [*halves.array, *np.column_stack([block.offsets[period + 1], -block.normals]).tolist()]
    both = cdd.matrix_from_array(rows, rep_type=cdd.RepType.INEQUALITY, lin_set=halves.lin_set)
    cut_generators = np.array(cdd.copy_generators(cdd.polyhedron_from_matrix(both)).array)
    return np.asarray(cut_generators[cut_generators[:, 0] == 1.0, 1:])


def polytope_step(block: StateBlock, vertices: Floats, period: int) -> Floats:
    """Compute a forward set with the package `polytope`: its quickhull and its vertex
    enumeration.
    """
    import polytope

    box = polytope.Polytope(block.normals, block.offsets[period + 1])
    extreme = polytope.extreme(polytope.qhull(_moved(block, vertices, period)).intersect(box))
    if extreme is None:
        raise ArithmeticError("the set is empty according to polytope")
    return np.asarray(extreme)


def _moved(block: StateBlock, vertices: Floats, period: int) -> Floats:
    corners = Polytope.from_box(
        -np.ones(len(block.controls)), np.ones(len(block.controls))
    ).vertices
    sums = (vertices @ block.transition[period].T)[:, None] + (corners @ block.control[period].T)[
        None
    ]
    return np.asarray(sums.reshape(-1, block.size))


def essential(vertices: Floats) -> int:
    """Return the number of vertices farther than 1e-7 from the hull of the others, by linear
    programs.
    """
    kept = list(range(len(vertices)))
    size = vertices.shape[1]
    for candidate in range(len(vertices)):
        others = vertices[[index for index in kept if index != candidate]]
        rows = np.block([[others.T, -np.ones((size, 1))], [-others.T, -np.ones((size, 1))]])
        ends = np.concatenate([vertices[candidate], -vertices[candidate]])
        cost = np.concatenate([np.zeros(len(others)), [1.0]])
        sums = np.concatenate([np.ones(len(others)), [0.0]])[None]
        distance = linprog(
            cost, A_ub=rows, b_ub=ends, A_eq=sums, b_eq=[1.0], bounds=(0.0, None), method="highs"
        )
        if distance.fun < MERGE:
            kept.remove(candidate)
    return len(kept)


STEPS: dict[str, tuple[str, Callable[[StateBlock, Floats, int], Floats]]] = {
    "infoset": ("rendezvous", own_step),
    "pycddlib-standalone, floats": ("cdd", cdd_step),
    "polytope": ("polytope", polytope_step),
}


@pytest.mark.parametrize(
    "first", [0, 2], ids=["from the start", "from t = 2, where sets have an interior"]
)
@pytest.mark.parametrize("which", [0, 1], ids=["x-y block, 4-D", "z block, 2-D"])
def test_forward_sets_compared_with_other_libraries(
    pytestconfig: pytest.Config, which: int, first: int
) -> None:
    """List the time of each library, whether it finishes, and whether its vertex counts are
    right.
    """
    block = paper(4).blocks[which]
    exact = [forward.vertices for forward in rational_sets(block)[0]]
    right = [essential(vertices) for vertices in exact[first + 1 :]]
    lines = [
        f"forward sets of {block.size} states, t = {first + 1}..4: essential vertices {right}, "
        f"by exact rationals {[len(vertices) for vertices in exact[first + 1 :]]}"
    ]
    for name, (module, step) in STEPS.items():
        if importlib.util.find_spec(module) is None:
            lines.append(f"    {name}: not installed")
            continue
        vertices = exact[first]
        counts = []
        failure = ""
        began = time.process_time()
        try:
            for period in range(first, 4):
                vertices = step(block, vertices, period)
                counts.append(len(vertices))
        except Exception as error:
            failure = (
                f", does not finish at t = {len(counts) + first + 1}: {type(error).__name__}: "
                f"{str(error)[:50]}"
            )
        taken = time.process_time() - began
        verdict = "right" if counts == right else "not right"
        lines.append(
            f"    {name}: {1e3 * taken:.0f} ms, counts {counts} "
            f"{'' if failure else verdict}{failure}"
        )
        if name == "infoset":
            assert counts == right
    pytestconfig.stash[LINES] += lines
