"""The one way this package compiles its kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., object])


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
    return cast(F, jit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nsz"}, **options)(function))
