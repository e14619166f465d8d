"""Versions of the packages that the numbers of a result depend on."""

from __future__ import annotations

import functools
import json
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

PACKAGES = ("infoset", "numpy", "numba")
"""Packages on which the numbers depend."""


class VersionError(Exception):
    """A worker has other versions of the packages; the message names both versions."""


def versions() -> dict[str, str]:
    """Return the versions that results, records and campaigns carry: those of the packages, and that of Python."""
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


def install_command(extra: str) -> str:
    """Return the command that installs an optional extra: from the clone if there is one, else by name.

    PEP 610: `direct_url.json` has the key `dir_info` if the package was installed from a folder.
    """
    try:
        origin = json.loads(distribution("infoset").read_text("direct_url.json") or "{}")
    except PackageNotFoundError:  # the folder is on the path of Python, not installed
        origin = {"url": Path(__file__).parents[1].as_uri(), "dir_info": {"editable": True}}
    if "dir_info" not in origin:
        return f'pip install "infoset[{extra}]"'
    folder = url2pathname(urlsplit(origin["url"]).path)
    return f'pip install {"-e " if origin["dir_info"].get("editable") else ""}"{folder}[{extra}]"'
