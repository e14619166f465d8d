"""`infoset engage`: simulation, files and tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from infoset.experiments.common.output import outcome_columns
from infoset.experiments.common.screen import figure_files, show
from infoset.experiments.interception.command import Engage
from infoset.experiments.interception.record_file import record_bytes
from infoset.experiments.interception.runs.engagement_table import (
    draw_engagements,
    engagement_figures,
    engagement_parts,
)
from infoset.experiments.interception.runs.shared import need_finite, work_of
from infoset.experiments.interception.scenario_file import scenario_with
from infoset.experiments.interception.strategies import NOISES, chosen_noise, own_strategy
from infoset.experiments.interception.study import is_of_paper
from infoset.guidance import NoiseKind
from infoset.guidance.noise import NoiseSource
from infoset.guidance.thruster import modulus
from infoset.sim import Record, Scenario, fly_one
from infoset.sim.columns import Cell, csv_text


def run(options: Engage) -> None:
    """Simulate one or two engagements, write the files and print the table."""
    scenario = scenario_with(options)
    own = own_strategy(options.strategy)
    both = options.noise == "both"
    wanted = _noises_of(options, scenario)
    noises = [*wanted]
    if not both and isinstance(wanted[noises[0]], str):
        scenario = replace(scenario, noise=NoiseKind(noises[0]))
    names = [
        "steps.csv",
        *(f"record-{noise}.npz" for noise in noises),
        *figure_files(*engagement_figures(scenario)),
    ]

    with work_of(options, scenario, names, _record_files(options, noises)) as work:
        records = []
        summaries = {}
        for noise in noises:
            began_s = perf_counter()
            record = fly_one(
                scenario,
                options.run,
                seed=options.seed,
                strategy=own,
                noise=wanted[noise],
                progress=work.begin(f"{noise} noise"),
            )
            need_finite(record.result)
            records.append(record)
            summaries[noise] = _summary(record, perf_counter() - began_s)

        work.save(summaries if both else summaries[noises[0]])
        work.written.save("steps.csv", steps_csv(records), "--csv")
        for noise, record in zip(noises, records, strict=True):
            work.written.save(f"record-{noise}.npz", record_bytes(record), f"--record of {noise}")
        draw_engagements(records, work.written, work.begin)

    show(engagement_parts(records), options.quiet or work.written.stdout_taken)


def _noises_of(options: Engage, scenario: Scenario) -> dict[str, NoiseSource | str]:
    """Return the noises of the engagements by name: a built-in name, or a noise of a file."""
    chosen = chosen_noise(options.noise or scenario.noise.value, [*NOISES, "both"])
    if chosen == "both":
        return {"random": "random", "game": "game"}
    if isinstance(chosen, str):
        return {chosen: chosen}
    return {chosen.name: chosen}


def _record_files(options: Engage, noises: Sequence[str]) -> dict[str, Path | None]:
    """Return the files of ``--record`` by the names of outputs under which `run` saves them, one
    for each noise; the files of two engagements have their noises in their names too.

    A record that `run` saves under another name would not be written.
    """
    file = options.record
    if len(noises) == 1 or file is None:
        return {f"--record of {noise}": file for noise in noises}
    return {
        f"--record of {noise}": file.with_name(f"{file.stem}-{noise}{file.suffix}")
        for noise in noises
    }


def _summary(record: Record, elapsed_s: float) -> dict[str, object]:
    """Return the results of an engagement in JSON."""
    keys: dict[str, object] = {
        "seed": record.seed,
        "run": record.run,
        "runs": 1,
        "elapsed_s": elapsed_s,
    }
    if is_of_paper(record.scenario):
        is_game = record.noise_name == NoiseKind.GAME.value
        has_range_sensor = record.scenario.range_sensor is not None
        # Curves of the paper: 1 random, 2 random with range sensor, 3 game, 4 game with the sensor.
        keys["published_curve"] = 1 + has_range_sensor + 2 * is_game
    keys["noise"] = record.noise_name
    keys["strategy"] = record.strategy
    for name, values in outcome_columns(record.result).items():
        keys[name] = values[0]
    keys["hit"] = record.result.hit.tolist()[0]

    keys["inconsistency"] = None
    first = record.inconsistency
    if first is not None:
        keys["inconsistency"] = {
            "step": first.step,
            "time_s": float(record.time_s[first.step]),
            "label_m": first.label_m,
        }
    if record.scenario.information_set.wrong_images:
        keys["suspected_s"] = record.suspected_s
    keys["steps"] = _step_rows(record)
    return keys


def steps_csv(records: Sequence[Record]) -> str:
    """Return a line for each step of engagements of one scenario, as CSV.

    Columns of a lateral axis have its name.
    """
    rows = [{"noise": record.noise_name, **row} for record in records for row in _step_rows(record)]
    return csv_text([*rows[0]], [[*row.values()] for row in rows])


def _step_rows(record: Record) -> list[dict[str, Cell]]:
    """Return the values of each step; None where they are not known."""
    unknown = np.full((record.steps, len(record.scenario.set_model.axes)), np.nan)
    columns = {
        "time_s": record.time_s,
        "true_range_m": record.true_range_m,
        "measured_range_m": record.measured.get("range", unknown[:, 0]),
        "impulse_m_s": modulus(record.impulse_m_s.T),
    }

    for number, axis in enumerate(record.scenario.set_model.axes):
        columns |= {
            f"measured_angle_{axis}_rad": record.measured["angle"][:, number],
            f"measured_rate_{axis}_rad_s": record.measured.get("rate", unknown)[:, number],
            f"true_angle_{axis}_rad": record.true_angle_rad[:, number],
            f"true_rate_{axis}_rad_s": record.true_rate_rad_s[:, number],
            f"impulse_{axis}_m_s": record.impulse_m_s[:, number],
            f"predicted_miss_{axis}_lower_m": record.predicted_miss_m[:, number, 0],
            f"predicted_miss_{axis}_upper_m": record.predicted_miss_m[:, number, 1],
        }

    columns["truth_margin_m"] = record.truth_margin_m

    rows = []
    for step in range(record.steps):
        row: dict[str, Cell] = {"step": step}
        for name, values in columns.items():
            row[name] = None if np.isnan(values[step]) else float(values[step])
        row["sections"] = len(record.sections[step])
        rows.append(row)

    return rows
