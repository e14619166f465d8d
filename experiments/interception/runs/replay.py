"""`infoset replay`: pages, animations, figures and tables of recorded engagements."""

from __future__ import annotations

import shutil
from pathlib import Path

from experiments.common.errors import InputError
from experiments.common.output import output_of
from experiments.common.screen import figure_files, progress_bar, say, show, table_console
from experiments.interception.command import Replay
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
    files = {"--gif": options.gif, "--mp4": options.mp4}
    for option, file in files.items():
        _check_animation(option, file)
    with output_of(options, figure_files(*FIGURES), files) as written, progress_bar(options.quiet) as begin:
        records = [load_record(file) for file in options.records]
        need_times(options.times, times_s, records)
        if options.html is not None:
            written.deliver("--html", interception_page(records))
        for option, file in files.items():
            if file is not None:
                from experiments.interception.figures.animation import animate

                written.deliver(option, animate(records, file.suffix, options.frames, options.width, begin(file.name)))
        draw_engagements(records, times_s, written, begin)
    if options.terminal:
        play(records, table_console(False), options.speed)
    else:
        show(engagement_parts(records), options.quiet)
        if not written.written:
            say("--html FILE.html writes an interactive page, --out DIR writes the figures", options.quiet)


def _check_animation(option: str, path: Path | None) -> None:
    """Raise `InputError` if an animation file has another suffix, or the program that writes it is missing."""
    if path is None:
        return
    ending = option.replace("--", ".")
    if path.suffix != ending:
        raise InputError(f"{option}: {path} must end in {ending}; for example {option} flight{ending}")
    if option == "--mp4" and shutil.which("ffmpeg") is None:
        raise InputError(
            f"{option}: the program ffmpeg, which writes such files, is not on the path; install it (Debian: apt-get "
            "install ffmpeg), or use --gif flight.gif"
        )
