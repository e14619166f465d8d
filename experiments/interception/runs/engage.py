"""`infoset engage`: simulation, files and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from time import perf_counter

from experiments.common.input_file import to_toml
from experiments.common.output import Cell, outcome_columns, output_of, to_csv, to_json
from experiments.common.screen import figure_files, progress_bar, say_warnings, show
from experiments.interception.command import Engage
from experiments.interception.record_file import record_path, write_record
from experiments.interception.runs.engagement_table import (
    FIGURES,
    draw_engagements,
    engagement_parts,
    need_times,
    read_times,
)
from experiments.interception.runs.shared import need_finite, summary_head
from experiments.interception.scenario_file import scenario_warnings, scenario_with
from experiments.interception.strategies import own_strategy
from guidance import NoiseKind
from infoset.sensors import SENSORS
from sim import AxisStep, Record, StepRecord, fly_one
from sim.storage.codec import fingerprint
from sim.versions import versions


def run(options: Engage) -> None:
    """Simulate one or two engagements, write the files and print the table."""
    scenario = scenario_with(options)
    own = own_strategy(options.strategy, scenario)
    times_s = read_times(options.times, options.out)
    both = options.noise == "both"
    noises = [*NoiseKind] if both else [NoiseKind(options.noise or scenario.noise)]
    record_files = {}
    if options.record is not None:
        file = record_path("--record", options.record)
        record_files = {
            noise: file.with_name(f"{file.stem}-{noise.value}{file.suffix}") if both else file for noise in noises
        }
    folder_records = [f"record-{noise.value}.npz" for noise in noises]
    names = ["scenario.toml", "results.json", "steps.csv", *folder_records, *figure_files(*FIGURES)]
    with (
        output_of(options, names, {f"--record ({file.name})": file for file in record_files.values()}) as written,
        progress_bar(options.quiet) as begin,
    ):
        warnings = scenario_warnings(scenario)
        say_warnings(warnings, options.quiet)
        records, summaries = [], {}
        for noise in noises:
            began_s = perf_counter()
            flown = replace(scenario, noise=noise)
            record = fly_one(
                flown, options.run, seed=options.seed, strategy=own, progress=begin(f"{noise.value} noise")
            )
            need_finite(record.result)
            records.append(record)
            summaries[noise.value] = {
                **summary_head(flown, warnings, own),
                **_summary(record, perf_counter() - began_s),
            }
        need_times(options.times, times_s, records)
        head = {"versions": versions(), "scenario_hash": fingerprint(scenario)}
        summary = {**head, **summaries} if both else summaries[noises[0].value]
        written.save("scenario.toml", to_toml(scenario if both else records[0].scenario))
        written.save("results.json", to_json(summary), "--json")
        written.save("steps.csv", steps_csv(records), "--csv")
        for record, name in zip(records, folder_records, strict=True):
            targets = [record_files.get(record.scenario.noise), None if options.out is None else options.out / name]
            for file in filter(None, targets):
                write_record(record, file, overwrite=options.overwrite)
                written.add(file)
        draw_engagements(records, times_s, written, begin)
    show(engagement_parts(records), options.quiet, stdout_taken=written.stdout_taken)


def _summary(record: Record, elapsed_s: float) -> dict[str, object]:
    scenario, first = record.scenario, record.inconsistency
    contradiction = first and {"step": first.step, "time_s": record.steps[first.step].time_s, "label_m": first.label_m}
    return {
        "seed": record.seed,
        "run": record.run,
        "runs": 1,
        "elapsed_s": elapsed_s,
        "published_curve": 1 + (scenario.range_sensor is not None) + 2 * (scenario.noise is NoiseKind.GAME),
        "noise": scenario.noise.value,
        "range_sensor": scenario.range_sensor is not None,
        **{name: values[0] for name, values in outcome_columns(record.result).items()},
        "hit": record.result.hit.tolist()[0],
        "inconsistency": contradiction,
        "steps": [
            {
                "time_s": step.time_s,
                **_line_of_sight(record, step),
                **_impulses(step),
                **{f"predicted_miss{mark}_m": axis.predicted_miss_m for mark, axis in _marked(step).items()},
                "sections": len(step.sections),
                "truth_margin_m": step.truth_margin_m,
            }
            for step in record.steps
        ],
    }


def steps_csv(records: Sequence[Record]) -> str:
    """Return a line for each step of engagements of one scenario, as CSV; in space, columns name the axis."""
    rows: list[dict[str, Cell]] = [
        {
            "noise": record.noise_name,
            "step": number,
            "time_s": step.time_s,
            **_line_of_sight(record, step),
            "true_range_m": step.true_range_m,
            **_impulses(step),
            **{
                f"predicted_miss{mark}_{end}_m": value
                for mark, axis in _marked(step).items()
                for end, value in zip(("lower", "upper"), axis.predicted_miss_m or (None, None), strict=True)
            },
            "truth_margin_m": step.truth_margin_m,
            "sections": len(step.sections),
        }
        for record in records
        for number, step in enumerate(record.steps)
    ]
    return to_csv([*rows[0]], [[*row.values()] for row in rows])


def _marked(step: StepRecord) -> dict[str, AxisStep]:
    """Return the axes by what names of columns contain: nothing in a plane, ``_y`` and ``_z`` in space."""
    return {"" if len(step.axes) == 1 else f"_{name}": axis for name, axis in step.axes.items()}


def _line_of_sight(record: Record, step: StepRecord) -> dict[str, float | None]:
    """Return the measured values and the true plane angles and rates."""
    axes, values = _marked(step), {}
    for kind in SENSORS:
        for mark, axis in axes.items():
            name = kind.name + mark * kind.is_lateral
            values[f"measured_{kind.quantity.replace(kind.name, name)}"] = axis.measured.get(kind.name)
    for quantity, unit in (("angle", "rad"), ("rate", "rad_s")):
        values |= {
            f"true_{quantity}{mark}_{unit}": getattr(axis, f"true_{quantity}_{unit}") for mark, axis in axes.items()
        }
    return values


def _impulses(step: StepRecord) -> dict[str, float]:
    """Return the impulse, in space the modulus and the components."""
    return {"impulse_m_s": step.impulse_m_s} | {
        f"impulse{mark}_m_s": a.impulse_m_s for mark, a in _marked(step).items()
    }
