"""Types of arrays, and a fast test of flags."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Integers = NDArray[np.int64]


def some(flags: Flags) -> bool:
    """Return whether any flag is true; faster than `flags.any()` for a batch."""
    return bool(np.count_nonzero(flags))
