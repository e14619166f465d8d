"""Terminal control of a linear system in discrete time under constraints on its states and controls."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]

MOST_PERIODS = 256


class ThrustShape(Enum):
    """What the bounds on a control mean."""

    BOX = "box"
    BALL = "ball"


class InadmissibleStartError(ValueError):
    """The initial state breaks a constraint.

    Parameters
    ----------
    broken : tuple of tuple of (str, float)
        Each broken constraint, and by how much.
    """

    def __init__(self, broken: tuple[tuple[str, float], ...]) -> None:
        said = ", ".join(f"{name} by {excess:.6g}" for name, excess in broken)
        super().__init__(f"the initial state is outside its constraints: {said}")
        self.broken = broken


@dataclass(frozen=True, eq=False)
class ReachabilityProblem:
    """Minimise |x(T)| for x(t+1) = A(t) x(t) + B(t) u(t) from x(0), and find all controls that do.

    Parameters
    ----------
    transition : ndarray, shape (T, n, n)
        A(t), of states in their own units; it may be singular.
    control : ndarray, shape (T, n, m)
        B(t).
    initial : ndarray, shape (n,)
        The state at t = 0.
    state_bounds : ndarray, shape (n,)
        |x_i(t)| <= state_bounds_i for t = 0..T, all positive; they are also the sizes that states are compared with.
    control_bounds : ndarray, shape (m,)
        |u_j| <= control_bounds_j for a box; for a ball the Euclidean norm is bounded and all must be equal.
    thrust : ThrustShape
    normals : ndarray, shape (k, n)
        More constraints on states: normals x(t) <= offsets(t).
    offsets : ndarray, shape (T + 1, k)
        In the units of normals x; infinite where a constraint does not hold.
    constraint_names : tuple of str
        What to call these k in messages.
    between : ndarray, shape (T, s, n, n + m) or None
        States between the periods, x = between[t, i] (x(t), u(t)), at which the constraints are to hold too.
    state_names : tuple of str
        What to call the states in messages.

    Raises
    ------
    ValueError
        If shapes do not fit, a number is not finite, a bound is not positive, or there is no period.
    InadmissibleStartError
        If x(0) breaks a constraint.
    """

    transition: Floats
    control: Floats
    initial: Floats
    state_bounds: Floats
    control_bounds: Floats
    thrust: ThrustShape = ThrustShape.BOX
    normals: Floats | None = None
    offsets: Floats | None = None
    constraint_names: tuple[str, ...] = ()
    between: Floats | None = None
    state_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.transition.ndim != 3 or not len(self.transition):
            raise ValueError("T = 0: there must be at least one period; give A(t) as an array of shape (T, n, n)")
        periods, n = self.transition.shape[:2]
        if periods > MOST_PERIODS:
            raise ValueError(f"{periods} periods would not finish; at most {MOST_PERIODS} are taken")
        if self.control.ndim != 3 or not self.control.shape[2]:
            raise ValueError("B(t) must have the shape (T, n, m), m at least 1")
        m = self.control.shape[2]
        wanted = {
            "A(t)": (self.transition, (periods, n, n)),
            "B(t)": (self.control, (periods, n, m)),
            "the initial state": (self.initial, (n,)),
            "the bounds on states": (self.state_bounds, (n,)),
            "the bounds on controls": (self.control_bounds, (m,)),
        }
        for name, (array, shape) in wanted.items():
            if array.shape != shape:
                raise ValueError(f"{name} must have the shape {shape}, found {array.shape}")
            if not np.isfinite(array).all():
                raise ValueError(f"{name} must be finite")
        if (self.state_bounds <= 0.0).any() or (self.control_bounds <= 0.0).any():
            raise ValueError("all bounds on states and controls must be positive")
        if self.thrust is ThrustShape.BALL and np.ptp(self.control_bounds) > 0.0:
            raise ValueError("a ball has one radius: the bounds on controls must be equal")
        self._check_more(periods, n, m)
        self._check_start()

    def _check_more(self, periods: int, n: int, m: int) -> None:
        if (self.normals is None) != (self.offsets is None):
            raise ValueError("constraints need both normals and offsets")
        if self.normals is not None and self.offsets is not None:
            k = len(self.normals)
            if self.normals.shape != (k, n) or self.offsets.shape != (periods + 1, k):
                raise ValueError(f"constraints need normals of shape (k, {n}) and offsets of shape ({periods + 1}, k)")
            if not np.isfinite(self.normals).all() or np.isnan(self.offsets).any() or (self.offsets == -np.inf).any():
                raise ValueError("normals must be finite, and offsets numbers or plus infinity")
            if (np.linalg.norm(self.normals, axis=1) == 0.0).any():
                raise ValueError("a constraint has a normal of zero length")
            if len(self.constraint_names) not in (0, k):
                raise ValueError("there must be a name for each constraint, or none")
        if len(self.state_names) not in (0, n):
            raise ValueError("there must be a name for each state, or none")
        if self.between is not None and (
            self.between.ndim != 4 or self.between.shape[0] != periods or self.between.shape[2:] != (n, n + m)
        ):
            raise ValueError(f"states between the periods need the shape ({periods}, s, {n}, {n + m})")

    def _check_start(self) -> None:
        over = np.abs(self.initial) - self.state_bounds
        broken = [(self.state_name(i), float(over[i])) for i in np.flatnonzero(over > 0.0).tolist()]
        if self.normals is not None and self.offsets is not None:
            excess = self.normals @ self.initial - self.offsets[0]
            slack = 1e-12 * np.abs(self.normals) @ self.state_bounds
            broken += [(self.name_of(k), float(excess[k])) for k in np.flatnonzero(excess > slack).tolist()]
        if broken:
            raise InadmissibleStartError(tuple(broken))

    def name_of(self, constraint: int) -> str:
        """Return what to call a `constraint` beyond the bounds, by its place."""
        return self.constraint_names[constraint] if self.constraint_names else f"constraint {constraint + 1}"

    def state_name(self, state: int) -> str:
        """Return what to call a state, by its place."""
        return self.state_names[state] if self.state_names else f"state {state + 1}"

    @property
    def periods(self) -> int:
        """Number of periods T."""
        return int(self.transition.shape[0])

    @property
    def states(self) -> int:
        """Number of states n."""
        return int(self.transition.shape[1])

    @property
    def controls(self) -> int:
        """Number of controls m."""
        return int(self.control.shape[2])

    def run(self, controls: ArrayLike) -> Floats:
        """Return the states that controls lead through.

        Parameters
        ----------
        controls : array_like, shape (..., T, m)

        Returns
        -------
        ndarray, shape (..., T + 1, n)
        """
        given = np.asarray(controls, dtype=float)
        states = [np.broadcast_to(self.initial, (*given.shape[:-2], self.states))]
        for t in range(self.periods):
            states.append(states[-1] @ self.transition[t].T + given[..., t, :] @ self.control[t].T)
        return np.stack(states, axis=-2)

    def excess(self, controls: ArrayLike) -> Floats:
        """Return by how much controls break a constraint, relative to the bounds; at most 0 where they break none.

        Parameters
        ----------
        controls : array_like, shape (..., T, m)

        Returns
        -------
        ndarray, shape (...)
        """
        given = np.asarray(controls, dtype=float)
        if self.thrust is ThrustShape.BALL:
            worst = np.linalg.norm(given, axis=-1).max(axis=-1) / self.control_bounds[0] - 1.0
        else:
            worst = (np.abs(given) / self.control_bounds).max(axis=(-1, -2)) - 1.0
        states = self.run(given)
        worst = np.maximum(worst, self._state_excess(states, np.arange(self.periods + 1)))
        if self.between is not None:
            both = np.concatenate([states[..., :-1, :], given], axis=-1)
            inner = np.einsum("tsij,...tj->...tsi", self.between, both)
            for place in range(self.between.shape[1]):
                worst = np.maximum(worst, self._state_excess(inner[..., place, :], np.arange(self.periods)))
        return np.asarray(worst)

    def _state_excess(self, states: Floats, times: NDArray[np.int64]) -> Floats:
        """Worst over the last two axes (time, state); a constraint holds between t and t + 1 where it does at t."""
        worst = (np.abs(states) / self.state_bounds).max(axis=(-1, -2)) - 1.0
        if self.normals is not None and self.offsets is not None:
            sizes = np.abs(self.normals) @ self.state_bounds
            beyond = (states @ self.normals.T - self.offsets[times]) / sizes
            worst = np.maximum(worst, beyond.max(axis=(-1, -2)))
        return np.asarray(worst)

    def first(self, periods: int) -> ReachabilityProblem:
        """Return the problem that ends after the first periods.

        Parameters
        ----------
        periods : int
            From 1 to T.

        Returns
        -------
        ReachabilityProblem
        """
        return self._part(0, periods, self.initial)

    def rest(self, start: int, state: ArrayLike) -> ReachabilityProblem:
        """Return the problem that begins at a later time, from a state.

        Parameters
        ----------
        start : int
            From 0 to T - 1.
        state : array_like, shape (n,)

        Returns
        -------
        ReachabilityProblem

        Raises
        ------
        InadmissibleStartError
            If the state breaks a constraint.
        """
        return self._part(start, self.periods, np.asarray(state, dtype=float))

    def _part(self, start: int, end: int, state: Floats) -> ReachabilityProblem:
        if not 0 <= start < end <= self.periods:
            raise ValueError(f"T = 0: from period {start} to {end} is no part of {self.periods} periods")
        return ReachabilityProblem(
            self.transition[start:end],
            self.control[start:end],
            state,
            self.state_bounds,
            self.control_bounds,
            self.thrust,
            self.normals,
            None if self.offsets is None else self.offsets[start : end + 1],
            self.constraint_names,
            None if self.between is None else self.between[start:end],
            self.state_names,
        )
