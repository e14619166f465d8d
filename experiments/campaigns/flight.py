"""Simulation of a campaign or a sweep: workers, progress and error messages."""

from __future__ import annotations

import contextlib
import shutil
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn
from rich.progress import Progress as ProgressBars

from experiments.campaigns.cluster import workers_of
from experiments.campaigns.command import Flight
from experiments.common.errors import InputError
from experiments.common.input_file import to_toml
from experiments.common.screen import LINE_EVERY_S, NOT_FINITE, number, say
from experiments.interception.scenario_file import scenario_warnings, study_scenario
from sim import Campaign, CampaignNoise, CampaignResult, Scenario
from sim.campaign import Progress
from sim.flights import fly_on_threads
from sim.simulate import ENGAGEMENTS_AT_ONCE
from sim.storage import MANIFEST, StorageError, need_free, read_manifest
from sim.versions import VersionError

SCENARIO_FILE = "scenario.toml"
"""Name of the scenario file in the folder of a campaign."""
RESUME_HINT = "; the stored runs are complete: continue with --resume"
ESTIMATED_FROM = 50_000
"""Number of engagements from which time and disk space are estimated first."""

MAX_WARNINGS = 5
"""Maximum number of warnings shown for a sweep, whose cells have similar warnings."""
BYTES_A_RUN, BYTES_A_SHARD = 66, 6_000
_WARM_UP = 8


def scenario_of(options: Flight) -> tuple[Scenario, list[str]]:
    """Return the scenario that the options describe, with the campaign's noise, and lines about it for the screen."""
    resumed = None
    if options.resume and (options.out / MANIFEST).is_file():
        resumed = read_manifest(options.out).scenario.information_set.model
    scenario, notes = study_scenario(options, resumed)
    return (scenario if options.noise is None else CampaignNoise(options.noise).applied_to(scenario)), notes


@dataclass(frozen=True)
class Flown:
    """A simulated campaign or sweep, the warnings about its scenarios, and the time of this session."""

    result: CampaignResult
    warnings: list[str]
    elapsed_s: float


def fly(campaign: Campaign, options: Flight, notes: Sequence[str]) -> Flown:
    """Simulate the engagements that the folder of a campaign does not contain yet, with messages on stderr."""
    need_free(options.out, resume=options.resume)
    note = partial(say, quiet=options.quiet)
    files = {SCENARIO_FILE: to_toml(campaign.scenario)}
    scenarios = campaign.cells or (campaign.scenario,)
    warnings = list(dict.fromkeys(line for scenario in scenarios for line in scenario_warnings(scenario)))
    for line in notes:
        note(line)
    for warning in warnings[: MAX_WARNINGS if campaign.cells else None]:
        note(f"warning: {warning}")
    with workers_of(options, note) as workers, campaign_progress(campaign.kind, options.quiet) as progress:
        if campaign.engagements >= ESTIMATED_FROM:
            note(_estimate(campaign, workers.cores))
        began_s = time.perf_counter()
        result = campaign.run(
            workers.executor, workers=workers.at_once, resume=options.resume, progress=progress, beside=files
        )
    for damage in result.redone:
        note(f"{damage.file}: {damage.reason}; its runs were simulated again")
    return Flown(result, warnings, time.perf_counter() - began_s)


@contextlib.contextmanager
def campaign_errors(resume_hint: str = "") -> Iterator[None]:
    """Turn errors of a campaign into messages for the user, with a hint where it can be resumed."""
    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(resume_hint) from None
    except MemoryError as error:
        raise InputError(
            f"not enough memory ({error}); free some, or give fewer --workers or a smaller --chunk{resume_hint}"
        ) from None
    except StorageError as error:
        raise InputError(str(error)) from None
    except VersionError as error:
        raise InputError(
            f"--dask: a worker has other versions of the packages, and its numbers may differ: {error}; install the "
            f"same versions there{resume_hint}"
        ) from None
    except FloatingPointError:
        raise InputError(NOT_FINITE) from None
    except (CancelledError, BrokenExecutor) as error:
        reason = f" ({str(error)[:200]})" if str(error) else ""
        raise InputError(f"a worker process or the cluster has stopped{reason}{resume_hint}") from None
    except Exception as error:
        # The exceptions of a cluster can be named only where Dask is installed.
        if not type(error).__module__.startswith(("distributed.", "dask.")):
            raise
        raise InputError(f"--dask: the cluster failed: {str(error)[:300]}{resume_hint}") from None


def _estimate(campaign: Campaign, cores: int) -> str:
    """Return a line with the time and the disk space of a campaign, measured on a few of its engagements."""
    manifest, folder = campaign.manifest(), Path(campaign.folder)
    chunk = campaign.chunk_at(manifest.chunks // 2, manifest)
    pilot = range(min(ENGAGEMENTS_AT_ONCE, campaign.runs))
    list(fly_on_threads(1, [replace(chunk, runs=range(_WARM_UP))]))  # loads or compiles the kernels
    began_s = time.perf_counter()
    list(fly_on_threads(1, [replace(chunk, runs=pilot)]))
    seconds = (time.perf_counter() - began_s) / len(pilot) * campaign.engagements / cores
    needed = BYTES_A_RUN * campaign.engagements + BYTES_A_SHARD * manifest.chunks
    existing = next(path for path in (folder, *folder.absolute().parents) if path.is_dir())
    free = shutil.disk_usage(existing).free
    most, about = ("at most ", "at most") if campaign.until else ("", "about")
    line = (
        f"{most}{campaign.engagements} engagements: {about} {duration(seconds)} on {cores} "
        f"core{'s' if cores > 1 else ''}, and {most}{size(needed)} in {manifest.chunks} shards"
    )
    if needed > free:
        raise InputError(f"{folder}: {line}, but the disk has {size(free)} left; free some space, or give fewer --runs")
    return line


@contextlib.contextmanager
def campaign_progress(name: str, quiet: bool) -> Iterator[Callable[[Progress], None]]:
    """Yield a function that shows progress on stderr: a bar on a terminal, otherwise a line every `LINE_EVERY_S`."""
    if quiet:
        yield lambda _: None
    elif not sys.stderr.isatty():
        last_s = time.monotonic()

        def line(progress: Progress) -> None:
            nonlocal last_s
            if time.monotonic() - last_s >= LINE_EVERY_S:
                last_s = time.monotonic()
                of = " runs" if progress.undecided is not None else f" of {progress.total}"
                typer.echo(f"{name}: {progress.done}{of}, {_pace(progress)}", err=True)

        yield line
    else:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[pace]}"),
        )
        with ProgressBars(*columns, console=Console(stderr=True), transient=True) as bars:
            task = bars.add_task(name, total=None, pace="")
            yield lambda progress: bars.update(
                task, total=progress.total, completed=progress.done, pace=_pace(progress)
            )


def _pace(progress: Progress) -> str:
    """Return the rate of this session, and the time left at this rate."""
    if not progress.flown:
        return "- runs/s"
    rate = progress.flown / max(progress.elapsed_s, 1e-9)
    if progress.undecided is not None:
        return f"{number(rate)} runs/s, {progress.undecided} cells undecided"
    return f"{number(rate)} runs/s, {duration((progress.total - progress.done) / rate)} left"


def duration(seconds: float) -> str:
    """Return a time in suitable units: 40 s, 3 min, 2 h 10 min, 5 days."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    if minutes < 100:
        return f"{minutes} min"
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours < 48 else f"{hours / 24.0:.0f} days"


def size(count: float) -> str:
    """Return a number of bytes in suitable units."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} TB"
