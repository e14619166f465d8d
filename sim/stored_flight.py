"""A plan flown into a folder: what is missing there is flown, written, and looked at."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Generator
from concurrent.futures import Executor
from dataclasses import dataclass

from sim.chunk import Chunk
from sim.chunks_in_flight import fly_on, fly_on_threads
from sim.plan import CampaignNoise, Plan
from sim.results import Results
from sim.stopping_rule import StoppingRule, Watch
from sim.storage import CampaignFolder


@dataclass(frozen=True)
class Progress:
    """How far a campaign is.

    Parameters
    ----------
    done, total : int
        Engagements that are stored, those of earlier sessions among them, and all that may have to be.
    flown : int
        Engagements stored by this session.
    elapsed_s : float
        Since this session began.
    """

    done: int
    total: int
    flown: int
    elapsed_s: float


def fly_into(
    folder: CampaignFolder,
    plan: Plan,
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    rule: StoppingRule | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> None:
    """Fly what a folder lacks of a plan, and store each chunk as it is done.

    Parameters
    ----------
    folder : CampaignFolder
        Of this plan, locked.
    plan : Plan
    executor : Executor or None
        None is threads of this process.
    workers : int or None
        How many of them, or how many chunks an executor of one's own is given at once; None is a thread a core, and
        twice as many chunks.
    rule : StoppingRule or None
        Of a plan of one cell.
    progress : callable or None
        Is told how far it is, after each chunk.

    Raises
    ------
    StorageError
        If a shard cannot be written.
    VersionError
        If the executor flies with other versions.
    ValueError
        If there is not at least one worker.
    FloatingPointError
        If results are not finite.
    """
    if workers is not None and workers < 1:
        raise ValueError(f"need at least one worker: got {workers}")
    began_s = time.perf_counter()
    folder.discard_damaged()
    watch = None if rule is None else _watch(folder, plan, rule)
    if _stopped(folder, plan, watch):
        return
    missing = [index for index in range(plan.chunks) if index not in folder.finished]
    done, flown = plan.engagements - sum(plan.size(index) for index in missing), 0

    def tell() -> None:
        if progress is not None:
            progress(Progress(done, plan.engagements, flown, time.perf_counter() - began_s))

    tell()
    with contextlib.closing(_flights(plan, missing, executor, workers)) as flights:
        for chunk, results in flights:
            folder.write(chunk, results)
            done, flown = done + chunk.runs, flown + chunk.runs
            tell()
            if _stopped(folder, plan, watch):
                return


def _flights(
    plan: Plan, missing: list[int], executor: Executor | None, workers: int | None
) -> Generator[tuple[Chunk, Results], None, None]:
    chunks = map(plan.chunk_at, missing)
    cores = os.cpu_count() or 1
    if executor is None:
        return fly_on_threads(min(workers or cores, max(1, len(missing))), chunks)
    return fly_on(executor, chunks, workers or 2 * cores)


def _watch(folder: CampaignFolder, plan: Plan, rule: StoppingRule) -> Watch:
    noises = [each.value for each in (CampaignNoise.RANDOM, CampaignNoise.GAME)]
    flown = noises if plan.noise is CampaignNoise.MIXED else [plan.noise.value]
    return Watch(
        rule, len(flown), lambda index: folder.chunk_samples(index, rule.quantile.quantity, flown), plan.chunks
    )


def _stopped(folder: CampaignFolder, plan: Plan, watch: Watch | None) -> bool:
    """Whether a rule is met; then what was flown beyond is taken away."""
    if watch is None:
        return False
    met = watch.met(folder.finished.__contains__)
    if met is None:
        return False
    folder.stop_after(min(met * plan.chunk, plan.runs))
    return True
