"""Simulation of runs in parallel: on threads or processes of this machine, or on a cluster."""

from __future__ import annotations

import contextlib
import itertools
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import dataclass, field, replace
from enum import Enum
from functools import partial
from multiprocessing.synchronize import Lock
from typing import NamedTuple

import numpy as np

from infoset.guidance import NoiseKind, Strategy
from infoset.guidance.noise import NoiseSource
from infoset.kernels import LOGGER, NOTICE
from infoset.sim.engagement import Step
from infoset.sim.results import Results, join
from infoset.sim.scenario import Scenario
from infoset.sim.simulate import simulate_runs
from infoset.sim.versions import need_versions, versions

_PARENT_CHECK_S = 0.5
"""Time between two checks of the parent process, s. Chosen: a worker ends soon after its parent.
"""


class CampaignNoise(Enum):
    """Measurement noise of a campaign: a `NoiseKind`, or one of the two below.

    MIXED is random noise in even runs and game noise in odd ones, OWN a noise of the user's own.
    """

    RANDOM: CampaignNoise
    GAME: CampaignNoise

    # All kinds become members, so that a new kind is added in `NoiseKind` only.
    _ignore_ = "_members _kind"
    _members = vars()
    for _kind in NoiseKind:
        _members[_kind.name] = _kind.value
    MIXED = "mixed"
    OWN = "own"

    @property
    def kinds(self) -> tuple[CampaignNoise, ...]:
        """Noises of run 0, 1, 2, ..., repeated."""
        if self is CampaignNoise.MIXED:
            return (CampaignNoise.RANDOM, CampaignNoise.GAME)
        return (self,)

    def of_run(self, run: int) -> CampaignNoise:
        """Return the noise of a run."""
        return self.kinds[run % len(self.kinds)]

    def applied_to(self, scenario: Scenario) -> Scenario:
        """Return a scenario with this noise; MIXED and OWN leave it unchanged."""
        if self in (CampaignNoise.MIXED, CampaignNoise.OWN):
            return scenario
        return replace(scenario, noise=NoiseKind(self.value))


@dataclass(frozen=True, eq=False)
class Task:
    """Runs of one scenario that one worker simulates.

    Parameters
    ----------
    runs : sequence of int
        Run numbers in increasing order.
    noise : CampaignNoise, NoiseSource or None
        Noise of the runs, or one of the user's own; None is the scenario's.
    cell : int
        Number of the scenario in a sweep.
    progress, observe : callable or None
        As for `simulate`; for threads only. With MIXED noise, random runs are simulated before game
        runs, and the index counts the runs of one noise.
    versions : dict of str to str
        Versions of the packages that must simulate the runs.
    """

    scenario: Scenario
    runs: Sequence[int]
    seed: int
    noise: CampaignNoise | NoiseSource | None = None
    guarantee: bool = True
    strategy: Strategy | None = None
    cell: int = 0
    progress: Callable[[float], None] | None = None
    observe: Callable[[int, Step], None] | None = None
    versions: dict[str, str] = field(default_factory=versions)


def simulate_tasks(
    tasks: Iterable[Task], executor: Executor | None = None, workers: int | None = None
) -> Generator[tuple[Task, Results], None, None]:
    """Simulate tasks on an executor and yield each with its results once it is finished.

    The order may differ from the order of the tasks. The results of a run depend neither on the
    executor nor on the other runs of its task. When the generator is closed or ends with an error,
    tasks that have not started are cancelled, and threads stop after their current step.

    Parameters
    ----------
    tasks : iterable of Task
        Tasks, of which a limited number is taken at a time.
    executor : Executor or None
        An executor of `concurrent.futures`, or one with the same interface. None uses threads of
        this process: the kernels release the interpreter's lock.
    workers : int or None
        Number of threads, by default one per core; with an executor the number of tasks that are
        submitted at a time, by default two per core.

    Raises
    ------
    VersionError
        If the workers have other versions of the packages.
    FloatingPointError
        If results are not finite.
    """
    cores = os.cpu_count() or 1
    stopped = threading.Event()
    if executor is None:
        pool: Executor = ThreadPoolExecutor(workers or cores)
        at_once = (workers or cores) + 1  # one waits, so that no thread is idle
        check = stopped.is_set
    else:
        pool = executor
        at_once = workers or 2 * cores
        check = None
    waiting = iter(tasks)
    running: dict[Future[Results], Task] = {}
    can_wait = True
    try:
        while True:
            for task in itertools.islice(waiting, at_once - len(running)):
                running[pool.submit(simulate_task, task, check)] = task
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(future), future.result()
    except MemoryError:
        # Numba may still hold its lock, and a running task would wait for it for ever.
        can_wait = False
        raise
    finally:
        stopped.set()
        for future in running:
            future.cancel()
        if executor is None:
            pool.shutdown(wait=can_wait, cancel_futures=True)


