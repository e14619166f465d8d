"""`infoset replay`: pages, animations, figures and tables of recorded engagements."""

from __future__ import annotations

import math

from infoset.experiments.common.errors import InputError, input_errors
from infoset.experiments.common.output import output_of
from infoset.experiments.common.screen import figure_files, progress_bar, show
from infoset.experiments.interception.command import Replay
from infoset.experiments.interception.page import MAX_RECORDS, interception_page
from infoset.experiments.interception.record_file import load_record
from infoset.experiments.interception.runs.engagement_table import (
    FIGURE_OF_MEMBERS,
    FIGURES,
    FIGURES_OF_PAPER,
    draw_engagements,
    engagement_parts,
)


def run(options: Replay) -> None:
    """Read the records, write the files and print the table."""
    if len(options.records) > MAX_RECORDS:
        raise InputError(
            f"replay needs one record or two records, found {len(options.records)}; omit some"
        )

    with input_errors("--times", "; for example --times 0.5,40,90"):
        times_s = [float(time_s) for time_s in options.times.split(",") if time_s]
        if not all(0.0 <= time_s < math.inf for time_s in times_s):
            raise ValueError("times must be finite and not negative")

    # The scenario, on which the names of the figures depend, is known after the records are read,
    # which can take long.
    names = dict.fromkeys([*FIGURES, *FIGURES_OF_PAPER, FIGURE_OF_MEMBERS])
    figures = figure_files(*names)
    with (
        output_of(options, figures, {"--gif": options.gif}) as written,
        progress_bar(options.quiet) as begin,
    ):
        records = [load_record(file) for file in options.records]
        if options.html is not None:
            written.deliver("--html", interception_page(records))
        if options.gif is not None:
            from infoset.experiments.interception.figures.animation import animate

            written.deliver("--gif", animate(records, progress=begin(options.gif.name)))
        draw_engagements(records, written, begin, times_s)

    show(engagement_parts(records), options.quiet)
