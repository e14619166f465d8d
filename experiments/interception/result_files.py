"""Files of results and records: `save` writes them, `load_results` reads results."""

from __future__ import annotations

import json
import os
from pathlib import Path

from infoset.experiments.common.errors import InputError, on_a_screen
from infoset.experiments.common.input_file import read_input
from infoset.experiments.common.output import to_json, write_file
from infoset.experiments.interception.record_file import LONGEST_REASON, write_record
from infoset.sim import Record, Results
from infoset.sim.results import from_columns

FORMAT = "infoset-results-1"
"""Value of the key ``format`` of a file of results; another number means other keys."""
MAX_FILE_BYTES = 1 << 28
"""Maximum size of a file that `load_results` reads, about 500 000 runs; `save` does not check it.
Chosen.

Larger samples are campaigns, which have files of their own.
"""
KEYS = ("format", "guarantees", "b_plane_t_rad", "burns_m_s", "columns")
"""Keys of a file of results: exactly those that `save` writes."""


def save(
    results: Results | Record, path: str | os.PathLike[str], *, overwrite: bool = False
) -> None:
    """Write results as JSON or CSV, or the record of one engagement as ``.npz``.

    Parameters
    ----------
    results : Results or Record
        What `simulate` or `fly_one` returned.
    path : str or path
        Its suffix selects the format. Results: ``.json``, which `load_results` reads again with all
        digits, or ``.csv``, a table for other programs. A record: ``.npz``, which `load_record`
        reads again.
    overwrite : bool
        Replace a file that exists.

    Raises
    ------
    InputError
        If the suffix is none of these, or the file exists or cannot be written.
    """
    file = Path(path)
    if isinstance(results, Record):
        write_record(results, file, overwrite=overwrite)
        return

    suffix = file.suffix.lower()
    if suffix == ".json":
        text = to_json(
            {
                "format": FORMAT,
                "guarantees": results.guarantees,
                "b_plane_t_rad": results.b_plane_t_rad,
                "burns_m_s": results.burns_m_s,
                "columns": results.to_dict(),
            }
        )
    elif suffix == ".csv":
        text = results.to_csv()
    else:
        raise InputError(f"{file}: results are written as .json or .csv; for example results.json")

    write_file(file, text, overwrite=overwrite)


def load_results(path: str | os.PathLike[str]) -> Results:
    """Read results that `save` wrote as ``.json``, with all columns and digits.

    `InputError` if the file has no results, or is damaged.
    """
    file = Path(path)
    content = read_input(file, MAX_FILE_BYTES)
    try:
        found = json.loads(content)
        if not isinstance(found, dict) or found.get("format") != FORMAT:
            raise ValueError(f'its key "format" is not "{FORMAT}"')
        if sorted(found) != sorted(KEYS):
            raise ValueError(f"its keys are not {', '.join(KEYS)}")
        return from_columns(
            found["columns"],
            guarantees=found["guarantees"],
            burns_m_s=found["burns_m_s"],
            b_plane_t_rad=found["b_plane_t_rad"],
        )
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        reason = on_a_screen(str(error)[:LONGEST_REASON])

    raise InputError(
        f"{file}: are not readable results: {reason}; infoset.save(results, 'FILE.json') makes them"
    )
