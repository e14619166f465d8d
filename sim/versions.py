"""Versions of the packages that the numbers of a result depend on."""

from __future__ import annotations

import functools
import json
import platform
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

CALCULATING = ("infoset", "numpy", "numba", "llvmlite")


class VersionError(Exception):
    """A chunk needs other versions of the packages; the message names both versions."""


@functools.cache
def calculating_versions() -> tuple[tuple[str, str], ...]:
    """Return the names and versions of the packages on which results depend."""
    return tuple((name, _version(name)) for name in CALCULATING)


def versions() -> dict[str, str]:
    """Return the versions that results and records carry: those of the packages, and that of Python."""
    return {**dict(calculating_versions()), "python": platform.python_version()}


def differences(here: tuple[tuple[str, str], ...], there: tuple[tuple[str, str], ...]) -> list[str]:
    """Return a text for each version that differs, such as `numpy 2.1 here, 2.0 there`."""
    ours, theirs = dict(here), dict(there)
    return [
        f"{name} {ours.get(name, 'none')} here, {theirs.get(name, 'none')} there"
        for name in dict.fromkeys((*ours, *theirs))
        if ours.get(name) != theirs.get(name)
    ]


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
