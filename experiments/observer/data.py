"""Measurements of an observer: from a CSV file, from the problem file, or simulated."""

from __future__ import annotations

import csv
import io
import math
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from experiments.common.errors import InputError, shown
from experiments.observer.command import MAX_STEPS, Errors
from experiments.observer.file import ObserverProblem
from infoset import Zonotope
from infoset.arrays import Floats
from infoset.limits import MAXIMUM
from infoset.observer_sets import Set, polytope_of

MAX_CSV_BYTES = 10_000_000
MAX_STATE = 1e40
"""Maximum state of which sets are computed."""
_STEP = re.compile(r"[0-9]{1,15}")


@dataclass(frozen=True, eq=False)
class Data:
    """Measurements y of N steps, shape (N, q), NaN if missing, and the inputs u after each, (N, p).

    A simulation also has the true states, (N, n). `origin` is a text for reports.
    """

    measured: Floats
    inputs: Floats
    states: Floats | None
    origin: str


def data_of(problem: ObserverProblem, file: Path | None, errors: Errors, seed: int) -> Data:
    """Return the measurements of a CSV file, else those of the problem, else simulated ones.

    Raise `InputError` if the file cannot be read, or does not fit the system.
    """
    if file is not None:
        return read_csv(file, len(problem.system.C), problem.system.inputs)
    if problem.measured is not None:
        inputs = _padded(problem.inputs, len(problem.measured), problem.system.inputs)
        return Data(problem.measured, inputs, None, f"measurements of {problem.name}")
    return simulate(problem, errors, seed)


def simulate(problem: ObserverProblem, errors: Errors, seed: int) -> Data:
    """Return measurements of a random motion, with errors at their bounds or within them."""
    generator, system = np.random.default_rng(seed), problem.system
    a, b, c = np.array(system.A), np.reshape(system.B, (len(system.A), system.inputs)), np.array(system.C)
    inputs = _padded(problem.inputs, problem.simulation.steps, system.inputs)
    states = [_point(problem.initial.shape, errors, generator)]
    for step, u in enumerate(inputs[:-1], start=1):
        w = _point(problem.disturbance_set, errors, generator)
        states.append(a @ states[-1] + b @ u + (system.offset or 0.0) + w)
        need_size(f"{problem.name}: simulation, step {step}", states[-1])
    true = np.array(states)
    measured = true @ c.T + _signs(errors, (len(true), len(c)), generator) * problem.noise.half_width
    measured[[step for step in problem.simulation.missing if step < len(measured)]] = np.nan
    return Data(measured, inputs, true, f"simulated, {errors.value} errors, seed {seed}")


def need_size(where: str, *values: Floats) -> None:
    """Raise an error if a state is too large; NaN is not."""
    if any((np.abs(numbers) > MAX_STATE).any() for numbers in values):
        raise InputError(
            f"{where}: a state is larger than {MAX_STATE:g}; the system is unstable: correct A, or use fewer steps"
        )


def _signs(errors: Errors, shape: tuple[int, ...], generator: np.random.Generator) -> Floats:
    """Return random numbers from -1 to 1, only both ends for extremal errors."""
    if errors is Errors.EXTREMAL:
        return generator.choice([-1.0, 1.0], shape)
    return generator.uniform(-1.0, 1.0, shape)


def _point(shape: Set, errors: Errors, generator: np.random.Generator) -> Floats:
    """Return a random point of a set: an extreme one for extremal errors."""
    if isinstance(shape, Zonotope):
        return np.asarray(shape.centre + _signs(errors, (len(shape.generators),), generator) @ shape.generators)
    vertices = polytope_of(shape).vertices
    if errors is Errors.EXTREMAL:
        return np.asarray(vertices[generator.integers(len(vertices))])
    return np.asarray(generator.dirichlet(np.ones(len(vertices))) @ vertices)


def _padded(inputs: Floats | None, steps: int, size: int) -> Floats:
    """Return inputs for a number of steps; zero where there are none."""
    padded = np.zeros((steps, size))
    if inputs is not None:
        padded[: len(inputs)] = inputs[:steps]
    return padded


def read_csv(file: Path, outputs: int, inputs: int) -> Data:
    """Read measurements and inputs from a CSV file.

    Raise `InputError` if the file cannot be read, a column is missing or unknown, or a cell is not a number.
    """
    try:
        with file.open("rb") as opened:
            content = opened.read(MAX_CSV_BYTES + 1)
        if len(content) > MAX_CSV_BYTES:
            raise InputError(f"--data: {file}: is larger than {MAX_CSV_BYTES} bytes; divide it")
        rows = list(csv.reader(io.StringIO(content.decode("utf-8-sig"), newline="")))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not a CSV file in UTF-8"
        raise InputError(f"--data: {file}: {reason}; give a CSV file with a header") from None
    wanted = [f"y{number}" for number in range(1, outputs + 1)] + [f"u{number}" for number in range(1, inputs + 1)]
    header = [cell.strip() for cell in rows[0]] if rows else []
    unknown = [name for name in header if name not in (*wanted, "k")]
    missing = [name for name in wanted if name not in header]
    if unknown or missing or len(set(header)) < len(header):
        repeated = [name for name in header if header.count(name) > 1]
        problem = f"column {missing[0]} is missing" if missing else f"wrong column {shown((unknown or repeated)[0])}"
        raise InputError(
            f"--data: {file}: {problem}; the header must be {','.join(wanted)} (and k, optionally), found "
            f"{shown(','.join(header))}"
        )
    while rows and not rows[-1]:
        rows.pop()
    # In a file of one column an empty line is an empty cell.
    body = [(line, row or [""]) for line, row in enumerate(rows[1:], start=2) if row or len(header) == 1]
    if not 1 <= len(body) <= MAX_STEPS:
        raise InputError(f"--data: {file}: has {len(body)} steps; 1 to {MAX_STEPS} are possible")
    if "k" in header:
        _need_successive(file, body, header.index("k"))
    values = np.array([_numbers(file, line, row, header, wanted) for line, row in body])
    return Data(values[:, :outputs], values[:, outputs:], None, f"measurements of {file.name}")


def _need_successive(file: Path, body: list[tuple[int, list[str]]], column: int) -> None:
    """Check that the steps in column k are successive whole numbers."""
    texts = [(line, row[column].strip()) for line, row in body if column < len(row)]
    for (_, before), (line, text) in pairwise([(0, ""), *texts]):
        if not _STEP.fullmatch(text) or (before and int(text) != int(before) + 1):
            raise InputError(
                f"--data: {file}: line {line}, k: steps must be successive whole numbers, found {shown(text)}; "
                "write a row for each step, with empty cells of y where there is no measurement"
            )


def _numbers(file: Path, line: int, row: list[str], header: list[str], wanted: list[str]) -> list[float]:
    """Return the numbers of a row in the order of the columns that are wanted."""
    if len(row) != len(header):
        raise InputError(f"--data: {file}: line {line} has {len(row)} cells, and the header has {len(header)}")
    cells = dict(zip(header, row, strict=True))
    numbers = []
    for name in wanted:
        text = cells[name].strip()
        try:
            number = float(text) if text else math.nan
        except ValueError:
            number = math.inf
        is_missing = not text and name.startswith("y")
        if not is_missing and not abs(number) <= MAXIMUM:
            raise InputError(
                f"--data: {file}: line {line}, {name}: must be a number of at most {MAXIMUM:g} in size, found "
                f"{shown(text)}; an empty cell of y is a missing measurement; an input of zero is written 0"
            )
        numbers.append(number)
    return numbers
