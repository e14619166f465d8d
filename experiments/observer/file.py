"""Problem files of kind `observer`: tables and keys, and the observer of their system."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from infoset.arrays import Floats
from infoset.experiments.observer.command import MAX_STEPS
from infoset.geometry.convex_polygons import ConvexPolygons
from infoset.geometry.polytope import Polytope
from infoset.geometry.zonotope import Zonotope
from infoset.limits import (
    NOT_NEGATIVE,
    NUMBER,
    WHOLE,
    Description,
    Limits,
    Line,
    Name,
    Positive,
    real_values,
)
from infoset.observer.cover import Cover
from infoset.observer.linear_observer import LinearObserver
from infoset.observer.sets import Set

Row = Annotated[tuple[float, ...], NUMBER]
Rows = tuple[Row, ...]


@dataclass(frozen=True, kw_only=True)
class ObserverTable:
    """[system]: x+ = A x + B u + c + w, y = C x + v, every `step_s`.

    `states` are names for figures.
    """

    A: Rows
    B: Rows = ()
    C: Rows
    c: Row = ()
    step_s: Positive | None = None
    states: tuple[Annotated[str, Line(40)], ...] = ()

    @property
    def inputs(self) -> int:
        """Number of inputs."""
        return len(self.B[0]) if self.B else 0


@dataclass(frozen=True)
class SetTable:
    """[initial], [disturbance]: a box, a zonotope or a polytope.

    A zonotope has a generator in each row (times -1 to 1), a polytope a vertex in each row.
    """

    lower: Row = ()
    upper: Row = ()
    center: Row = ()
    generators: Annotated[Rows, Field(max_length=12)] = ()
    vertices: Annotated[Rows, Field(max_length=100)] = ()

    def __post_init__(self) -> None:
        _ = self.shape  # raises ValueError if there is no such set

    @cached_property
    def shape(self) -> Set:
        """The set."""
        # Which keys are given, in the order of the fields.
        match [bool(values) for values in vars(self).values()]:
            case [True, True, False, False, False]:
                return Zonotope.box(self.lower, self.upper)
            case [False, False, True, True, False]:
                return Zonotope(self.center, self.generators)
            case [False, False, False, False, True]:
                points = real_values("vertices", self.vertices)
                try:
                    return (
                        ConvexPolygons.from_points(points)
                        if points.shape[1] == 2
                        else Polytope.from_vertices(points)
                    )
                except ArithmeticError as error:
                    raise ValueError(f"vertices: {error}") from None
        raise ValueError("must have lower and upper, or center and generators, or vertices")


@dataclass(frozen=True)
class NoiseTable:
    """[noise]: the bound of the error v of each output.

    At most `wrong_measurements` of a run have errors beyond it; they are dealt into
    `measurement_classes` as in `LinearObserver`.
    """

    half_width: Annotated[tuple[float, ...], NOT_NEGATIVE]
    wrong_measurements: int = 0
    measurement_classes: int | None = None

    def __post_init__(self) -> None:
        # Raises ValueError if a number is not possible.
        _ = Cover.of(self.wrong_measurements, self.measurement_classes)


@dataclass(frozen=True)
class MeasurementTable:
    """[measurements]: rows of outputs and of inputs, one for each step.

    A missing output is empty, and the inputs act after the outputs of their row are measured.
    """

    y: Rows = ()
    u: Rows = ()


@dataclass(frozen=True)
class SimulationTable:
    """[simulation]: number of measurements that are simulated if the file has none.

    `missing` are the steps without a measurement.
    """

    steps: Annotated[int, Limits(minimum=1, maximum=MAX_STEPS, whole=True)] = 30
    missing: tuple[Annotated[int, WHOLE], ...] = ()


@dataclass(frozen=True)
class WrongMeasurementsTable:
    """[wrong_measurements]: measurements of a simulation with errors beyond their bounds.

    They are simulated whatever the observer allows for: `noise.wrong_measurements` is what it
    allows for. `size` are the minimum and the maximum error in units of its bound: the logarithm is
    uniform, and the sign of each output random. `steps` are the first and the last step at which
    they may be; None is all steps.
    """

    number: Annotated[int, Limits(minimum=0, maximum=MAX_STEPS, whole=True)]
    size: Annotated[tuple[float, float], Limits(minimum=1.0, maximum=1e6)] = (2.0, 100.0)
    steps: tuple[Annotated[int, WHOLE], Annotated[int, WHOLE]] | None = None

    def __post_init__(self) -> None:
        if self.steps is not None and self.steps[0] > self.steps[1]:
            raise ValueError(f"steps must be [first, last], and is reversed: got {self.steps}")


@dataclass(frozen=True, kw_only=True)
class ObserverProblem:
    """A problem file of kind `observer`.

    Parameters
    ----------
    name, description : str
        Name of the results, and a line about the problem.
    system : ObserverTable
        The system.
    initial : SetTable
        Set of the state before the first measurement.
    disturbance : SetTable or None
        Set of w; None is zero.
    noise : NoiseTable
        Bounds of v.
    measurements, simulation : MeasurementTable, SimulationTable
        Measurements and inputs of the file, and the simulation if it has no measurements.
    wrong_measurements : WrongMeasurementsTable or None
        Wrong measurements of the simulation; None is none.
    """

    kind: ClassVar[str] = "observer"
    name: Name = "observer"
    description: Description = ""
    system: ObserverTable
    initial: SetTable
    disturbance: SetTable | None = None
    noise: NoiseTable
    measurements: MeasurementTable = MeasurementTable()
    simulation: SimulationTable = SimulationTable()
    wrong_measurements: WrongMeasurementsTable | None = None

    def __post_init__(self) -> None:
        states = self.observer().states  # raises ValueError if a matrix or a set is wrong
        if len(self.names) != states:
            raise ValueError(
                f"system.states must be {states} names, one for each state: got {len(self.names)}"
            )
        _ = self.measured, self.inputs

    @cached_property
    def measured(self) -> Floats | None:
        """Measurements of the file, shape (N, q), NaN if missing; None if there are none."""
        # An empty row stands for no measurement.
        missing = (np.nan,) * len(self.system.C)
        return _series(
            "measurements.y", [row or missing for row in self.measurements.y], len(missing)
        )

    @cached_property
    def inputs(self) -> Floats | None:
        """Inputs of the file, shape (M, p); None if there are none."""
        return _series("measurements.u", self.measurements.u, self.system.inputs)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.system.states or tuple(
            f"x{number}" for number in range(1, len(self.system.A) + 1)
        )

    @property
    def disturbance_set(self) -> Set:
        """The set of w."""
        return (
            Zonotope(np.zeros(len(self.names)), [])
            if self.disturbance is None
            else self.disturbance.shape
        )

    def observer(self, runs: int | None = None) -> LinearObserver:
        """Return the observer at its initial set; `runs` as in `LinearObserver`."""
        return LinearObserver(
            self.system.A,
            self.system.C,
            self.initial.shape,
            noise=self.noise.half_width,
            disturbance=self.disturbance_set,
            input_matrix=self.system.B or None,
            offset=self.system.c or None,
            runs=runs,
            wrong_measurements=self.noise.wrong_measurements,
            measurement_classes=self.noise.measurement_classes,
        )


def _series(key: str, rows: Sequence[Row], size: int) -> Floats | None:
    values = real_values(key, rows)
    if rows and values.shape[1] != size:
        raise ValueError(f"{key} must have {size} numbers a row: got {values.shape[1]}")
    return values if rows else None
