"""The arrays of a polytope: vertices, facets and their incidence, in scaled coordinates."""

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
    """The arrays of a polytope; see `Polytope`. The module `construction` computes them."""

    points: Floats
    facets: Floats
    equations: Floats
    incidence: Flags
    centre: Floats
    scale: Floats
    exact: Polyhedron | None = None
    """The set in exact integers if it is unbounded; the other arrays are its rounded numbers, with
    a `scale` of one.
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
        """Directions of unit length in which the set is unbounded, shape (r, n).

        They are the rays of its recession cone. A set that contains lines has `lines` too, and one
        direction for each ray between them.
        """
        return rounded_directions(self.exact.directions if self.exact else (), self.space)

    @cached_property
    def lines(self) -> Floats:
        """Independent directions of lines that the set contains, shape (l, n), of unit length."""
        return rounded_directions(self.exact.lines if self.exact else (), self.space)

    @cached_property
    def vertices(self) -> Floats:
        """Vertices, shape (v, n)."""
        return self.centre + self.scale * self.points

    @cached_property
    def normals(self) -> Floats:
        """Normals of the facets, shape (f, n), of unit length, along the affine hull.

        The empty set has one row of zeros.
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
        """Offsets of the facets, shape (f,): normals x <= offsets; -1 for the empty set."""
        if self.is_empty:
            return -np.ones(1)
        if len(self.equations):
            return supports(self.vertices, self.normals)

        rows, limits = half_spaces(self)
        lengths = np.linalg.norm(rows, axis=1)
        rounding = np.abs(self.normals) @ (UNSURE * np.abs(self.vertices).max(axis=0))
        # A division by a power of two is exact, and so is a row without a centre.
        mantissas, _ = np.frexp(lengths)
        is_moved = self.centre.any() & (rows != 0.0)
        is_rounded = (mantissas != 0.5) | is_moved.any(axis=1)
        return np.asarray(limits / lengths + is_rounded * rounding)

    @cached_property
    def across(self) -> Floats:
        """Orthonormal normals of the affine hull, shape (n - dimension, n)."""
        columns = (self.equations[:, :-1] / self.scale).T
        basis, _ = orthonormal(columns, np.zeros((0, len(self.equations))))
        return basis.T

    @cached_property
    def levels(self) -> Floats:
        """Levels of the affine hull, shape (n - dimension,): across x = levels."""
        upper = supports(self.vertices, self.across)
        lower = -supports(self.vertices, -self.across)
        return 0.5 * upper + 0.5 * lower

    @cached_property
    def _steps(self) -> Floats:
        """A basis of the directions of the affine hull, shape (n, d): steps of d coordinates.

        Each step changes one of the own coordinates by its scale.
        """
        own, others = own_and_others(self.equations)
        steps = np.zeros((self.space, self.dimension))
        steps[own] = np.eye(len(own))
        steps[others] = -self.equations[:, own]
        return self.scale[:, None] * steps

    def constraints(self) -> tuple[Floats, Floats]:
        """Return normals, shape (k, n), of unit length, and offsets, shape (k,), of half-spaces.

        The set is {x: normals x <= offsets}. An equation of a flat set gives two rows; an empty set
        is 0 x <= -1.
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
        """Return the minimum and the maximum coordinates, each of shape (n,). O(v n), exact.

        They are infinite where the set is unbounded.
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
    """Return half-spaces rows (x - origin) <= limits: the facets, and two for each equation.

    The set is not empty: the empty set has no facets here.
    """
    sides = np.vstack([one.facets, one.equations, -one.equations])
    rows = sides[:, :-1] / one.scale
    return rows, moved_limits(rows, sides[:, -1], origin - one.centre)


def own_and_others(equations: Floats) -> tuple[Integers, Integers]:
    """Return the indices of the own coordinates of a flat set, and of the others.

    A set of dimension d has d own coordinates. The others, in the order of their equations, are
    functions of them: in `equations`, shape (n - d, n + 1), their columns are the columns of the
    identity. These columns are exact: they are compared without tolerance.
    """
    coefficients = equations[:, :-1]
    units = np.eye(len(coefficients))
    others = np.array([(unit == coefficients.T).all(axis=1).argmax() for unit in units], np.int64)
    own = np.delete(np.arange(coefficients.shape[1]), others)
    return own, others
