"""Random encounters from OEM tables.

    python -m benchmarks.trajectory_tables [--encounters 200] [--first 0]

Each encounter has two orbits around the Sun, tables of both as OEM files, and an epoch beside a
change of the step. The script makes the scenario of each (`infoset scenarios from-states`) and
compares B.T and B.R with the closest approach by SciPy's DOP853 from the exact states. Every
encounter must be within 10 m, or refused. The tables are of five kinds of steps, three
interpolations, two segments and four time systems; the epoch has the time system of the first
table. The covariance claims errors of a quarter of this; a table that cannot be so accurate must be
refused.

The positions of the tables are those of Kepler's equation. TDB - TT is the series of Kaplan (2005),
USNO Circular 179, equation 2.6, which has terms that the program neglects (below 50 microseconds,
or 1.5 m at 30 km/s).
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from infoset.arrays import Floats
from infoset.experiments import load_scenario
from infoset.experiments.common.errors import InputError
from infoset.experiments.interception.trajectory_file import scenario_of

SUN_M3_S2 = 1.32712440018e20
DAY_S = 86_400
ALLOWED_M = 10.0
"""Largest error of B.T and B.R."""
KINDS = {
    "1 d / 60 s": (DAY_S, 60),
    "1 d / 600 s": (DAY_S, 600),
    "1 h / 60 s": (3600, 60),
    "6 h / 10 s": (6 * 3600, 10),
    "irregular": (3 * 3600, 3 * 3600),
}
"""Steps on the two sides of the change, s; irregular steps are 0.3 to 3 times this one."""
METHODS = ("HERMITE", "LAGRANGE", "LINEAR")
SCALES = ("UTC", "TAI", "TT", "TDB")
ROWS = 14
"""States on each side of the change."""
LEAPS = ((datetime(2012, 7, 1), 35), (datetime(2015, 7, 1), 36), (datetime(2017, 1, 1), 37))
"""TAI - UTC from each of these days; all encounters are later than the first."""
J2000 = datetime(2000, 1, 1, 12)


class Encounter(NamedTuple):
    """A random encounter: its kind, its files by name, and its B-plane by DOP853.

    `is_sound` is whether the segment of the epoch has the frame and centre of the other file.
    """

    steps: str
    method: str
    segments: int
    scales: tuple[str, str]
    is_sound: bool
    files: dict[str, str]
    b_plane_m: Floats


class Outcome(NamedTuple):
    """The encounter, the error of B.T and B.R, m, or NaN, and the message of a refusal."""

    encounter: Encounter
    error_m: float
    refusal: str


def random_encounter(number: int) -> Encounter:
    """Return the random encounter with a number; the same number gives the same encounter."""
    generator = np.random.default_rng(np.random.SeedSequence(entropy=55, spawn_key=(number,)))
    meeting = _meeting(generator)
    steps = list(KINDS)[number % len(KINDS)]
    method = METHODS[number // len(KINDS) % len(METHODS)]
    scales = (SCALES[generator.integers(4)], SCALES[generator.integers(4)])
    segments = int(generator.integers(1, 3))
    is_sound = segments == 1 or generator.random() < 0.75
    is_reversed = generator.random() < 0.5

    # The encounter is some days after the epoch, in TDB; one in three epochs is near a leap second.
    arrival_s = generator.uniform(0.3, 10.0) * DAY_S
    middle = datetime(2013, 1, 1) + timedelta(seconds=int(generator.integers(0, 16 * 365 * DAY_S)))
    if generator.random() < 1 / 3:
        middle = LEAPS[1][0] + timedelta(seconds=int(generator.integers(-7200, 7200)))

    tables = []
    for scale in scales:
        near = 3 * min(KINDS[steps])
        change = round((middle - J2000).total_seconds()) + int(generator.integers(-near, near))
        if scale in ("TT", "TDB"):
            change += 32  # the same instant as in TAI, nearly
        tables.append((scale, _row_times(steps, change, is_reversed, generator)))
    epoch = _epoch_near(tables[0][1], generator)
    epoch_tdb = _tdb(epoch, scales[0])

    files = {}
    for name, craft, (scale, rows) in zip(("spacecraft", "object"), meeting, tables, strict=True):
        seconds = np.array([float(_tdb(row, scale) - epoch_tdb) for row in rows]) - arrival_s
        states = kepler(craft, seconds)
        broken = name == "spacecraft" and not is_sound
        held = epoch if name == "spacecraft" else None
        files[f"{name}.oem"] = _oem(rows, states, scale, method, segments, held, broken, generator)

    at_epoch = np.concatenate([kepler(craft, np.array([-arrival_s])) for craft in meeting])
    flight_s = float(min(4 * 3600.0, 0.5 * arrival_s))
    files["states.toml"] = _toml(
        f"{_text(epoch, scales[0])} {scales[0]}", flight_s, float(arrival_s)
    )
    return Encounter(
        steps,
        method,
        segments,
        scales,
        is_sound,
        files,
        b_plane_by_dop853(at_epoch, flight_s, arrival_s),
    )


def outcome_of(encounter: Encounter, folder: Path) -> Outcome:
    """Return the outcome of an encounter; its files are written into a folder."""
    for name, text in encounter.files.items():
        (folder / name).write_text(text, encoding="utf-8")
    try:
        text = scenario_of(folder / "states.toml", load_scenario("dart-2022"), 3.0).text
    except InputError as error:
        return Outcome(encounter, np.nan, str(error))
    match = re.search(r"B\.T = (\S+) km, B\.R = (\S+) km", text)
    assert match is not None
    found_m = 1e3 * np.array([float(match[1]), float(match[2])])
    return Outcome(encounter, float(np.abs(found_m - encounter.b_plane_m).max()), "")


def kepler(state: Floats, times_s: Floats) -> Floats:
    """Return states of an elliptic orbit around the Sun, shape (n, 2, 3), by f and g."""
    position, velocity = state
    distance = np.linalg.norm(position)
    axis = 1.0 / (2.0 / distance - velocity @ velocity / SUN_M3_S2)
    mean_motion = np.sqrt(SUN_M3_S2 / axis**3)
    cosine = 1.0 - distance / axis  # e cos(E) and e sin(E) at the state
    sine = position @ velocity / np.sqrt(SUN_M3_S2 * axis)

    # Newton's method for the change x of the eccentric anomaly.
    mean = mean_motion * times_s
    x = mean.copy()
    for _ in range(30):
        value = x - cosine * np.sin(x) + sine * (1.0 - np.cos(x)) - mean
        x -= value / (1.0 - cosine * np.cos(x) + sine * np.sin(x))
    versine = 2.0 * np.sin(0.5 * x) ** 2
    now = axis * (1.0 - cosine * np.cos(x) + sine * np.sin(x))
    f = 1.0 - axis / distance * versine
    g = times_s - (x - np.sin(x)) / mean_motion
    f_rate = -np.sqrt(SUN_M3_S2 * axis) / (now * distance) * np.sin(x)
    g_rate = 1.0 - axis / now * versine
    positions = f[:, None] * position + g[:, None] * velocity
    velocities = f_rate[:, None] * position + g_rate[:, None] * velocity
    return np.stack([positions, velocities], axis=1)


def b_plane_by_dop853(states: Floats, flight_s: float, arrival_s: float) -> Floats:
    """Return (B.T, B.R) of two states, shape (2, 2, 3), m.

    The axes are those of the time `flight_s` before the closest approach.
    """
    from scipy.integrate import solve_ivp

    def rates(_time: float, y: Floats) -> Floats:
        pairs = y.reshape(2, 2, 3)
        pull = -SUN_M3_S2 * pairs[:, 0] / np.linalg.norm(pairs[:, 0], axis=1, keepdims=True) ** 3
        return np.concatenate([pairs[0, 1], pull[0], pairs[1, 1], pull[1]])

    def moved(
        y: Floats, duration_s: float, event: Callable[[float, Floats], float] | None = None
    ) -> Any:
        return solve_ivp(
            rates, (0.0, duration_s), y, method="DOP853", rtol=1e-13, atol=1e-6, events=event
        )

    def recedes(_time: float, y: Floats) -> float:
        return float((y[6:9] - y[0:3]) @ (y[9:12] - y[3:6]))

    solution = moved(states.ravel(), 1.05 * arrival_s, recedes)
    closest_s = float(solution.t_events[0][0])
    start = moved(states.ravel(), closest_s - flight_s).y[:, -1]
    end = moved(start, flight_s).y[:, -1]

    along = -(start[9:12] - start[3:6])
    along /= np.linalg.norm(along)
    across = np.cross(along, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    place = end[6:9] - end[0:3]
    return -np.array([place @ across, place @ np.cross(along, across)])


def _meeting(generator: np.random.Generator) -> tuple[Floats, Floats]:
    """Return the states of the spacecraft and the object at their closest approach."""
    distance = generator.uniform(0.8, 1.6) * 1.495978707e11
    circular = np.sqrt(SUN_M3_S2 / distance)
    turn = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    velocity = (
        circular * generator.uniform(0.9, 1.1) * (turn[1] + generator.uniform(-0.2, 0.2) * turn[0])
    )
    relative = generator.normal(size=3)
    # So slow that both orbits are ellipses.
    relative *= circular * generator.uniform(0.1, 0.27) / np.linalg.norm(relative)
    miss = np.cross(relative, generator.normal(size=3))
    miss *= generator.uniform(0.0, 5e3) / np.linalg.norm(miss)
    position = distance * turn[0]
    return np.stack([position, velocity]), np.stack([position + miss, velocity + relative])


def _row_times(
    steps: str, change: int, is_reversed: bool, generator: np.random.Generator
) -> list[Fraction]:
    """Return the times of the rows around a change of the step, s from J2000.

    The scale is the table's, and TAI for UTC.
    """
    first, second = KINDS[steps][::-1] if is_reversed else KINDS[steps]
    if steps == "irregular":
        lengths = [
            round(first * factor) for factor in 10.0 ** generator.uniform(-0.5, 0.5, size=2 * ROWS)
        ]
    else:
        lengths = [first] * ROWS + [second] * ROWS
    begin = Fraction(change - sum(lengths[:ROWS])) + Fraction(331, 1000)
    return [begin + sum(lengths[:row]) for row in range(2 * ROWS + 1)]


def _epoch_near(rows: list[Fraction], generator: np.random.Generator) -> Fraction:
    """Return an epoch within some rows of the change; one in ten is the epoch of a row."""
    row = ROWS + int(generator.integers(-2, 2))
    share = 0.0 if generator.random() < 0.1 else float(generator.uniform(0.02, 0.98))
    step = rows[row + 1] - rows[row]
    return rows[row] + Fraction(round(float(step) * share * 1000), 1000)


def _tdb(seconds: Fraction, scale: str) -> Fraction:
    """Return the seconds from J2000 in TDB; times of UTC are given in TAI."""
    if scale == "TDB":
        return seconds
    tt = seconds if scale == "TT" else seconds + Fraction("32.184")
    centuries = float(tt) / (36525 * DAY_S)
    terms = (
        (0.001657, 628.3076, 6.2401),
        (0.000022, 575.3385, 4.2970),
        (0.000014, 1256.6152, 6.1969),
        (0.000005, 606.9777, 4.0212),
        (0.000005, 52.9691, 0.4444),
        (0.000002, 21.3299, 5.5431),
        (0.000010 * centuries, 628.3076, 4.2490),
    )
    return tt + Fraction(
        sum(size * np.sin(rate * centuries + phase) for size, rate, phase in terms)
    )


def _text(seconds: Fraction, scale: str) -> str:
    """Return an epoch as text with milliseconds."""
    if scale != "UTC":
        return _date(seconds)
    for begin, offset in reversed(LEAPS):
        utc = seconds - offset
        leap = Fraction(round((begin - J2000).total_seconds()))
        if utc >= leap:
            return _date(utc)
        if utc >= leap - 1 and offset > LEAPS[0][1]:  # within the leap second, 23:59:60
            return f"{begin - timedelta(days=1):%Y-%m-%d}T23:59:{60 + float(utc - leap + 1):06.3f}"
    raise ValueError("before the table of leap seconds")


def _date(seconds: Fraction) -> str:
    milliseconds = round(seconds * 1000)
    whole, rest = divmod(milliseconds, 1000)
    return f"{J2000 + timedelta(seconds=whole):%Y-%m-%dT%H:%M:%S}.{rest:03}"


def _oem(
    rows: list[Fraction],
    states: Floats,
    scale: str,
    method: str,
    segments: int,
    held: Fraction | None,
    is_broken: bool,
    generator: np.random.Generator,
) -> str:
    """Return an OEM file of one or two segments, divided at a row away from the epoch.

    If `is_broken`, the segment that holds the epoch `held` has a rotating frame or another centre;
    otherwise the segment that does not hold it may have them.
    """
    divisions = [0, len(rows) - 1]
    if segments == 2:
        divisions.insert(1, ROWS + int(generator.choice([-6, 6])))
    text = "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\n"
    for first, last in pairwise(divisions):
        holds = held is not None and rows[first] <= held <= rows[last]
        frame, centre = "EME2000", "SUN"
        if (is_broken and holds) or (held is not None and not is_broken and not holds):
            frame, centre = (("ITRF-97", "SUN"), ("EME2000", "EARTH"))[generator.integers(2)]
        text += (
            "META_START\n"
            "OBJECT_NAME = X\n"
            "OBJECT_ID = 2026-001A\n"
            f"CENTER_NAME = {centre}\n"
            f"REF_FRAME = {frame}\n"
            f"TIME_SYSTEM = {scale}\n"
            f"START_TIME = {_text(rows[first], scale)}\n"
            f"STOP_TIME = {_text(rows[last], scale)}\n"
            f"INTERPOLATION = {method}\n"
            "INTERPOLATION_DEGREE = 7\n"
            "META_STOP\n"
        )
        for row in range(first, last + 1):
            words = [f"{value:.15e}" for value in (1e-3 * states[row]).ravel()]
            text += f"{_text(rows[row], scale)} {' '.join(words)}\n"
    return text


def _toml(epoch: str, flight_s: float, arrival_s: float) -> str:
    # The errors of both states together may be a quarter of what is allowed, in position and until
    # the arrival.
    position_m = 0.25 * ALLOWED_M / math.sqrt(3.0)
    velocity_m_s = position_m / arrival_s
    return f"""\
