"""The manifest of a campaign: all that determines its numbers, so that it can be resumed, read and repeated."""

from __future__ import annotations

import hashlib
import json
import math
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from infoset.limits import COUNT, NUMBER, WHOLE
from sim.chunk import CampaignNoise
from sim.scenario import Scenario
from sim.storage.codec import fingerprint, from_json, to_json
from sim.storage.files import ManifestError, reporting, write_whole

FORMAT = "infoset-campaign"
SCHEMA = 1
MANIFEST = "manifest.json"
MAX_BYTES = 10_000_000
MAX_DIFFERENCES = 20
MAX_CELLS = 10_000
MAX_RUNS_A_SHARD = 1_000_000

_PROGRESS = ("runs", "until", "stopped_after", "cell_runs", "require", "extended", "made_by")
"""Keys that may differ between the sessions of a campaign."""
_DERIVED = ("format", "schema", "version", "kind", "name", "scenario_hash", "sha256")
"""Keys of the file that follow from the others."""


@dataclass(frozen=True)
class Axis:
    """A key that a sweep varies.

    Parameters
    ----------
    key : str
        Key as in a scenario file, with its table and unit.
    values : tuple of float
        At least two values, in the unit of the file.

    Raises
    ------
    TypeError, ValueError
        If there are fewer values, or one is out of range.
    """

    key: str
    values: tuple[float, ...]
    scale: Literal["linear", "log"] = "linear"

    def __post_init__(self) -> None:
        if len(self.values) < 2:
            raise ValueError(f"{self.key}: an axis needs at least two values")
        for value in self.values:
            NUMBER.need(self.key, value)


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """All that determines the numbers of a campaign or a sweep, its progress, and its division into chunks.

    Chunks are numbered from 0; each is stored as one shard. A TypeError or ValueError is raised if a number is out of
    its range.

    Parameters
    ----------
    runs : int
        Engagements of each cell, numbered from 0; with `until` the maximum number.
    until : str or None
        The rule that may stop the campaign early, or the requirement that stops the cells of a sweep.
    stopped_after : int or None
        Runs after which the rule stopped the campaign.
    cell_runs : tuple of int
        Engagements of each cell of a finished sweep whose cells were stopped by a requirement; otherwise empty.
    require : str or None
        Requirement of a sweep, that of the last session; it does not change any result.
    extended : bool
        Whether runs were ever added to a sweep, by a rule or by a greater number of runs.
    scenario : Scenario
        Scenario; for a sweep the one that is varied.
    strategy : str
        Name; for a strategy in a Python file with the hash of the file: `mine.py:Mine sha256:0123456789abcdef`.
    chunk : int
        Engagements per shard; the last shard of a cell may have fewer. Results do not depend on it.
    axes : tuple of Axis
        Keys that a sweep varies, in all combinations of values; the last varies fastest. Empty for a campaign.
    order : str
        How chunks are numbered: `cells`, all chunks of a cell one after the other, or `rounds`, the first chunks of all
        cells, then the second ones, so that cells can be extended.
    cells_hash : str
        Fingerprint of the scenarios of a sweep's cells; empty for a campaign.
    made_by : mapping of str to str
        Version of Python and kind of machine of the first session; they may differ when a campaign is resumed.
    """

    runs: int
    until: str | None = None
    stopped_after: int | None = None
    cell_runs: tuple[int, ...] = ()
    require: str | None = None
    extended: bool = False
    scenario: Scenario
    seed: int
    noise: CampaignNoise
    strategy: str
    guarantee: bool
    chunk: int
    axes: tuple[Axis, ...] = ()
    cells_hash: str = ""
    versions: Mapping[str, str]
    made_by: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, limits in (("runs", COUNT), ("chunk", COUNT), ("seed", WHOLE)):
            limits.need(name, getattr(self, name))
        if self.chunk > MAX_RUNS_A_SHARD:
            raise ValueError(f"chunk must be at most {MAX_RUNS_A_SHARD} engagements: got {self.chunk}")
        if self.cells > MAX_CELLS:
            raise ValueError(f"axes make {self.cells} cells, more than the {MAX_CELLS} that a sweep may have")
        if self.stopped_after is not None and not 1 <= self.stopped_after <= self.runs:
            raise ValueError(f"stopped_after must be from 1 to {self.runs}: got {self.stopped_after}")
        if self.cell_runs and (
            len(self.cell_runs) != self.cells or not all(0 <= runs <= self.runs for runs in self.cell_runs)
        ):
            raise ValueError(f"cell_runs must contain {self.cells} numbers from 0 to {self.runs}")

    @property
    def kind(self) -> str:
        """`campaign` or `sweep`."""
        return "sweep" if self.axes else "campaign"

    @property
    def is_watched(self) -> bool:
        """Whether the number of runs of a sweep may depend on its results (`sim.requirement.judge`)."""
        return bool(self.axes) and (self.extended or self.until is not None)

    @property
    def cells(self) -> int:
        """Number of simulated scenarios."""
        return math.prod(len(axis.values) for axis in self.axes)

    def wanted_runs(self, cell: int) -> int:
        """Return the engagements of a cell that belong to the result: fewer than `runs` where a rule stopped it."""
        if self.cell_runs:
            return self.cell_runs[cell]
        return self.runs if self.stopped_after is None else self.stopped_after

    @property
    def chunks_a_cell(self) -> int:
        """Number of chunks of each cell."""
        return -(-self.runs // self.chunk)

    @property
    def chunks(self) -> int:
        """Number of chunks of all cells."""
        return self.chunks_a_cell * self.cells

    def runs_of(self, index: int) -> tuple[int, range]:
        """Return the cell and the numbers of the runs of a chunk."""
        number, cell = divmod(index, self.cells)
        first = number * self.chunk
        return cell, range(first, min(first + self.chunk, self.runs))

    def index_of(self, cell: int, number: int) -> int:
        """Return the number of the chunk that is the `number`-th of a cell, from 0."""
        return number * self.cells + cell

    def values_of(self, cell: int) -> dict[str, float]:
        """Return the varied values of a cell of a sweep, by key."""
        values = {}
        for axis in reversed(self.axes):
            cell, number = divmod(cell, len(axis.values))
            values[axis.key] = axis.values[number]
        return dict(reversed(values.items()))

    def decisive(self) -> dict[str, Any]:
        """Return the values that must be equal in all sessions of a campaign, as JSON values."""
        plain = {key: value for key, value in to_json(self).items() if key not in _PROGRESS}
        return {"format": FORMAT, "schema": SCHEMA, "kind": self.kind, **plain}

    @property
    def identity(self) -> str:
        """Fingerprint of `decisive`; it is stored in every shard."""
        return hashlib.sha256(json.dumps(self.decisive(), sort_keys=True).encode()).hexdigest()[:32]

    def to_json(self) -> dict[str, Any]:
        """Return the content of the file."""
        value = {
            "format": FORMAT,
            "schema": SCHEMA,
            "version": self.versions.get("infoset", ""),
            "kind": self.kind,
            "name": self.scenario.name,
            "scenario_hash": fingerprint(self.scenario),
            **to_json(self),
        }
        return {**value, "sha256": checksum(value)}


def checksum(value: Mapping[str, Any]) -> str:
    """Return the SHA-256 of everything in a manifest but `sha256` itself."""
    rest = {key: inner for key, inner in value.items() if key != "sha256"}
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()


def made_here() -> dict[str, str]:
    """Return Python's version and the kind of this machine."""
    return {"python": platform.python_version(), "machine": platform.machine(), "system": platform.system()}


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write a manifest into its folder atomically."""
    write_whole(folder / MANIFEST, (json.dumps(manifest.to_json(), indent=1, allow_nan=False) + "\n").encode())


def read_manifest(folder: Path) -> Manifest:
    """Read the manifest of a folder.

    A ManifestError is raised if there is none, or this version cannot read it; the message names the invalid key.
    """
    file = folder / MANIFEST
    if not file.is_file():
        raise ManifestError(
            f"{folder}: contains no campaign and no sweep (no file {MANIFEST}); name a folder of infoset campaign or "
            "infoset sweep"
        )
    with reporting(file), file.open("rb") as stream:
        content = stream.read(MAX_BYTES + 1)
    try:
        return _parsed(content)
    except (ValueError, RecursionError) as error:
        raise ManifestError(
            f"{file}: is not a readable manifest: {str(error)[:300]}; restore it from a copy, or use a new folder"
        ) from None


def _parsed(content: bytes) -> Manifest:
    if len(content) > MAX_BYTES:
        raise ValueError(f"is over {MAX_BYTES // 1_000_000} MB")
    value = json.loads(content)
    if not isinstance(value, dict) or value.get("format") != FORMAT:
        raise ValueError(f"format: must be {FORMAT}")
    if value.get("schema") != SCHEMA:
        raise ValueError(
            f"schema: must be {SCHEMA}, the only one this version reads, found {value.get('schema')}; update infoset"
        )
    manifest = from_json(Manifest, {key: inner for key, inner in value.items() if key not in _DERIVED})
    if value.get("kind") != manifest.kind:
        raise ValueError("kind: must be sweep with axes, and campaign without")
    if value.get("sha256") != checksum(value):
        raise ValueError("the checksum differs: the file is damaged")
    return manifest


def need_same(stored: Manifest, wanted: Manifest, folder: Path) -> None:
    """Raise ManifestError, with all differences, if the decisive values of two campaigns differ."""
    there, here = _flat(stored.decisive()), _flat(wanted.decisive())
    lines = [
        f"{key}: {_shown(there, key)} in the folder, {_shown(here, key)} now"
        for key in dict.fromkeys((*there, *here))
        if there.get(key) != here.get(key)
    ]
    if not lines:
        return
    if len(lines) > MAX_DIFFERENCES:
        lines = [*lines[:MAX_DIFFERENCES], f"and {len(lines) - MAX_DIFFERENCES} more"]
    raise ManifestError(
        f"{folder}: contains a campaign with different settings; repeat the command with those of the folder, or "
        "choose another folder:" + "".join(f"\n  {line}" for line in lines)
    )


def _flat(value: Any, path: str = "") -> dict[str, Any]:
    """Return nested values by dotted key."""
    if isinstance(value, dict) and value:
        return {
            name: leaf
            for key, inner in value.items()
            for name, leaf in _flat(inner, f"{path}.{key}" if path else str(key)).items()
        }
    return {path: value}


def _shown(flat: Mapping[str, Any], key: str) -> str:
    return json.dumps(flat[key])[:200] if key in flat else "not set"
