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
    feasibility_warnings,
    scenario_warnings,
    study_scenario,
)
from infoset.experiments.interception.strategies import OwnNoise, chosen_noise, own_code_errors
from infoset.sim import Campaign, CampaignNoise, Scenario
from infoset.sim.storage import MANIFEST, CampaignFolder, StorageError, need_free, read_manifest
from infoset.sim.versions import VersionError

SCENARIO_FILE = "scenario.toml"
"""Name of the scenario file in the folder of a campaign."""
RESUME_HINT = "; the stored runs are complete: continue with --resume"
MAX_WARNINGS = 5
"""Maximum number of warnings shown for a sweep, whose cells have similar warnings."""


def scenario_of(options: FlightOptions) -> tuple[Scenario, list[str]]:
    """Return the scenario that the options describe, with the campaign's noise, and lines about it
    for the screen.
    """
    resumed = None
    if options.resume and (options.out / MANIFEST).is_file():
        resumed = read_manifest(options.out).scenario.information_set.model
    scenario, notes = study_scenario(options, resumed)
    noise = noise_of(options)
    return (noise.applied_to(scenario) if isinstance(noise, CampaignNoise) else scenario), notes


def noise_of(options: FlightOptions) -> CampaignNoise | OwnNoise | None:
    """Return the noise of the options; None is that of the scenario."""
    if options.noise is None:
        return None
    names = [noise.value for noise in CampaignNoise if noise is not CampaignNoise.OWN]
    chosen = chosen_noise(options.noise, names)
    return CampaignNoise(chosen) if isinstance(chosen, str) else chosen


def fly(
    campaign: Campaign, options: FlightOptions, notes: Sequence[str]
) -> tuple[CampaignFolder, list[str], float]:
    """Simulate the engagements that the folder of a campaign does not contain yet, with messages on
    stderr.

    Return the folder, the warnings about the scenarios, and the time of this session, s.
    """
    need_free(options.out, resume=options.resume)
    need_writable(options.out)
    scenarios = campaign.cells or (campaign.scenario,)
    warnings = list(
        dict.fromkeys(line for scenario in scenarios for line in scenario_warnings(scenario))
    )
    corners = dict.fromkeys((scenarios[0], scenarios[-1]))
    for name, scenario in zip(
        ("first cell: ", "last cell: ") if campaign.cells else ("",), corners, strict=False
    ):
        warnings += [f"{name}{line}" for line in feasibility_warnings(scenario)]
    say_warnings(warnings[: MAX_WARNINGS if campaign.cells else None], options.quiet, notes)
    with (
        workers_of(options, campaign.max_engagements, partial(say, quiet=options.quiet)) as (
            executor,
            workers,
        ),
        progress_bar(options.quiet) as begin,
    ):
        began_s = time.perf_counter()
        folder = campaign.run(
            executor,
            workers=workers,
            resume=options.resume,
            progress=begin("campaign"),
            within_chunks=True,
        )
    return folder, warnings, time.perf_counter() - began_s


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
        reason = str(error)[:200] or type(error).__name__
        raise InputError(
            f"a worker process or the cluster has stopped ({reason}){resume_hint}"
        ) from None
