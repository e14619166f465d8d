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
    """Return the versions of the packages and of Python, for results, records and campaigns."""
    return {name: _version(name) for name in PACKAGES} | {"python": platform.python_version()}


def need_versions(wanted: Mapping[str, str]) -> None:
    """Raise VersionError if the version of a package differs from the `wanted` one."""
    differences = [
        f"{name} {wanted.get(name)} in the campaign, {_version(name)} on the worker"
        for name in PACKAGES
        if wanted.get(name) != _version(name)
    ]
    if differences:
        raise VersionError("; ".join(differences))


@functools.cache
def _version(name: str) -> str:
    """Return the version of a package, or "none"."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "none"
