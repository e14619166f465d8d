"""`infoset pursuit-map`: computation, files and tables."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from experiments.common.display_units import M_PER_KM, S_PER_HOUR
from experiments.common.errors import InputError, shown
from experiments.common.input_file import changed, keys_of, numeric_key, similar_key, to_toml
from experiments.common.output import Cell, output_of, to_csv, to_json
from experiments.common.problems import head
from experiments.common.screen import figure_files, progress_bar, show
from experiments.pursuit.command import ROWS, PursuitMap
from experiments.pursuit.file import PursuitProblem, load_pursuit
from experiments.pursuit.report import STATUS_WORDS, counted
from rendezvous.pursuit_evasion import STATUSES, CaptureMap, Game, PointStatus, capture_map
from rendezvous.two_body import OrbitalElements

FIGURE = "figure-map"
MAX_VALUES, MAX_POINTS = 2000, 100_000
RATIOS = ("phase_deg", "thrust_ratio", "mass_ratio")
"""Parameters besides the keys of a file: lead of the evader in true longitude, its thrust and mass by the pursuer's."""
COLUMNS = "phase_deg=-30:30:61"
COLUMNS_OF_STATES = "mass_ratio=0.5:1.5:21"
PHASE_BY_THRUST = 12.0
"""Half the span of the columns in radians, per thrust acceleration over gravity: about the change of phase in one
revolution."""


_COMPUTED = (PointStatus.FOLLOWED, PointStatus.NEIGHBOUR)


@dataclass(frozen=True)
class Axis:
    """A parameter of the map and its values, in the unit of its name."""

    parameter: str
    values: NDArray[np.float64]


def run(options: PursuitMap) -> None:
    """Solve the games of the grid, write the files and print a summary."""
    problem = load_pursuit(options.problem, options.settings)
    x = read_axis("--x", _columns(problem) if options.columns is None else options.columns)
    y = read_axis("--y", options.rows)
    if x.parameter == y.parameter:
        raise InputError(f"--y: {y.parameter} is also the parameter of --x; choose another, for example --y {ROWS}")
    points = len(x.values) * len(y.values)
    if points > MAX_POINTS:
        raise InputError(f"--x and --y: {points} points are over {MAX_POINTS}; choose fewer")
    with output_of(options, ("problem.toml", "results.json", "map.csv", *figure_files(FIGURE))) as written:
        began_s = perf_counter()
        with progress_bar(options.quiet) as begin:
            solved = capture_map(
                lambda column, row: game_at(problem, {x.parameter: column, y.parameter: row}),
                x.values,
                y.values,
                follow_all=options.certify,
                progress=begin("map"),
            )
        elapsed_s = perf_counter() - began_s
        written.save("problem.toml", to_toml(problem))
        written.save("results.json", to_json(_summary(problem, x, y, solved, elapsed_s)), "--json")
        written.save("map.csv", to_csv(*_table(x, y, solved)), "--csv")
        if options.out is not None:
            from experiments.pursuit.map_figure import draw_map

            written.figure(FIGURE, draw_map(solved, x.parameter, y.parameter))
    lines = [f"{problem.name}: {points} points in {elapsed_s:.1f} s: {counted(solved)}"]
    if solved.capture_s.count():
        minimum, maximum = (float(time_s) / S_PER_HOUR for time_s in (solved.capture_s.min(), solved.capture_s.max()))
        lines.append(f"capture times from {minimum:.4f} to {maximum:.4f} h")
    if written.wants("--json") or written.wants("--csv"):
        words = (f'"{status.value}" is {STATUS_WORDS[status]}' for status in _COMPUTED)
        lines.append(f"status in the files: {', '.join(words)}")
    if solved.count(PointStatus.NEIGHBOUR):
        lines.append(
            "points continued from a neighbour are local saddle points: earlier captures are not excluded there; "
            "--certify solves every point from scratch"
        )
    show(lines, options.quiet, stdout_taken=written.stdout_taken)


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
    if "mass_ratio" in values:
        evader = replace(evader, mass_kg=values["mass_ratio"] * pursuer.mass_kg)
    return replace(problem, evader=evader).game


def _true_longitude_rad(orbit: OrbitalElements) -> float:
    return orbit.raan_rad + orbit.argument_of_perigee_rad + orbit.true_anomaly_rad


def _columns(problem: PursuitProblem) -> str:
    """Return the default columns."""
    if problem.pursuer.orbit is None or problem.evader.orbit is None:
        return COLUMNS_OF_STATES
    game = problem.game
    gravity_m_s2 = game.gravity.parameter_m3_s2 / math.hypot(*game.pursuer.position_m) ** 2
    half = math.degrees(PHASE_BY_THRUST * game.pursuer.acceleration_m_s2 / gravity_m_s2)
    # One digit, for round ticks.
    half = float(f"{min(90.0, max(1e-6, half)):.0e}")
    return f"phase_deg={-half!r}:{half!r}:61"


def read_axis(option: str, text: str) -> Axis:
    """Read KEY=FROM:TO:N; raise `InputError` if it has another form, an unknown parameter, or a value out of range."""
    example = f"for example {option} {COLUMNS if option == '--x' else ROWS}"
    key, _, span = text.partition("=")
    if key not in RATIOS and numeric_key(PursuitProblem, key) is None:
        guess = similar_key(key, [*RATIOS, *keys_of(PursuitProblem)])
        hint = f"did you mean {guess}?" if guess else f"choose {', '.join(RATIOS)} or a key of the file"
        raise InputError(f"{option}: there is no parameter {shown(key)}; {hint}")
    parts = span.split(":")
    try:
        if len(parts) != 3:
            raise ValueError
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except ValueError:
        raise InputError(f"{option}: must be KEY=FROM:TO:N, found {shown(text)}; {example}") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high and max(abs(low), abs(high)) <= 1e15):
        raise InputError(f"{option}: must go from a number to a larger one, found {shown(span)}; {example}")
    if not 2 <= count <= MAX_VALUES:
        raise InputError(f"{option}: must have from 2 to {MAX_VALUES} values, found {shown(parts[2])}; {example}")
    return Axis(key, np.linspace(low, high, count))


def _summary(problem: PursuitProblem, x: Axis, y: Axis, solved: CaptureMap, elapsed_s: float) -> dict[str, object]:
    return {
        **head(problem),
        "elapsed_s": elapsed_s,
        "x": x,
        "y": y,
        "points": solved.status.size,
        "counts": {status.value: solved.count(status) for status in PointStatus},
        "solved_from_nothing": solved.solved_from_nothing,
        "capture_time_s": solved.capture_s,
        "closing_speed_km_s": solved.closing_speed_m_s / M_PER_KM,
        "status_words": {status.value: words for status, words in STATUS_WORDS.items()},
        "status": [[STATUSES[status] for status in row] for row in solved.status],
    }


def _table(x: Axis, y: Axis, solved: CaptureMap) -> tuple[list[str], list[list[Cell]]]:
    times, hours = solved.capture_s.tolist(), (solved.capture_s / S_PER_HOUR).tolist()
    speeds = (solved.closing_speed_m_s / M_PER_KM).tolist()
    rows: list[list[Cell]] = [
        [float(column), float(row), times[j][i], hours[j][i], speeds[j][i], STATUSES[solved.status[j, i]].value]
        for j, row in enumerate(y.values)
        for i, column in enumerate(x.values)
    ]
    return [x.parameter, y.parameter, "capture_time_s", "capture_time_h", "closing_speed_km_s", "status"], rows
