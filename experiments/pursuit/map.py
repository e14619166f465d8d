"""`infoset pursuit-map`: computation, files and summary."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from experiments.common.errors import InputError, shown
from experiments.common.input_file import changed, keys_of, numeric_key, similar_key
from experiments.common.output import Cell, to_csv
from experiments.common.problem_command import ProblemCommand
from experiments.common.screen import BeginProgress
from experiments.common.units import M_PER_KM, S_PER_HOUR
from experiments.pursuit.command import PursuitMap
from experiments.pursuit.file import PursuitProblem
from rendezvous.pursuit_evasion import STATUSES, CaptureMap, Game, PointStatus, capture_map
from rendezvous.two_body import OrbitalElements

MAX_POINTS = 100_000
RATIOS = ("phase_deg", "thrust_ratio")
"""Parameters besides the keys of a file: lead of the evader in true longitude, its thrust by the pursuer's."""
STATUS_WORDS = {
    PointStatus.FOLLOWED: "solved from scratch",
    PointStatus.NEIGHBOUR: "continued from a neighbour",
    PointStatus.NOT_CERTIFIED: "not certified",
    PointStatus.ESCAPES: "escape",
    PointStatus.PROPELLANT_EXHAUSTED: "propellant exhausted",
    PointStatus.NO_GAME: "no game",
}


@dataclass(frozen=True)
class Axis:
    """A parameter of the map and its values, in the unit of its name."""

    parameter: str
    values: NDArray[np.float64]


@dataclass(frozen=True)
class MapReport:
    """Results of one command."""

    problem: PursuitProblem
    x: Axis
    y: Axis
    solved: CaptureMap


def solve_map(problem: PursuitProblem, options: PursuitMap, begin: BeginProgress) -> MapReport:
    """Return the solutions of the games of the grid."""
    x, y = read_axis("--x", options.columns), read_axis("--y", options.rows)
    if x.parameter == y.parameter:
        raise InputError(f"--y: {y.parameter} is also the parameter of --x; choose another")
    if len(x.values) * len(y.values) > MAX_POINTS:
        raise InputError(f"--x and --y: there are more than {MAX_POINTS} points; choose fewer")
    solved = capture_map(
        lambda column, row: game_at(problem, {x.parameter: column, y.parameter: row}),
        x.values,
        y.values,
        follow_all=options.certify,
        progress=begin("map"),
    )
    return MapReport(problem, x, y, solved)


def game_at(problem: PursuitProblem, values: Mapping[str, float]) -> Game:
    """Return the game with other values of parameters, those of `RATIOS` last.

    Raises
    ------
    ValueError
        If the values define no game.
    InputError
        If `phase_deg` is varied, and a player has no orbit.
    """
    keys = {key: value for key, value in values.items() if key not in RATIOS}
    try:
        problem = changed(problem, keys, problem.name) if keys else problem
    except InputError as error:
        raise ValueError(str(error)) from None
    pursuer, evader = problem.pursuer, problem.evader
    if "phase_deg" in values:
        if pursuer.orbit is None or evader.orbit is None:
            raise InputError("phase_deg: both players must have the table orbit; vary other keys instead")
        lead_rad = _true_longitude_rad(pursuer.orbit) - _true_longitude_rad(evader.orbit)
        anomaly_rad = evader.orbit.true_anomaly_rad + lead_rad + math.radians(values["phase_deg"])
        evader = replace(evader, orbit=replace(evader.orbit, true_anomaly_rad=anomaly_rad))
    if "thrust_ratio" in values:
        evader = replace(evader, thrust_N=values["thrust_ratio"] * pursuer.thrust_N)
    return replace(problem, evader=evader).game


def _true_longitude_rad(orbit: OrbitalElements) -> float:
    return orbit.raan_rad + orbit.argument_of_perigee_rad + orbit.true_anomaly_rad


def read_axis(option: str, text: str) -> Axis:
    """Read KEY=FROM:TO:N; raise `InputError` if it has another form, an unknown parameter, or a value out of range."""
    key, _, span = text.partition("=")
    if key not in RATIOS and numeric_key(PursuitProblem, key) is None:
        guess = similar_key(key, [*RATIOS, *keys_of(PursuitProblem)])
        hint = f"did you mean {guess}?" if guess else f"choose {', '.join(RATIOS)} or a key of the file"
        raise InputError(f"{option}: there is no parameter {shown(key)}; {hint}")
    try:
        low_text, high_text, count_text = span.split(":")
        low, high, count = float(low_text), float(high_text), int(count_text)
    except ValueError:
        low, high, count = 0.0, 0.0, 0
    if not (-1e15 <= low < high <= 1e15 and 2 <= count <= MAX_POINTS):
        raise InputError(
            f"{option}: must be KEY=FROM:TO:N with FROM less than TO and at least 2 values, found {shown(text)}; for "
            f"example {option} thrust_ratio=0:0.8:17"
        )
    return Axis(key, np.linspace(low, high, count))


def report_json(report: MapReport) -> dict[str, object]:
    """Return the results for `experiments.common.output.to_json`."""
    solved = report.solved
    return {
        "x": report.x,
        "y": report.y,
        "points": solved.status.size,
        "counts": {status.value: solved.count(status) for status in PointStatus},
        "solved_from_nothing": solved.solved_from_nothing,
        "capture_time_s": solved.capture_s,
        "closing_speed_km_s": solved.closing_speed_m_s / M_PER_KM,
        "status": [[STATUSES[status] for status in row] for row in solved.status],
    }


def report_csv(report: MapReport) -> str:
    """Return a line for each point as CSV."""
    x, y, solved = report.x, report.y, report.solved
    times, speeds = solved.capture_s.tolist(), (solved.closing_speed_m_s / M_PER_KM).tolist()
    rows: list[list[Cell]] = [
        [float(column), float(row), times[j][i], speeds[j][i], STATUSES[solved.status[j, i]].value]
        for j, row in enumerate(y.values)
        for i, column in enumerate(x.values)
    ]
    return to_csv([x.parameter, y.parameter, "capture_time_s", "closing_speed_km_s", "status"], rows)


def counted(solved: CaptureMap) -> str:
    """Return the number of points of each status, for the terminal and the figure."""
    counts = {words: solved.count(status) for status, words in STATUS_WORDS.items()}
    return ", ".join(f"{count} {words}" for words, count in counts.items() if count)


def report_lines(report: MapReport) -> Iterator[str]:
    """Yield the numbers of points by status and the range of capture times, for the screen."""
    solved = report.solved
    yield f"{report.problem.name}: {solved.status.size} points: {counted(solved)}"
    if solved.capture_s.count():
        low, high = (float(time_s) / S_PER_HOUR for time_s in (solved.capture_s.min(), solved.capture_s.max()))
        yield f"capture times from {low:.4f} to {high:.4f} h"
    if solved.count(PointStatus.NEIGHBOUR):
        yield (
            "points continued from a neighbour are local saddle points: earlier captures are not excluded there; "
            "--certify solves every point from scratch"
        )


COMMAND = ProblemCommand(
    owner=PursuitProblem,
    solve=solve_map,
    to_json=report_json,
    to_csv=report_csv,
    lines=report_lines,
    csv_name="map.csv",
    figures="experiments.pursuit.map_figure",
    figure_names=("figure-map",),
)
run = COMMAND.run
