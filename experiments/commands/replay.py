"""infoset replay: figures and pages of recorded engagements, with no simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from experiments.commands._options import Html, Out, Overwrite, Quiet

MOST_RECORDS = 2


def replay(
    records: Annotated[
        list[Path], typer.Argument(metavar="A.npz [B.npz]", help="One record, or two to draw side by side.")
    ],
    html: Html = None,
    out: Out = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Look at records of `infoset engage --record` again, without flying: a page to play, figures 2 and 3."""
    from experiments.commands._engagement_table import FIGURE_2, FIGURE_3, draw_engagements, show_engagements
    from experiments.commands._screen import figure_files, say
    from experiments.errors import InputError
    from experiments.output import checked_destinations
    from experiments.pages.document import page_path
    from experiments.record_file import read_record

    if len(records) > MOST_RECORDS:
        raise InputError(f"replay draws one record or two, side by side; found {len(records)}: leave some out")
    page_path("--html", html)
    names = figure_files(FIGURE_2, FIGURE_3)
    with checked_destinations(folder=out, names=names, files={"--html": html}, overwrite=overwrite):
        found = [read_record(each) for each in records]
        if html is not None:
            from experiments.output import write_file
            from experiments.pages.interception import interception_page

            write_file(html, interception_page(found), overwrite=overwrite)
        if out is not None:
            draw_engagements(found, out)
    if not quiet:
        show_engagements(found, stdout_taken=False)
        if out is None and html is None:
            say("give --html FILE.html for a page to play, --out DIR for the figures", quiet)
