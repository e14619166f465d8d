"""The repr of dataclasses with arrays: short at a prompt."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

_LONGEST = 70
"""Maximum number of characters of a value; NumPy breaks longer arrays into lines."""


def short_repr(self: Any) -> str:
    """Return the repr of a dataclass in which large arrays are shown by their shapes, and large parts by their types.

    Numbers have six digits. A dataclass uses it as `__repr__ = short_repr`.
    """
    shown = (f"{field.name}={_shown(getattr(self, field.name))}" for field in fields(self))
    return f"{type(self).__name__}({', '.join(shown)})"


def _shown(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else repr(value)
    if len(text) <= _LONGEST:
        return text
    if isinstance(value, np.ndarray):
        return f"<shape {value.shape}>"
    if isinstance(value, tuple):
        return f"<{len(value)} items>"
    return f"{type(value).__name__}(...)"
