"""Vertices of half-spaces, hulls of points, operations and zonotopes in three to six dimensions,
and times of cddlib.

``python -m benchmarks.polytope_numbers``. Both run in one process, in turn; the shortest of several
rounds counts. cddlib computes with doubles (`pycddlib`, which pip builds from its source with
Debian's `libcdd-dev` and `libgmp-dev`); without it only our times are printed.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from infoset import Polytope, Zonotope

Floats = NDArray[np.float64]

SIZES = ((3, 20), (4, 40), (5, 24), (6, 14), (6, 20))
"""Dimensions and numbers of points; the facets of their hull are the half-spaces."""
ROUNDS = 7
TARGET = 2.0
BOXES = (1, 4, 13)
"""Numbers of rotated boxes in space whose sum is computed: three generators each."""
ZONOTOPE_TARGET_MS = 20.0
"""Time for the facets of the sum of 13 boxes; as a hull of sums it took 8.5 s."""


def main() -> None:
    """Print the times and their ratios."""
    try:
        cdd = importlib.import_module("cdd")
    except ImportError:
        cdd = None
        print("pycddlib is not installed: no ratios")
    print("n  points  facets | H of V, ms  cddlib  ratio | V of H, ms  cddlib  ratio")
    worst = 0.0
    for space, count in SIZES:
        points = np.random.default_rng([space, count]).normal(size=(count, space))
        rows, limits = Polytope.from_vertices(points).constraints()
        line = f"{space}  {count:6}  {len(rows):6}"
        for ours, theirs in (
            (lambda p=points: Polytope.from_vertices(p), lambda p=points: facets_of(cdd, p)),
            (
                lambda r=rows, b=limits: Polytope.from_constraints(r, b),
                lambda r=rows, b=limits: vertices_of(cdd, r, b),
            ),
        ):
            mine, other = in_turn(ours, theirs if cdd else None)
            worst = max(worst, mine / other)
            line += f" | {mine:10.3f}  {other:6.3f}  {mine / other:5.2f}"
        print(line)
    print(f"target: at most {TARGET:g} times cddlib; the greatest ratio is {worst:.2f}")
    print_operations()
    print_zonotopes()


def print_operations() -> None:
    """Print the times of operations on sets of random points."""
    print("n  operation           | ms")
    for space in (3, 4):
        random = np.random.default_rng(space)
        one, two = (
            Polytope.from_vertices(random.normal(size=(20, space)) * size) for size in (1.0, 0.8)
        )
        small = Polytope.from_vertices(0.1 * random.normal(size=(space + 1, space)))
        points = random.normal(size=(1000, space))
        operations: dict[str, Callable[[], object]] = {
            "intersection": partial(one.intersection, two),
            "sum": partial(one.minkowski_sum, small),
            "projection on two": partial(one.project, [0, 1]),
            "difference": partial(one.minkowski_difference, small),
            "contains 1000 points": partial(one.contains, points),
            "Chebyshev centre": one.chebyshev_centre,
        }
        for name, compute in operations.items():
            took, _ = in_turn(compute, None)
            print(f"{space}  {name:20}| {took:8.3f}")


def print_zonotopes() -> None:
    """Print the times for all vertices and facets of sums of rotated boxes in space."""
    print("boxes  facets  vertices | polytope of a zonotope, ms")
    for count in BOXES:
        generators = rotated_boxes(count)
        polytope = zonotope_polytope(generators)
        took, _ = in_turn(partial(zonotope_polytope, generators), None)
        print(f"{count:5}  {len(polytope.normals):6}  {len(polytope.vertices):8} | {took:8.3f}")
    print(f"target: at most {ZONOTOPE_TARGET_MS:g} ms for {BOXES[-1]} boxes")


def zonotope_polytope(generators: Floats) -> Polytope:
    """Return the polytope of a new zonotope, so that nothing is kept from an earlier one."""
    return Zonotope(np.zeros(3), generators).polytope()


def rotated_boxes(count: int) -> Floats:
    """Return the generators of boxes with random sides and directions, shape (3 count, 3)."""
    random = np.random.default_rng(count)
    sides = random.uniform(0.1, 1.0, (count, 3, 1))
    turns = np.linalg.qr(random.normal(size=(count, 3, 3)))[0]
    return np.asarray((sides * turns).reshape(-1, 3))


def in_turn(ours: Callable[[], object], theirs: Callable[[], object] | None) -> tuple[float, float]:
    """Return the shortest processor times, ms, of two functions that are called in turn."""
    best = [np.inf, np.inf]
    for _ in range(ROUNDS + 1):
        for index, compute in enumerate((ours, theirs)):
            if compute is not None:
                start = time.process_time()
                compute()
                best[index] = min(best[index], 1e3 * (time.process_time() - start))
    return best[0], best[1]


def facets_of(cdd: Any, points: Floats) -> object:
    """Return the inequalities of the hull of points, by cddlib."""
    table = np.column_stack([np.ones(len(points)), points]).tolist()
    return cdd.copy_inequalities(
        cdd.polyhedron_from_matrix(cdd.matrix_from_array(table, rep_type=cdd.RepType.GENERATOR))
    )


def vertices_of(cdd: Any, normals: Floats, offsets: Floats) -> object:
    """Return the vertices of {x: normals x <= offsets}, by cddlib."""
    table = np.column_stack([offsets, -normals]).tolist()
    return cdd.copy_generators(
        cdd.polyhedron_from_matrix(cdd.matrix_from_array(table, rep_type=cdd.RepType.INEQUALITY))
    )


if __name__ == "__main__":
    main()
