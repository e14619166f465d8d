"""`infoset replay`: pages, animations, figures and tables of recorded engagements."""

from __future__ import annotations

from experiments.common.errors import InputError
from experiments.common.output import output_of
from experiments.common.screen import figure_files, progress_bar, say, show, table_console
from experiments.interception.command import Replay
from experiments.interception.figures.animation import GIF, MP4, animate, animation_path
from experiments.interception.page import MOST_RECORDS, interception_page
from experiments.interception.record_file import load_record
from experiments.interception.runs.engagement_table import (
    FIGURES,
    draw_engagements,
    engagement_parts,
    need_times,
    read_times,
)
from experiments.interception.terminal import play


def run(options: Replay) -> None:
    """Read the records, write the files and print the table or the terminal replay."""
    if len(options.records) > MOST_RECORDS:
        raise InputError(f"replay needs one record or two records, found {len(options.records)}; omit some")
    times_s = read_times(options.times, options.out)
    animation_path("--gif", options.gif, GIF)
    animation_path("--mp4", options.mp4, MP4)
    files = {"--gif": options.gif, "--mp4": options.mp4}
    with output_of(options, figure_files(*FIGURES), files) as written, progress_bar(options.quiet) as begin:
        records = [load_record(file) for file in options.records]
        need_times(options.times, times_s, records)
        if options.html is not None:
            written.deliver("--html", interception_page(records))
        for option, file in files.items():
            if file is not None:
                written.deliver(option, animate(records, file.suffix, options.frames, options.width, begin(file.name)))
        draw_engagements(records, times_s, written, begin)
    if options.terminal:
        play(records, table_console(False), options.speed)
    else:
        show(engagement_parts(records), options.quiet)
        if not written.written:
            say("--html FILE.html writes an interactive page, --out DIR writes the figures", options.quiet)
