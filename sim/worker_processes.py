"""Processes of this machine that fly chunks, and die with the process that began them."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor

_LOOK_EVERY_S = 0.5


@contextlib.contextmanager
def worker_processes(count: int) -> Iterator[Executor]:
    """Start processes that fly chunks; on leaving they are gone, with whatever they were at if an error leads out.

    Parameters
    ----------
    count : int

    Yields
    ------
    Executor

    Raises
    ------
    ValueError
        If `count` is not at least one.

    Notes
    -----
    They are spawned, never forked: a forked process would hold the lock of a campaign's folder beyond its parent.
    Threads share one interpreter, which half of the work of an engagement needs; processes do not, but each costs a
    second or two to start and the memory of a process.
    """
    if count < 1:
        raise ValueError(f"need at least one process: got {count}")
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(
        count, multiprocessing.get_context("spawn"), initializer=_live_and_die_with, initargs=(os.getpid(),)
    )
    try:
        yield pool
    except BaseException:
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def _live_and_die_with(parent: int) -> None:
    """Leave interrupts to the parent, and leave when it is gone: killed, it can tell nobody."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def look() -> None:
        while os.getppid() == parent:
            time.sleep(_LOOK_EVERY_S)
        os._exit(1)

    threading.Thread(target=look, daemon=True).start()
