"""infoset replay: figures of recorded engagements, with no simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from experiments.commands._options import Out, Overwrite, Quiet

MOST_RECORDS = 2


def replay(
    records: Annotated[
        list[Path], typer.Argument(metavar="A.npz [B.npz]", help="One record, or two to draw side by side.")
    ],
    out: Out = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Draw figures 2 and 3 from records of `infoset engage --record`, without flying again."""
    from experiments.commands._engagement_table import FIGURE_2, FIGURE_3, draw_engagements, show_engagements
    from experiments.commands._screen import figure_files, say
    from experiments.errors import InputError
    from experiments.output import checked_destinations
    from experiments.record_file import read_record

    if len(records) > MOST_RECORDS:
        raise InputError(f"replay draws one record or two, side by side; found {len(records)}: leave some out")
    with checked_destinations(folder=out, names=figure_files(FIGURE_2, FIGURE_3), overwrite=overwrite):
        found = [read_record(each) for each in records]
        if out is not None:
            draw_engagements(found, out)
    if not quiet:
        show_engagements(found, stdout_taken=False)
        if out is None:
            say("give --out DIR for the figures", quiet)
