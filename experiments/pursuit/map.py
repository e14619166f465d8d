"""`infoset pursuit-map`: computation, files and summary."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Floats
from infoset.experiments.common.errors import InputError, shown
from infoset.experiments.common.input_file import changed, keys_of, numeric_key, similar_key
from infoset.experiments.common.problem_command import ProblemCommand
from infoset.experiments.common.screen import BeginProgress
from infoset.experiments.common.units import M_PER_KM, S_PER_HOUR
from infoset.experiments.pursuit.command import PursuitMap
from infoset.experiments.pursuit.file import PursuitProblem
from infoset.rendezvous.pursuit_evasion import CertificateVerdict, Game, solve
from infoset.rendezvous.two_body import OrbitalElements
from infoset.sim.columns import csv_text

Masked = np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]]

MAX_POINTS = 100_000
"""Largest number of points of a map: an hour at 20 to 40 ms each."""
RATIOS = ("phase_deg", "thrust_ratio")
"""Parameters besides the keys of a file: lead of the evader in true longitude, its thrust by the
pursuer's.
"""
NO_GAME = "no-game"
"""Verdict of parameters that define no game, for example equal positions."""


@dataclass(frozen=True)
class MapAxis:
    """A parameter of the map and its values, in the unit of its name."""

    parameter: str
    values: Floats


@dataclass(frozen=True)
class MapReport:
    """Results of one command, shape (rows, columns).

    Times and closing speeds are masked without a capture.
    """

    problem: PursuitProblem
    x: MapAxis
    y: MapAxis
    verdict: NDArray[np.str_]
    capture_s: Masked
    closing_speed_m_s: Masked

    @property
    def summary(self) -> str:
        """The number of points of each verdict."""
        counts = Counter(self.verdict.ravel().tolist()).most_common()
        return (
            f"{self.verdict.size} points: "
            f"{', '.join(f'{count} {verdict}' for verdict, count in counts)}"
        )


def solve_map(problem: PursuitProblem, options: PursuitMap, begin: BeginProgress) -> MapReport:
    """Return the solutions of the games of the grid."""
    x = read_axis("--x", options.columns)
    y = read_axis("--y", options.rows)
    if x.parameter == y.parameter:
        raise InputError(f"--y: {y.parameter} is also the parameter of --x; choose another")
    if "phase_deg" in (x.parameter, y.parameter) and None in (
        problem.pursuer.orbit,
        problem.evader.orbit,
    ):
        raise InputError(
            "phase_deg: both players must have the table orbit; vary other keys instead"
        )
    if len(x.values) * len(y.values) > MAX_POINTS:
        raise InputError(f"--x and --y: there are more than {MAX_POINTS} points; choose fewer")
    progress = begin("map")
    rows = []
    for row in y.values.tolist():
        values = [{x.parameter: column, y.parameter: row} for column in x.values.tolist()]
        rows.append([_solved(problem, each, options.certify) for each in values])
        progress(len(rows) / len(y.values))
    times = np.array([[point.capture_s for point in points] for points in rows])
    speeds = np.array([[point.closing_speed_m_s for point in points] for points in rows])
    return MapReport(
        problem,
        x,
        y,
        np.array([[point.verdict for point in points] for points in rows]),
        np.ma.masked_invalid(times),
        np.ma.masked_invalid(speeds),
    )


class _Point(NamedTuple):
    """Result of a point of the map; NaN without a capture."""

    verdict: str
    capture_s: float = math.nan
    closing_speed_m_s: float = math.nan


def _solved(problem: PursuitProblem, values: Mapping[str, float], change_branch: bool) -> _Point:
    """Solve the game of a point."""
    try:
        game = game_at(problem, values)
    except (InputError, ValueError):
        return _Point(NO_GAME)

    solution = solve(game, change_branch=change_branch)
    if solution.capture is None or solution.verdict is not CertificateVerdict.CAPTURED:
        return _Point(solution.verdict.value)
    capture = solution.capture
    return _Point(solution.verdict.value, capture.time_s, capture.closing_speed_m_s)


def game_at(problem: PursuitProblem, values: Mapping[str, float]) -> Game:
    """Return the game with other values of parameters; `RATIOS` are applied last.

    Raise `ValueError` or `InputError` if they define no game.
    """
    keys = {key: value for key, value in values.items() if key not in RATIOS}
    problem = changed(problem, keys, problem.name) if keys else problem
    pursuer = problem.pursuer
    evader = problem.evader
    if "phase_deg" in values:
        assert pursuer.orbit is not None
        assert evader.orbit is not None
        # With a phase of zero both players have the same true longitude.
        apart_rad = _true_longitude_rad(pursuer.orbit) - _true_longitude_rad(evader.orbit)
        anomaly_rad = evader.orbit.true_anomaly_rad + apart_rad + math.radians(values["phase_deg"])
        evader = replace(evader, orbit=replace(evader.orbit, true_anomaly_rad=anomaly_rad))
    if "thrust_ratio" in values:
        evader = replace(evader, thrust_N=values["thrust_ratio"] * pursuer.thrust_N)
    return replace(problem, evader=evader).game


def _true_longitude_rad(orbit: OrbitalElements) -> float:
    return orbit.raan_rad + orbit.argument_of_perigee_rad + orbit.true_anomaly_rad


def read_axis(option: str, text: str) -> MapAxis:
    """Return the axis KEY=FROM:TO:N.

    Raise `InputError` if it has another form, an unknown parameter, or a value out of range.
    """
    key, _, span = text.partition("=")
    if key not in RATIOS and numeric_key(PursuitProblem, key) is None:
        guess = similar_key(key, [*RATIOS, *keys_of(PursuitProblem)])
        hint = f"choose {', '.join(RATIOS)} or a key of the file"
        if guess:
            hint = f"did you mean {guess}?"
        raise InputError(f"{option}: there is no parameter {shown(key)}; {hint}")
    try:
        low_text, high_text, count_text = span.split(":")
        low = float(low_text)
        high = float(high_text)
        count = int(count_text)
    except ValueError:
        low, high, count = 0.0, 0.0, 0
    # The limit excludes infinity and NaN; chosen: beyond all values for orbits around the Earth.
    if not (-1e15 <= low < high <= 1e15 and 2 <= count <= MAX_POINTS):
        raise InputError(
            f"{option}: must be KEY=FROM:TO:N with FROM less than TO and at least 2 values, found "
            f"{shown(text)}; for example {option} thrust_ratio=0:0.8:17"
        )
    return MapAxis(key, np.linspace(low, high, count))


def report_json(report: MapReport) -> dict[str, object]:
    """Return the results for `infoset.experiments.common.output.to_json`."""
    return {
        "x": report.x,
        "y": report.y,
        "counts": Counter(report.verdict.ravel().tolist()),
        "capture_time_s": report.capture_s,
        "closing_speed_km_s": report.closing_speed_m_s / M_PER_KM,
        "verdict": report.verdict,
    }


def report_csv(report: MapReport) -> str:
    """Return a line for each point as CSV."""
    grid = np.meshgrid(report.x.values, report.y.values)
    parts = (*grid, report.capture_s, report.closing_speed_m_s / M_PER_KM, report.verdict)
    columns = [
        report.x.parameter,
        report.y.parameter,
        "capture_time_s",
        "closing_speed_km_s",
        "verdict",
    ]
    return csv_text(columns, [*zip(*(part.ravel().tolist() for part in parts), strict=True)])


def report_lines(report: MapReport) -> Iterator[str]:
    """Yield the numbers of points by verdict and the range of capture times, for the screen."""
    yield f"{report.problem.name}: {report.summary}"
    hours = report.capture_s.compressed() / S_PER_HOUR
    if len(hours):
        yield f"capture times from {hours.min():.4f} to {hours.max():.4f} h"


COMMAND = ProblemCommand(
    owner=PursuitProblem,
    solve=solve_map,
    to_json=report_json,
    to_csv=report_csv,
    lines=report_lines,
    csv_name="map.csv",
    figures="infoset.experiments.pursuit.map_figure",
    figure_names=("figure-map",),
)
run = COMMAND.run
