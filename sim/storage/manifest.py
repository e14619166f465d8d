"""The manifest of a campaign: all that decides its numbers, so that it can be resumed, read and repeated."""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from infoset.limits import NUMBER
from sim.fingerprint import scenario_hash
from sim.scenario import Scenario
from sim.storage.atomic_file import reporting, write_whole
from sim.storage.errors import ManifestError
from sim.storage.scenario_json import scenario_from_json, scenario_to_json

FORMAT = "infoset-campaign"
SCHEMA = 1
MANIFEST = "manifest.json"
LARGEST_BYTES = 10_000_000
MOST_DIFFERENCES = 20
MOST_CELLS = 10_000
MOST_RUNS_A_SHARD = 1_000_000

_NOISES = ("random", "game", "mixed")
_SCALES = ("linear", "log")


@dataclass(frozen=True)
class Axis:
    """A key that a sweep varies.

    Parameters
    ----------
    key : str
        As in a scenario file, with its table and unit.
    values : tuple of float
        In the unit of the file.
    scale : str
        `linear` or `log`: how the values are spaced.
    """

    key: str
    values: tuple[float, ...]
    scale: str = "linear"


@dataclass(frozen=True)
class Manifest:
    """All that decides the numbers of a campaign or a sweep, and how far it came.

    Parameters
    ----------
    scenario : Scenario
        Whole; of a sweep the one that is varied.
    runs, chunk, seed : int
        Engagements (a cell), engagements a shard, root seed.
    noise : str
        `random`, `game` or `mixed`.
    strategy : str
        Its name.
    guarantee : bool
        Whether guaranteed misses were kept.
    versions : mapping of str to str
        Of what computes.
    axes : tuple of Axis
        What a sweep varies, every value with every other; the last varies fastest. None in a campaign.
    cells_hash : str
        Fingerprint of the scenarios of a sweep's cells; empty in a campaign.
    until : str or None
        The rule that may stop it early.
    stopped_after : int or None
        Runs after which the rule stopped it.
    made_by : mapping of str to str
        Version of Python and machine that began it: told, not compared.

    Raises
    ------
    ValueError
        If a shard would have too many engagements, or a sweep too many cells.
    """

    scenario: Scenario
    runs: int
    chunk: int
    seed: int
    noise: str
    strategy: str
    guarantee: bool
    versions: Mapping[str, str]
    axes: tuple[Axis, ...] = ()
    cells_hash: str = ""
    until: str | None = None
    stopped_after: int | None = None
    made_by: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.chunk > MOST_RUNS_A_SHARD:
            raise ValueError(f"chunk: must be at most {MOST_RUNS_A_SHARD} engagements a shard, found {self.chunk}")
        if self.cells > MOST_CELLS:
            raise ValueError(f"axes: make {self.cells} cells, and at most {MOST_CELLS} can be")

    @property
    def cells(self) -> int:
        """Number of scenarios flown."""
        return math.prod(len(axis.values) for axis in self.axes)

    @property
    def wanted_runs(self) -> int:
        """Engagements a cell that belong to the result: fewer where a rule has stopped it."""
        return self.runs if self.stopped_after is None else self.stopped_after

    def values_of(self, cell: int) -> dict[str, float]:
        """What a cell of a sweep has in place of the scenario's values, by key."""
        values = {}
        for axis in reversed(self.axes):
            cell, place = divmod(cell, len(axis.values))
            values[axis.key] = axis.values[place]
        return dict(reversed(values.items()))

    def decisive(self) -> dict[str, Any]:
        """What may not differ between one session of a campaign and the next, as JSON."""
        return {
            "format": FORMAT,
            "schema": SCHEMA,
            "kind": "sweep" if self.axes else "campaign",
            "scenario": scenario_to_json(self.scenario),
            "seed": self.seed,
            "noise": self.noise,
            "strategy": self.strategy,
            "guarantee": self.guarantee,
            "chunk": self.chunk,
            "axes": [{"key": each.key, "scale": each.scale, "values": list(each.values)} for each in self.axes],
            "cells_hash": self.cells_hash,
            "versions": dict(self.versions),
        }

    @property
    def identity(self) -> str:
        """Fingerprint of what is decisive; every shard carries it."""
        return hashlib.sha256(json.dumps(self.decisive(), sort_keys=True).encode()).hexdigest()[:32]

    def to_json(self) -> dict[str, Any]:
        """Return everything, as it stands in the file."""
        decisive = self.decisive()
        value = {
            "format": decisive.pop("format"),
            "schema": decisive.pop("schema"),
            "version": self.versions.get("infoset", ""),
            "kind": decisive.pop("kind"),
            "name": self.scenario.name,
            "scenario_hash": scenario_hash(self.scenario),
            "runs": self.runs,
            "until": self.until,
            "stopped_after": self.stopped_after,
            **decisive,
            "made_by": dict(self.made_by),
        }
        return {**value, "sha256": checksum(value)}


