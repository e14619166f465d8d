"""The manifest of a campaign, with all that determines its numbers: to resume and repeat it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from infoset.limits import COUNT, WHOLE, Number, check_fields
from infoset.sim.parallel import CampaignNoise
from infoset.sim.scenario import Scenario
from infoset.sim.storage.codec import from_json, to_json
from infoset.sim.storage.files import StorageError, reporting, write_whole

SCHEMA = 1
"""Version of the format; folders of other versions are refused."""
MANIFEST = "manifest.json"
"""Name of the manifest in the folder of a campaign."""
MAX_CELLS = 10_000
"""Maximum number of cells of a sweep: a map of 100 x 100 values. More are a mistake in --vary."""

_MAY_DIFFER = ("runs", "until", "cell_runs", "require", "extended", "versions.python")
"""Keys that may differ between the sessions of a campaign."""


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
    values: tuple[Number, ...]
    scale: Literal["linear", "log"] = "linear"

    def __post_init__(self) -> None:
        check_fields(self)
        if len(self.values) < 2:
            raise ValueError(f"{self.key}: an axis needs at least two values")


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """All that determines the numbers of a campaign or a sweep, its progress, and its chunks.

    A ValueError is raised if there are too many cells, or `cell_runs` does not fit.

    Parameters
    ----------
    runs : int
        Number of engagements of each cell; with `until` the maximum number.
    until : str or None
        The rule that may stop a campaign early, or the requirement that stops the cells of a sweep.
    cell_runs : tuple of int
        Engagements of each cell after the rule has stopped some of them; empty before.
    require : str or None
        Requirement of a sweep in the last session; it does not change any result.
    extended : bool
        Whether a later session of a sweep had more runs or another rule than the one before it.
    scenario : Scenario
        Scenario, in a sweep before it is varied.
    own_noise : str or None
        Name of the user's noise, written as `strategy` is; None is a noise of `CampaignNoise`.
    strategy : str
        Name; for a strategy in a Python file with the hash of the file: `mine.py:Mine
        sha256:0123456789abcdef`.
    chunk : int
        Engagements per file; the last file of a cell may have fewer. Results do not depend on it.
    axes : tuple of Axis
        Keys that a sweep varies, in all combinations of values; the last varies fastest. Empty for
        a campaign.
    cells_hash : str
        Fingerprint of the scenarios of a sweep's cells; empty for a campaign.
    versions : mapping of str to str
        Versions of the packages and of Python in the first session; only the latter may differ
        later.
    """

    runs: Annotated[int, COUNT]
    until: str | None = None
    cell_runs: tuple[int, ...] = ()
    require: str | None = None
    extended: bool = False
    scenario: Scenario
    seed: Annotated[int, WHOLE]
    noise: CampaignNoise
    own_noise: str | None = None
    strategy: str
    guarantee: bool
    chunk: Annotated[int, COUNT]
    axes: tuple[Axis, ...] = ()
    cells_hash: str = ""
    versions: Mapping[str, str]

    def __post_init__(self) -> None:
        if self.cells > MAX_CELLS:
            raise ValueError(
                f"axes make {self.cells} cells, more than the {MAX_CELLS} that a sweep may have"
            )
        if self.cell_runs and len(self.cell_runs) != self.cells:
            raise ValueError(f"cell_runs must contain {self.cells} numbers")

    @property
    def kind(self) -> str:
        """`campaign` or `sweep`."""
        return "sweep" if self.axes else "campaign"

    @property
    def is_watched(self) -> bool:
        """Whether the number of runs of a sweep may depend on its results, see `judge`."""
        return bool(self.axes) and (self.extended or self.until is not None)

    @property
    def cells(self) -> int:
        """Number of simulated scenarios."""
        return math.prod(len(axis.values) for axis in self.axes)

    @property
    def stopped_after(self) -> int | None:
        """Runs after which a rule stopped a campaign; None for a sweep, and if no rule did."""
        return self.cell_runs[0] if self.cell_runs and not self.axes else None

    def wanted_runs(self, cell: int) -> int:
        """Return the number of engagements of a cell, without those after a rule has stopped it."""
        return self.cell_runs[cell] if self.cell_runs else self.runs

    def chunks(self) -> Iterator[tuple[int, range]]:
        """Yield the cell and the runs of each chunk, the first chunk of each cell before others."""
        for first in range(0, self.runs, self.chunk):
            for cell in range(self.cells):
                end = self.wanted_runs(cell)
                if first < end:
                    yield cell, range(first, min(first + self.chunk, end))

    def values_of(self, cell: int) -> dict[str, float]:
        """Return the varied values of a cell of a sweep, by key."""
        values = {}
        # The last axis varies fastest: its number is the remainder.
        for axis in reversed(self.axes):
            cell, number = divmod(cell, len(axis.values))
            values[axis.key] = axis.values[number]
        return dict(reversed(values.items()))

    def decisive(self) -> dict[str, Any]:
        """Return the values that must be equal in all sessions of a campaign, by dotted key."""
        return {key: value for key, value in _flat(to_json(self)).items() if key not in _MAY_DIFFER}

    @property
    def identity(self) -> str:
        """Fingerprint of `decisive`; every file of runs contains it."""
        # 32 digits of a hash, 128 bits, tell all campaigns apart.
        text = json.dumps(self.decisive(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:32]

    def continued(self, wanted: Manifest, folder: Path) -> Manifest:
        """Return the manifest of this campaign, resumed with the runs and the rule of `wanted`.

        A StorageError, with all differences, is raised if they are different campaigns.
        """
        differences = _differences(self.decisive(), wanted.decisive())
        if differences:
            raise StorageError(
                f"{folder}: contains a campaign with different settings; repeat the command with "
                f"those of the folder, or choose another folder:{''.join(differences)}"
            )
        if wanted.runs < self.runs:
            option = "--max-runs" if wanted.axes and wanted.until else "--runs"
            raise StorageError(
                f"{folder}: the {self.kind} in this folder has {self.runs} runs, more than "
                f"{option} {wanted.runs}; give {option} {self.runs} or more"
            )

        is_same = wanted.runs == self.runs and wanted.until == self.until
        # Once the number of runs may depend on the results, it may in all later sessions.
        grows = bool(self.axes) and (
            self.is_watched or wanted.is_watched or wanted.runs > self.runs
        )
        return replace(
            wanted,
            versions=self.versions,
            cell_runs=self.cell_runs if is_same else (),
            extended=self.extended if is_same else grows,
        )

    def write(self, folder: Path) -> None:
        """Write the manifest into its folder atomically."""
        text = json.dumps({"schema": SCHEMA, **to_json(self)}, indent=1, allow_nan=False)
        write_whole(folder / MANIFEST, f"{text}\n".encode())


def read_manifest(folder: Path) -> Manifest:
    """Read the manifest of a folder.

    A StorageError, which names the invalid key, is raised if there is no readable one.
    """
    file = folder / MANIFEST
    if not file.is_file():
        raise StorageError(
            f"{folder}: contains no campaign and no sweep (no file {MANIFEST}); name a folder of "
            "infoset campaign or infoset sweep"
        )
    try:
        with reporting(file):
            return _parsed(file.read_bytes())
    except (ValueError, RecursionError) as error:
        raise StorageError(
            f"{file}: is not a readable manifest: {str(error)[:300]}; restore it from a copy, or "
            "use a new folder"
        ) from None


def _parsed(content: bytes) -> Manifest:
    value = json.loads(content)
    if not isinstance(value, dict) or value.pop("schema", None) != SCHEMA:
        raise ValueError(
            f"schema: must be {SCHEMA}, the only one that this version of infoset reads"
        )
    return from_json(Manifest, value)


def _flat(value: Any, path: str = "") -> dict[str, Any]:
    """Return the leaves of nested tables by dotted key; lists and empty tables are leaves.

    `Manifest.identity` hashes them: with other keys, stored campaigns would be refused.
    """
    if isinstance(value, dict) and value:
        return {
            name: leaf
            for key, inner in value.items()
            for name, leaf in _flat(inner, f"{path}.{key}" if path else str(key)).items()
        }
    return {path: value}


def _differences(there: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    """Return a line for each key with different values in the folder and now."""
    return [
        f"\n  {key}: {_shown(there, key)} in the folder, {_shown(here, key)} now"
        for key in dict.fromkeys((*there, *here))
        if there.get(key) != here.get(key)
    ]


def _shown(flat: Mapping[str, Any], key: str) -> str:
    return json.dumps(flat[key])[:200] if key in flat else "not set"
