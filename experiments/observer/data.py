"""Measurements of an observer: from a CSV file, from the problem file, or simulated."""

from __future__ import annotations

import codecs
import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.errors import InputError, shown
from infoset.experiments.common.input_file import read_input
from infoset.experiments.observer.command import MAX_STEPS, Errors, Observe
from infoset.experiments.observer.file import ObserverProblem, WrongMeasurementsTable
from infoset.geometry.zonotope import Zonotope
from infoset.limits import MAXIMUM
from infoset.observer.sets import Set, polytope_of
from infoset.sim.wrong_images import WrongMeasurements, draw_wrong_measurements

MAX_CSV_BYTES = 10_000_000
"""Largest size of a file of measurements: 1000 bytes for each of `MAX_STEPS` steps."""
SEPARATORS = (",", ";", "\t")
"""Separators of a CSV file, the default first."""
_SHOWN_STEPS = 10
"""Maximum number of steps in a text: a line of the screen."""
_WRONG_STREAM = 1
"""Second part of the seed of the wrong measurements: another number, another stream. The motion and
the other errors have the seed of the command alone.
"""
MAX_STATE = 1e40
"""Largest modulus of a component of a state of which sets are computed; chosen: even products of
seven such numbers are finite.
"""


@dataclass(frozen=True, eq=False)
class Data:
    """Measurements y of N steps, shape (N, q), NaN if missing, and the inputs u after each, (N, p).

    A simulation also has the true states, (N, n). `origin` is a text for reports.
    """

    measured: Floats
    inputs: Floats
    states: Floats | None
    origin: str


def data_of(problem: ObserverProblem, options: Observe) -> Data:
    """Return the measurements of a CSV file, else those of the problem, else simulated ones.

    Raise `InputError` if the file cannot be read, or does not fit the system.
    """
    if options.data is not None:
        return read_csv(options.data, problem, options.columns)
    if problem.measured is not None:
        inputs = _padded(problem.inputs, len(problem.measured), problem.system.inputs)
        return Data(problem.measured, inputs, None, f"measurements of {problem.name}")
    return simulate(problem, options.errors, options.seed)


def simulate(problem: ObserverProblem, errors: Errors, seed: int) -> Data:
    """Return measurements of a random motion, with errors at their bounds or within them."""
    generator = np.random.default_rng(seed)
    system = problem.system
    a = np.array(system.A)
    b = np.reshape(system.B, (len(system.A), system.inputs))
    c = np.array(system.C)
    inputs = _padded(problem.inputs, problem.simulation.steps, system.inputs)
    states = [_point(problem.initial.shape, errors, generator)]
    # The last inputs act after the last measurement: no state follows.
    for step, u in enumerate(inputs[:-1], start=1):
        w = _point(problem.disturbance_set, errors, generator)
        states.append(a @ states[-1] + b @ u + (system.c or 0.0) + w)
        need_size(f"{problem.name}: simulation, step {step}", states[-1])

    true = np.array(states)
    noise = _signs(errors, (len(true), len(c)), generator) * problem.noise.half_width
    measured = true @ c.T + noise
    origin = f"simulated, {errors.value} errors, seed {seed}"
    # Numbers beyond the last step mean no step.
    missing = [step for step in problem.simulation.missing if step < len(measured)]
    if problem.wrong_measurements is not None:
        sizes = _wrong_errors(problem.wrong_measurements, missing, measured.shape, seed)
        wrong = sizes * problem.noise.half_width
        # Outputs whose bound is zero are exact.
        is_wrong = (wrong != 0.0).any(axis=1)
        measured[is_wrong] = (true @ c.T + wrong)[is_wrong]
        steps = np.flatnonzero(is_wrong).tolist()
        origin += f", wrong measurements at {steps_text(steps)}"
    measured[missing] = np.nan
    return Data(measured, inputs, true, origin)


def _wrong_errors(
    wrong: WrongMeasurementsTable, missing: list[int], shape: tuple[int, ...], seed: int
) -> Floats:
    """Return the errors of the wrong measurements, shape (N, q), in units of the bounds.

    They are zero for the others. Their random numbers are a stream of their own, so that the motion
    and the other errors do not depend on the table.
    """
    first, last = (0, shape[0] - 1) if wrong.steps is None else wrong.steps
    # A number where a measurement can be wrong, NaN elsewhere, as `draw_wrong_measurements` needs.
    places = np.full(shape[0], np.nan)
    places[first : last + 1] = 0.0
    places[missing] = np.nan
    generator = np.random.default_rng([seed, _WRONG_STREAM])
    drawn = WrongMeasurements(wrong.number, wrong.size)
    return draw_wrong_measurements(drawn, places, shape[1], generator).T


def steps_text(steps: list[int]) -> str:
    """Return steps as text; of many steps, the first ones and their number."""
    if not steps:
        return "no step"
    shown_steps = ", ".join(map(str, steps[:_SHOWN_STEPS]))
    more = f", .. ({len(steps)} steps)" if len(steps) > _SHOWN_STEPS else ""
    return f"step{'s' if len(steps) > 1 else ''} {shown_steps}{more}"