def checksum(value: Mapping[str, Any]) -> str:
    """Return the SHA-256 of everything in a manifest but itself."""
    rest = {key: each for key, each in value.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def made_here() -> dict[str, str]:
    """What a manifest tells of the machine it was begun on."""
    return {"python": platform.python_version(), "machine": platform.machine(), "system": platform.system()}


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write a manifest into its folder, whole or not at all."""
    write_whole(folder / MANIFEST, (json.dumps(manifest.to_json(), indent=1, allow_nan=False) + "\n").encode())


def read_manifest(folder: Path) -> Manifest:
    """Read the manifest of a folder.

    Parameters
    ----------
    folder : Path

    Returns
    -------
    Manifest

    Raises
    ------
    ManifestError
        If there is none, or it is not one that this version reads; the message names the key.
    """
    file = folder / MANIFEST
    if not file.is_file():
        raise ManifestError(f"{folder}: holds no campaign and no sweep: there is no {MANIFEST} in it")
    with reporting(file), file.open("rb") as stream:
        content = stream.read(LARGEST_BYTES + 1)
    try:
        if len(content) > LARGEST_BYTES:
            raise ValueError(f"is over {LARGEST_BYTES // 1_000_000} MB")
        value = json.loads(content)
        if not isinstance(value, dict) or value.get("format") != FORMAT:
            raise ValueError(f"its format is not {FORMAT}")
        if value.get("schema") != SCHEMA:
            raise ValueError(f"schema: must be {SCHEMA}, the only one this version reads, found {value.get('schema')}")
        found = _from_json(value)
        if value["sha256"] != checksum(value):
            raise ValueError("it is not what was written (the checksum differs): the file is damaged")
        return found
    except (ValueError, RecursionError, KeyError, TypeError) as error:
        said = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
        raise ManifestError(f"{file}: is no manifest of a campaign: {said[:300]}") from None


def need_same(found: Manifest, given: Manifest, folder: Path) -> None:
    """Refuse to go on with a campaign as if it were another.

    Parameters
    ----------
    found, given : Manifest
        In the folder, and asked for.
    folder : Path

    Raises
    ------
    ManifestError
        If they differ in anything decisive; every difference is shown.
    """
    there, here = _flat(found.decisive()), _flat(given.decisive())
    lines = [
        f"{key}: {_shown(there, key)} in the folder, {_shown(here, key)} now"
        for key in dict.fromkeys((*there, *here))
        if there.get(key) != here.get(key)
    ]
    if not lines:
        return
    if len(lines) > MOST_DIFFERENCES:
        lines = [*lines[:MOST_DIFFERENCES], f"and {len(lines) - MOST_DIFFERENCES} more"]
    raise ManifestError(
        f"{folder}: is another campaign than the one asked for; resume it as it was begun, or choose another folder:"
        + "".join(f"\n  {line}" for line in lines)
    )


def _flat(value: Any, path: str = "") -> dict[str, Any]:
    """Values by dotted key."""
    if isinstance(value, dict) and value:
        return {
            name: each
            for key, inner in value.items()
            for name, each in _flat(inner, f"{path}.{key}" if path else str(key)).items()
        }
    return {path: value}


def _shown(flat: Mapping[str, Any], key: str) -> str:
    return json.dumps(flat[key])[:200] if key in flat else "nothing"


def _from_json(value: Mapping[str, Any]) -> Manifest:
    axes = tuple(_axis(each, f"axes[{place}]") for place, each in enumerate(_list(value["axes"], "axes")))
    if (value["kind"] == "sweep") != bool(axes):
        raise ValueError("kind: must be a sweep with axes, or a campaign without")
    runs = _whole(value, "runs", 1)
    stopped = value["stopped_after"]
    if stopped is not None and not 1 <= _whole(value, "stopped_after", 1) <= runs:
        raise ValueError("stopped_after: must be at most runs")
    if not isinstance(value["guarantee"], bool):
        raise ValueError("guarantee: must be true or false")
    return Manifest(
        scenario=scenario_from_json(value["scenario"]),
        runs=runs,
        chunk=_whole(value, "chunk", 1),
        seed=_whole(value, "seed", 0),
        noise=_one_of(value["noise"], _NOISES, "noise"),
        strategy=_text(value["strategy"], "strategy"),
        guarantee=value["guarantee"],
        versions=_texts(value["versions"], "versions"),
        axes=axes,
        cells_hash=_text(value["cells_hash"], "cells_hash"),
        until=None if value["until"] is None else _text(value["until"], "until"),
        stopped_after=stopped,
        made_by=_texts(value["made_by"], "made_by"),
    )


def _axis(value: Any, path: str) -> Axis:
    if not isinstance(value, dict):
        raise ValueError(f"{path}: must be an object")
    values = _list(value["values"], f"{path}.values")
    if len(values) < 2 or any(isinstance(each, bool) or not isinstance(each, int | float) for each in values):
        raise ValueError(f"{path}.values: must be at least two numbers")
    for each in values:
        NUMBER.need(f"{path}.values", each)
    return Axis(
        _text(value["key"], f"{path}.key"),
        tuple(float(each) for each in values),
        _one_of(value["scale"], _SCALES, f"{path}.scale"),
    )


def _whole(value: Mapping[str, Any], key: str, least: int) -> int:
    number = value[key]
    if isinstance(number, bool) or not isinstance(number, int) or number < least:
        raise ValueError(f"{key}: must be a whole number from {least}")
    return number


def _text(value: Any, path: str) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{path}: must be text")
    if not value.isprintable():  # it is shown on terminals, which may be steered by what is not
        raise ValueError(f"{path}: must be text without control characters")
    return value


def _texts(value: Any, path: str) -> dict[str, str]:
    if not isinstance(value, dict):
        raise ValueError(f"{path}: must be an object")
    return {key: _text(each, f"{path}.{key}") for key, each in value.items()}


def _one_of(value: Any, names: tuple[str, ...], path: str) -> str:
    if value not in names:
        raise ValueError(f"{path}: must be one of {', '.join(names)}")
    return _text(value, path)


def _list(value: Any, path: str) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError(f"{path}: must be a list")
    return value
