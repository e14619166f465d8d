"""Problem files of kind `reachable-system`: a linear system of the user."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np

from infoset.arrays import Floats
from infoset.limits import NUMBER, POSITIVE, Description, Limits, Line, Name, real_values
from infoset.rendezvous.reachability import MAX_PERIODS, ReachabilityProblem, ThrustShape

Row = Annotated[tuple[float, ...], NUMBER]


@dataclass(frozen=True, kw_only=True)
class SystemTable:
    """[system]: x+ = A x + B u + c; `states` are names."""

    A: tuple[Row, ...]
    B: tuple[Row, ...]
    c: Row = ()
    states: tuple[Annotated[str, Line(40)], ...] = ()


@dataclass(frozen=True, kw_only=True)
class BoundTable:
    """[bounds]: of the absolute value of each state at t = 0..T, and of each control."""

    states: Annotated[tuple[float, ...], POSITIVE]
    controls: Annotated[tuple[float, ...], POSITIVE]


@dataclass(frozen=True, kw_only=True)
class ReachableSystem:
    """A linear system that is to reach a `target` in T `periods` from an `initial` state.

    The default target is 0.
    """

    kind: ClassVar[str] = "reachable-system"

    name: Name = "system"
    description: Description = ""
    periods: Annotated[int, Limits(minimum=1, maximum=MAX_PERIODS, whole=True)]
    initial: Row
    target: Row = ()
    thrust: ThrustShape = ThrustShape.BOX
    system: SystemTable
    bounds: BoundTable

    def __post_init__(self) -> None:
        n = len(self.system.A)
        m = len(self.bounds.controls)
        for name, value, size in (
            ("system.A", self.system.A, (n, n)),
            ("system.B", self.system.B, (n, m)),
            ("system.c", self.system.c or (0.0,) * n, (n,)),
            ("initial", self.initial, (n,)),
            ("target", self.target or (0.0,) * n, (n,)),
            ("bounds.states", self.bounds.states, (n,)),
        ):
            if real_values(name, value).shape != size:
                wanted = " x ".join(map(str, size))
                raise ValueError(
                    f"{name}: must have {wanted} values, for {n} states and {m} controls"
                )
        if len(self.names) != n:
            raise ValueError(f"system.states: must be {n} names, one for each state")
        _ = self.problem  # raises ValueError if it is none

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.system.states or tuple(
            f"x{number}" for number in range(1, len(self.system.A) + 1)
        )

    @cached_property
    def path(self) -> Floats:
        """A motion without control that ends at the target, shape (T + 1, n).

        States are relative to it.
        """
        n = len(self.names)
        a = np.array(self.system.A)
        c = np.array(self.system.c or [0.0] * n)
        states = [np.array(self.target or [0.0] * n)]
        for _ in range(self.periods):
            states.append(np.linalg.lstsq(a, states[-1] - c, rcond=None)[0])
            # More than the rounding of least squares: there is no such state; chosen.
            if np.abs(a @ states[-1] + c - states[-2]).max() > 1e-9 * max(
                1.0, np.abs(states[-2]).max()
            ):
                raise ValueError("target: A is singular, and no motion without control ends there")
        return np.array(states[::-1])

    @property
    def problem(self) -> ReachabilityProblem:
        """The problem that is solved, in states relative to `path`."""
        n = len(self.names)
        bounds = np.array(self.bounds.states)
        # The bounds about a path that is not zero differ from time to time: they are half-spaces,
        # inside a box that contains them at all times.
        moving = bool(self.path.any())
        return ReachabilityProblem(
            np.array([self.system.A] * self.periods),
            np.array([self.system.B] * self.periods),
            np.array(self.initial) - self.path[0],
            bounds + np.abs(self.path).max(axis=0),
            np.array(self.bounds.controls),
            self.thrust,
            np.vstack([np.eye(n), -np.eye(n)]) if moving else None,
            np.hstack([bounds - self.path, bounds + self.path]) if moving else None,
            tuple(f"the bound on {name}" for name in self.names) * 2 if moving else (),
            None,
            self.names,
        )
