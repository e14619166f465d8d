"""The one way this package compiles its kernels."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import config, njit, types
from numba.core import cgutils
from numba.extending import intrinsic

F = TypeVar("F", bound=Callable[..., object])

NOWHERE_TO_KEEP = (
    "compiled kernels can be kept in no folder, neither beside their source nor in the user's, and are compiled in "
    "every process: name one that can be written in the environment variable NUMBA_CACHE_DIR"
)


def _compile(function: F, **options: bool | str) -> F:
    # nrt, Numba's reference counting, has no public name.
    jit: Any = njit

    def decorated() -> F:
        return cast(F, jit(nogil=True, error_model="numpy", fastmath={"nnan", "nsz"}, **options)(function))

    try:
        return decorated()
    except RuntimeError as error:
        if "no locator available" not in str(error):
            raise
        warnings.warn(NOWHERE_TO_KEEP, RuntimeWarning, stacklevel=1)  # of one place: it is said once
        options["cache"] = False
        return decorated()


def compiled(function: F) -> F:
    """Compile `function` with Numba: cached on disk, releasing the GIL, divisions unchecked as in C.

    Notes
    -----
    Numba keys its cache by the file that holds the function, not by the files of the functions that it
    calls: after editing a kernel, delete `__pycache__` (see CONTRIBUTING).
    """
    return _compile(function, cache=True)


def entry(function: F) -> F:
    """Compile a kernel called from Python that makes no array, nor does anything it calls.

    Notes
    -----
    Numba counts the references to arrays, atomically, wherever one is handed on: that may cost more than the work.
    Kernels that make no array can do without.
    """
    return _compile(function, cache=True, _nrt=False)


def allocation_free(function: F) -> F:
    """Compile a kernel that makes no array, called by other kernels and stored with them."""
    return _compile(function, _nrt=False)


def inlined(function: F) -> F:
    """Compile a small helper that makes no array, so that it is always inlined."""
    return _compile(function, forceinline=True, _nrt=False)


def substituted(function: F) -> F:
    """Compile an expression of a line or two by writing it out where it is used: quicker to compile, and leaner."""
    return _compile(function, inline="always", _nrt=False)


def constants(number: int) -> tuple[int, ...]:
    """Return the numbers 0, 1, ... to be handed from kernel to kernel: rows, sides, parts.

    Notes
    -----
    A kernel that is handed a Python constant is compiled for that very number, and all that it calls with it.
    """
    return tuple(cast(int, np.int64(value)) for value in range(number))


(ZERO,) = constants(1)
"""Where a count begins that is handed from kernel to kernel."""


def _prefetch(_context: Any, array: Any, index: Any) -> Any:
    """Type and code of `prefetch`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        flag = ir.IntType(32)
        pointer = builder.bitcast(builder.gep(data, [arguments[1]]), ir.PointerType(ir.IntType(8)))
        kind = ir.FunctionType(ir.VoidType(), [pointer.type, flag, flag, flag])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")  # type: ignore[no-untyped-call]
        builder.call(function, [pointer, flag(1), flag(3), flag(1)])
        return context.get_dummy_value()

    return types.void(array, index), generate


def _nothing(_array: Any, _index: int) -> None:
    """Stand in for `prefetch` where nothing is compiled."""


prefetch: Any = _nothing if getattr(config, "DISABLE_JIT", False) else intrinsic(_prefetch)
"""Ask for the line of memory at a place of an array, counted through all its axes: soon it is read and written."""