def need_size(where: str, *values: Floats) -> None:
    """Raise an error if a state is too large; NaN is not too large."""
    if any((np.abs(numbers) > MAX_STATE).any() for numbers in values):
        raise InputError(
            f"{where}: a state is larger than {MAX_STATE:g}; the system is unstable: correct A, or "
            "use fewer steps"
        )


def _signs(errors: Errors, shape: tuple[int, ...], generator: np.random.Generator) -> Floats:
    """Return random numbers from -1 to 1, only both ends for extremal errors."""
    if errors is Errors.EXTREMAL:
        return generator.choice([-1.0, 1.0], shape)
    return generator.uniform(-1.0, 1.0, shape)


def _point(shape: Set, errors: Errors, generator: np.random.Generator) -> Floats:
    """Return a random point of a set, not uniform in it.

    For extremal errors it is a vertex, or for a zonotope the centre with each generator added or
    subtracted, which need not be a vertex.
    """
    if isinstance(shape, Zonotope):
        return np.asarray(
            shape.centre + _signs(errors, (len(shape.generators),), generator) @ shape.generators
        )
    vertices = polytope_of(shape).vertices
    if errors is Errors.EXTREMAL:
        return np.asarray(vertices[generator.integers(len(vertices))])
    return np.asarray(generator.dirichlet(np.ones(len(vertices))) @ vertices)


def _padded(inputs: Floats | None, steps: int, size: int) -> Floats:
    """Return inputs for a number of steps: the first ones, and zeros where there are fewer."""
    padded = np.zeros((steps, size))
    if inputs is not None:
        padded[: len(inputs)] = inputs[:steps]
    return padded


def read_csv(file: Path, problem: ObserverProblem, columns: str) -> Data:
    """Read measurements and inputs from a CSV file with a row for each step.

    `columns` gives other names of its columns. Raise `InputError` if the file cannot be read, a
    column is missing, or a cell is not a number.
    """
    outputs = len(problem.system.C)
    inputs = problem.system.inputs
    names = [f"y{number}" for number in range(1, outputs + 1)]
    names += [f"u{number}" for number in range(1, inputs + 1)]
    wanted = _renamed(names, columns)
    content = read_input(file, MAX_CSV_BYTES)
    try:
        header, *table = _rows(content, wanted)
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"--data: {file}: is not a CSV file in UTF-8: {error}") from None
    if any(header.count(name) != 1 for name in wanted):
        raise InputError(
            f"--data: {file}: the header must have each of {','.join(wanted)} once (see "
            f"--columns); found the header {shown(','.join(header))}"
        )
    if not 1 <= len(table) <= MAX_STEPS:
        raise InputError(f"--data: {file}: has {len(table)} steps; 1 to {MAX_STEPS} are possible")

    places = [header.index(name) for name in wanted]
    rows = []
    for line, cells in enumerate(table, start=2):
        full = cells or [""]  # a file of one column has empty lines
        # A row without the number of cells of the header, or with a text, is empty: refused below.
        try:
            row = [
                float(full[place].strip() or "nan") for place in places if len(full) == len(header)
            ]
        except ValueError:
            row = []
        if (
            not row
            or any(abs(value) > MAXIMUM for value in row)
            or any(map(math.isnan, row[outputs:]))
        ):
            raise InputError(
                f"--data: {file}: line {line}: {','.join(wanted)} must be numbers of at most "
                f"{MAXIMUM:g} in size, with a decimal point, and only measurements may be empty or "
                f"NaN; found {shown(','.join(cells))}"
            )
        rows.append(row)

    values = np.array(rows)
    return Data(values[:, :outputs], values[:, outputs:], None, f"measurements of {file.name}")


def _rows(content: bytes, wanted: list[str]) -> list[list[str]]:
    """Return the cells of a CSV file by row, the header first.

    Commas, semicolons or tabs separate them. The separator is the first one that gives a header
    with the wanted columns, or a comma. A byte order mark selects UTF-16, as of spreadsheets;
    without one the file is UTF-8.
    """
    is_utf_16 = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    lines = content.decode("utf-16" if is_utf_16 else "utf-8-sig").rstrip(" \r\n").splitlines()

    def header_by(separator: str) -> list[str]:
        return [cell.strip() for cell in next(csv.reader(lines[:1], delimiter=separator), [])]

    separator = next(
        (each for each in SEPARATORS if set(wanted) <= set(header_by(each))), SEPARATORS[0]
    )
    return [header_by(separator), *csv.reader(lines[1:], delimiter=separator)]


def _renamed(names: list[str], columns: str) -> list[str]:
    """Return the columns of a file for some names; `columns` is NAME=COLUMN,NAME=COLUMN."""
    wanted = {name: name for name in names}
    for part in columns.split(",") if columns else ():
        name, _, column = (text.strip() for text in part.partition("="))
        if name not in wanted or not column:
            raise InputError(
                f"--columns: {shown(part)}: must be NAME=COLUMN with a name of {', '.join(names)}"
            )
        wanted[name] = column
    return list(wanted.values())
