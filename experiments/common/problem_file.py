"""Problem files: TOML with a `kind`, one kind per command; the built-in files are in `experiments/problems`."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel

from experiments.common.errors import InputError
from experiments.common.output import library_version
from experiments.common.toml_form import Form, KeyPath, Known, Problem, Tables
from experiments.common.toml_values import Constant, Description, Name, Table, key, quoted_text
from rendezvous.two_body import OrbitalElements, orbit_fault, semi_major_axis_m

MOST_RADIANS = Decimal(1000)
LEAST_RADIANS = Decimal("1e-9")
"""Angles of the orbit during a problem, within which linear motion is meaningful."""
EARTH_M3_S2, EARTH_RADIUS_M = 3.986004418e14, 6378137.0
_MOST_RADII = 1000.0
"""Greatest semi-major axis in radii of the planet: that of an orbit in metres, read as kilometres, is greater."""
_STAR_M3_S2 = 1e19
"""Gravitational parameter between that of Jupiter, 1.27e17, and that of the Sun, 1.33e20."""


class ProblemTables(Table):
    """The keys of every problem file, above its first table."""

    schema_number: Constant = key("version of this file format", "1", alias="schema", default=1)
    kind: Constant = key("kind of problem", '"pareto-encounter"')
    name: Name = key("name of the results", '"my-problem"')
    description: Description = key("one line for results and pages", '""', default="")


OfProblem = TypeVar("OfProblem", bound=ProblemTables)


@dataclass(frozen=True, eq=False, repr=False)
class ReadProblem(Generic[OfProblem]):
    """A problem as read: its tables, and the name of its file for messages."""

    tables: OfProblem
    source: str

    def __repr__(self) -> str:
        about = f"\n {self.tables.description}" if self.tables.description else ""
        return f"<{self.tables.kind} problem {self.name}, hash {self.hash}{about}>"

    @property
    def name(self) -> str:
        """Return the name of the results."""
        return self.tables.name

    @property
    def hash(self) -> str:
        """Return the fingerprint of the values."""
        return problem_hash(self.tables)

    @property
    def toml(self) -> str:
        """Return a file that reads back as the same problem."""
        return problem_toml(self.tables)

    @property
    def head(self) -> dict[str, object]:
        """Return the first keys of the JSON of a command."""
        return {"version": library_version(), "problem": self.name, "problem_hash": self.hash}

    def need_finite(self, *results: ArrayLike) -> None:
        """Raise `InputError` if a result is not finite."""
        if not all(np.isfinite(values).all() for values in results):
            raise InputError(f"{self.source}: the numbers are so large that results are not finite; check the units")


def problem_form(
    kind: str,
    tables: type[Tables],
    checks: Callable[[Known], Iterable[Problem]] = lambda _: (),
    written: Sequence[str] = (),
) -> Form[Tables]:
    """Return the form of the problem files of a kind; the parameters are those of `Form`."""
    return Form(
        "problem",
        "infoset problems list",
        f"infoset problems new {kind or 'KIND'} FILE",
        tables,
        checks,
        ("name", *written),
        kind,
    )


def problem_hash(tables: Tables) -> str:
    """Return a short hash of all values of a problem except its name and description.

    It has 16 hexadecimal digits, the same for equal values on every machine.
    """
    values = tables.model_dump(exclude={"name", "description"})
    return hashlib.sha256(json.dumps(values, sort_keys=True, default=_plain).encode()).hexdigest()[:16]


def problem_toml(tables: BaseModel) -> str:
    """Return a file with the values that a problem sets; it is read back as the same problem."""
    document = tables.model_dump(by_alias=True, exclude_unset=True, exclude_none=True)
    top, inner = [], []
    for name, value in document.items():
        if isinstance(value, dict):
            inner += ["", f"[{name}]", *_lines(value)]
        elif isinstance(value, list | tuple) and value and isinstance(value[0], dict):
            inner += [line for table in value for line in ("", f"[[{name}]]", *_lines(table))]
        else:
            top += _lines({name: value})
    return "\n".join([*top, *inner]) + "\n"


def _lines(table: Mapping[str, object]) -> list[str]:
    return [f"{name} = {_literal(value)}" for name, value in table.items()]


def _literal(value: object) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_literal(item) for item in value)}]"
    if isinstance(value, Enum):
        return quoted_text(value.value if isinstance(value.value, str) else value.name.lower())
    if isinstance(value, bool):
        return str(value).lower()
    return quoted_text(value) if isinstance(value, str) else str(value)


def duplicate_names(known: Known, table: str, count: int) -> Iterator[Problem]:
    """Yield a problem for each name that occurs twice in the first ``count`` tables of an array of tables."""
    numbers: dict[object, int] = {}
    for index in range(count):
        name = known.value(table, str(index), "name")
        first = numbers.setdefault(name, index + 1)
        if isinstance(name, str) and first <= index:
            yield Problem((table, str(index), "name"), f'"{name}" is also the name of {table} #{first}', "rename one")


def angle_problems(path: KeyPath, duration_s: Decimal | None, rate_rad_s: Decimal | None) -> Iterator[Problem]:
    """Yield a problem if the orbit turns by an unlikely angle in a time; wrong or missing values yield none."""
    if duration_s is None or rate_rad_s is None or duration_s <= 0 or rate_rad_s <= 0:
        return
    angle = duration_s * rate_rad_s
    if not LEAST_RADIANS <= angle <= MOST_RADIANS:
        yield Problem(
            path,
            f"is {float(angle):.3g} radians of the orbit; {LEAST_RADIANS:g} to {MOST_RADIANS} make sense",
            f"check the units of orbit_rate_rad_s and {path[-1]}",
        )


def orbit_problems(
    path: KeyPath,
    state: tuple[ArrayLike, ArrayLike],
    mu_m3_s2: float,
    remedy: str,
    planet_radius_m: float | None = None,
) -> Iterator[Problem]:
    """Yield a problem if the orbit of a state (position and velocity, SI) meets its planet, or is absurdly large.

    Without a radius, that of a planet with the density of the Earth is used. No planet or moon is denser, so that
    theirs are greater. Orbits about a star have no upper limit.
    """
    position, velocity = (np.asarray(vector, dtype=float) for vector in state)
    densest_m = EARTH_RADIUS_M * (mu_m3_s2 / EARTH_M3_S2) ** (1.0 / 3.0)
    fault = orbit_fault(position, velocity, mu_m3_s2, densest_m if planet_radius_m is None else planet_radius_m)
    if fault is None and mu_m3_s2 < _STAR_M3_S2:
        radii = semi_major_axis_m(position, velocity, mu_m3_s2) / densest_m
        if radii > _MOST_RADII:
            fault = f"the orbit is {radii:.4g} times as large as the planet; at most {_MOST_RADII:g} times make sense"
    if fault is not None:
        of_density = "" if planet_radius_m is not None else " (the radius is that of the Earth's density)"
        yield Problem(path, fault, remedy + of_density)


def rate_problems(rate_rad_s: Decimal | None, eccentricity: Decimal | None = None) -> Iterator[Problem]:
    """Yield a problem if the orbit of this mean motion about the Earth has one; see `orbit_problems`.

    The rate at the surface of a planet depends on its density only, so that the Earth stands for all of them.
    """
    if rate_rad_s is None or rate_rad_s <= 0:
        return
    axis_m = (EARTH_M3_S2 / float(rate_rad_s) ** 2) ** (1.0 / 3.0)
    state = OrbitalElements(axis_m, float(eccentricity or 0), 0.0, 0.0, 0.0, 0.0).state(EARTH_M3_S2)
    remedy = "check its unit; these are numbers of the orbit about the Earth"
    yield from orbit_problems(("orbit_rate_rad_s",), state, EARTH_M3_S2, remedy, EARTH_RADIUS_M)


def _plain(value: object) -> str:
    if isinstance(value, Enum):
        return str(value.value)
    if isinstance(value, Decimal):
        return f"{value.normalize():f}"
    raise TypeError(f"a problem contains no {type(value).__name__}")
