"""`infoset replay`: options."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from experiments.common.options import Html, Out, Overwrite, Quiet


@dataclass(frozen=True)
class Replay:
    """Show records of `infoset engage --record` without simulating again: page, animations, figures 2 and 3."""

    records: Annotated[
        list[Path], typer.Argument(metavar="A.npz [B.npz]", help="One record, or two records to show side by side.")
    ]
    html: Html = None
    gif: Annotated[Path | None, typer.Option(metavar="FILE.gif", help="Write an animation of the sets.")] = None
    mp4: Annotated[
        Path | None, typer.Option(metavar="FILE.mp4", help="Write the animation as a video; needs the program ffmpeg.")
    ] = None
    terminal: Annotated[
        bool,
        typer.Option(
            "--terminal", help="Play as text in the terminal. If the output is not a terminal, print a few steps."
        ),
    ] = False
    speed: Annotated[
        float, typer.Option(metavar="STEPS_PER_S", min=0.1, max=1000.0, help="Speed of --terminal in steps per second.")
    ] = 10.0
    out: Out = None
    overwrite: Overwrite = False
    quiet: Quiet = False
