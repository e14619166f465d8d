"""`infoset reproduce`: options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import typer

from infoset.experiments.common.options import Json, Overwrite, Quiet


@dataclass(frozen=True)
class Reproduce:
    """Compare every published number with the computed one.

    Each number has a verdict: agreed, possible (one printed run, and our runs differ too much to
    confirm it), misprint (with the correct number and the reason), explained by another model (with
    the number of this model), or not explained (with the attempted explanations). The exit code is
    1 if a number that should agree does not. Where a paper prints no numbers, those of another
    implementation stand in their place. Without --json no file is written.
    """

    paper: Annotated[
        Literal["interception", "pareto", "multipoint", "reachability", "pursuit"] | None,
        typer.Option(help="One paper. Default: all five."),
    ] = None
    json: Json = None
    overwrite: Overwrite = False
    quiet: Quiet = False
