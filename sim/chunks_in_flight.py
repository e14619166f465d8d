"""Chunks flown on any executor, a bounded number at a time."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from functools import partial
from threading import Event

from sim.chunk import Chunk, fly_chunk
from sim.results import Results

THREADS = "infoset-flight"
"""What the names of the threads begin with."""


def fly_on(executor: Executor, chunks: Iterable[Chunk], at_once: int) -> Generator[tuple[Chunk, Results], None, None]:
    """Fly chunks on an executor of somebody else's.

    Parameters
    ----------
    executor : Executor
        Of threads, of processes, or of another machine's.
    chunks : iterable of Chunk
    at_once : int
        How many are handed to the executor before the first comes back: what bounds the memory.

    Yields
    ------
    tuple of Chunk and Results
        As they are done, in any order.

    Notes
    -----
    Closed early, or broken by an error, it takes back what has not begun.
    """
    yield from _flying(executor, chunks, at_once, None)


def fly_on_threads(workers: int, chunks: Iterable[Chunk]) -> Generator[tuple[Chunk, Results], None, None]:
    """Fly chunks on threads of this process; the kernels release the interpreter.

    Parameters
    ----------
    workers : int
    chunks : iterable of Chunk

    Yields
    ------
    tuple of Chunk and Results
        As they are done, in any order.

    Notes
    -----
    Closed early, or broken by an error or an interrupt, it breaks off the chunks under way. Where memory ends in one,
    the others are not waited for: Numba does not let go of its lock if it ends while a kernel is compiled or loaded.
    """
    stopped = Event()
    pool = ThreadPoolExecutor(workers, thread_name_prefix=THREADS)
    enough_memory = True
    try:
        yield from _flying(pool, chunks, workers + 1, partial(_leave_if, stopped))
    except (MemoryError, SystemError, ImportError, OSError):
        # Of memory that ended, in all its forms: a lock that the thread held may be locked for ever. Nobody waits.
        enough_memory = False
        raise
    finally:
        stopped.set()
        pool.shutdown(wait=enough_memory, cancel_futures=True)


def _leave_if(stopped: Event) -> None:
    """Break off a chunk between its steps, in the thread that flies it."""
    if stopped.is_set():
        raise InterruptedError


def _flying(
    executor: Executor, chunks: Iterable[Chunk], at_once: int, check: Callable[[], None] | None
) -> Generator[tuple[Chunk, Results], None, None]:
    extra = () if check is None else (check,)
    waiting = iter(chunks)
    under_way: dict[Future[Results], Chunk] = {}
    try:
        while True:
            for chunk in itertools.islice(waiting, at_once - len(under_way)):
                under_way[executor.submit(fly_chunk, chunk, *extra)] = chunk
            if not under_way:
                return
            done, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in done:
                yield under_way.pop(future), future.result()
    finally:
        for future in under_way:
            future.cancel()
