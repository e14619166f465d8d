"""The one way this package compiles its kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., object])

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"nnan", "nsz"}}


def compiled(function: F) -> F:
    """Compile `function` with Numba: cached on disk, releasing the GIL, divisions unchecked as in C.

    Notes
    -----
    Numba keys its cache by the file that holds the function, not by the files of the functions that it
    calls: after editing a kernel, delete `__pycache__` (see CONTRIBUTING).
    """
    return cast(F, njit(**_OPTIONS, cache=True)(function))


def entry(function: F) -> F:
    """Compile a kernel called from Python that makes no array, nor does anything it calls.

    Notes
    -----
    Numba counts the references to arrays, atomically, wherever one is handed on: that may cost more than the work.
    Kernels that make no array can do without.
    """
    return cast(F, njit(**_OPTIONS, cache=True, _nrt=False)(function))


def allocation_free(function: F) -> F:
    """Compile a kernel that makes no array, called by other kernels and stored with them."""
    return cast(F, njit(**_OPTIONS, _nrt=False)(function))


def inlined(function: F) -> F:
    """Compile a small helper that makes no array, so that it is always inlined."""
    return cast(F, njit(**_OPTIONS, forceinline=True, _nrt=False)(function))


def substituted(function: F) -> F:
    """Compile an expression of a line or two by writing it out where it is used: quicker to compile, and leaner."""
    return cast(F, njit(**_OPTIONS, inline="always", _nrt=False)(function))
