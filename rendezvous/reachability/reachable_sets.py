"""Forward sets and the tube of a problem, whatever blocks it falls into and whatever is known of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoset.polytope import Polytope
from rendezvous.reachability.block_sets import BlockSets, SetKind
from rendezvous.reachability.blocks import Block
from rendezvous.reachability.problem import ReachabilityProblem

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SetCounts:
    """How many vertices and facets a set has, and of which dimension it is.

    Parameters
    ----------
    vertices : int
        Those nearer to each other than 1e-7 of the bounds count once.
    facets : int
    dimension : int
    """

    vertices: int
    facets: int
    dimension: int


@dataclass(frozen=True, eq=False)
class ReachableSets:
    """Sets of states at t = 0..T, in the units of the problem.

    Parameters
    ----------
    problem : ReachabilityProblem
    blocks : tuple of Block
    parts : tuple of BlockSets
        One a block.
    """

    problem: ReachabilityProblem
    blocks: tuple[Block, ...]
    parts: tuple[BlockSets, ...]

    def bounds(self, kind: SetKind) -> Floats:
        """Return the least and greatest of each state at each time.

        Parameters
        ----------
        kind : SetKind

        Returns
        -------
        ndarray, shape (T + 1, n, 2)
        """
        result = np.zeros((self.problem.periods + 1, self.problem.states, 2))
        for block, part in zip(self.blocks, self.parts, strict=True):
            result[:, block.states] = part.bounds(kind) * block.scale[:, None]
        return result

    def support(self, kind: SetKind, time: int, directions: Floats) -> Floats:
        """Return the support function of a set, in the units of direction . x.

        Parameters
        ----------
        kind : SetKind
        time : int
            From 0 to T.
        directions : ndarray, shape (k, n)
            In the units of the problem: what is maximised is direction . x.

        Returns
        -------
        ndarray, shape (k,)
        """
        total = np.zeros(len(directions))
        for block, part in zip(self.blocks, self.parts, strict=True):
            total += part.support(kind, time, directions[:, block.states] * block.scale)
        return total

    def counts(self, kind: SetKind, time: int) -> SetCounts | None:
        """Return the counts of a set, or None where it is known by programs only.

        Parameters
        ----------
        kind : SetKind
        time : int

        Returns
        -------
        SetCounts or None
        """
        known = [part.polytope(kind, time) for part in self.parts]
        sets = [each for each in known if each is not None]
        if len(sets) < len(known):
            return None
        return SetCounts(
            int(np.prod([each.essential_vertices() for each in sets])),
            sum(len(each.normals) for each in sets),
            sum(each.dimension for each in sets),
        )

    def shadow(self, kind: SetKind, time: int, axes: Sequence[int], tolerance: float = 1e-9) -> Floats:
        """Return the vertices of the projection of a set on some states.

        Parameters
        ----------
        kind : SetKind
        time : int
        axes : sequence of int
            Two or three states, by their places.
        tolerance : float
            By how much of its size the projection may be short of a set that is known by programs only.

        Returns
        -------
        ndarray, shape (v, len(axes))
            In no order.
        """
        wanted = list(axes)
        order: list[int] = []
        points = np.zeros((1, 0))
        for block, part in zip(self.blocks, self.parts, strict=True):
            mine = [int(np.flatnonzero(block.states == axis)[0]) for axis in wanted if axis in block.states]
            if not mine:
                continue
            order += [int(block.states[place]) for place in mine]
            found: Polytope = part.shadow(kind, time, np.eye(block.size)[mine], tolerance)
            scaled = found.vertices * block.scale[mine]
            points = np.hstack([np.repeat(points, len(scaled), axis=0), np.tile(scaled, (len(points), 1))])
        return points[:, [order.index(axis) for axis in wanted]]
