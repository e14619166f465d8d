"""infoset engage: one engagement, step by step, and the paper's figures 2 and 3."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.options import Csv, Json, Out, Overwrite, Quiet, Seed, choice, whole_number
from experiments.interception.options import MOST_RUNS, ModelName, RangeMeter, ScenarioName, StrategyName, TieName

if TYPE_CHECKING:
    from experiments.common.output import Cell
    from guidance import Strategy
    from sim import Inconsistency, Record, Scenario

BOTH = "both"


def engage(
    scenario: ScenarioName = "asteroid-1997",
    noise: Annotated[
        str | None,
        typer.Option("--noise", metavar="random|game|both", help="Measurement noise, in place of the scenario's."),
    ] = None,
    range_meter: RangeMeter = None,
    strategy: StrategyName = None,
    model: ModelName = None,
    tie: TieName = None,
    seed: Seed = 0,
    run: Annotated[int, typer.Option("--run", metavar="K", help="Which run of that seed, from 0.")] = 0,
    record: Annotated[
        Path | None,
        typer.Option("--record", metavar="FILE.npz", help="Write the record; both noises: FILE-random, FILE-game."),
    ] = None,
    out: Out = None,
    json_: Json = None,
    csv: Csv = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Fly one engagement and show how it went; with --noise both, one under either noise.

    Run K is the same engagement, number for number, as run K of: infoset experiment with the same seed.
    Without --out, --json, --csv or --record nothing is written.
    """
    from experiments.common.output import STDOUT, checked_destinations, deliver, library_version, to_json
    from experiments.common.screen import say_warnings, tell_of_compiling
    from experiments.interception.choices import own_strategy, scenario_with
    from experiments.interception.scenario_file import scenario_hash, scenario_warnings

    whole_number("--seed", seed, 0, None, 0)
    whole_number("--run", run, 0, MOST_RUNS - 1, 0)
    given = scenario_with(scenario, strategy=strategy, model=model, tie=tie, range_meter=range_meter)
    own = own_strategy(strategy)
    flown = _with_noise(given, noise)
    records_at = [] if record is None else _record_paths(record, [each.noise.value for each in flown])
    files = {"--json": json_, "--csv": csv} | {f"--record ({each.name})": each for each in records_at}
    with checked_destinations(folder=out, names=_names(flown), files=files, overwrite=overwrite):
        warnings = scenario_warnings(given)
        say_warnings(warnings, quiet)
        tell_of_compiling(quiet)
        flights = _fly(flown, own, seed, run, quiet)
        summaries = {each.scenario.noise.value: _summary(each, took_s, warnings) for each, took_s in flights}
        if noise == BOTH:
            whole: dict[str, object] = {
                "version": library_version(),
                "scenario_hash": scenario_hash(given),
                **summaries,
            }
        else:
            (whole,) = summaries.values()
        records = [each for each, _ in flights]
        json_text, csv_text = to_json(whole), _to_csv(records)
        deliver(json_, json_text, overwrite=overwrite)
        deliver(csv, csv_text, overwrite=overwrite)
        _write_records(records, records_at, overwrite)
        if out is not None:
            _fill(out, flown[0] if len(flown) == 1 else given, records, json_text, csv_text, overwrite)
    if not quiet:
        from experiments.interception.commands.engagement_table import show_engagements

        show_engagements(records, STDOUT in (str(json_), str(csv)))


def _with_noise(scenario: Scenario, noise: str | None) -> list[Scenario]:
    from dataclasses import replace

    from guidance import NoiseKind

    if noise is None:
        return [scenario]
    kinds = [each.value for each in NoiseKind]
    choice("--noise", noise, [*kinds, BOTH])
    return [replace(scenario, noise=NoiseKind(kind)) for kind in (kinds if noise == BOTH else [noise])]


def _record_paths(record: Path, noises: Sequence[str]) -> list[Path]:
    """Return where the records go: one, or one a noise."""
    from experiments.interception.record_file import record_path

    record_path("--record", record)
    if len(noises) == 1:
        return [record]
    return [record.with_name(f"{record.stem}-{noise}{record.suffix}") for noise in noises]


def _names(flown: Sequence[Scenario]) -> list[str]:
    from experiments.common.screen import figure_files
    from experiments.interception.commands.engagement_table import FIGURE_2, FIGURE_3

    records = [f"record-{each.noise.value}.npz" for each in flown]
    return ["scenario.toml", "results.json", "steps.csv", *records, *figure_files(FIGURE_2, FIGURE_3)]


