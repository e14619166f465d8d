"""What the commands that fly campaigns show: progress with rate and time left, estimates, quantiles."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from experiments.common.screen import number, say

if TYPE_CHECKING:
    from rich.console import Console

    from experiments.campaigns.samples import Sample
    from sim import Campaign
    from sim.campaign import Progress

ESTIMATED_FROM = 50_000
"""Engagements from which on time and disk are estimated before the work."""

LINE_EVERY_S = 60.0
BYTES_A_RUN, BYTES_A_SHARD = 66, 6_000
_WARM = 8


@contextlib.contextmanager
def campaign_progress(name: str, quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Show progress on stderr: a bar on a terminal, else a line a minute.

    Parameters
    ----------
    name : str
    quiet : bool
        Whether to show nothing.

    Yields
    ------
    callable
        Is told how far it is.
    """
    if quiet:
        yield lambda _progress: None
        return
    if not sys.stderr.isatty():
        last_s = time.monotonic()

        def line(progress: Progress) -> None:
            nonlocal last_s
            if time.monotonic() - last_s >= LINE_EVERY_S:
                last_s = time.monotonic()
                say(f"{name}: {progress.done} of {progress.total}, {_pace(progress)}", quiet)

        yield line
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[pace]}"))
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(name, total=None, pace="")
        yield lambda progress: bar.update(task, total=progress.total, completed=progress.done, pace=_pace(progress))


def _pace(progress: Progress) -> str:
    """The rate of this session, and the time left at it."""
    if not progress.flown:
        return "- runs/s"
    rate = progress.flown / max(progress.elapsed_s, 1e-9)
    return f"{number(rate)} runs/s, {duration((progress.total - progress.done) / rate)} left"


def duration(seconds: float) -> str:
    """Return a time as a person says it: 40 s, 3 min, 2 h 10 min, 5 days."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    if minutes < 100:
        return f"{minutes} min"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours < 48 else f"{hours / 24.0:.0f} days"


def size(count: float) -> str:
    """Return bytes as a person says them."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} TB"


def estimate(asked: Campaign, cores: int) -> str:
    """Estimate the time and the disk space of a campaign by flying a few of its engagements.

    Parameters
    ----------
    asked : Campaign
        Not yet flown.
    cores : int
        How many engagements are flown at the same time.

    Returns
    -------
    str
        A line.

    Raises
    ------
    InputError
        If the disk has not as much room.
    """
    import shutil
    from dataclasses import replace

    from experiments.common.errors import InputError
    from sim.chunk import fly_chunk
    from sim.simulate import ENGAGEMENTS_AT_ONCE

    manifest, folder = asked.manifest(), Path(asked.folder)
    chunk = asked.chunk_at(manifest.chunks // 2, manifest)
    fly_chunk(replace(chunk, runs=range(_WARM)))  # loads or compiles the kernels
    pilot = min(ENGAGEMENTS_AT_ONCE, asked.runs)
    began_s = time.perf_counter()
    fly_chunk(replace(chunk, runs=range(pilot)))
    seconds = (time.perf_counter() - began_s) / pilot * asked.engagements / cores
    needed = BYTES_A_RUN * asked.engagements + BYTES_A_SHARD * manifest.chunks
    there = next(each for each in (folder, *folder.absolute().parents) if each.is_dir())
    free = shutil.disk_usage(there).free
    said = (
        f"{asked.engagements} engagements: about {duration(seconds)} on {cores} core{'s' if cores > 1 else ''}, and "
        f"{size(needed)} in {manifest.chunks} shards"
    )
    if needed > free:
        raise InputError(f"{folder}: {said}, but the disk has {size(free)} left; make room, or ask for fewer runs")
    return said


def show_samples(console: Console, found: Sequence[Sample], model: str) -> None:
    """Print quantiles with their intervals, a block a noise, and how the runs ended.

    Parameters
    ----------
    console : Console
    found : sequence of Sample
        At least one.
    model : str
        Of the information set: the paper's guarantees nothing.
    """
    from rich.table import Table
    from rich.text import Text

    from sim import Outcome
    from sim.stopping_rule import level_name

    phi = "published Phi, m" if model == "paper" else "guaranteed miss, m"
    names = {"miss_m": "miss, m", "impulse_m_s": "impulse, m/s", "guaranteed_miss_m": phi}
    table = Table("noise", box=None, pad_edge=False)
    table.add_column("quantity", no_wrap=True)
    for each in found[0].quantiles["miss_m"]:
        table.add_column(level_name(each.level), justify="right")
    table.add_column("max", justify="right")
    notes = []
    for sample in found:
        for place, (quantity, estimates) in enumerate(sample.quantiles.items()):
            first = sample.noise if place == 0 else ""
            values = [number(each.value) for each in estimates]
            table.add_row(first, names[quantity], *values, number(sample.worst[quantity]))
            table.add_row("", "  at least", *(number(each.lower) for each in estimates), "", style="dim")
            table.add_row("", "  at most", *(number(each.upper) for each in estimates), "", style="dim")
        others = [f"{count} {name}" for name, count in sample.outcomes.items() if name != Outcome.INTERCEPTED.value]
        held = f", Phi held {sample.phi_held}/{sample.phi_known}" if sample.phi_known else ""
        notes.append(
            f"{sample.noise} noise, {sample.runs} runs: truth kept {sample.truth_kept}/{sample.runs}{held}; not "
            f"intercepted: {', '.join(others) or 'none'}"
        )
    console.print(table)
    for note in notes:
        console.print(Text(note), soft_wrap=True)
