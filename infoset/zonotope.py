"""Zonotopes: boxes, disturbances and initial sets of observers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset.limits import LARGEST, real_values, shown

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, init=False)
class Zonotope:
    """The set of centre + t_1 g_1 + ... + t_m g_m with all -1 <= t_i <= 1.

    Parameters
    ----------
    centre : array_like, shape (n,)
        Point of symmetry.
    generators : array_like, shape (m, n)
        One generator g_i a row; none for a point.

    Raises
    ------
    ValueError
        If the shapes do not agree, or a number is not finite.
    """

    centre: Floats
    generators: Floats

    def __init__(self, centre: ArrayLike, generators: ArrayLike) -> None:
        centre = real_values("centre", centre)
        is_point = np.size(generators) == 0 and centre.ndim == 1
        rows = np.zeros((0, len(centre))) if is_point else real_values("generators", generators)
        if centre.ndim != 1 or not len(centre) or rows.ndim != 2 or rows.shape[1] != len(centre):
            raise ValueError(
                f"centre of shape (n,) and generators of shape (m, n), one a row, are needed: "
                f"got {centre.shape} and {rows.shape}"
            )
        for name, values in (("centre", centre), ("generators", rows)):
            if not (np.abs(values) <= LARGEST).all():
                raise ValueError(f"{name} must be finite, at most {LARGEST:g} in size: got {shown(values)}")
        object.__setattr__(self, "centre", centre)
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
        centre = 0.5 * least + 0.5 * greatest
        # Rounding of the centre must not lose an end.
        half = np.maximum(greatest - centre, centre - least)
        return cls(centre, np.diag(half)[half > 0.0])

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return len(self.centre)