def _fly(
    flown: Sequence[Scenario], own: Strategy | None, seed: int, run: int, quiet: bool
) -> list[tuple[Record, float]]:
    from time import perf_counter

    from experiments.common.screen import need_finite, progress_bar
    from sim import fly_one

    flights = []
    with progress_bar(quiet) as begin:
        for each in flown:
            began_s = perf_counter()
            record = fly_one(each, run, seed=seed, strategy=own, progress=begin(f"{each.noise.value} noise"))
            need_finite(record.result)
            flights.append((record, perf_counter() - began_s))
    return flights


def _summary(record: Record, elapsed_s: float, warnings: Sequence[str]) -> dict[str, object]:
    from experiments.common.output import library_version, outcome_columns
    from experiments.interception.scenario_file import scenario_hash
    from guidance import NoiseKind
    from infoset.sensors import SENSORS

    scenario = record.scenario
    return {
        "version": library_version(),
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        **({"warnings": list(warnings)} if warnings else {}),
        "seed": record.seed,
        "run": record.run,
        "runs": 1,
        "elapsed_s": elapsed_s,
        "published_curve": 1 + (scenario.range_sensor is not None) + 2 * (scenario.noise is NoiseKind.GAME),
        "noise": scenario.noise.value,
        "range_meter": scenario.range_sensor is not None,
        **{name: values[0] for name, values in outcome_columns(record.result).items()},
        "inconsistency": None if record.inconsistency is None else _where(record, record.inconsistency),
        "steps": [
            {
                "time_s": step.time_s,
                **{f"measured_{kind.quantity}": step.measured.get(kind.name) for kind in SENSORS},
                "true_angle_rad": step.true_angle_rad,
                "true_rate_rad_s": step.true_rate_rad_s,
                "impulse_m_s": step.impulse_m_s,
                "predicted_miss_m": None if step.predicted_miss_m is None else list(step.predicted_miss_m),
                "sections": len(step.sections),
                "truth_margin_m": step.truth_margin_m,
            }
            for step in record.steps
        ],
    }


def _where(record: Record, found: Inconsistency) -> dict[str, object]:
    """Say at which step, and at which hypothesis, the data contradicted the model."""
    return {"step": found.step, "time_s": record.steps[found.step].time_s, "label_m": found.label_m}


def _to_csv(records: Sequence[Record]) -> str:
    from experiments.common.output import to_csv
    from infoset.sensors import SENSORS

    columns = (
        *("noise", "step", "time_s", *(f"measured_{kind.quantity}" for kind in SENSORS)),
        *("true_angle_rad", "true_rate_rad_s", "true_range_m", "impulse_m_s"),
        *("predicted_miss_lower_m", "predicted_miss_upper_m", "truth_margin_m", "sections"),
    )
    rows: list[list[Cell]] = []
    for record in records:
        for number, step in enumerate(record.steps):
            lower, upper = step.predicted_miss_m or (None, None)
            rows.append(
                [
                    record.scenario.noise.value,
                    number,
                    step.time_s,
                    *(step.measured.get(kind.name) for kind in SENSORS),
                    step.true_angle_rad,
                    step.true_rate_rad_s,
                    step.true_range_m,
                    step.impulse_m_s,
                    lower,
                    upper,
                    step.truth_margin_m,
                    len(step.sections),
                ]
            )
    return to_csv(columns, rows)


def _write_records(records: Sequence[Record], paths: Sequence[Path], overwrite: bool) -> None:
    if not paths:
        return
    from experiments.interception.record_file import write_record

    for record, path in zip(records, paths, strict=True):
        write_record(record, path, overwrite=overwrite)


def _fill(
    folder: Path, scenario: Scenario, records: Sequence[Record], json_text: str, csv_text: str, overwrite: bool
) -> None:
    from experiments.common.output import write_file
    from experiments.interception.commands.engagement_table import draw_engagements
    from experiments.interception.scenario_file import scenario_to_toml

    write_file(folder / "scenario.toml", scenario_to_toml(scenario), overwrite=overwrite)
    write_file(folder / "results.json", json_text, overwrite=overwrite)
    write_file(folder / "steps.csv", csv_text, overwrite=overwrite)
    paths = [folder / f"record-{record.scenario.noise.value}.npz" for record in records]
    _write_records(records, paths, overwrite)
    draw_engagements(records, folder)
