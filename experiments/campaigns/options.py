"""What the commands that fly campaigns have in common: their options, and where they fly. Imports nothing heavy."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

SCENARIO_FILE = "scenario.toml"
"""Of a campaign's folder."""
MOST_WORKERS = 1024
MOST_AT_ONCE = 1_000_000

CampaignOut = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder for the runs, shard by shard; made if it is not there.")
]
NoiseName = Annotated[
    str | None,
    typer.Option(
        "--noise",
        metavar="random|game|mixed",
        help="Measurement noise, in place of the scenario's; mixed: random in even runs, game in odd ones.",
    ),
]
Chunk = Annotated[
    int | None,
    typer.Option("--chunk", metavar="N", help="Engagements a shard; it changes no number. Suits the runs by default."),
]
Workers = Annotated[
    int | None, typer.Option("--workers", metavar="W", help="Threads on this machine; as many as cores by default.")
]
Processes = Annotated[
    int | None,
    typer.Option(
        "--processes", metavar="W", help="Processes on this machine in place of threads: faster for long campaigns."
    ),
]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with what DIR holds; an empty DIR begins anew.")]
Dask = Annotated[
    str | None,
    typer.Option("--dask", metavar="ADDRESS", help="Fly on a Dask cluster: its scheduler, as tcp://host:8786."),
]


@dataclass(frozen=True)
class Crew:
    """Who flies.

    Parameters
    ----------
    executor : Executor or None
        None is threads of this process.
    workers : int or None
        Threads, or chunks that the executor is given at once.
    cores : int
        How many fly at the same time.
    """

    executor: Executor | None
    workers: int | None
    cores: int


def need_campaign_extra() -> None:
    """Say what to install, if what stores campaigns is not there.

    Raises
    ------
    InputError
        If it is not.
    """
    with campaign_errors():
        from sim.storage import need_arrow

        need_arrow()


def checked_noise(noise: str | None) -> str | None:
    """Return a campaign's noise if there is such a one.

    Parameters
    ----------
    noise : str or None

    Returns
    -------
    str or None

    Raises
    ------
    InputError
        If there is none.
    """
    from experiments.common.options import choice
    from sim import CampaignNoise

    return None if noise is None else choice("--noise", noise, [each.value for each in CampaignNoise])


@contextlib.contextmanager
def crew(dask: str | None, workers: int | None, processes: int | None, quiet: bool) -> Iterator[Crew]:
    """Call together who flies: threads or processes here, or the workers of a cluster.

    Parameters
    ----------
    dask : str or None
        Address of a scheduler.
    workers, processes : int or None
        Threads, or processes, here.
    quiet : bool

    Yields
    ------
    Crew

    Raises
    ------
    InputError
        If both are given, or there is no such cluster.
    """
    import os

    from experiments.common.errors import InputError
    from experiments.common.options import whole_number
    from experiments.common.screen import say

    for option, count in (("--workers", workers), ("--processes", processes)):
        if count is not None:
            whole_number(option, count, 1, MOST_WORKERS, 2)
    if sum(each is not None for each in (dask, workers, processes)) > 1:
        raise InputError(
            "--workers (threads here), --processes (here) and --dask (elsewhere) say who flies; leave all but one out"
        )
    if processes is not None:
        from sim.flights import worker_processes

        with worker_processes(processes) as pool:
            yield Crew(pool, 2 * processes, processes)
        return
    if dask is None:
        yield Crew(None, workers, workers or os.cpu_count() or 1)
        return
    from experiments.campaigns.cluster import connected, is_open

    if is_open(dask):
        say(
            f"warning: --dask: what is sent to {dask} is not encrypted, and whoever reaches it can run programs there: "
            "use a network of your own, or tls:// (see the documentation, campaigns)",
            quiet,
        )
    with connected(dask) as cluster:
        say(f"{cluster.workers} Dask workers, {cluster.threads} threads", quiet)
        # Two chunks a thread keep all busy while results travel; workers that join later are given some too.
        yield Crew(cluster.executor, max(2 * cluster.threads, 16), cluster.threads)


@contextlib.contextmanager
def campaign_errors(resume_hint: str = "") -> Iterator[None]:
    """Turn what can go wrong with a campaign into a message for a person.

    Parameters
    ----------
    resume_hint : str
        Is added where what is stored can be gone on with.

    Yields
    ------
    None
    """
    from concurrent.futures import BrokenExecutor, CancelledError

    from experiments.common.errors import InputError
    from experiments.common.screen import NOT_FINITE
    from sim.storage import StorageError
    from sim.versions import VersionError

    try:
        yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(resume_hint) from None
    except MemoryError as error:
        raise InputError(f"there is not enough memory ({error}); give it more, or --chunk less{resume_hint}") from None
    except StorageError as error:
        raise InputError(str(error)) from None
    except VersionError as error:
        raise InputError(
            f"--dask: a worker has other versions than here, and its numbers may differ: {error}; install the same "
            f"there{resume_hint}"
        ) from None
    except FloatingPointError:
        raise InputError(NOT_FINITE) from None
    except (CancelledError, BrokenExecutor) as error:
        said = f" ({str(error)[:200]})" if str(error) else ""
        raise InputError(
            f"what flies the chunks has gone, a cluster, its scheduler or a process{said}{resume_hint}"
        ) from None
    except Exception as error:
        if "can't start new thread" in str(error):
            raise InputError(
                f"there is no memory for another thread; give it more, or --workers 1{resume_hint}"
            ) from None
        # What a cluster raises is known only where Dask is installed.
        if not type(error).__module__.startswith(("distributed.", "dask.")):
            raise
        raise InputError(f"--dask: the cluster failed: {str(error)[:300]}{resume_hint}") from None
