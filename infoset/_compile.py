"""The decorators of this package's kernels, and types and numbers that only kernels need."""

from __future__ import annotations

from functools import cache
from typing import Any, cast, get_type_hints

import numpy as np

from infoset.kernels import Kernels

# No number is NaN, and the sign of a zero decides nothing. All other liberties would change bits:
# sums in another order, and products that are not rounded (see `rendezvous._compile`).
_kernels = Kernels("nnan", "nsz")
compiled = _kernels.compiled
entry = _kernels.entry
allocation_free = _kernels.allocation_free
inlined = _kernels.inlined
pasted = _kernels.pasted


@cache
def record_of(fields: type) -> np.dtype[Any]:
    """Return the type of array elements with the fields of a class.

    Kernels take the address of such a record.
    """
    kinds = {float: np.float64, int: np.int64, bool: np.bool_}
    columns = [(name, kinds[kind]) for name, kind in get_type_hints(fields).items()]
    # In a call with a pair of types NumPy ignores `align`.
    aligned = np.dtype(columns, align=True)
    return np.dtype((np.record, aligned))


def constants(number: int) -> tuple[int, ...]:
    """Return the numbers 0, 1, ... as variables, for arguments of kernels: rows, sides, parts.

    Numba compiles a kernel anew for each Python constant that is passed to it.
    """
    return tuple(cast(int, np.int64(value)) for value in range(number))


(ZERO,) = constants(1)
"""Start of a count that is passed from kernel to kernel; a variable, see `constants`."""
FALSE = cast(bool, np.bool_(False))
"""A flag for arguments of kernels; a variable, see `constants`."""
TRUE = cast(bool, np.bool_(True))
"""A flag for arguments of kernels; a variable, see `constants`."""
