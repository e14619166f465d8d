"""Versions of the packages that the numbers of a result depend on."""

from __future__ import annotations

import functools
import json
from importlib.metadata import PackageNotFoundError, distribution, version

CALCULATING = ("infoset", "numpy", "numba", "llvmlite")


class VersionError(Exception):
    """A chunk needs other versions of the packages; the message names both versions."""


@functools.cache
def calculating_versions() -> tuple[tuple[str, str], ...]:
    """Return the names and versions of the packages on which results depend."""
    return tuple((name, _version(name)) for name in CALCULATING)


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
    """Return the command that installs an optional extra: from the clone of an editable installation, else by name."""
    try:
        origin = json.loads(distribution("infoset").read_text("direct_url.json") or "{}")
    except PackageNotFoundError:
        origin = {"dir_info": {"editable": True}}
    editable = origin.get("dir_info", {}).get("editable", False)
    return f'pip install -e ".[{extra}]"' if editable else f'pip install "infoset[{extra}]"'
