"""Kernels that only other kernels call, for tests that call them from Python."""

from __future__ import annotations

from types import ModuleType, SimpleNamespace
from typing import Any

from infoset.kernels import JIT


def callable_kernels(module: ModuleType) -> Any:
    """Return the contents of a module, with its kernels callable from Python."""
    return SimpleNamespace(
        **{
            name: _callable(value) if hasattr(value, "py_func") else value
            for name, value in vars(module).items()
        }
    )


def _callable(kernel: Any) -> Any:
    def call(*arguments: Any) -> Any:
        return kernel(*arguments)

    return JIT(call)
