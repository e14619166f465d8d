"""Storage of zonotopes: the centre and the generators."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Floats
from infoset.geometry._set_arguments import box_ends, finite_values
from infoset.limits import shown


@dataclass(frozen=True, eq=False, init=False, repr=False)
class ZonotopeArrays:
    """The arrays of a zonotope; see `Zonotope`."""

    centre: Floats
    generators: Floats

    def __init__(self, centre: ArrayLike, generators: ArrayLike) -> None:
        middle = finite_values("centre", centre, "n")
        object.__setattr__(self, "centre", middle)
        object.__setattr__(
            self, "generators", finite_values("generators", generators, "g", len(middle))
        )

    @classmethod
    def box(cls, lower: ArrayLike, upper: ArrayLike) -> Self:
        """Return {x: lower <= x <= upper}; equal ends give a flat box."""
        minimum, maximum = box_ends(lower, upper, "n")
        centre = 0.5 * minimum + 0.5 * maximum
        # Rounding of the centre must not lose an end.
        half = np.maximum(maximum - centre, centre - minimum)
        return cls(centre, box_generators(half))

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return len(self.centre)

    def __repr__(self) -> str:
        return f"<zonotope in R^{self.space}: {len(self.generators)} generators>"


def box_generators(half: Floats) -> Floats:
    """Return the generators of a box with half-widths, shape (n,).

    There is one for each half-width that is not zero.
    """
    return np.asarray(np.diag(half)[half > 0.0])


def need_zonotope(name: str, value: object) -> ZonotopeArrays:
    """Return an argument that is a zonotope.

    Raises
    ------
    TypeError
        If it is not.
    """
    if not isinstance(value, ZonotopeArrays):
        raise TypeError(f"{name} must be of the type Zonotope: got {shown(value)}")
    return value
