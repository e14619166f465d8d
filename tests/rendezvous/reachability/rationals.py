"""Sets in exact rational arithmetic, by the Parma Polyhedra Library (pplpy)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from math import lcm

import numpy as np

from infoset.arrays import Floats
from infoset.rendezvous.reachability.problem import StateBlock
from tests.rationals import Fraction

with suppress(ModuleNotFoundError):  # tests that need it are skipped
    import ppl

Rationals = list[Fraction]


@dataclass(frozen=True, eq=False)
class RationalSet:
    """A polytope computed in exact rationals, as floats.

    Parameters
    ----------
    vertices : ndarray, shape (v, n)
        Rounded once.
    facets : int
        Number of inequalities that are not redundant.
    dimension : int
        Of the affine hull.
    bounds : ndarray, shape (n, 2)
        Minimum and maximum coordinates, rounded once.
    """

    vertices: Floats
    facets: int
    dimension: int
    bounds: Floats


def rational_hull(points: Floats) -> RationalSet:
    """Return the exact convex hull of points, shape (k, n), by the double description of PPL."""
    return rounded(polyhedron_of([[Fraction(float(value)) for value in point] for point in points]))


def polyhedron_of(points: list[Rationals]) -> ppl.C_Polyhedron:
    """Return the exact convex hull of points, at least one, as a polyhedron of PPL."""
    system = ppl.Generator_System()
    for point in points:
        numerators, divisor = _whole(point)
        system.insert(ppl.point(_expression(numerators), divisor))
    return ppl.C_Polyhedron(system)


def vertices_of(polyhedron: ppl.C_Polyhedron) -> list[Rationals]:
    """Return the exact vertices of a bounded polyhedron."""
    return [
        [
            Fraction(int(point.coefficient(ppl.Variable(i))), int(point.divisor()))
            for i in range(point.space_dimension())
        ]
        for point in polyhedron.minimized_generators()
    ]


def rounded(polyhedron: ppl.C_Polyhedron) -> RationalSet:
    """Return a bounded polyhedron with its vertices rounded."""
    size = polyhedron.space_dimension()
    if polyhedron.is_empty():
        return RationalSet(np.zeros((0, size)), 0, -1, np.zeros((size, 2)))
    facets = sum(1 for row in polyhedron.minimized_constraints() if row.is_inequality())
    vertices = np.array([[float(value) for value in point] for point in vertices_of(polyhedron)])
    bounds = np.stack([vertices.min(axis=0), vertices.max(axis=0)], axis=-1)
    return RationalSet(vertices, facets, int(polyhedron.affine_dimension()), bounds)


def rational_intersection(normals: Floats, offsets: Floats) -> RationalSet:
    """Return {x: normals x <= offsets}, exactly, for normals of shape (m, n)."""
    polyhedron = ppl.C_Polyhedron(normals.shape[1], "universe")
    _cut(polyhedron, normals, offsets, range(normals.shape[1]))
    return rounded(polyhedron)


def rational_sets(block: StateBlock) -> tuple[list[RationalSet], list[RationalSet]]:
    """Return the exact forward sets of a block and its exact tube to zero, at t = 0..T.

    Thrust is in a box and constraints hold at whole periods; floats are taken as the rationals they
    are.

    Notes
    -----
    Forward: states, controls and next states as one polyhedron, projected on the last. Backward:
    projected on the first. No inverse of A, no rounding; numbers grow by some 50 binary digits a
    period.
    """
    size = block.size
    group = len(block.controls)
    current = ppl.C_Polyhedron(size, "universe")
    _fix(current, block.initial, range(size))
    forward = [current]
    for t in range(block.periods):
        step = _step(block, t, before=size, after=0)
        step.intersection_assign(_widened(forward[t], size, group))
        step.remove_higher_space_dimensions(size)
        _cut(step, block.normals, block.offsets[t + 1], range(size))
        forward.append(step)
    backward = ppl.C_Polyhedron(size, "universe")
    _fix(backward, np.zeros(size), range(size))
    tube = [ppl.C_Polyhedron(backward)]
    for t in range(block.periods - 1, -1, -1):
        step = _step(block, t, before=0, after=size + group)
        step.intersection_assign(_widened(backward, size + group, 0))
        step.remove_higher_space_dimensions(size)
        _cut(step, block.normals, block.offsets[t], range(size))
        backward = step
        both = ppl.C_Polyhedron(step)
        both.intersection_assign(forward[t])
        tube.append(both)
    return [rounded(polyhedron) for polyhedron in forward], [
        rounded(polyhedron) for polyhedron in reversed(tube)
    ]


def _step(block: StateBlock, period: int, before: int, after: int) -> ppl.C_Polyhedron:
    """The step of a period as a polyhedron, with states unconstrained.

    The coordinates are states (first index `before`), controls and next states (`after`).
    """
    size = block.size
    group = len(block.controls)
    polyhedron = ppl.C_Polyhedron(2 * size + group, "universe")
    for j in range(group):
        polyhedron.add_constraint(ppl.Variable(before + size + j) <= 1)
        polyhedron.add_constraint(ppl.Variable(before + size + j) >= -1)
    for i in range(size):
        row = np.concatenate([block.transition[period, i], block.control[period, i]])
        numerators, divisor = _whole([Fraction(float(value)) for value in row])
        polyhedron.add_constraint(
            divisor * ppl.Variable(after + i) == _expression(numerators, before)
        )
    return polyhedron


def _widened(inner: ppl.C_Polyhedron, before: int, after: int) -> ppl.C_Polyhedron:
    """The set with more, free coordinates before and after its own."""
    polyhedron = ppl.C_Polyhedron(before, "universe")
    polyhedron.concatenate_assign(inner)
    polyhedron.add_space_dimensions_and_embed(after)
    return polyhedron


def _cut(polyhedron: ppl.C_Polyhedron, normals: Floats, offsets: Floats, axes: range) -> None:
    for normal, offset in zip(normals, offsets, strict=True):
        if np.isfinite(offset):
            numerators, _ = _whole([Fraction(float(value)) for value in (*normal, offset)])
            total = sum(
                (n * ppl.Variable(axis) for n, axis in zip(numerators, axes, strict=False)), start=0
            )
            polyhedron.add_constraint(total <= numerators[-1])


def _fix(polyhedron: ppl.C_Polyhedron, state: Floats, axes: range) -> None:
    for value, axis in zip(state, axes, strict=True):
        exact = Fraction(float(value))
        polyhedron.add_constraint(exact.denominator * ppl.Variable(axis) == exact.numerator)


def _whole(values: Rationals) -> tuple[list[int], int]:
    """Numerators over a common denominator."""
    divisor = lcm(*(value.denominator for value in values))
    return [int(value * divisor) for value in values], divisor


def _expression(numerators: list[int], first: int = 0) -> ppl.Linear_Expression:
    terms = (n * ppl.Variable(first + axis) for axis, n in enumerate(numerators))
    return sum(terms, start=ppl.Linear_Expression(0))
