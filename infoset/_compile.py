"""The decorators of this package's kernels, and what only kernels need."""

from __future__ import annotations

from functools import cache
from typing import Any, TypeVar, cast, get_type_hints

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)

from infoset.kernels import Kernels

_kernels = Kernels("nnan", "nsz")
compiled, entry = _kernels.compiled, _kernels.entry
allocation_free, inlined = _kernels.allocation_free, _kernels.inlined


T = TypeVar("T", bound=type)


class _Reference(types.Type):
    """Type of a NamedTuple of arrays of which kernels receive the address."""

    def __init__(self, content: types.NamedTuple) -> None:
        self.content = content
        super().__init__(f"reference to {content}")


@register_model(_Reference)
class _ReferenceModel(models.PrimitiveModel):
    """Representation of a reference: a pointer to the NamedTuple."""

    def __init__(self, manager: Any, kind: _Reference) -> None:
        super().__init__(manager, kind, manager.lookup(kind.content).get_value_type().as_pointer())


@unbox(_Reference)  # type: ignore[untyped-decorator]
def _unbox(kind: _Reference, value: Any, compilation: Any) -> NativeValue:
    content = compilation.unbox(kind.content, value)
    pointer = cgutils.alloca_once_value(compilation.builder, content.value)
    return NativeValue(pointer, is_error=content.is_error, cleanup=content.cleanup)


@infer_getattr
class _ReferenceFields(AttributeTemplate):
    key = _Reference

    def generic_resolve(self, kind: _Reference, name: str) -> Any:  # type: ignore[override]
        """Return the type of a field."""
        return kind.content[kind.content.fields.index(name)]


@lower_getattr_generic(_Reference)  # type: ignore[untyped-decorator]
def _load_field(context: Any, builder: Any, kind: _Reference, pointer: Any, name: str) -> Any:
    number = kind.content.fields.index(name)
    field = builder.load(cgutils.gep_inbounds(builder, pointer, 0, number))
    return impl_ret_borrowed(context, builder, kind.content[number], field)


def by_reference(record: T) -> T:
    """Make kernels take the address of a NamedTuple of arrays.

    Otherwise each call of a kernel passes each size and each stride of each array, a seventh of the generated code.
    """

    @typeof_impl.register(record)
    def _type_of(value: Any, context: Any) -> _Reference:
        return _Reference(types.NamedTuple([typeof_impl(part, context) for part in value], record))

    return record


@cache
def record_of(fields: type) -> np.dtype[Any]:
    """Return the type of array elements with the fields of a class; kernels take the address of such a record."""
    kinds = {float: np.float64, int: np.int64, bool: np.bool_}
    return np.dtype((np.record, [(name, kinds[kind]) for name, kind in get_type_hints(fields).items()]), align=True)


def constants(number: int) -> tuple[int, ...]:
    """Return the numbers 0, 1, ... as variables, for arguments of kernels: rows, sides, parts.

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
