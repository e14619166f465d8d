"""Solution in closed form: costs as quadratic forms of the free terminal values, and flights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pareto.encounter import Craft, Encounter


@dataclass(frozen=True, eq=False)
class Plan:
    """The minimum-energy flight of one craft from its start to the meeting.

    `costate`, shape (6,), is the costate at the meeting.
    """

    craft: Craft
    meeting_s: float
    costate: Floats

    def control(self, time_s: ArrayLike) -> Floats:
        """Return u(t) = B' Phi(T, t)' lambda, m/s^2, shape (..., 3): (2.1) of the paper."""
        return self._costate_at(np.asarray(time_s, dtype=np.float64))[..., 3:]

    def state(self, time_s: ArrayLike) -> Floats:
        """Return x(t) = Phi x0 + G(t, t0) Phi(T, t)' lambda, m and m/s, shape (..., 6).

        This is (2.5) of the paper.
        """
        times = np.asarray(time_s, dtype=np.float64)
        segment = self.craft.motion.segment(np.full(times.shape, self.craft.start_s), times)
        forced = np.einsum("...ab,...b->...a", segment.gramian, self._costate_at(times))
        return np.asarray(segment.transition @ self.craft.state + forced)

    def times(self, count: int) -> Floats:
        """Return `count` >= 2 equally spaced times, s, both ends included."""
        return np.linspace(self.craft.start_s, self.meeting_s, count)

    def effects(self, time_s: Floats) -> Floats:
        """Return Phi(T, t) B(t), shape (k, 6, 3).

        It is the effect of a unit control for a second on the terminal state.
        """
        return self._to_meeting(time_s)[:, :, 3:]

    def breaks(self) -> Floats:
        """Return times, s, between which the motion turns by at most about a radian."""
        return self.craft.motion.breaks(self.craft.start_s, self.meeting_s)

    def _costate_at(self, times: Floats) -> Floats:
        return np.asarray(np.einsum("...ba,b->...a", self._to_meeting(times), self.costate))

    def _to_meeting(self, times: Floats) -> Floats:
        """Phi(T, t), shape (..., 6, 6)."""
        return self.craft.motion.transition(times, np.full(times.shape, self.meeting_s))


@dataclass(frozen=True, eq=False)
class CraftCost:
    """J^2(p) = J*^2 + (p - p*)' M (p - p*) of one craft.

    Parameters
    ----------
    ideal : ndarray, shape (f,)
        p*: the cheapest free values for this craft alone.
    ideal_cost_squared : float
        J*^2, m^2/s^3.
    root : ndarray, shape (f, f)
        R, upper triangular, M = R' R; m/s^1.5 over the units of p.
    effort_base, effort_slope : ndarray, shapes (c,) and (c, f)
        The scaled effort y(p) = base + slope p, |y|^2 = J^2, for c common components (6, or 3 in an
        intercept).
    to_costate : ndarray, shape (6, c)
        From y to the costate at the meeting.
    """

    craft: Craft
    ideal: Floats
    ideal_cost_squared: float
    root: Floats
    effort_base: Floats
    effort_slope: Floats
    to_costate: Floats

    @property
    def matrix(self) -> Floats:
        """M, shape (f, f)."""
        return np.asarray(self.root.T @ self.root)

    def excess(self, point: Floats) -> Floats:
        """J^2 - J*^2, m^2/s^3, at a `point`, shape (..., f): shape (...)."""
        return np.asarray((((point - self.ideal) @ self.root.T) ** 2).sum(axis=-1))


@dataclass(frozen=True, eq=False)
class EncounterSolution:
    """A solved encounter: the meeting of minimum group loss, and the costs of any other meeting.

    `point`, shape (f,), contains the free values that minimise the weighted sum of excesses, the
    norm (1.7) of the paper. The methods use it where their `point` is None.
    """

    encounter: Encounter
    costs: tuple[CraftCost, ...]
    point: Floats

    @property
    def ideals(self) -> Floats:
        """p* of the craft, shape (n, f)."""
        return np.array([cost.ideal for cost in self.costs])

    @property
    def same_matrix(self) -> bool:
        """Whether all craft have one M, up to rounding, and not only up to a factor.

        Then the Pareto set is the convex hull of the ideals. Rounding is below 1e-12 of a number.
        """
        first = self.costs[0].matrix
        return all(np.allclose(cost.matrix, first, rtol=1e-12, atol=0.0) for cost in self.costs[1:])

    def meeting_state(self, point: Floats | None = None) -> Floats:
        """Return the terminal state, shape (6,), of a `point`, shape (f,).

        Only the position is common to all craft at an intercept.
        """
        return np.asarray(
            self.encounter.base + self.encounter.opening @ (self.point if point is None else point)
        )

    def excess(self, point: Floats | None = None) -> Floats:
        """Return J_i^2 - J_i*^2 of all craft, m^2/s^3, shape (..., n), at a `point` (..., f)."""
        point = self.point if point is None else point
        return np.stack([cost.excess(point) for cost in self.costs], axis=-1)

    def cost_squared(self, point: Floats | None = None) -> Floats:
        """Return J_i^2 of all craft, m^2/s^3, shape (..., n), at a `point`, shape (..., f)."""
        return np.asarray(
            self.excess(point) + np.array([cost.ideal_cost_squared for cost in self.costs])
        )

    def group_loss(self, point: Floats | None = None) -> Floats:
        """Return the norm (1.7), m^2/s^3, shape (...), at a `point`, shape (..., f).

        It is the weighted sum of the excesses.
        """
        return np.asarray(self.excess(point) @ self.encounter.weights)

    def plan(self, index: int, point: Floats | None = None) -> Plan:
        """Return the flight of craft number `index` to a `point`, shape (f,)."""
        cost = self.costs[index]
        costate = cost.to_costate @ (
            cost.effort_base + cost.effort_slope @ (self.point if point is None else point)
        )
        return Plan(cost.craft, self.encounter.meeting_s, costate)

    def plans(self, point: Floats | None = None) -> tuple[Plan, ...]:
        """Return the flights of all craft to a `point`, shape (f,)."""
        return tuple(self.plan(index, point) for index in range(len(self.costs)))


def solve_encounter(encounter: Encounter) -> EncounterSolution:
    """Solve an `encounter`.

    (2.1) to (2.7) of Barseghyan and Stepanyan (2008) for any free components. States are divided by
    (T, T, T, 1, 1, 1) before the Cholesky factor of the Gramian is computed, and the ideal is a
    least-squares problem of that factor, so J* loses no digits. O(n) small matrices.

    Raises
    ------
    ValueError
        If the numbers overflow, or a Gramian is singular: the craft's control does not reach all
        components.
    """
    common = encounter.common
    opening = encounter.opening
    base = encounter.base
    factors: dict[tuple[int, float], tuple[Floats, Floats]] = {}
    costs = []
    for craft in encounter.craft:
        key = (id(craft.motion), craft.start_s)
        if key not in factors:
            factors[key] = _factor(craft, encounter.meeting_s, common)
        transition, whiten = factors[key]
        missing = (base - transition @ craft.state)[:common]
        costs.append(_craft_cost(craft, whiten, missing, opening[:common]))
    return EncounterSolution(encounter, tuple(costs), weighted_point(costs, encounter.weights))


def weighted_point(costs: Sequence[CraftCost], weights: ArrayLike) -> Floats:
    """Return the free values, shape (f,), that minimise the weighted sum of excesses.

    The `weights`, shape (n,), are not negative, and not all zero. The values are (sum w_i M_i)^-1
    sum w_i M_i p_i*, as a least-squares problem of the roots of M_i of the `costs`.
    """
    roots = np.sqrt(np.asarray(weights, dtype=np.float64))
    rows = np.concatenate([root * cost.root for root, cost in zip(roots, costs, strict=True)])
    right = np.concatenate(
        [root * (cost.root @ cost.ideal) for root, cost in zip(roots, costs, strict=True)]
    )
    orthogonal, upper = np.linalg.qr(rows)
    return np.asarray(np.linalg.solve(upper, orthogonal.T @ right))


def _factor(craft: Craft, meeting_s: float, common: int) -> tuple[Floats, Floats]:
    """Return Phi, and L^-1 S^-1, the map from the missing state to the scaled effort."""
    segment = craft.motion.segment(craft.start_s, meeting_s)
    scale = np.ones(common)
    scale[:3] = meeting_s - craft.start_s
    scaled = segment.gramian[:common, :common] / np.outer(scale, scale)
    if not (np.isfinite(scaled).all() and np.isfinite(segment.transition).all()):
        raise ValueError(
            f"craft {craft.name!r}: the motion overflows over {meeting_s - craft.start_s:g} s; "
            "check the units"
        )
    try:
        lower = np.linalg.cholesky(scaled)
    except np.linalg.LinAlgError:
        raise ValueError(
            f"craft {craft.name!r}: its Gramian over {meeting_s - craft.start_s:g} s is singular; "
            "check duration, rate"
        ) from None
    whiten = np.linalg.solve(lower, np.diag(1.0 / scale))
    return segment.transition, np.asarray(whiten)


def _craft_cost(craft: Craft, whiten: Floats, missing: Floats, opening: Floats) -> CraftCost:
    """Return the cost |base + slope p|^2 of a craft for free values p.

    `missing` is the state that lacks at p = 0, and `opening` how it changes with p.
    """
    base = whiten @ missing
    slope = whiten @ opening
    orthogonal, upper = np.linalg.qr(slope)
    ideal = -np.linalg.solve(upper, orthogonal.T @ base)
    # Orthogonal to the slope: base + slope p* would cancel if the ideal is far away. If all
    # components that are in common are free there is no rest.
    rest = np.zeros(0)
    if len(base) > slope.shape[1]:
        rest = base - orthogonal @ (orthogonal.T @ base)
    to_costate = np.zeros((6, len(base)))
    to_costate[: len(base)] = whiten.T
    if not np.isfinite(ideal).all():
        raise ValueError(f"craft {craft.name!r}: the numbers overflow; check the units")
    return CraftCost(craft, ideal, float(rest @ rest), upper, base, slope, to_costate)
