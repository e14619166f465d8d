"""The arrays of a polytope: vertices, facets and their incidence, in scaled coordinates, and what
follows from them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.double_words import supports
from infoset.geometry.polytope._measures import orthonormal
from infoset.geometry.polytope.errors import EmptyPolytopeError, UnboundedPolytopeError
from infoset.geometry.polytope.polyhedron import Polyhedron, rounded_directions
from infoset.geometry.polytope.scaled_coordinates import moved_limits
from infoset.geometry.tolerances import UNSURE


@dataclass(frozen=True, eq=False)
class PolytopeArrays:
    """The arrays of a polytope; see `Polytope`. Functions of the module `construction` compute
    them.
    """

    points: Floats
    facets: Floats
    equations: Floats
    incidence: Flags
    centre: Floats
    scale: Floats
    exact: Polyhedron | None = None
    """The set in exact integers if it is unbounded; its other arrays are this one, rounded, with
    `scale` one.
    """

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return int(self.points.shape[1])

    @property
    def dimension(self) -> int:
        """Dimension of the affine hull; -1 for the empty set."""
        return int(self.space - len(self.equations)) if len(self.points) else -1

    @property
    def is_empty(self) -> bool:
        """Whether the set is empty."""
        return not len(self.points)

    @property
    def is_bounded(self) -> bool:
        """Whether the set is bounded; the empty set is."""
        return self.exact is None

    @cached_property
    def directions(self) -> Floats:
        """Directions of unit length in which the set is unbounded, shape (r, n): those of its
        recession cone.

        A set that contains lines has `lines` too, and one direction for each ray between them.
        """
        return rounded_directions(self.exact.directions if self.exact else (), self.space)

    @cached_property
    def lines(self) -> Floats:
        """Directions of unit length of lines that the set contains, shape (l, n), linearly
        independent.
        """
        return rounded_directions(self.exact.lines if self.exact else (), self.space)

    @cached_property
    def vertices(self) -> Floats:
        """Vertices, shape (v, n)."""
        return self.centre + self.scale * self.points

    @cached_property
    def normals(self) -> Floats:
        """Normals of the facets, shape (f, n), of unit length, in the directions of the affine
        hull.
        """
        if self.is_empty:
            return np.zeros((1, self.space))
        rows = self.facets[:, :-1] / self.scale
        if len(self.equations):
            columns, gradients = orthonormal(self._steps, rows @ self._steps)
            rows = gradients @ columns.T
        return np.asarray(rows / np.linalg.norm(rows, axis=1)[:, None])

    @cached_property
    def offsets(self) -> Floats:
        """Offsets of the facets, shape (f,): normals x <= offsets."""
        if self.is_empty:
            return -np.ones(1)
        if len(self.equations):
            return supports(self.vertices, self.normals)
        rows, limits = half_spaces(self)
        lengths = np.linalg.norm(rows, axis=1)
        rounding = UNSURE * np.abs(self.vertices).max(axis=0)
        rounded = (np.frexp(lengths)[0] != 0.5) | (self.centre.any() & (rows != 0.0)).any(axis=1)
        return np.asarray(limits / lengths + rounded * (np.abs(self.normals) @ rounding))

    @cached_property
    def across(self) -> Floats:
        """Orthonormal normals of the affine hull, shape (n - dimension, n)."""
        return orthonormal(
            (self.equations[:, :-1] / self.scale).T, np.zeros((0, len(self.equations)))
        )[0].T

    @cached_property
    def levels(self) -> Floats:
        """Levels of the affine hull, shape (n - dimension,): across x = levels."""
        return 0.5 * supports(self.vertices, self.across) - 0.5 * supports(
            self.vertices, -self.across
        )

    @cached_property
    def _steps(self) -> Floats:
        """A basis of the directions of the affine hull, shape (n, d): changes of d coordinates by
        their scales.
        """
        own, others = own_and_others(self.equations)
        steps = np.zeros((self.space, self.dimension))
        steps[own] = np.eye(len(own))
        steps[others] = -self.equations[:, own]
        return self.scale[:, None] * steps

    def constraints(self) -> tuple[Floats, Floats]:
        """Return normals, shape (k, n), of unit length, and offsets, shape (k,): the set is normals
        x <= offsets.

        An equation of a flat set gives two rows; an empty set is 0 x <= -1.
        """
        rows = np.vstack([self.normals, self.across, -self.across])
        return rows, np.concatenate([self.offsets, self.levels, -self.levels])

    def needed(self) -> Self:
        """Return the set itself.

        Raises
        ------
        EmptyPolytopeError
            If it is empty.
        """
        if self.is_empty:
            raise EmptyPolytopeError("the polytope is empty")
        return self

    def bounded(self) -> Self:
        """Return the set itself.

        Raises
        ------
        UnboundedPolytopeError
            If it is unbounded.
        """
        if self.exact is not None:
            raise UnboundedPolytopeError(np.vstack([self.lines, self.directions])[0])
        return self

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Return the minimum and the maximum coordinates, each of shape (n,), infinite where the
        set is unbounded.

        O(v n), exact.
        """
        lower = self.needed().vertices.min(axis=0)
        upper = self.vertices.max(axis=0)
        if self.exact is not None:
            along = np.vstack([self.directions, self.lines, -self.lines])
            lower = np.where((along < 0.0).any(axis=0), -np.inf, lower)
            upper = np.where((along > 0.0).any(axis=0), np.inf, upper)
        return lower, upper

    def __repr__(self) -> str:
        kind = "empty polytope" if self.is_empty else f"polytope of dimension {self.dimension}"
        if not self.is_bounded:
            kind = f"unbounded {kind}"
        return f"<{kind} in R^{self.space}: {len(self.points)} vertices, {len(self.facets)} facets>"


def half_spaces(one: PolytopeArrays, origin: Floats | float = 0.0) -> tuple[Floats, Floats]:
    """Return half-spaces rows (x - origin) <= limits: the facets, and two of each equation."""
    sides = np.vstack([one.facets, one.equations, -one.equations])
    rows = sides[:, :-1] / one.scale
    return rows, moved_limits(rows, sides[:, -1], origin - one.centre)


def own_and_others(equations: Floats) -> tuple[Integers, Integers]:
    """Return d coordinates of which the others are functions, and the others, in the order of their
    equations.

    `equations` has the shape (n - d, n + 1); its columns of the others are those of the identity.
    """
    bound = equations[:, :-1]
    others = np.array(
        [(unit == bound.T).all(axis=1).argmax() for unit in np.eye(len(bound))], np.int64
    )
    return np.delete(np.arange(bound.shape[1]), others), others
