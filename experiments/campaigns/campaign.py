"""infoset campaign: as many engagements as one likes, stored as they are flown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from experiments.campaigns.options import (
    SCENARIO_FILE,
    CampaignOut,
    Chunk,
    Dask,
    NoiseName,
    Processes,
    Resume,
    Workers,
)
from experiments.common.options import Json, Overwrite, Quiet, Seed, whole_number
from experiments.interception.options import MOST_RUNS, ModelName, RangeMeter, ScenarioName, StrategyName, TieName

if TYPE_CHECKING:
    from collections.abc import Sequence

    from experiments.campaigns.options import Crew
    from experiments.campaigns.samples import Sample
    from sim import Campaign, CampaignResult, StoppingRule

SUMMARY = "summary.json"


def campaign(
    scenario: ScenarioName = "asteroid-1997",
    *,
    runs: Annotated[int, typer.Option("--runs", metavar="N", help="Engagements; with --until: at most.")],
    out: CampaignOut,
    noise: NoiseName = None,
    seed: Seed = 0,
    strategy: StrategyName = None,
    model: ModelName = None,
    tie: TieName = None,
    range_meter: RangeMeter = None,
    guarantee: Annotated[
        bool,
        typer.Option(
            "--guarantee/--no-guarantee",
            help="Whether the model guaranteed keeps its guaranteed miss Phi, which takes as long as all the rest.",
        ),
    ] = True,
    until: Annotated[
        str | None,
        typer.Option(
            "--until",
            metavar="RULE",
            help='Stop once a quantile\'s 95 % confidence interval is narrow enough: "miss_m p99 ci<0.5".',
        ),
    ] = None,
    chunk: Chunk = None,
    workers: Workers = None,
    processes: Processes = None,
    dask: Dask = None,
    resume: Resume = False,
    json_: Json = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Fly a campaign: thousands of engagements, each stored in DIR as soon as its shard is flown.

    Whatever ends it, --resume goes on with the same command line; more runs extend it. The numbers depend on the
    scenario, the seed and the run alone: not on workers, shards, or interruptions. Run K of a noise is the same
    engagement as: infoset engage --noise NOISE --run K. See it with: infoset report DIR.
    """
    from experiments.campaigns.options import (
        MOST_AT_ONCE,
        campaign_errors,
        checked_noise,
        crew,
        need_campaign_extra,
    )
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_json, write_file
    from experiments.common.screen import say_warnings, tell_of_compiling
    from experiments.interception.choices import scenario_with

    whole_number("--runs", runs, 1, MOST_RUNS, 10_000)
    whole_number("--seed", seed, 0, None, 0)
    if chunk is not None:
        whole_number("--chunk", chunk, 1, MOST_AT_ONCE, 1024)
    need_campaign_extra()
    from experiments.campaigns.samples import samples
    from experiments.interception.scenario_file import scenario_warnings
    from sim import Campaign, CampaignNoise
    from sim.storage import need_free

    named = checked_noise(noise)
    given = scenario_with(scenario, strategy=strategy, model=model, tie=tie, range_meter=range_meter)
    asked = Campaign(
        given,
        runs,
        out,
        seed=seed,
        noise=None if named is None else CampaignNoise(named),
        guarantee=guarantee,
        chunk=chunk,
        until=_rule(until),
    )
    hint = "; what is stored is whole: go on with --resume"
    with checked_destinations(files={"--json": json_}, overwrite=overwrite), campaign_errors(hint):
        need_free(out, resume=resume)
        warnings = scenario_warnings(given)
        say_warnings(warnings, quiet)
        with crew(dask, workers, processes, quiet) as flying:
            tell_of_compiling(quiet)
            _tell_estimate(asked, flying.cores, quiet)
            result, elapsed_s = _fly(asked, flying, resume, quiet)
        found = samples(result.folder)
        summary = _summary(result, found, elapsed_s, warnings)
        write_file(out / SUMMARY, to_json(summary), overwrite=True)
        deliver(json_, to_json(summary), overwrite=overwrite)
    if not quiet:
        _show(result, found, elapsed_s, str(json_) == STDOUT)


def _rule(until: str | None) -> StoppingRule | None:
    from experiments.common.errors import InputError
    from sim import StoppingRule

    if until is None:
        return None
    try:
        return StoppingRule.parse(until)
    except ValueError as error:
        raise InputError(f"--until: {error}") from None


def _tell_estimate(asked: Campaign, cores: int, quiet: bool) -> None:
    from experiments.campaigns.screen import ESTIMATED_FROM, estimate
    from experiments.common.screen import say

    if asked.runs >= ESTIMATED_FROM:
        said = estimate(asked, cores)
        say(f"{said}{' at most' if asked.until else ''}", quiet)


def _fly(asked: Campaign, flying: Crew, resume: bool, quiet: bool) -> tuple[CampaignResult, float]:
    from time import perf_counter

    from experiments.campaigns.screen import campaign_progress
    from experiments.common.screen import say
    from experiments.interception.scenario_file import scenario_to_toml

    began_s = perf_counter()
    with campaign_progress("campaign", quiet) as progress:
        result = asked.run(
            flying.executor,
            workers=flying.workers,
            resume=resume,
            progress=progress,
            beside={SCENARIO_FILE: scenario_to_toml(asked.manifest().scenario)},
        )
    for damage in result.redone:
        say(f"{damage.file}: {damage.reason}; flown again", quiet)
    return result, perf_counter() - began_s


def _summary(
    result: CampaignResult, found: Sequence[Sample], elapsed_s: float, warnings: Sequence[str]
) -> dict[str, object]:
    from experiments.campaigns.samples import heading, to_json

    return {
        **heading(result.folder),
        **({"warnings": list(warnings)} if warnings else {}),
        "elapsed_s": elapsed_s,
        "redone": [{"file": each.file.name, "reason": each.reason} for each in result.redone],
        "samples": [to_json(each) for each in found],
    }


def _show(result: CampaignResult, found: Sequence[Sample], elapsed_s: float, stdout_taken: bool) -> None:
    from rich.text import Text

    from experiments.campaigns.screen import duration, show_samples
    from experiments.common.screen import table_console

    manifest = result.folder.manifest
    console = table_console(stdout_taken)
    stopped = "" if manifest.stopped_after is None else f" of {manifest.runs}, stopped by {manifest.until}"
    console.print(
        Text(
            f"{manifest.scenario.name}, {len(result)} runs{stopped}, {duration(elapsed_s)}; quantiles, 95 % intervals"
        ),
        soft_wrap=True,
    )
    show_samples(console, found, manifest.scenario.set_model.kind.value)
    if manifest.until is not None and manifest.stopped_after is None:
        console.print(Text(f"{manifest.until} was not met: give more --runs, with --resume"), soft_wrap=True)
    console.print(Text(f"see it with: infoset report {result.folder.path}"), soft_wrap=True)
