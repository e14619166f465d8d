"""infoset pursuit-map: capture time over two parameters of a pursuit-evasion problem."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.display_units import M_PER_KM
from experiments.common.options import Csv, Json, Out, Overwrite, ProblemName, Quiet
from experiments.pursuit.command import Settings, problem_with

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from experiments.pursuit.file import PursuitProblem
    from rendezvous.pursuit_evasion import CaptureMap

FIGURE = "figure-map"
MOST_VALUES, MOST_POINTS = 2000, 100_000
COLUMNS, ROWS = "phase_deg=-30:30:61", "thrust_ratio=0:0.8:17"
COLUMNS_OF_STATES = "mass_ratio=0.5:1.5:21"
PHASE_BY_THRUST = 12.0
"""Half of the columns' span in radians over thrust by gravity: about what a revolution changes the phase by."""

Axis = tuple[str, "NDArray[np.float64]"]


def pursuit_map(
    problem: ProblemName = "geo-pursuit",
    columns: Annotated[
        str | None,
        typer.Option(
            "--x",
            metavar="KEY=FROM:TO:N",
            help="Parameter of the columns, its ends and how many; phases as far as the pursuer's thrust goes.",
        ),
    ] = None,
    rows: Annotated[str, typer.Option("--y", metavar="KEY=FROM:TO:N", help="Parameter of the rows.")] = ROWS,
    settings: Settings = None,
    certify: Annotated[
        bool,
        typer.Option("--certify", help="Solve each point from nothing, with other branches where one folds: slow."),
    ] = False,
    out: Out = None,
    json_: Json = None,
    csv: Csv = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Solve a game over a grid of two parameters: phase_deg (the evader's lead), thrust_ratio, mass_ratio, any key.

    A point starts from its neighbours; some are solved from nothing and the rest are checked against them. What is not
    certified has no capture time and is shown as such. Without --out, --json or --csv nothing is written.
    """
    from experiments.common.errors import InputError
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_csv, to_json
    from experiments.common.screen import figure_files, say_warnings, tell_of_compiling_pursuit

    given = problem_with(problem, settings)
    x, y = _axis("--x", _columns(given) if columns is None else columns), _axis("--y", rows)
    if x[0] == y[0]:
        raise InputError(f"--y: {y[0]} is the parameter of --x too; choose another, for example --y {ROWS}")
    if len(x[1]) * len(y[1]) > MOST_POINTS:
        raise InputError(f"--x and --y: {len(x[1]) * len(y[1])} points are over {MOST_POINTS}; ask for fewer")
    files = ("problem.toml", "results.json", "map.csv", *figure_files(FIGURE))
    with checked_destinations(folder=out, names=files, files={"--json": json_, "--csv": csv}, overwrite=overwrite):
        say_warnings(given.warnings(), quiet)
        tell_of_compiling_pursuit(quiet)
        found, elapsed_s = _solve(given, x, y, certify, quiet)
        json_text = to_json(_summary(given, x, y, found, elapsed_s))
        csv_text = to_csv(*_table(x, y, found))
        deliver(json_, json_text, overwrite=overwrite)
        deliver(csv, csv_text, overwrite=overwrite)
        if out is not None:
            _fill(out, given, x, y, found, json_text, csv_text, overwrite)
    if not quiet:
        _show(given, found, elapsed_s, STDOUT in (str(json_), str(csv)))


def _columns(problem: PursuitProblem) -> str:
    """Return the columns of a map for which none are asked."""
    if problem.tables.pursuer.position_km is not None or problem.tables.evader.position_km is not None:
        return COLUMNS_OF_STATES
    game = problem.game()
    gravity_m_s2 = game.gravity.parameter_m3_s2 / math.hypot(*game.pursuer.position_m) ** 2
    half = math.degrees(PHASE_BY_THRUST * game.pursuer.acceleration_m_s2 / gravity_m_s2)
    # To one digit, for ticks that read well.
    half = float(f"{min(90.0, max(1e-6, half)):.0e}")
    return f"phase_deg={-half!r}:{half!r}:61"


def _axis(option: str, text: str) -> Axis:
    """Read KEY=FROM:TO:N."""
    import numpy as np

    from experiments.common.errors import InputError
    from experiments.common.toml_values import nearest, shown
    from experiments.pursuit.file import parameter_names

    example = f"for example {option} {COLUMNS if option == '--x' else ROWS}"
    key, _, span = text.partition("=")
    valid = parameter_names()
    if key not in valid:
        guess = nearest(key, valid)
        hint = f"did you mean {guess}? " if guess else ""
        raise InputError(f"{option}: there is no {shown(key)}; {hint}choose one of: {', '.join(valid)}")
    parts = span.split(":")
    try:
        if len(parts) != 3:
            raise ValueError
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except ValueError:
        raise InputError(f"{option}: must be KEY=FROM:TO:N, found {shown(text)}; {example}") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high and max(abs(low), abs(high)) <= 1e15):
        raise InputError(f"{option}: must go from a number to a greater one, found {shown(span)}; {example}")
    if not 2 <= count <= MOST_VALUES:
        raise InputError(f"{option}: must have from 2 to {MOST_VALUES} values, found {shown(parts[2])}; {example}")
    return key, np.linspace(low, high, count)


def _solve(problem: PursuitProblem, x: Axis, y: Axis, certify: bool, quiet: bool) -> tuple[CaptureMap, float]:
    from time import perf_counter

    from experiments.common.screen import progress_bar
    from rendezvous.pursuit_evasion import Game, capture_map

    def game_at(column: float, row: float) -> Game:
        return problem.game({x[0]: column, y[0]: row})

    began_s = perf_counter()
    with progress_bar(quiet) as begin:
        found = capture_map(game_at, x[1], y[1], follow_all=certify, progress=begin("map"))
    return found, perf_counter() - began_s


def _summary(problem: PursuitProblem, x: Axis, y: Axis, found: CaptureMap, elapsed_s: float) -> dict[str, object]:
    from experiments.common.output import library_version
    from rendezvous.pursuit_evasion import STATUSES, PointStatus

    return {
        "version": library_version(),
        "problem": problem.name,
        "problem_hash": problem.hash,
        "elapsed_s": elapsed_s,
        "x": {"parameter": x[0], "values": x[1].tolist()},
        "y": {"parameter": y[0], "values": y[1].tolist()},
        "points": found.status.size,
        "counts": {status.value: found.count(status) for status in PointStatus},
        "solved_from_nothing": found.solved_from_nothing,
        "capture_time_s": found.capture_s.tolist(),
        "closing_speed_km_s": (found.closing_speed_m_s / M_PER_KM).tolist(),
        "status": [[STATUSES[each].value for each in row] for row in found.status],
    }


def _table(x: Axis, y: Axis, found: CaptureMap) -> tuple[list[str], list[list[str | float | None]]]:
    from rendezvous.pursuit_evasion import STATUSES

    times, speeds = found.capture_s.tolist(), (found.closing_speed_m_s / M_PER_KM).tolist()
    rows: list[list[str | float | None]] = [
        [float(column), float(row), times[j][i], speeds[j][i], STATUSES[found.status[j, i]].value]
        for j, row in enumerate(y[1])
        for i, column in enumerate(x[1])
    ]
    return [x[0], y[0], "capture_time_s", "closing_speed_km_s", "status"], rows


def _fill(
    folder: Path,
    problem: PursuitProblem,
    x: Axis,
    y: Axis,
    found: CaptureMap,
    json_text: str,
    csv_text: str,
    overwrite: bool,
) -> None:
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures, write_file
    from experiments.pursuit.map_figure import draw_map

    write_file(folder / "problem.toml", problem.to_toml(), overwrite=overwrite)
    write_file(folder / "results.json", json_text, overwrite=overwrite)
    write_file(folder / "map.csv", csv_text, overwrite=overwrite)
    figure = draw_map(found, x[0], y[0])
    with reporting_failures(folder):
        save_figure(figure, folder, FIGURE)


def _show(problem: PursuitProblem, found: CaptureMap, elapsed_s: float, stdout_taken: bool) -> None:
    from rich.text import Text

    from experiments.common.screen import table_console
    from experiments.pursuit.report import counted
    from rendezvous.pursuit_evasion import PointStatus

    console = table_console(stdout_taken)
    said = f"{problem.name}: {found.status.size} points in {elapsed_s:.1f} s: {counted(found)}"
    console.print(Text(said), soft_wrap=True)
    if found.capture_s.count():
        low, high = float(found.capture_s.min()), float(found.capture_s.max())
        console.print(Text(f"capture times from {low:.1f} to {high:.1f} s"), soft_wrap=True)
    if found.count(PointStatus.NEIGHBOUR):
        said = "neighbour: a local saddle, earlier captures not excluded at the point itself; --certify follows each"
        console.print(Text(said), soft_wrap=True)
