"""Old names that remain for one release."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any


def renamed(old: str, new: str) -> Callable[..., Any]:
    """Return a method with an old name that warns and calls the method, or returns the property, with the new name."""

    def method(self: Any, *arguments: Any, **options: Any) -> Any:
        warnings.warn(f"{old} is deprecated and will be removed: use {new}", DeprecationWarning, stacklevel=2)
        return getattr(self, new)(*arguments, **options)

    method.__doc__ = f"Call `{new}`. Deprecated."
    method.__name__ = old
    return method
