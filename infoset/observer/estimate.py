"""Estimates of a `LinearObserver`: the sets of possible states at a step, and contradictions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry._set_arguments import finite_values
from infoset.geometry.convex_polygons import ConvexPolygons
from infoset.geometry.drawing import draw_polygons
from infoset.geometry.polytope import Polytope
from infoset.limits import shown
from infoset.observer.sets import Motion, Polygons, Polytopes, Set, Sets
from infoset.observer.steps import Strips
from infoset.observer.window import Windows, exact_hull

MAX_POLYTOPE_STATES = 4
"""Number of states up to which the sets are polytopes. For more states, programs give tighter
bounds than reduced polytopes.
"""
MAX_RECORD = 20_000
"""Number of steps and measurements up to which they are kept, so that the memory of an observer is
bounded; chosen.
"""
_OUTLINE_SIDES = 32
"""Sides of a polygon around a projection: around an ellipse it has 0.3 % more area."""


@dataclass(frozen=True, eq=False)
class Inconsistency:
    """Where the measurements contradict the model.

    The arrays have the shape () for a single run, or (B,).

    Parameters
    ----------
    step : ndarray of int
        Step whose measurement made the set empty; -1 if the set is not empty.
    output : ndarray of int
        Output whose bounds made it empty, from 0, after the outputs before it. For noise in a set,
        the row of the normals of the polytope (of a polygon V, `V.polytope().normals`), or of its
        projection on the measured outputs. 0 if the set is not empty.
    excess : ndarray
        Minimum enlargement of these bounds, all others unchanged, for which a state exists, in the
        unit of the output; 0 if the set is not empty.
    """

    step: Integers
    output: Integers
    excess: Floats


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """The sets of possible states of all runs at a step.

    They result from the `initial` set and the first `count` of the `events`, steps and
    measurements. With `single` there is one run, without an axis of runs.

    With `wrong_measurements` a run has R sets, the `members`, and its possible states are in one of
    them: bounds are the minimum and the maximum over those that are not empty. Results for each set
    have an axis R after the axis of runs; other observers have one set for each run, without this
    axis.
    """

    step: int
    sets: Sets
    single: bool
    members: int
    states: int
    initial: Set
    events: list[Motion | Strips]
    count: int

    def __repr__(self) -> str:
        head = f"<estimate of {self.states} states at step {self.step}:"
        ends = np.stack(self._hull, axis=-1)
        if not self.single:
            empty = int(self.is_empty.sum())
            return f"{head} {len(ends)} runs, {empty} of them without a possible state>"
        if self.is_empty:
            return f"{head} no state is possible>"
        bounds = ", ".join(f"{low:.6g} to {high:.6g}" for low, high in ends)
        return f"{head} {bounds}>"

    @property
    def is_empty(self) -> Flags:
        """Whether no state is possible, shape () or (B,)."""
        # A run has a possible state if one of its sets has.
        return np.asarray(~self._runs(self._maximum(~self.sets.is_empty)))

    @property
    def reduced(self) -> Flags:
        """Whether the set, or one of the members, is larger than the exact one, shape () or (B,).

        It has a bounded number of facets, or uses the last steps only. Polygons of two states are
        exact up to 512 vertices, and not counted here.
        """
        return np.asarray(self._runs(self._maximum(self.sets.reduced)))

    def excess_widths(self) -> Floats:
        """Return the excess of the widths of the set over the exact ones, shape (n,) or (B, n).

        2 n linear programs over the whole record are solved for each reduced set; the exact widths
        are at most 1e-7 of a state smaller than the widths that they find. The excess is 0 for
        other sets, and NaN for the empty set and where a program has no solution.

        Raises
        ------
        ValueError
            If a run is reduced and the estimate follows more than 20 000 steps and measurements:
            the record is no longer kept.
        """
        below, above = self._heights(np.eye(self.states))
        is_larger = self.sets.reduced & ~self.sets.is_empty
        # A record that became too long was discarded (`LinearObserver._note`).
        if is_larger.any() and len(self.events) < self.count:
            raise ValueError(
                f"exact widths are known for {MAX_RECORD} steps and measurements, not more"
            )

        exact_below = below.copy()
        exact_above = above.copy()
        for number in np.flatnonzero(is_larger):
            record = self.events[: self.count]
            least, most = exact_hull(self.initial, record, int(number), self.step)
            exact_below[number] = -least
            exact_above[number] = most

        widths = self._maximum(above) + self._maximum(below)
        exact = self._maximum(exact_above) + self._maximum(exact_below)
        with np.errstate(invalid="ignore"):  # the heights of the empty set are -inf
            return self._runs(np.maximum(widths - exact, 0.0))

    @property
    def polygons(self) -> ConvexPolygons:
        """The sets of two states as polygons.

        Their shape is (), or (B,), and (R,) or (B, R) with wrong measurements. In a batch, rows of
        `vertices` after the `counts` of a polygon are NaN.

        Raises
        ------
        ValueError
            If the system has another number of states.
        """
        if not isinstance(self.sets, Polygons):
            instead = ".lower, .upper or .output_hull"
            if isinstance(self.sets, Polytopes):
                instead = ".polytopes"
            raise ValueError(f"the set has {self.states} states, not two: use {instead}")

        counts = self.sets.counts
        used = np.arange(counts.max(initial=0)) < counts[:, None]
        vertices = np.where(used[..., None], self.sets.vertices[:, : used.shape[1]], np.nan)
        polygons = ConvexPolygons.unchecked(self._by_member(vertices), self._by_member(counts))
        return polygons[0] if self.single else polygons

    @property
    def polytopes(self) -> tuple[Polytope, ...]:
        """The set of each run; a tuple of one set for a single run.

        With wrong measurements they are R sets for each run, one run after the other.

        Raises
        ------
        ValueError
            If the system has more than four states: their polytopes are not computed.
        """
        if isinstance(self.sets, Polytopes):
            return tuple(member.polytope for member in self.sets.members)
        if not isinstance(self.sets, Polygons):
            raise ValueError(
                f"sets of {self.states} states have too many facets for a polytope, at most "
                f"{MAX_POLYTOPE_STATES} states are possible: use .lower, .upper or .output_hull"
            )
        return tuple(
            Polytope.from_vertices(points) if len(points) else Polytope.empty(2)
            for points in self._vertices()
        )

    @property
    def lower(self) -> Floats:
        """Minimum value of each state, shape (n,) or (B, n); NaN for the empty set."""
        return self._hull[0]

    @property
    def upper(self) -> Floats:
        """Maximum value of each state, shape (n,) or (B, n); NaN for the empty set."""
        return self._hull[1]

    def chebyshev_centre(self) -> Floats:
        """Return the centre of a largest ball in each set, shape (n,) or (B, n).

        The shape is (R, n) or (B, R, n) with wrong measurements. It is NaN for the empty set.

        Raises
        ------
        ValueError
            If the system has more than four states: their facets are not known.
        """
        return self._runs(self._by_member(self.sets.chebyshev_centres()))

    def output_hull(self, matrix: ArrayLike) -> tuple[Floats, Floats]:
        """Return the minimum and the maximum values of matrix x, each of shape (m,) or (B, m).

        They are NaN for the empty set.

        Raises
        ------
        ValueError
            If the matrix does not have the shape (m, n), m at least 1, or is not finite.
        """
        rows = finite_values("matrix", matrix, "m", self.states)
        below, above = map(self._maximum, self._heights(rows))
        # `below` are maxima of -row . x. A difference from 0.0, because -0.0 would be shown as -0.
        lower = 0.0 - np.where(np.isinf(below), np.nan, below)
        upper = np.where(np.isinf(above), np.nan, above)
        return self._runs(lower), self._runs(upper)

    def to_dict(self) -> dict[str, Any]:
        """Return the step, bounds and, up to four states, vertices as Python numbers and lists.

        The keys are `step`, `is_empty`, `lower`, `upper` and `vertices`. The bounds of the empty
        set are None, and its vertices are an empty list. In a batch all values but the step are
        lists with a member for each run. With wrong measurements, the vertices of a run are a list
        for each set.
        """
        # The bounds of an empty set are NaN.
        lower = np.atleast_2d(self.lower)
        is_empty: Flags = np.asarray(np.isnan(lower).any(axis=1))
        columns: dict[str, list[Any]] = {"is_empty": is_empty.tolist()}
        for name, ends in (("lower", lower), ("upper", np.atleast_2d(self.upper))):
            columns[name] = [
                None if empty else row.tolist() for row, empty in zip(ends, is_empty, strict=True)
            ]
        if not isinstance(self.sets, Windows):
            vertices = [points.tolist() for points in self._vertices()]
            if self.members > 1:
                firsts = range(0, len(vertices), self.members)
                vertices = [vertices[first : first + self.members] for first in firsts]
            columns["vertices"] = vertices
        if self.single:
            return {"step": self.step, **{name: values[0] for name, values in columns.items()}}
        return {"step": self.step, **columns}

    def plot(self, ax: Any = None, states: tuple[int, int] = (0, 1), **style: Any) -> list[Any]:
        """Fill the projections of the sets on the plane of two states; return the artists.

        There is one artist for each set that is not empty. For five and more states the picture is
        a polygon that contains the projection, of 32 sides, with a linear program for each.

        Parameters
        ----------
        ax : matplotlib axes, optional
            Axes; the default are the present ones.
        states : tuple of int
            Numbers of the states along the horizontal and the vertical axis, from 0.
        **style : Any
            Options of matplotlib's `fill`.

        Raises
        ------
        ValueError
            If the states are not two different ones of the system.
        """
        numbers = [number for number in np.ravel(states).tolist() if number in range(self.states)]
        if np.shape(states) != (2,) or len(set(numbers)) != 2:
            raise ValueError(
                f"states must be two different numbers from 0 to {self.states - 1}: got "
                f"{shown(states)}"
            )
        return draw_polygons(ax, self._outlines(numbers), style)

    def _vertices(self) -> list[Floats]:
        """Return the vertices of each set, shape (v, n)."""
        if isinstance(self.sets, Polygons):
            pairs = zip(self.sets.vertices, self.sets.counts, strict=True)
            return [points[:count] for points, count in pairs]
        return [polytope.vertices for polytope in self.polytopes]

    def _outlines(self, numbers: list[int]) -> list[Floats]:
        """Return the polygon of each set in the plane of two states, shape (m, 2)."""
        if isinstance(self.sets, Windows):
            return self._outlines_by_programs(numbers)
        outlines = []
        for points in self._vertices():
            outline = np.zeros((0, 2))
            if len(points):
                outline = ConvexPolygons.from_points(points[:, numbers]).polygon()
            outlines.append(outline)
        return outlines

    def _outlines_by_programs(self, numbers: list[int]) -> list[Floats]:
        """Return polygons around the projections, with sides at equal angles in a square plot."""
        lower, upper = (np.atleast_2d(end)[:, numbers] for end in self._hull)
        # The bounds of an empty set are NaN, and not greater: its width counts as zero.
        widths = np.nanmax(np.where(upper > lower, upper - lower, 0.0), axis=0)
        units = np.where(widths > 0.0, widths, 1.0)
        angles = np.linspace(0.0, 2.0 * np.pi, _OUTLINE_SIDES, endpoint=False)
        normals = np.column_stack([np.cos(angles), np.sin(angles)]) / units

        directions = np.zeros((len(normals), self.states))
        directions[:, numbers] = normals
        heights = np.array([self.sets.support(direction) for direction in directions]).T
        outlines = []
        for limits in heights:
            outline = np.zeros((0, 2))
            if not np.isinf(limits).any():
                outline = ConvexPolygons.from_constraints(normals, limits).polygon()
            outlines.append(outline)
        return outlines

    @cached_property
    def _hull(self) -> tuple[Floats, Floats]:
        """The minimum and the maximum of each state."""
        return self.output_hull(np.eye(self.states))

    def _heights(self, rows: Floats) -> tuple[Floats, Floats]:
        """Return the maxima of -row . x and of row . x of each set, shape (B R, m)."""
        below = np.array([self.sets.support(-row) for row in rows]).T
        above = np.array([self.sets.support(row) for row in rows]).T
        return below, above

    def _by_member(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return an array of all sets, shape (B R, ...), as (B, R, ...); (B, ...) if R is 1."""
        if self.members == 1:
            return values
        runs = len(values) // self.members
        return values.reshape(runs, self.members, *values.shape[1:])

    def _maximum(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return the maximum over the sets of each run, shape (B, ...)."""
        if self.members == 1:
            return values
        return np.asarray(self._by_member(values).max(axis=1))

    def _runs(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return an array with an axis of runs without this axis for a single run."""
        return np.asarray(values[0] if self.single else values)
