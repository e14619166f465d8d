"""Simulation of chunks on threads or processes of this machine or on a cluster, a limited number at a time."""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait

from sim.chunk import Chunk, fly_chunk
from sim.results import Results

THREADS = "infoset-flight"
"""Prefix of the names of the threads."""
_PARENT_CHECK_S = 0.5

Flights = Generator[tuple[Chunk, Results], None, None]


def fly_on(
    executor: Executor, chunks: Iterable[Chunk], at_once: int, check: Callable[[], None] | None = None
) -> Flights:
    """Simulate chunks and yield every chunk with its results as soon as it is finished, in any order.

    At most `at_once` chunks are submitted to the executor of threads, processes or a cluster at a time, which limits
    the memory. `check` is that of `fly_chunk`, for threads only. When the generator is closed or ends with an error,
    chunks that have not started are cancelled.
    """
    waiting = iter(chunks)
    under_way: dict[Future[Results], Chunk] = {}
    try:
        while True:
            for chunk in itertools.islice(waiting, at_once - len(under_way)):
                under_way[executor.submit(fly_chunk, chunk, *(() if check is None else (check,)))] = chunk
            if not under_way:
                return
            done, _ = wait(under_way, return_when=FIRST_COMPLETED)
            for future in done:
                yield under_way.pop(future), future.result()
    finally:
        for future in under_way:
            future.cancel()


def fly_on_threads(workers: int, chunks: Iterable[Chunk]) -> Flights:
    """Simulate chunks on threads of this process, as `fly_on` does; the kernels release the interpreter's lock.

    When the generator is closed or ends with an error or an interrupt, running chunks stop after their current step, by
    an InterruptedError. After a MemoryError it does not wait for running chunks, because Numba may then keep its lock.
    """
    stopped = threading.Event()

    def check() -> None:
        if stopped.is_set():
            raise InterruptedError

    pool = ThreadPoolExecutor(workers, thread_name_prefix=THREADS)
    enough_memory = True
    try:
        yield from fly_on(pool, chunks, workers + 1, check)
    except MemoryError:
        enough_memory = False
        raise
    finally:
        stopped.set()
        pool.shutdown(wait=enough_memory, cancel_futures=True)


@contextlib.contextmanager
def worker_processes(count: int) -> Iterator[Executor]:
    """Start processes that simulate chunks, and end the processes on exit from the context.

    After an error they end at once; if this process dies, they end too. Processes are spawned, because a forked process
    would keep the lock of a campaign's folder after the end of its parent. Half of the work of an engagement needs the
    interpreter, which threads share and processes do not. Each process takes one or two seconds to start, and needs
    additional memory. A ValueError is raised if `count` is less than one.
    """
    if count < 1:
        raise ValueError(f"need at least one process: got {count}")
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        count, multiprocessing.get_context("spawn"), initializer=_end_with, initargs=(os.getpid(),)
    )
    try:
        yield pool
    except BaseException:
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _end_with(parent: int) -> None:
    """Ignore SIGINT (the parent handles it); exit when the parent dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PARENT_CHECK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
