"""The one way this package compiles its kernels.

The interception has its own, for neither of the two imports the other, and the two take different liberties. Here a
product and a sum may be one operation (`contract`): quicker, and rounded once; nothing here has to come out the same
bit for bit whichever way round it is computed, as cut edges of an information set do. And nothing is promised about NaN
(no `nnan`): these kernels meet it where numbers overflow or a matrix is singular, and tell it by comparisons that fail,
such as `not value > 0.0`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., object])

NOWHERE_TO_KEEP = (
    "compiled kernels can be kept in no folder, neither beside their source nor in the user's, and are compiled in "
    "every process: name one that can be written in the environment variable NUMBA_CACHE_DIR"
)


def compiled(function: F) -> F:
    """Compile `function` with Numba: cached on disk, releasing the GIL, divisions unchecked as in C.

    Notes
    -----
    Numba keys its cache by the file that holds the function, not by the files of the functions that it calls: after
    editing a kernel, delete `rendezvous/**/__pycache__`.
    """
    return _compile(function)


def allocation_free(function: F) -> F:
    """Compile a kernel that makes no array, nor does anything it calls, as `compiled` does.

    Notes
    -----
    Without Numba's atomic count of references, which costs more than the work of a small kernel.
    """
    return _compile(function, _nrt=False)


def _compile(function: F, **options: bool) -> F:
    jit: Any = njit

    def decorated(*, cache: bool) -> F:
        kept = jit(cache=cache, nogil=True, error_model="numpy", fastmath={"contract", "nsz"}, **options)
        return cast(F, kept(function))

    try:
        return decorated(cache=True)
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        warnings.warn(NOWHERE_TO_KEEP, RuntimeWarning, stacklevel=1)  # of one place: it is said once
        return decorated(cache=False)
