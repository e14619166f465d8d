"""The one way this package compiles its kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile `function` with Numba: cached on disk, releasing the GIL, divisions unchecked as in C.

    Notes
    -----
    Numba keys its cache by the file that holds the function, not by the files of the functions that it
    calls: after editing a kernel, delete `__pycache__` (see CONTRIBUTING).
    """
    return cast(F, njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz"})(function))


def inlined(function: F) -> F:
    """Compile a small helper of the kernels so that it is always inlined: a call costs about 20 ns."""
    return cast(
        F, njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz"}, forceinline=True, _nrt=False)(function)
    )