kind = "trajectory"
name = "random"
epoch = "{epoch}"
gravitational_parameter_m3_s2 = {SUN_M3_S2!r}
flight_s = {flight_s!r}
[spacecraft]
oem = "spacecraft.oem"
[object]
oem = "object.oem"
[covariance]
position_sigma_m = [{position_m!r}, {position_m!r}, {position_m!r}]
velocity_sigma_m_s = [{velocity_m_s!r}, {velocity_m_s!r}, {velocity_m_s!r}]
"""


def outcomes(first: int, count: int) -> Iterator[Outcome]:
    """Yield the outcomes of encounters with consecutive numbers."""
    for number in range(first, first + count):
        with tempfile.TemporaryDirectory() as folder:
            yield outcome_of(random_encounter(number), Path(folder))


def main() -> int:
    """Print the table; return 1 if an encounter is neither right nor refused."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--encounters", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()

    found = list(outcomes(options.first, options.encounters))
    print(f"{'steps':12} {'method':9} {'right':>5} {'refused':>7} {'wrong':>5}  largest error, m")
    for steps in KINDS:
        for method in METHODS:
            of_kind = [
                each
                for each in found
                if each.encounter.steps == steps and each.encounter.method == method
            ]
            print(_line(f"{steps:12} {method:9}", of_kind))
    print(_line(f"{'all':22}", found))
    reasons = Counter(_reason(each.refusal) for each in found if each.refusal)
    print("refused:", ", ".join(f"{count} {reason}" for reason, count in reasons.most_common()))
    unsound = sum(not each.encounter.is_sound for each in found)
    accepted = sum(not each.encounter.is_sound and not each.refusal for each in found)
    print(f"another frame or centre in the segment of the epoch: {accepted} of {unsound} accepted")
    return int(accepted > 0 or any(each.error_m > ALLOWED_M for each in found))


def _reason(refusal: str) -> str:
    """Return the kind of a refusal; all of it if it is not known."""
    kinds = {
        "the interpolation has errors": "less accurate than the covariance",
        "is not a known inertial frame": "rotating frame",
        "must be the same": "another centre",
        "in a gap": "gap",
    }
    return next((kind for part, kind in kinds.items() if part in refusal), refusal)


def _line(head: str, found: list[Outcome]) -> str:
    errors = np.array([each.error_m for each in found if not each.refusal])
    wrong = int((errors > ALLOWED_M).sum())
    largest = f"{errors.max():.2g}" if errors.size else "-"
    return f"{head} {errors.size - wrong:5} {len(found) - errors.size:7} {wrong:5}  {largest}"


if __name__ == "__main__":
    sys.exit(main())
