"""Checks of the arguments of operations on sets.

A message has the name of the argument, and what is possible.
"""

from __future__ import annotations

import math
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Floats
from infoset.limits import MAXIMUM, NOT_NEGATIVE, real_values, shown

Set = TypeVar("Set")


def need_finite(name: str, values: Floats) -> None:
    """Raise an error if a number is not finite, or too large for exact decisions."""
    # The sum of squares is the fastest test of a small array, and enough for almost all arrays.
    if np.vdot(values, values) <= MAXIMUM:
        return
    if not (np.abs(values) <= MAXIMUM).all():
        raise ValueError(f"{name} must be finite, at most {MAXIMUM:g} in size: got {shown(values)}")


def finite_values(name: str, value: ArrayLike, *shape: str | int) -> Floats:
    """Return finite numbers of a shape; an empty list is an array without rows.

    `shape` has the sizes of the axes. A letter is any size, of the axes n and m at least 1; "..."
    is any number of axes. An empty list is such an array only if the last of two axes is a number.
    """
    values = real_values(name, value)
    has_batch = shape[:1] == ("...",)
    last = shape[1:] if has_batch else shape
    if values.shape == (0,) and len(last) == 2 and not isinstance(last[1], str):
        values = values.reshape(0, last[1])

    # `last` are the axes after those of the batch.
    has_axes = values.ndim >= len(last) if has_batch else values.ndim == len(last)
    if not has_axes or not _fit(values.shape[values.ndim - len(last) :], last):
        text = str(shape).replace("'", "")
        raise ValueError(f"{name} must have the shape {text}: got {values.shape}")
    need_finite(name, values)
    return values


def _fit(sizes: tuple[int, ...], wanted: tuple[str | int, ...]) -> bool:
    """Return whether sizes of axes are as wanted: numbers, or letters as in `finite_values`."""
    for size, one in zip(sizes, wanted, strict=True):
        if isinstance(one, int) and size != one:
            return False
        if one in ("n", "m") and size == 0:
            return False
    return True


def bound_values(name: str, value: ArrayLike, *shapes: tuple[int, ...]) -> Floats:
    """Return numbers that may be infinite, of one of `shapes`; of any shape if none is given."""
    bounds = real_values(name, value)
    # A sum of squares, infinite ones included, is NaN only if a number is NaN.
    if math.isnan(np.vdot(bounds, bounds)):
        raise ValueError(f"{name} must be a number, not NaN: got {shown(value)}")
    if shapes and bounds.shape not in shapes:
        raise ValueError(
            f"{name} must have the shape {' or '.join(map(str, shapes))}: got {bounds.shape}"
        )
    return bounds


def constraint_values(
    names: tuple[str, str], rows: ArrayLike, limits: ArrayLike, *shape: str | int
) -> tuple[Floats, Floats]:
    """Return rows of a shape (..., k, n) and their limits, shape (..., k).

    The limits may be infinite, but not NaN or larger than `MAXIMUM`. Without "..." in `shape` they
    have one axis.
    """
    normals = finite_values(names[0], rows, *shape)
    ends = real_values(names[1], limits)
    has_axes = ends.ndim == 1 or shape[0] == "..."
    if not has_axes or ends.shape[-1:] != normals.shape[-2:-1]:
        raise ValueError(
            f"{names[0]} and {names[1]} must have as many rows: got the shapes {normals.shape} and "
            f"{ends.shape}"
        )
    need_finite(names[1], np.where(np.isinf(ends), 0.0, ends))
    return normals, ends


def offset_values(offset: ArrayLike, *shape: Any) -> Floats:
    """Return offsets of a shape (..., n), also from one number for all coordinates."""
    values = real_values("offset", offset)
    if values.ndim == 0:
        values = np.full(shape[-1], values)
    return finite_values("offset", values, *shape)


def box_ends(lower: ArrayLike, upper: ArrayLike, *shape: str | int) -> tuple[Floats, Floats]:
    """Return the lower and the upper ends of boxes, of the same shape."""
    minimum = finite_values("lower", lower, *shape)
    upper_shape = shape if shape[0] == "..." else minimum.shape
    maximum = finite_values("upper", upper, *upper_shape)
    minimum, maximum = np.broadcast_arrays(minimum, maximum)
    if (minimum > maximum).any():
        raise ValueError(
            "the box is reversed: its lower end exceeds the upper one by "
            f"{float((minimum - maximum).max()):g}"
        )
    return minimum, maximum


def radius_values(radius: ArrayLike, *shape: str) -> Floats:
    """Return radii of a shape."""
    radii = finite_values("radius", radius, *shape)
    if (radii < 0.0).any():
        raise ValueError(f"radius must not be negative: got {shown(radius)}")
    return radii


def axis_numbers(axes: ArrayLike, space: int, most: int) -> list[int]:
    """Return different axes of a space, at most `most`, from one number or several."""
    # Whole numbers that are stored as floats are axes, too: they are equal to one of the range.
    numbers = np.atleast_1d(real_values("axes", axes))
    listed = [int(number) for number in numbers.flat if number in range(space)]
    if numbers.ndim > 1 or not 0 < len(set(listed)) == numbers.size <= most:
        not_all = ", not all" if most < space else ""
        raise ValueError(
            f"axes must be one or more different numbers from 0 to {space - 1}{not_all}: "
            f"got {shown(axes)}"
        )
    return listed


def need_set(name: str, value: object, kind: type[Set]) -> Set:
    """Return an argument that is a set of a class."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} must be of the type {kind.__name__}: got {shown(value)}")
    return value


def not_negative(name: str, value: float) -> float:
    """Return a number that is not negative."""
    if value != 0.0:  # no check for zero, the default of most arguments: it saves time
        NOT_NEGATIVE.need(name, value)
    return value
