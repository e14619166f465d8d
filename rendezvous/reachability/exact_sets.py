"""Sets of states with all their vertices and facets, by the method of forward and backward sets."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from infoset.polytope import Polytope, cut, intersection, linear_image
from rendezvous.reachability.block_sets import SetKind
from rendezvous.reachability.optimum import BlockOptimum

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Budget:
    """What the exact route may take.

    Parameters
    ----------
    seconds : float
        Time, s, for all blocks together; a step that is expected to go beyond is not begun.
    megabytes : float
        Memory, MB, for one step.
    dimension : int
        Largest block.
    """

    seconds: float = 5.0
    megabytes: float = 500.0
    dimension: int = 6


class TooLargeError(ArithmeticError):
    """The exact route would take more than it may."""


class Meter:
    """What has been spent, and what the next hull is expected to take.

    Parameters
    ----------
    budget : Budget

    Notes
    -----
    Qhull's time for k points in R^d grows as k^(d/2) at worst, and the memory of the check as vertices times facets.
    Both are carried on from the last hull of that dimension, the first one from figures of a slow machine.
    """

    def __init__(self, budget: Budget) -> None:
        self.budget = budget
        self._began_s = perf_counter()
        self._last: dict[int, tuple[int, float, int]] = {}

    def hull(self, points: Floats) -> Polytope:
        """Return the hull of points, unless that is expected to take too much.

        Parameters
        ----------
        points : ndarray, shape (k, n)

        Returns
        -------
        Polytope

        Raises
        ------
        TooLargeError
        """
        count, size = points.shape
        if size > 2:
            self._check(count, size)
        began_s = perf_counter()
        found = Polytope.from_vertices(points)
        self._last[size] = (count, perf_counter() - began_s, len(found.normals))
        return found

    def _check(self, count: int, size: int) -> None:
        power = max(1.0, size / 2.0)
        last_count, last_s, facets = self._last.get(size, (1000, 0.02 * 4.0 ** (size - 2), 50 * 4 ** (size - 2)))
        growth = (count / last_count) ** power
        expected_s = perf_counter() - self._began_s + growth * last_s
        expected_mb = 1e-6 * growth * facets * (8.0 * count + 4.0 * growth * facets)
        if expected_s > self.budget.seconds:
            raise TooLargeError(
                f"a hull of {count} points in R^{size} is expected to bring the exact sets to {expected_s:.3g} s, over "
                f"the {self.budget.seconds:g} s they may take"
            )
        if expected_mb > self.budget.megabytes:
            raise TooLargeError(
                f"a hull of {count} points in R^{size} is expected to take {expected_mb:.3g} MB, over the "
                f"{self.budget.megabytes:g} MB it may take"
            )


class ExactSets:
    """Sets of a block by its exact route.

    Parameters
    ----------
    optimum : BlockOptimum
        Of a block with thrust in a box and constraints at whole periods only.
    meter : Meter

    Raises
    ------
    TooLargeError
        Before it would take more than it may.
    UncertainHullError
        If rounding has the better of a set.

    Notes
    -----
    Shorikov and Goranov (2021): G+(t + 1) = (A G+(t) + B U) cut by X; G-(t) = {x in X: A x in G-(t + 1) - B U}, whose
    half-spaces come without an inverse of A; the tube is what both have in common. Where zero is not reached the tube
    is a face of G+ that rounding would lose; it is then the image of the vertices of the optimal controls.
    """

    def __init__(self, optimum: BlockOptimum, meter: Meter) -> None:
        block = optimum.block
        if block.size > meter.budget.dimension:
            raise TooLargeError(f"a block of {block.size} states is over the {meter.budget.dimension} of exact sets")
        self._optimum, self._meter = optimum, meter
        reach = np.ones(len(block.controls))
        corners = Polytope.box(-reach, reach).vertices if len(reach) else np.zeros((1, 0))
        forward = [Polytope.from_vertices(block.initial[None, :])]
        for t in range(block.periods):
            moved = forward[-1].vertices @ block.transition[t].T
            reached = meter.hull(_sums(moved, corners @ block.control[t].T))
            forward.append(cut(reached, *_finite(block.normals, block.offsets[t + 1])))
        self._forward = forward
        self._tube = self._both_ways(corners) if optimum.reached else self._of_controls()

    def support(self, kind: SetKind, time: int, directions: Floats) -> Floats:
        """Return the support function along directions, shape (k, n), as an array of shape (k,)."""
        return self.polytope(kind, time).support(directions)

    def bounds(self, kind: SetKind) -> Floats:
        """Return the least and greatest of each state at each time, shape (T + 1, n, 2)."""
        sets = self._forward if kind is SetKind.FORWARD else self._tube
        return np.array([np.stack(each.bounds, axis=-1) for each in sets])

    def shadow(self, kind: SetKind, time: int, rows: Floats, tolerance: float = 1e-9) -> Polytope:
        """Return the image of a set under a matrix, shape (d, n), of few rows."""
        return linear_image(self.polytope(kind, time), rows, np.zeros(len(rows)))

    def polytope(self, kind: SetKind, time: int) -> Polytope:
        """Return the set itself."""
        return (self._forward if kind is SetKind.FORWARD else self._tube)[time]

    def _both_ways(self, corners: Floats) -> list[Polytope]:
        block = self._optimum.block
        backward = Polytope.from_vertices(np.zeros((1, block.size)))
        tube = [backward]
        for t in range(block.periods - 1, 0, -1):
            before = self._meter.hull(_sums(backward.vertices, -corners @ block.control[t].T))
            rows, ends = _finite(block.normals, block.offsets[t])
            backward = Polytope.from_halfspaces(
                np.vstack([before.normals @ block.transition[t], rows]),
                np.concatenate([before.offsets, ends]),
                before.across @ block.transition[t],
                before.levels,
                bounded=True,
            )
            tube.append(intersection(self._forward[t], backward))
        return [self._forward[0], *reversed(tube)]

    def _of_controls(self) -> list[Polytope]:
        optimal = self._optimum.optimal
        found = Polytope.from_halfspaces(optimal.rows, optimal.limits, bounded=True) if optimal.size else None
        corners = np.zeros((1, 0)) if found is None else found.vertices
        return [
            self._meter.hull(free + corners @ response.T)
            for free, response in zip(optimal.free, optimal.response, strict=True)
        ]


def _sums(first: Floats, second: Floats) -> Floats:
    return np.asarray((first[:, None, :] + second[None, :, :]).reshape(-1, first.shape[1]))


def _finite(normals: Floats, offsets: Floats) -> tuple[Floats, Floats]:
    held = np.isfinite(offsets)
    return normals[held], offsets[held]
