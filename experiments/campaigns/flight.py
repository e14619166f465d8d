"""Simulation of a campaign or a sweep: workers, progress and error messages."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from functools import partial

from infoset.experiments.campaigns.cluster import workers_of
from infoset.experiments.campaigns.command import FlightOptions
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.output import need_writable
from infoset.experiments.common.screen import NOT_FINITE, progress_bar, say, say_warnings
from infoset.experiments.interception.scenario_file import (
    all_warnings,
    feasibility_warnings,
    scenario_warnings,
    study_scenario,
)
from infoset.experiments.interception.strategies import OwnNoise, chosen_noise, own_code_errors
from infoset.sim import Campaign, CampaignNoise, Scenario
from infoset.sim.requirement import AnyRequirement, least_runs
from infoset.sim.storage import MANIFEST, CampaignFolder, StorageError, need_free, read_manifest
from infoset.sim.versions import VersionError

SCENARIO_FILE = "scenario.toml"
"""Name of the scenario file in the folder of a campaign."""
RESUME_HINT = "; the stored runs are complete: continue with --resume"
MAX_WARNINGS = 5
"""Maximum number of warnings shown for a sweep, whose cells have similar warnings."""


def scenario_of(options: FlightOptions) -> tuple[Scenario, list[str]]:
    """Return the scenario of the options, and lines about it for the screen.

    It has the campaign's noise, unless this is the user's own. With --resume it has the model of
    the stored campaign, if there is one.
    """
    resumed = None
    if options.resume and (options.out / MANIFEST).is_file():
        resumed = read_manifest(options.out).scenario.information_set.model
    scenario, notes = study_scenario(options, resumed)
    noise = noise_of(options)
    if isinstance(noise, CampaignNoise):
        scenario = noise.applied_to(scenario)
    return scenario, notes


def noise_of(options: FlightOptions) -> CampaignNoise | OwnNoise | None:
    """Return the noise of the options; None is the noise of the scenario."""
    if options.noise is None:
        return None
    names = [noise.value for noise in CampaignNoise if noise is not CampaignNoise.OWN]
    chosen = chosen_noise(options.noise, names)
    return CampaignNoise(chosen) if isinstance(chosen, str) else chosen


def noises_at_once(options: FlightOptions) -> int:
    """Return the number of noises among which the runs of the options are divided; own noise: 1."""
    noise = noise_of(options)
    return len(noise.kinds) if isinstance(noise, CampaignNoise) else 1


def needed_runs(options: FlightOptions, required: AnyRequirement) -> int:
    """Return the least number of runs that can decide a requirement with each noise."""
    # `watched`: a campaign can be looked at and extended before it decides.
    return noises_at_once(options) * least_runs(required.share, watched=True)


def fly(
    campaign: Campaign, options: FlightOptions, notes: Sequence[str]
) -> tuple[CampaignFolder, list[str], float]:
    """Simulate the engagements that the folder of a campaign does not contain yet.

    Messages are printed on stderr.

    Return the folder, the warnings about the scenarios, all of them although a sweep shows few, and
    the time of the simulation in this session, s.
    """
    need_free(options.out, resume=options.resume)
    need_writable(options.out)
    warnings = _warnings(campaign)
    most = MAX_WARNINGS if campaign.cells else None
    say_warnings(warnings[:most], options.quiet, notes)

    note = partial(say, quiet=options.quiet)
    with (
        workers_of(options, campaign.max_engagements, note) as (executor, workers),
        progress_bar(options.quiet) as begin,
    ):
        began_s = time.perf_counter()
        folder = campaign.run(
            executor,
            workers=workers,
            resume=options.resume,
            progress=begin("campaign"),
            within_chunks=True,  # the bar moves within chunks of threads, too
        )

    return folder, warnings, time.perf_counter() - began_s


def _warnings(campaign: Campaign) -> list[str]:
    """Return the warnings about a scenario, or about the cells of a sweep.

    The feasibility, which takes long, is examined in the first and in the last cell only.
    """
    if not campaign.cells:
        return all_warnings(campaign.scenario)
    lines = [line for cell in campaign.cells for line in scenario_warnings(cell)]
    warnings = [*dict.fromkeys(lines)]
    # Every axis rises: the cells of the smallest and of the largest values.
    corners = dict.fromkeys((campaign.cells[0], campaign.cells[-1]))
    # Of two equal cells `fromkeys` keeps one.
    for name, cell in zip(("first", "last"), corners, strict=False):
        warnings += [f"{name} cell: {line}" for line in feasibility_warnings(cell)]
    return warnings


@contextlib.contextmanager
def campaign_errors(resume_hint: str = "") -> Iterator[None]:
    """Turn errors of a campaign into messages for the user, with a hint where it can be resumed."""
    try:
        with own_code_errors():
            yield
    except KeyboardInterrupt:
        raise KeyboardInterrupt(resume_hint) from None
    except MemoryError as error:
        raise InputError(
            f"not enough memory ({error}); free some, or give fewer --workers or a smaller "
            f"--chunk{resume_hint}"
        ) from None
    except StorageError as error:
        raise InputError(str(error)) from None
    except VersionError as error:
        raise InputError(
            f"--dask: other versions may compute other numbers: {error}; install the same versions "
            f"there{resume_hint}"
        ) from None
    except FloatingPointError:
        raise InputError(NOT_FINITE) from None
    except Exception as error:
        # The exceptions of a cluster can be named only where Dask is installed.
        is_of_cluster = type(error).__module__.startswith(("distributed.", "dask."))
        if not isinstance(error, CancelledError | BrokenExecutor) and not is_of_cluster:
            raise
        # Of a reason of any length, some lines; chosen.
        reason = str(error)[:200] or type(error).__name__
        raise InputError(
            f"a worker process or the cluster has stopped ({reason}){resume_hint}"
        ) from None
