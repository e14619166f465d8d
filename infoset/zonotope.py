"""Zonotopes: boxes, disturbances and initial sets of observers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset.limits import LARGEST, real_values, shown

Floats = NDArray[np.float64]

MOST_GENERATORS = 12
"""Generators of a zonotope whose vertices are wanted: 2^generators points."""


@dataclass(frozen=True, eq=False, init=False)
class Zonotope:
    """The set of center + t_1 g_1 + ... + t_m g_m with all -1 <= t_i <= 1.

    Parameters
    ----------
    center : array_like, shape (n,)
        Point of symmetry.
    generators : array_like, shape (m, n)
        One generator g_i a row; none for a point.

    Raises
    ------
    ValueError
        If the shapes do not agree, or a number is not finite.
    """

    center: Floats
    generators: Floats

    def __init__(self, center: ArrayLike, generators: ArrayLike) -> None:
        center = real_values("center", center)
        is_point = np.size(generators) == 0 and center.ndim == 1
        rows = np.zeros((0, len(center))) if is_point else real_values("generators", generators)
        if center.ndim != 1 or not len(center) or rows.ndim != 2 or rows.shape[1] != len(center):
            raise ValueError(
                f"center of shape (n,) and generators of shape (m, n), one a row, are needed: "
                f"got {center.shape} and {rows.shape}"
            )
        for name, values in (("center", center), ("generators", rows)):
            if not (np.abs(values) <= LARGEST).all():
                raise ValueError(f"{name} must be finite, at most {LARGEST:g} in size: got {shown(values)}")
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "generators", rows)

    @classmethod
    def box(cls, lower: ArrayLike, upper: ArrayLike) -> Zonotope:
        """Return {x: lower <= x <= upper}; equal ends give a flat box.

        Raises
        ------
        ValueError
            If `lower` exceeds `upper` in a coordinate.
        """
        least, greatest = real_values("lower", lower), real_values("upper", upper)
        if least.shape != greatest.shape or least.ndim != 1:
            raise ValueError(f"lower and upper of shape (n,) are needed: got {least.shape} and {greatest.shape}")
        if not (least <= greatest).all():
            raise ValueError(f"lower must not exceed upper: got {shown(least)} and {shown(greatest)}")
        center = 0.5 * least + 0.5 * greatest
        # Rounding of the center must not lose an end.
        half = np.maximum(greatest - center, center - least)
        return cls(center, np.diag(half)[half > 0.0])

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return len(self.center)

    def points(self) -> Floats:
        """Return center plus all sums of generators with both signs, shape (2^m, n); the vertices are among them.

        Raises
        ------
        ValueError
            If there are more than `MOST_GENERATORS` generators.
        """
        if len(self.generators) > MOST_GENERATORS:
            raise ValueError(f"a zonotope of at most {MOST_GENERATORS} generators is needed here")
        signs = np.array(list(product((-1.0, 1.0), repeat=len(self.generators))))
        return np.asarray(self.center + signs.reshape(-1, len(self.generators)) @ self.generators)
