"""A limit of the norm of the controls, replaced by faces of a polytope inside the ball."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull

from infoset.rendezvous._arrays import Floats, Places
from infoset.rendezvous.reachability.independent_parts import independent_parts
from infoset.rendezvous.reachability.outputs import OutputProblem, PathRows, joined

_POLYGON_FACES = 16
"""Faces of the polygon in a plane: it loses 1.9 %, and its vertices are on the axes and halfway."""
_CUBE_STEPS = 3
"""Directions between an axis and the edge of a cube, 15 degrees apart: 218 faces lose 1.6 %."""
_ROUNDING = 1e-9
"""Part by which a box in the polytope is smaller than the largest one: far above rounding, and far
below the printed digits."""


class NormFaces(NamedTuple):
    """The polytope {u: normals u <= distance}, whose farthest vertices have the norm one.

    `normals`, shape (k, m), are unit vectors.
    """

    normals: Floats
    distance: float

    @property
    def loss(self) -> float:
        """The largest part of the ball's radius that the polytope does not contain."""
        return 1.0 - self.distance

    @property
    def box(self) -> float:
        """Half-width of a box in the polytope, to rounding below the largest one."""
        return (1.0 - _ROUNDING) * self.distance / float(np.abs(self.normals).sum(axis=1).max())


def norm_faces(controls: int) -> NormFaces:
    """Return a polytope inside the unit ball of one, two or three controls."""
    if controls == 1:
        return NormFaces(np.array([[1.0], [-1.0]]), 1.0)
    if controls == 2:
        half = np.pi / _POLYGON_FACES
        angles = half * (2 * np.arange(_POLYGON_FACES) + 1)
        return NormFaces(np.column_stack([np.cos(angles), np.sin(angles)]), float(np.cos(half)))

    # Directions to points of a cube's surface. A unit vector is within the largest angle of the
    # cells between them from a direction; the hull's faces are as far from the origin as its
    # cosine.
    steps = np.tan(0.25 * np.pi * np.arange(-_CUBE_STEPS, _CUBE_STEPS + 1) / _CUBE_STEPS)
    points = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    on_surface = np.isclose(np.abs(points).max(axis=1), 1.0)
    normals = points[on_surface]
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return NormFaces(normals, float(-ConvexHull(normals).equations[:, -1].max()))


def acting_controls(problem: OutputProblem) -> Places:
    """Return the controls that a plan uses: not those of parts that rest at their target."""
    parts = independent_parts(problem)
    return np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *(p.controls for p in parts)]))


def with_norm_limit(problem: OutputProblem, limit: float, acting: Places) -> OutputProblem:
    """Return the problem with a limit of the norm of each control, by faces inside the ball.

    Controls that are not `acting` must be zero, and `limit` is also a limit of each control.
    """
    # The norm of a single control is its absolute value, which has its own limit.
    if len(acting) < 2:
        return problem
    faces = norm_faces(len(acting))
    count = len(faces.normals)
    periods = problem.periods
    normals = np.zeros((count, problem.controls))
    normals[:, acting] = faces.normals
    rows = PathRows(
        np.repeat(np.arange(periods), count),
        np.zeros((periods * count, problem.states)),
        np.tile(normals, (periods, 1)),
        np.full(periods * count, -np.inf),
        np.full(periods * count, limit * faces.distance),
    )
    return replace(problem, path=joined(problem.path, rows))
