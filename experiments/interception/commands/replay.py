"""infoset replay: pages, figures and animations of recorded engagements, with no simulation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.options import Html, Out, Overwrite, Quiet

if TYPE_CHECKING:
    from sim import Record

MOST_RECORDS = 2
LEAST_SPEED, MOST_SPEED = 0.1, 1000.0


def replay(
    records: Annotated[
        list[Path], typer.Argument(metavar="A.npz [B.npz]", help="One record, or two to draw side by side.")
    ],
    html: Html = None,
    gif: Annotated[
        Path | None, typer.Option("--gif", metavar="FILE.gif", help="Write an animation of the sets.")
    ] = None,
    mp4: Annotated[
        Path | None, typer.Option("--mp4", metavar="FILE.mp4", help="The same as a film; needs the program ffmpeg.")
    ] = None,
    terminal: Annotated[
        bool, typer.Option("--terminal", help="Play here, in text; printed elsewhere, a few moments.")
    ] = False,
    speed: Annotated[
        float, typer.Option("--speed", metavar="STEPS_PER_S", help="How fast --terminal plays, steps a second.")
    ] = 10.0,
    out: Out = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Look at records of `infoset engage --record` again, without flying: a page to play, films, figures 2 and 3."""
    from experiments.common.errors import InputError
    from experiments.common.output import checked_destinations
    from experiments.common.page_document import page_path
    from experiments.common.screen import figure_files, say
    from experiments.interception.commands.engagement_table import (
        FIGURE_2,
        FIGURE_3,
        draw_engagements,
        show_engagements,
    )
    from experiments.interception.record_file import load_record

    if len(records) > MOST_RECORDS:
        raise InputError(f"replay draws one record or two, side by side; found {len(records)}: leave some out")
    if not (math.isfinite(speed) and LEAST_SPEED <= speed <= MOST_SPEED):
        raise InputError(
            f"--speed: must be from {LEAST_SPEED} to {MOST_SPEED:g}, found {speed:g}; for example --speed 10"
        )
    page_path("--html", html)
    _check_animations(gif, mp4)
    files = {"--html": html, "--gif": gif, "--mp4": mp4}
    with checked_destinations(folder=out, names=figure_files(FIGURE_2, FIGURE_3), files=files, overwrite=overwrite):
        found = [load_record(each) for each in records]
        if html is not None:
            from experiments.common.output import write_file
            from experiments.interception.page import interception_page

            write_file(html, interception_page(found), overwrite=overwrite)
        _write_animations(found, (gif, mp4), overwrite, quiet)
        if out is not None:
            draw_engagements(found, out)
    if terminal:
        from rich.console import Console

        from experiments.interception.terminal.engagement import play

        play(found, Console(highlight=False, markup=False), speed)
    elif not quiet:
        show_engagements(found, stdout_taken=False)
        if not any((out, html, gif, mp4)):
            say("give --html FILE.html for a page to play, --out DIR for the figures", quiet)


def _check_animations(gif: Path | None, mp4: Path | None) -> None:
    """Refuse what cannot be made, before anything is done."""
    if gif is None and mp4 is None:
        return
    from experiments.interception.figures.animation import GIF, MP4, animation_path

    animation_path("--gif", gif, GIF)
    animation_path("--mp4", mp4, MP4)


def _write_animations(records: Sequence[Record], paths: Sequence[Path | None], overwrite: bool, quiet: bool) -> None:
    wanted = [path for path in paths if path is not None]
    if not wanted:
        return
    from experiments.common.output import write_file
    from experiments.common.screen import progress_bar
    from experiments.interception.figures.animation import animate

    with progress_bar(quiet) as begin:
        for path in wanted:
            write_file(path, animate(records, path.suffix, begin(path.name)), overwrite=overwrite)
