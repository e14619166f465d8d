"""Problem files of kind `observer`: tables, checks, and the system with its sets."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Annotated, Any

import numpy as np
from pydantic import PlainValidator

from experiments.common.errors import InputError
from experiments.common.problem_file import ProblemTables, ReadProblem, problem_form
from experiments.common.toml_file import load_tables
from experiments.common.toml_form import Known, Problem
from experiments.common.toml_values import NUMBER, ZERO, Items, Line, Name, Number, Positive, Table, Whole, key, wrong
from experiments.observer.command import MOST_STEPS
from infoset import ConvexPolygons, LinearObserver, Zonotope
from infoset.arrays import Floats
from infoset.linear_observer import MOST_STATES
from infoset.observer_sets import Set
from infoset.polytope import Polytope

Row = tuple[Decimal, ...]

KIND = "observer"
MOST_OUTPUTS = 12
MOST_VERTICES = 100
MOST_GENERATORS = 12


@dataclass(frozen=True)
class Rows:
    """An array of up to `most` rows of numbers, all of one length up to `longest`; empty rows only with `gaps`."""

    most: int
    longest: int
    gaps: bool = False

    def __call__(self, value: object) -> tuple[Row, ...]:
        """Check and return them."""
        numbers = Items(NUMBER, "numbers", self.longest, least=0 if self.gaps else 1)
        rows = Items(numbers, "rows, each an array of numbers", self.most, numbered="row {}:")(value)
        if len({len(row) for row in rows if row}) > 1:
            raise wrong("must have rows of one length")
        return rows


Matrix = Annotated[tuple[Row, ...], PlainValidator(Rows(MOST_OUTPUTS, MOST_STATES))]
Vector = Annotated[Row, PlainValidator(Items(NUMBER, "numbers", MOST_STATES))]
Generators = Annotated[tuple[Row, ...], PlainValidator(Rows(MOST_GENERATORS, MOST_STATES))]
Vertices = Annotated[tuple[Row, ...], PlainValidator(Rows(MOST_VERTICES, MOST_STATES))]
Widths = Annotated[Row, PlainValidator(Items(Number(least=ZERO), "numbers", MOST_OUTPUTS))]
Series = Annotated[tuple[Row, ...], PlainValidator(Rows(MOST_STEPS, MOST_OUTPUTS, gaps=True))]
Inputs = Annotated[tuple[Row, ...], PlainValidator(Rows(MOST_STEPS, MOST_OUTPUTS))]
Steps = Annotated[tuple[int, ...], PlainValidator(Items(Whole(MOST_STEPS - 1, least=0), "steps", MOST_STEPS, least=0))]
Names = Annotated[
    tuple[str, ...], PlainValidator(Items(Line(40, empty=False), "texts", MOST_STATES, numbered="text {} of the array"))
]


class SystemTable(Table):
    """[system]: x+ = A x + B u + offset + w, y = C x + v."""

    A: Matrix = key("n rows of n numbers", "[[1.0, 0.5], [0.0, 1.0]]")
    B: Matrix | None = key("n rows, a column for each input", "[[0.125], [0.5]]", default=None)
    C: Matrix = key("a row for each output, n columns", "[[1.0, 0.0]]")
    offset: Vector | None = key("n numbers", "[0.0, 0.0]", default=None)
    step_s: Positive | None = key("time between two steps, for figures", "0.5", default=None)
    states: Names | None = key(
        "names of the states with their units, for figures", '["position, m", "speed, m/s"]', default=None
    )


class SetTable(Table):
    """[initial], [disturbance]: one of three forms of a set."""

    lower: Vector | None = key("a box: least value of each state", "[-1.0, -1.0]", default=None)
    upper: Vector | None = key("a box: greatest value of each state", "[1.0, 1.0]", default=None)
    center: Vector | None = key("a zonotope: its center", "[0.0, 0.0]", default=None)
    generators: Generators | None = key(
        "a zonotope: a generator a row, times -1 to 1", "[[1.0, 0.0], [0.0, 1.0]]", default=None
    )
    vertices: Vertices | None = key("a polytope: a vertex a row", "[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]", default=None)


class DisturbanceTable(SetTable):
    """[disturbance]: W."""

    lower: Vector | None = key("a box: least value of each state", "[-0.01, -0.05]", default=None)
    upper: Vector | None = key("a box: greatest value of each state", "[0.01, 0.05]", default=None)


class NoiseTable(Table):
    """[noise]: the bounds of v."""

    half_width: Widths = key("bound of the error of each output", "[0.2]")


class MeasurementTable(Table):
    """[measurements]: measurements and inputs."""

    y: Series | None = key("a row of outputs a step; [] is a missing measurement", "[[0.1], [], [0.3]]", default=None)
    u: Inputs | None = key("a row of inputs a step; it acts after the measurement", "[[1.0], [0.0]]", default=None)


class SimulationTable(Table):
    """[simulation]: measurements that are simulated if there are none."""

    steps: Annotated[int, PlainValidator(Whole(MOST_STEPS))] = key("number of measurements", "30", default=30)
    missing: Steps = key("steps without a measurement", "[10, 11]", default=())


class ObserverTables(ProblemTables):
    """A problem file of kind `observer`."""

    name: Name = key("name of the results", '"my-system"', default="observer")
    system: SystemTable = key("the system x+ = A x + B u + offset + w, y = C x + v", "")
    initial: SetTable = key("set of the state before the first measurement", "")
    disturbance: DisturbanceTable | None = key("set of the disturbance w; without this table: 0", "", default=None)
    noise: NoiseTable = key("bounds of the errors v of the outputs", "")
    measurements: MeasurementTable | None = key("measurements and inputs", "", default=None)
    simulation: SimulationTable | None = key("simulated measurements, if there are none", "", default=None)


_FORMS = (("lower", "upper"), ("center", "generators"), ("vertices",))


def _width(value: object) -> int | None:
    """Return the number of columns of an array of rows, or of numbers; None if it is missing."""
    if not isinstance(value, list):
        return None
    rows = [row for row in value if row != []]
    return len(rows[0]) if rows and isinstance(rows[0], list) else len(value)


def _checks(known: Known) -> Iterator[Problem]:
    """Check the shapes against each other."""
    n = _width(known.value("system", "A"))
    if n is None:
        return
    rows = {name: known.value("system", name) for name in ("A", "B", "C")}
    for name in ("A", "B"):
        value = rows[name]
        if isinstance(value, list) and len(value) != n:
            text = f"has {len(value)} rows, and A has {n} columns"
            yield Problem(("system", name), text, f"write {n} rows, one a state")
            if name == "A":  # the number of states is unknown
                return
    sizes = [(("system", name), n) for name in ("C", "offset", "states")]
    sizes += [((table, name), n) for table in ("initial", "disturbance") for form in _FORMS for name in form]
    if isinstance(rows["C"], list):
        outputs = len(rows["C"])
        sizes += [(("noise", "half_width"), outputs), (("measurements", "y"), outputs)]
    inputs = _width(rows["B"]) or 0
    for path, size in [*sizes, (("measurements", "u"), inputs)]:
        width = _width(known.value(*path))
        if width is not None and width != size:
            of = {"half_width": "C has {} rows", "y": "C has {} rows", "u": "B has {} columns"}
            reason = of.get(path[-1], "A has {} columns").format(size)
            yield Problem(path, f"has {width} numbers a row, and {reason}", f"write {size}")
    for table in ("initial", "disturbance"):
        value = known.value(table)
        if isinstance(value, dict):
            yield from _form_problems(known, table, value)


def _form_problems(known: Known, table: str, value: dict[str, Any]) -> Iterator[Problem]:
    """Yield a problem unless a set has exactly one of the three forms."""
    used = [form for form in _FORMS if any(name in value for name in form)]
    if len(used) != 1 or not all(name in value for name in used[0]):
        remedy = "write lower and upper, or center and generators, or vertices"
        yield Problem((table,), "does not describe one set", remedy)
        return
    lower, upper = (known.value(table, name) for name in ("lower", "upper"))
    if isinstance(lower, list) and isinstance(upper, list) and len(lower) == len(upper):
        for number, (least, greatest) in enumerate(zip(lower, upper, strict=True), start=1):
            if least > greatest:
                yield Problem((table, "lower"), f"number {number} exceeds that of upper", "write the smaller value")


FORM = problem_form(
    KIND,
    ObserverTables,
    _checks,
    ("initial.lower", "initial.upper", "disturbance", "disturbance.lower", "disturbance.upper"),
)


@dataclass(frozen=True, eq=False, repr=False)
class ObserverProblem(ReadProblem[ObserverTables]):
    """A problem as read.

    `measured` and `inputs` are y and u of the file, shapes (N, q), NaN if missing, and (M, p). `steps` and `missing`
    describe a simulation: the number of measurements, and the steps without one.
    """

    a: Floats
    b: Floats
    c: Floats
    offset: Floats
    initial: Set
    disturbance: Set
    half_width: Floats
    measured: Floats | None
    inputs: Floats | None
    steps: int
    missing: tuple[int, ...]
    step_s: float | None
    names: tuple[str, ...]

    def observer(self, runs: int | None = None) -> LinearObserver:
        """Return the observer at its initial set; `runs` as in `LinearObserver`."""
        return LinearObserver(
            self.a,
            self.c,
            self.initial,
            noise=self.half_width,
            disturbance=self.disturbance,
            input_matrix=self.b,
            offset=self.offset,
            runs=runs,
        )


def load_observer(name_or_path: str, settings: Sequence[str] | None = None) -> ObserverProblem:
    """Read a built-in problem by its name or a file by its path, with settings KEY=VALUE in place of its values.

    Raises
    ------
    InputError
        If there is no such problem, or it is not sound.
    """
    tables = load_tables(FORM, name_or_path, settings)
    system = tables.system
    a, c = np.array(system.si("A")), np.array(system.si("C"))
    n, q = len(a), len(c)
    b = np.zeros((n, 0)) if system.B is None else np.array(system.si("B"))
    series = tables.measurements or MeasurementTable()
    simulation = tables.simulation or SimulationTable()
    return ObserverProblem(
        tables,
        name_or_path,
        a,
        b,
        c,
        np.zeros(n) if system.offset is None else np.array(system.si("offset")),
        _set_of(tables.initial, n, f"{name_or_path}: initial"),
        Zonotope(np.zeros(n), []) if tables.disturbance is None else _set_of(tables.disturbance, n, name_or_path),
        np.array(tables.noise.si("half_width")),
        _series(series.si("y"), q),
        _series(series.si("u"), b.shape[1]),
        simulation.steps,
        simulation.missing,
        system.si("step_s"),
        system.states or tuple(f"x{number}" for number in range(1, n + 1)),
    )


def _set_of(table: SetTable, states: int, where: str) -> Set:
    if table.lower is not None:
        return Zonotope.box(table.si("lower"), table.si("upper"))
    if table.center is not None:
        return Zonotope(table.si("center"), table.si("generators"))
    points = np.array(table.si("vertices"))
    if states == 2:
        return ConvexPolygons.from_points(points)
    try:
        return Polytope.from_vertices(points)
    except ArithmeticError as error:
        raise InputError(f"{where}: vertices: {error}") from None


def _series(rows: tuple[tuple[float, ...], ...] | None, size: int) -> Floats | None:
    """Return rows as an array; NaN for an empty row."""
    return None if rows is None else np.array([row or (np.nan,) * size for row in rows])