def simulate_task(task: Task, stopped: Callable[[], bool] | None = None) -> Results:
    """Return the results of the runs of a task, in the order of the runs; see `simulate_tasks`.

    The simulation ends with an InterruptedError after a step at which `stopped` returns true. A
    FloatingPointError is raised if results are not finite.
    """
    need_versions(task.versions)

    def progress(before: int, number: int, share: float) -> None:
        if stopped is not None and stopped():
            raise InterruptedError
        if task.progress is not None:
            task.progress((before + share * number) / len(task.runs))

    noise = task.noise or CampaignNoise(task.scenario.noise.value)
    own_noise = None if isinstance(noise, CampaignNoise) else noise
    campaign_noise = noise if isinstance(noise, CampaignNoise) else CampaignNoise.OWN
    parts: list[Results] = []
    before = 0
    for kind in campaign_noise.kinds:
        runs = [run for run in task.runs if campaign_noise.of_run(run) is kind]
        if runs:
            results_of_kind = simulate_runs(
                kind.applied_to(task.scenario),
                runs,
                seed=task.seed,
                strategy=task.strategy,
                noise=own_noise,
                guarantee=task.guarantee,
                progress=partial(progress, before, len(runs)),
                observe=task.observe,
            )
            parts.append(results_of_kind)
            before += len(runs)

    # The parts are in the order of their noises; `take` below restores the order of the runs.
    results = join(parts)
    if not is_finite(results):
        raise FloatingPointError(
            f"results of runs {task.runs[0]} to {task.runs[-1]} are not finite"
        )
    return results.take(np.argsort(results.runs))


def is_finite(results: Results) -> bool:
    """Whether no result overflowed."""
    values = (results.miss_m, results.impulse_m_s, results.guaranteed_miss_m.filled(0.0))
    return all(bool(np.isfinite(each).all()) for each in values)


@contextlib.contextmanager
def worker_processes(count: int) -> Iterator[Executor]:
    """Start processes that simulate tasks; they end with the context, after an error at once.

    Half of the work of an engagement needs the interpreter, which threads share and processes do
    not. A process takes one or two seconds to start. Processes are spawned: forked ones would keep
    the lock of a campaign's folder after this process has ended.
    """
    before = set(multiprocessing.active_children())
    spawning = multiprocessing.get_context("spawn")
    level = logging.ERROR if NOTICE.is_given else LOGGER.getEffectiveLevel()
    notice = _WorkerNotice(level, NOTICE.purpose, spawning.Lock())
    pool = ProcessPoolExecutor(
        count, spawning, initializer=_start_worker, initargs=(os.getpid(), notice)
    )
    try:
        yield pool
    except BaseException:
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


class _WorkerNotice(NamedTuple):
    """The notice about compiling in worker processes: level of its logger, purpose, and a lock.

    Only the process that acquires the lock, which is never released, gives the notice.
    """

    level: int
    purpose: str
    first: Lock


def _start_worker(parent: int, notice: _WorkerNotice) -> None:
    """Take over the notice about compiling from the parent, and end with it."""
    NOTICE.purpose = notice.purpose
    is_first = notice.first.acquire(block=False)
    LOGGER.setLevel(notice.level if is_first else logging.ERROR)
    _end_with(parent)


def _end_with(parent: int) -> None:
    """Ignore SIGINT (the parent handles it), and exit when the parent dies (the pool does not)."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_PARENT_CHECK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
