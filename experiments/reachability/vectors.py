"""Values of keys that a file has for each axis, or as one number for all."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator

from infoset.limits import NOT_NEGATIVE, POSITIVE


def _for_each_axis(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else (value,) * 3


Vector = tuple[float, float, float]
Bound = Annotated[Vector, POSITIVE, BeforeValidator(_for_each_axis)]
"""A positive number for each axis; a file may have one number for all."""
HalfWidth = Annotated[Vector, NOT_NEGATIVE, BeforeValidator(_for_each_axis)]
"""As `Bound`, but zero is possible."""
