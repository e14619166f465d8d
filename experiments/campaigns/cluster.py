"""Workers of a campaign: threads, processes, or a Dask cluster whose address, workers and versions are checked."""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import os
import re
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from experiments.campaigns.command import Flight
from experiments.common.errors import InputError, shown
from sim.flights import worker_processes
from sim.versions import CALCULATING, calculating_versions, differences, install_command

if TYPE_CHECKING:
    from distributed import Client

PATIENCE_S = 8.0
"""Time limit for the scheduler's answer, and then for its workers, s."""

RETRIES = 3
_ADDRESS = re.compile(r"(?P<protocol>tcp|tls)://(?P<host>\[[0-9a-fA-F:]+\]|[^\s/:\[\]]+):(?P<port>\d{1,5})/?")


@dataclass(frozen=True)
class Workers:
    """An executor, or None for threads; its chunks at a time, or the threads; and the number of cores."""

    executor: Executor | None
    at_once: int | None
    cores: int


@contextlib.contextmanager
def workers_of(options: Flight, note: Callable[[str], None]) -> Iterator[Workers]:
    """Start the workers that the options choose; `note` prints a line."""
    if sum(option is not None for option in (options.dask, options.workers, options.processes)) > 1:
        raise InputError("--workers, --processes and --dask (a cluster) cannot be combined; give only one of them")
    if options.dask is not None:
        if is_open(options.dask):
            note(
                f"warning: --dask: the connection to {options.dask} is not encrypted, and everyone who reaches that "
                "address can run programs there: use a private network, or tls:// (see the documentation, campaigns)"
            )
        with connected(options.dask) as cluster:
            note(f"{cluster.workers} Dask workers, {cluster.threads} threads")
            # With two chunks per thread all threads have work while results are sent, and workers can join later.
            yield Workers(cluster.executor, max(2 * cluster.threads, 16), cluster.threads)
    elif options.processes is not None:
        with worker_processes(options.processes) as pool:
            yield Workers(pool, 2 * options.processes, options.processes)
    else:
        yield Workers(None, options.workers, options.workers or os.cpu_count() or 1)


@dataclass(frozen=True)
class Cluster:
    """A connected cluster."""

    executor: Executor
    threads: int
    workers: int


@contextlib.contextmanager
def connected(address: str) -> Iterator[Cluster]:
    """Connect to the Dask scheduler at an address such as tcp://host:8786.

    Raise `InputError` if Dask is not installed, the scheduler does not answer in time or has no workers, or a worker
    has other versions of the packages.
    """
    parts = _ADDRESS.fullmatch(address)
    if parts is None or not 0 < int(parts["port"]) < 65536:
        raise InputError(f"--dask: must be an address such as tcp://host:8786, found {shown(address)}")
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            f"--dask: clusters need Dask, which is not installed: {install_command('distributed')}"
        ) from None
    # The failure of a scheduler is one message of the command, without tracebacks of the client's threads.
    for name in ("distributed", "distributed.client", "asyncio"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    _need_listener(address, parts["host"].strip("[]"), int(parts["port"]))
    _need_scheduler(address)
    try:
        client = Client(address, timeout=PATIENCE_S, set_as_default=False)
    except (OSError, ValueError, RuntimeError) as error:
        raise _silent(address, error) from None
    try:
        _need_workers(client, address)
        _need_same_versions(client)
        threads = client.nthreads()
        executor = client.get_executor(pure=False, retries=RETRIES)
        yield Cluster(executor, sum(threads.values()), len(threads))
    finally:
        with contextlib.suppress(OSError, RuntimeError):
            client.close(timeout=2)


def is_open(address: str) -> bool:
    """Whether a scheduler's address is neither encrypted nor on this machine only; False if it is not an address."""
    parts = _ADDRESS.fullmatch(address)
    if parts is None or parts["protocol"] == "tls":
        return False
    host = parts["host"].strip("[]")
    if host == "localhost":
        return False
    try:
        return not ipaddress.ip_address(host).is_loopback
    except ValueError:  # a host name, which may be that of any machine
        return True


def _need_listener(address: str, host: str, port: int) -> None:
    """Fail at once if no program listens at the address; the client of the cluster would retry."""
    try:
        with socket.create_connection((host, port), timeout=PATIENCE_S / 2):
            pass
    except OSError as error:
        raise _silent(address, error) from None


def _need_scheduler(address: str) -> None:
    """Check, with a time limit, that a scheduler listens at the address; the client may wait without a limit."""
    import asyncio

    from distributed.comm.core import connect
    from distributed.security import Security

    async def kind() -> object:
        arguments = Security().get_connection_args("client")
        comm = await connect(address, timeout=PATIENCE_S / 2, **arguments)
        try:
            await comm.write({"op": "identity", "reply": True})
            answer = await comm.read()
            return answer.get("type") if isinstance(answer, dict) else None
        finally:
            comm.abort()

    async def in_time() -> object:
        return await asyncio.wait_for(kind(), PATIENCE_S / 2)

    try:
        program = asyncio.run(in_time())
    except Exception as error:  # another program may send anything, and reading it may fail in any way
        raise _silent(address, error) from None
    if program != "Scheduler":
        raise _silent(address, OSError(0, f"it is a {str(program)[:40]}"))


def _silent(address: str, error: BaseException) -> InputError:
    reason = (error.strerror if isinstance(error, OSError) else "") or str(error) or "no answer in time"
    if not isinstance(error, OSError | TypeError):  # TypeError: no certificates for TLS
        reason = "the answer is not in Dask's protocol"
    return InputError(
        f"--dask: no Dask scheduler answers at {address} ({reason[:150]}); start one with: dask scheduler, and check "
        "the address that it prints"
    )


def _need_workers(client: Client, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=PATIENCE_S)
    except OSError:
        raise InputError(
            f"--dask: the scheduler at {address} has no workers; start some with: dask worker {address}"
        ) from None


def _need_same_versions(client: Client) -> None:
    """Refuse workers with other versions of the packages: their numbers may differ."""
    names = CALCULATING

    def versions_there() -> tuple[tuple[str, str], ...]:
        # Sent as code: a worker may not have this package.
        from importlib.metadata import PackageNotFoundError, version

        versions = []
        for name in names:
            try:
                versions.append((name, version(name)))
            except PackageNotFoundError:
                versions.append((name, "none"))
        return tuple(versions)

    answers: dict[str, Any] = client.run(versions_there, on_error="return")
    lines = []
    for worker, answer in sorted(answers.items()):
        if isinstance(answer, BaseException):
            lines.append(f"worker {worker} does not return its versions: {str(answer)[:100]}")
        else:
            differ = differences(calculating_versions(), answer)
            lines += [f"worker {worker}: {'; '.join(differ)}"] if differ else []
    if lines:
        more = f"\n  and {len(lines) - 10} more" if len(lines) > 10 else ""
        raise InputError(
            "--dask: workers with other versions may compute other numbers; install the same versions there:"
            + "".join(f"\n  {line}" for line in lines[:10])
            + more
        )
