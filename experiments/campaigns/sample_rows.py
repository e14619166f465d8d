"""Rows of tables from stored runs, with a few columns in memory at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from infoset.sim import Results
from infoset.sim.columns import columns_of
from infoset.sim.storage import CampaignFolder

PASS_BYTES = 160_000_000
"""Memory of the columns that are read together, bytes: of ten million runs two columns of numbers,
of 700 000 runs all columns.

A pass needs up to four times as much, with the Parquet files and the work on one column. Every pass
opens all files, which takes as long as reading a few of their columns, so the columns of small
campaigns are read together.
"""
_BYTES = {float: 8, int: 8, bool: 2}
"""Memory of a value by its kind; a flag can be unknown."""
_TEXT_BYTES = 4
"""Memory of a text, which is stored as an index."""
_BYTES_A_RUN = {column.name: _BYTES.get(column.kind, _TEXT_BYTES) for column in columns_of(Results)}


@dataclass(frozen=True)
class Step:
    """A part of the rows of a table.

    `keys_of` returns the keys and values of a sample, which may be empty, from these columns.
    """

    columns: tuple[str, ...]
    keys_of: Callable[[pd.DataFrame], dict[str, Any]]


def noises_of(folder: CampaignFolder) -> list[str]:
    """Return the noises of a campaign."""
    return [kind.value for kind in folder.manifest.noise.kinds]


def rows_of_samples(folder: CampaignFolder, steps: Sequence[Step]) -> Iterator[dict[str, Any]]:
    """Yield the keys of all steps for each cell and noise, whose sample may be empty.

    A campaign has one cell. Only the columns of a few steps of one cell are in memory, at most
    about `PASS_BYTES` or one step.
    """
    noises = noises_of(folder)
    for cell, chunks in enumerate(folder.stored_chunks()):
        rows = {noise: {"cell": cell, "noise": noise} for noise in noises}
        runs = sum(len(part) for _, part in chunks)
        for together in _passes(steps, runs):
            _add_keys(rows, together, folder.read_chunks(chunks, ["noise", *_columns(together)]))
        yield from rows.values()


def _add_keys(rows: dict[str, dict[str, Any]], steps: Sequence[Step], read: pd.DataFrame) -> None:
    """Add the keys of some steps to the row of each noise."""
    for noise, row in rows.items():
        chosen = read["noise"] == noise
        for step in steps:
            row.update(step.keys_of(read.loc[chosen, [*step.columns]]))


def samples_of(folder: CampaignFolder, columns: Sequence[str]) -> dict[str, pd.DataFrame]:
    """Return some columns of the runs of a campaign by noise, without noises that have no runs."""
    read = folder.runs(["noise", *columns])
    samples = {noise: read.loc[read["noise"] == noise, [*columns]] for noise in noises_of(folder)}
    return {noise: runs for noise, runs in samples.items() if len(runs)}


def fits(columns: Sequence[str], runs: int) -> bool:
    """Return whether some columns of a number of runs may be in memory together."""
    return runs * sum(_BYTES_A_RUN[name] for name in columns) <= PASS_BYTES


def _passes(steps: Sequence[Step], runs: int) -> Iterator[list[Step]]:
    """Yield groups of steps in their order; the columns of a group are read together."""
    together: list[Step] = []
    for step in steps:
        wanted = [*together, step]
        if together and not fits(_columns(wanted), runs):
            yield together
            wanted = [step]
        together = wanted
    yield together


def _columns(steps: Sequence[Step]) -> list[str]:
    """Return the columns of some steps, each once."""
    return [*dict.fromkeys(name for step in steps for name in step.columns)]
