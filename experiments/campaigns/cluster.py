"""Workers of a campaign: threads or processes of this machine, or a Dask cluster."""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from urllib.parse import urlsplit

from infoset.experiments.campaigns.command import FlightOptions
from infoset.experiments.common.errors import InputError
from infoset.sim.parallel import worker_processes

PATIENCE_S = 8.0
"""Time limit for the scheduler's answer, and then for its workers, s; chosen."""
RUNS_OF_A_PROCESS = 1500
"""Minimum number of runs for each process, from which processes are used instead of threads: a
process takes a second or two to start, and so many runs take a core some seconds.

Later, processes are up to 1.2 times as fast as threads, which share the interpreter's lock.
"""
LOCAL = ("localhost", "127.0.0.1", "::1")
"""Hosts to which a connection does not leave the machine."""


@contextlib.contextmanager
def workers_of(
    options: FlightOptions, runs: int, note: Callable[[str], None]
) -> Iterator[tuple[Executor | None, int | None]]:
    """Start the workers that the options choose for a number of runs.

    Yield the arguments `executor` and `workers` of `Campaign.run`. `note` prints a line.
    """
    if options.dask is not None and options.workers is not None:
        raise InputError(
            "--workers and --dask (a cluster) cannot be combined; give only one of them"
        )

    workers = options.workers or os.cpu_count() or 1
    if options.dask is not None:
        with cluster(options.dask, note) as (executor, threads):
            # With two chunks per thread all threads have work while results are sent. With 16,
            # workers can join later.
            yield executor, max(2 * threads, 16)
    elif workers > 1 and runs >= RUNS_OF_A_PROCESS * workers:
        with worker_processes(workers) as pool:
            yield pool, 2 * workers  # two chunks for each, as above
    else:
        yield None, workers


@contextlib.contextmanager
def cluster(address: str, note: Callable[[str], None]) -> Iterator[tuple[Executor, int]]:
    """Connect to a Dask scheduler; yield its executor and number of threads.

    The address is for example tcp://host:8786. Raise `InputError` if the scheduler does not answer
    in time, or has no workers. The loggers of Dask stay silent afterwards.

    The scheduler repeats chunks of workers that have stopped
    (`distributed.scheduler.allowed-failures`). A chunk that raises an exception is not repeated:
    it would raise it again.
    """
    from distributed import Client

    if not address.startswith("tls://") and urlsplit(address).hostname not in LOCAL:
        note(
            f"warning: --dask: the connection to {address} is not encrypted, and everyone who "
            "reaches that address can run programs there: use a private network, or tls:// (see "
            "the documentation, campaigns)"
        )
    # A failure is one message of the command, without tracebacks of the threads of the client.
    for name in ("distributed", "distributed.client", "tornado.application", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)

    with contextlib.ExitStack() as stack:
        try:
            # Not the default client: Dask elsewhere in this process would use it.
            client = stack.enter_context(Client(address, timeout=PATIENCE_S, set_as_default=False))
        except Exception as error:  # another program sends anything; reading it fails in any way
            # Of a reason of any length, two lines; chosen.
            raise InputError(
                f"--dask: no Dask scheduler answers at {address} ({str(error)[:150]}); start one "
                "with: dask scheduler, and check the address that it prints"
            ) from None
        try:
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except OSError:
            raise InputError(
                f"--dask: the scheduler at {address} has no workers; start some with: dask worker "
                f"{address}"
            ) from None

        threads = client.nthreads()
        note(f"{len(threads)} Dask workers, {sum(threads.values())} threads")
        # Not `pure`: chunks with equal arguments would have one key, and an earlier result.
        yield client.get_executor(pure=False), sum(threads.values())
