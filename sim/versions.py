"""Versions of the packages that the numbers of a result depend on."""

from __future__ import annotations

import functools
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

PACKAGES = ("infoset", "numpy", "numba")
"""Packages on which the numbers depend."""


class VersionError(Exception):
    """A worker has other versions of the packages; the message names both versions."""


def versions() -> dict[str, str]:
    """Return the versions that results, records and campaigns carry: those of the packages, and
    that of Python.
    """
    return {**{name: _version(name) for name in PACKAGES}, "python": platform.python_version()}


def need_versions(wanted: Mapping[str, str]) -> None:
    """Raise VersionError if a package has another version than the `wanted` one."""
    differ = [
        f"{name} {wanted.get(name)} in the campaign, {_version(name)} on the worker"
        for name in PACKAGES
        if wanted.get(name) != _version(name)
    ]
    if differ:
        raise VersionError("; ".join(differ))


@functools.cache
def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
