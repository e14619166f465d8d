"""The body: the outline of its silhouette across the approach, and which misses hit it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats
from infoset.limits import NUMBER, POSITIVE, Checked, Limits, Positive

HALVINGS = 200
"""Maximum number of halvings of an interval. They end earlier if no number is between its ends:
after at most 110 in 20 000 random cases. Near a root of zero, a point on the edge, they would go on
to 2^-1074; after 200 the distance, which is proportional to the root, does not change.
"""
TURN = 2.0 * math.pi
"""A full turn, rad: a direction may be counted from -180 or from 0 degrees."""


@dataclass(frozen=True)
class Body(Checked):
    """The size of the object: a sphere, or the ellipse that an ellipsoid shows across the approach.

    Parameters
    ----------
    radius_m : float or None
        Radius of a sphere, m. Either the radius or the semi-axes are given.
    semi_axes_m : tuple of float, or None
        Semi-axes q1 >= q2 of the silhouette, an ellipse across the approach, m. For space only.
    axis_angle_rad : float or None
        Direction of the longer axis of the ellipse, from y toward z, rad. None: it is unknown, and
        drawn in each run.
    aim_m : tuple of float, or None
        Point of the plane across the approach at which guidance aims, relative to the centre of the
        body, along y and z, m; None is the centre. For space only.

    Raises
    ------
    TypeError, ValueError
        If a value is not within its limits, or the aim point is not certainly inside the body.
    """

    radius_m: Positive | None = None
    semi_axes_m: Annotated[tuple[float, ...], POSITIVE] | None = None
    axis_angle_rad: Annotated[float, Limits(minimum=-TURN, maximum=TURN)] | None = None
    aim_m: Annotated[tuple[float, ...], NUMBER] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.radius_m is None) == (self.semi_axes_m is None):
            given = "neither"
            if self.radius_m is not None:
                given = "both; in a copy of a built-in file, delete the line of radius_m"
            raise ValueError(
                f"Body: set either radius_m (sphere) or semi_axes_m (ellipse): got {given}"
            )
        axes = self.semi_axes_m
        if axes is not None and (len(axes) != 2 or axes[0] < axes[1]):
            raise ValueError(
                "Body: semi_axes_m must be two numbers, the longer semi-axis first: got "
                f"{list(axes)!r}"
            )
        if axes is None and self.axis_angle_rad is not None:
            raise ValueError(
                "Body: axis_angle_rad is the direction of an ellipse: set semi_axes_m, or leave "
                "axis_angle_rad out"
            )
        if self.aim_m is None:
            return
        if len(self.aim_m) != 2:
            raise ValueError(f"Body: aim_m must be two numbers: got {list(self.aim_m)!r}")
        if not self.inscribed_m > 0.0:
            raise ValueError(
                f"Body: aim_m must be inside the body for all its possible directions: got "
                f"{list(self.aim_m)!r}"
            )

    @property
    def size_key(self) -> str:
        """Key with the size: `radius_m` or `semi_axes_m`."""
        return "semi_axes_m" if self.radius_m is None else "radius_m"

    @property
    def axes_m(self) -> tuple[float, float]:
        """Semi-axes q1 >= q2 of the silhouette, m; equal for a sphere."""
        if self.semi_axes_m is None:
            radius_m = self.radius_m or 0.0
            return radius_m, radius_m
        longer_m, shorter_m = self.semi_axes_m
        return longer_m, shorter_m

    @property
    def mean_radius_m(self) -> float:
        """Radius of the circle that has the area of the silhouette, m.

        A sphere of this radius stands for the body in the offset of its centre of brightness.
        """
        longer_m, shorter_m = self.axes_m
        return math.sqrt(longer_m * shorter_m)

    @property
    def longest_m(self) -> float:
        """Longer semi-axis of the silhouette, m."""
        return self.axes_m[0]

    @property
    def is_sphere_around_aim(self) -> bool:
        """Whether the body is a sphere with the aim point in its centre: the miss alone decides."""
        return self.semi_axes_m is None and self.aim_m is None

    @property
    def certain_miss_m(self) -> float:
        """Miss from the aim point above which no strategy can be sure of a hit, m.

        A point that is farther from the aim point is outside the body, or for an ellipse in an
        unknown direction outside for some directions.
        """
        longer_m, shorter_m = self.axes_m
        far_m = shorter_m if self.is_turned_by_chance else longer_m
        return far_m + math.hypot(*(self.aim_m or ()))

    @property
    def is_turned_by_chance(self) -> bool:
        """Whether the direction of an ellipse is unknown."""
        return self.semi_axes_m is not None and self.axis_angle_rad is None

    @property
    def inscribed_m(self) -> float:
        """Radius of the largest circle around the aim point that is certainly inside the body, m.

        A miss of at most this radius hits: at `axis_angle_rad`, or for all directions if that is
        None. It is zero if the aim point can be on the edge, and negative if it can be outside.
        """
        longer_m, shorter_m = self.axes_m
        if self.aim_m is None:
            return shorter_m
        aim_m = math.hypot(*self.aim_m)
        if self.axis_angle_rad is None or longer_m == shorter_m:
            return shorter_m - aim_m
        along_m, across_m = _turned(np.array(self.aim_m), self.axis_angle_rad).tolist()
        return _distance_to_edge(abs(along_m), abs(across_m), longer_m, shorter_m)

    @property
    def outer_m(self) -> float:
        """Radius of a circle around the aim point that contains the body, m.

        A greater miss is no hit, whatever the direction of the ellipse is.
        """
        return self.longest_m + math.hypot(*(self.aim_m or ()))

    def contains(self, lateral_m: Floats, axis_angle_rad: ArrayLike | None) -> Flags:
        """Return whether points of the plane across the approach are inside the silhouette.

        Points of the edge are inside.

        Parameters
        ----------
        lateral_m : ndarray, shape (2, B)
            Points (y, z) relative to the centre, m.
        axis_angle_rad : array_like, shape () or (B,), or None
            Direction of the ellipse, rad; None is unknown: the points inside for all directions.
        """
        longer_m, shorter_m = self.axes_m
        if axis_angle_rad is None or longer_m == shorter_m:
            return np.asarray(np.hypot.reduce(lateral_m, axis=0) <= shorter_m)
        along_m, across_m = _turned(lateral_m, axis_angle_rad)
        return np.asarray(np.hypot(along_m / longer_m, across_m / shorter_m) <= 1.0)

    def hit_probability(self, distance_m: ArrayLike) -> Floats:
        """Return the probability that points at these distances from the centre, m, are inside.

        The direction of the ellipse is unknown, and uniform.
        """
        longer_m, shorter_m = self.axes_m
        distance = np.asarray(distance_m, dtype=np.float64)
        is_between = (distance > shorter_m) & (distance < longer_m)
        # A point at the distance r is inside where the sine of its angle to the longer axis is at
        # most q2/r ((q1^2 - r^2)/(q1^2 - q2^2))^(1/2). The divisor 1 is for a circle, which has no
        # distances between.
        between = np.where(is_between, distance, longer_m)
        sine = (shorter_m / between) * np.sqrt(
            np.where(is_between, longer_m**2 - between**2, 0.0)
            / (longer_m**2 - shorter_m**2 or 1.0)
        )
        partial = 2.0 / math.pi * np.arcsin(np.minimum(sine, 1.0))
        return np.where(is_between, partial, distance <= shorter_m)


def _turned(points_m: Floats, angle_rad: ArrayLike) -> Floats:
    """Return the components of points (y, z), shape (2, ...), along and across a direction."""
    y_m, z_m = points_m
    cosine = np.cos(angle_rad)
    sine = np.sin(angle_rad)
    return np.stack([y_m * cosine + z_m * sine, z_m * cosine - y_m * sine])


def _distance_to_edge(along_m: float, across_m: float, longer_m: float, shorter_m: float) -> float:
    """Return the distance of a point of the first quadrant from an ellipse; negative outside.

    `along_m` and `across_m`, zero or positive, are the coordinates of the point along the longer
    and the shorter axis of the ellipse, `longer_m` and `shorter_m` its semi-axes.

    Notes
    -----
    The nearest point of the ellipse is (q1^2 u / (t + q1^2), q2^2 v / (t + q2^2)), with the root t
    > -q2^2 of (q1 u / (t + q1^2))^2 + (q2 v / (t + q2^2))^2 = 1. The left side decreases with t.

    References
    ----------
    Eberly, Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid, section 2.
    """
    is_inside = math.hypot(along_m / longer_m, across_m / shorter_m) < 1.0
    eccentric_m = (longer_m**2 - shorter_m**2) / longer_m
    # On the longer axis the root may be -q2^2, where the second coordinate is 0/0.
    if across_m == 0.0:
        if along_m >= eccentric_m:
            return longer_m - along_m
        nearest = longer_m * (along_m / eccentric_m)
        height_m = shorter_m * math.sqrt(1.0 - (nearest / longer_m) ** 2)
        return math.hypot(nearest - along_m, height_m)

    # At `lower` the second term alone is 1. At `upper` the sum would be 1 with q2 in place of q1 in
    # the denominator; the true sum is not greater.
    lower = shorter_m * (across_m - shorter_m)
    upper = math.hypot(longer_m * along_m, shorter_m * across_m) - shorter_m**2
    for _ in range(HALVINGS):
        middle = 0.5 * (lower + upper)
        if not lower < middle < upper:
            break
        radius = math.hypot(
            longer_m * along_m / (middle + longer_m**2),
            shorter_m * across_m / (middle + shorter_m**2),
        )
        if radius > 1.0:
            lower = middle
        else:
            upper = middle
    root = 0.5 * (lower + upper)
    distance_m = math.hypot(
        along_m * root / (root + longer_m**2), across_m * root / (root + shorter_m**2)
    )
    return distance_m if is_inside else -distance_m
