"""The decorators of this package's kernels, and what only kernels need."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

from infoset.kernels import Kernels

_kernels = Kernels("nnan", "nsz")
compiled, entry = _kernels.compiled, _kernels.entry
allocation_free, inlined = _kernels.allocation_free, _kernels.inlined


def constants(number: int) -> tuple[int, ...]:
    """Return the numbers 0, 1, ... as variables, for arguments of kernels: rows, sides, parts.

    Notes
    -----
    Numba compiles a kernel anew for each Python constant that is passed to it.
    """
    return tuple(cast(int, np.int64(value)) for value in range(number))


(ZERO,) = constants(1)
"""Start of a count that is passed from kernel to kernel."""


def _prefetch(_context: Any, array: Any, index: Any) -> Any:
    """Type and code of `prefetch`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        flag = ir.IntType(32)
        pointer = builder.bitcast(builder.gep(data, [arguments[1]]), ir.PointerType(ir.IntType(8)))
        kind = ir.FunctionType(ir.VoidType(), [pointer.type, flag, flag, flag])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(function, [pointer, flag(1), flag(3), flag(1)])
        return context.get_dummy_value()

    return types.void(array, index), generate


def _nothing(_array: Any, _index: int) -> None:
    """Stand in for `prefetch` where nothing is compiled."""


prefetch: Any = _nothing if getattr(config, "DISABLE_JIT", False) else intrinsic(_prefetch)
"""Load the cache line of an array's element, counted through all its axes, before it is read and written."""
