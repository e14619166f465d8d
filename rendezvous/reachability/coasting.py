"""Sets of states of motion without control, at all times, after impulses with bounded errors.

The bounds between instants, and of the remainder of gravity, are those of the sections "If the
engines fail" and "Nonlinear motion" of `docs/guaranteed-rendezvous.md`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.reachability.independent_parts import ProblemPart
from infoset.rendezvous.reachability.motion import IMPULSE
from infoset.rendezvous.reachability.outputs import AffinePlan, ErrorSet
from infoset.rendezvous.relative_motion import EllipticOrbit, TschaunerHempel
from infoset.rendezvous.relative_motion.linear_motion import HeldSegment

_MAX_RADIUS_ROUNDS = 60
"""Maximum number of assumed distances: they grow by 2 % at least, thus by a factor of three."""
RADIUS_RESERVE = 1.02
"""Ratio of the next assumed distance to the one that was found last: it is above 1 because the
acceleration of gravity, and so the plan and its distances, change with it. Chosen."""
_STARTS_AND_ENDS = (slice(None, -1), slice(1, None))
"""The starts and the ends of the N intervals, among the N + 1 times of a coast."""


class UnboundedCoastError(ArithmeticError):
    """No bound of the distance was proved for nonlinear motion."""


@dataclass(frozen=True, eq=False)
class Coasting:
    """Motion without control for some periods from just after the impulses u(0), u(1), ...

    States are in m and m/s in Hill's axes about the `orbit`, and controls are impulses in m/s at
    the starts of the periods.

    Parameters
    ----------
    orbit : EllipticOrbit
        The reference orbit; t = 0 is the start of the first period.
    period_s : float
        Length of a period.
    impulses : int
        Number of impulses K; a coast begins after each of u(0), ..., u(K - 1).
    periods : int
        Number of periods of each coast.
    instants : int
        Number of equal intervals into which a period is divided.
    acceleration_m_s2 : float
        Bound of the magnitude of an unknown acceleration, any function of time.
    semi_major_axis_m : float or None
        Of the reference orbit. If given, the motion is nonlinear: that about a central body.
    """

    orbit: EllipticOrbit
    period_s: float
    impulses: int
    periods: int
    instants: int = 4
    acceleration_m_s2: float = 0.0
    semi_major_axis_m: float | None = None

    @property
    def interval_s(self) -> float:
        """Length of an interval."""
        return self.period_s / self.instants

    @cached_property
    def starts_s(self) -> Floats:
        """The starts of the N intervals of each coast, shape (K, N)."""
        first = self.period_s * np.arange(self.impulses)
        return np.asarray(
            first[:, None] + self.interval_s * np.arange(self.periods * self.instants)
        )

    @cached_property
    def segments(self) -> HeldSegment:
        """The motion in each interval."""
        return TschaunerHempel(self.orbit).segment(self.starts_s, self.starts_s + self.interval_s)

    @cached_property
    def transitions(self) -> Floats:
        """Phi from the start of each coast to the ends of its intervals, (K, N + 1, 6, 6)."""
        steps = self.segments.transition
        matrices = [np.broadcast_to(np.eye(6), (self.impulses, 6, 6))]
        for i in range(steps.shape[1]):
            matrices.append(steps[:, i] @ matrices[i])
        return np.stack(matrices, axis=1)

    @cached_property
    def nearness(self) -> Floats:
        """Upper bounds of (1 + e cos f) in each interval, shape (K, N): p over the radius."""
        begin = self.orbit.true_anomaly(self.starts_s)
        end = self.orbit.true_anomaly(self.starts_s + self.interval_s)
        highest = np.maximum(np.cos(begin), np.cos(end))
        turn = 2.0 * np.pi
        # The anomaly increases without bound: a periapsis is where a number of turns is whole.
        passes_periapsis = np.floor(begin / turn) != np.floor(end / turn)
        highest[passes_periapsis] = 1.0
        return np.asarray(1.0 + self.orbit.eccentricity * highest)

    @cached_property
    def rates(self) -> Floats:
        """Upper bounds of the magnitudes of the last rows of A(t), shape (K, N, 3, 6)."""
        e = self.orbit.eccentricity
        k2 = self.orbit.semi_latus_rate_rad_s
        w = k2 * self.nearness**2
        gravity = k2**2 * self.nearness**3
        bounds = np.zeros((*w.shape, 3, 6))
        bounds[..., 0, 0] = w**2 + 2.0 * gravity
        # w^2 - gravity = gravity e cos f, and the rate of w is -2 gravity e sin f.
        bounds[..., 1, 1] = gravity * e
        bounds[..., 2, 2] = gravity
        bounds[..., 0, 1] = bounds[..., 1, 0] = 2.0 * gravity * e
        bounds[..., 0, 4] = bounds[..., 1, 3] = 2.0 * w
        return bounds

    def remainder(self, radii: Floats) -> Floats:
        """Return the bound of Theorem 7 at most `radii`, shape (K, N), from the origin, m/s^2.

        It is infinite where the centre of gravity may be reached.
        """
        assert self.semi_major_axis_m is not None
        parameter = self.semi_major_axis_m * (1.0 - self.orbit.eccentricity**2)
        gravity = self.orbit.semi_latus_rate_rad_s**2 * parameter**3
        depth = parameter / self.nearness - radii
        bounds = np.full(radii.shape, np.inf)
        np.divide(3.0 * gravity * radii**2, depth**4, out=bounds, where=depth > 0.0)
        return bounds

    def tube(self, plan: AffinePlan, part: ProblemPart | None = None) -> CoastTube:
        """Return the certain bounds of all coasts under a `plan`, with its errors.

        The plan may be that of an independent `part`; the other states are then zero. The
        equations of the plane of the orbit and of its normal are apart, also in all bounds.

        Raises
        ------
        ValueError
            If the motion is nonlinear, and the intervals are too long for a bound between their
            ends; for linear motion `CoastTube.sagittas` raises it.
        UnboundedCoastError
            If nonlinear motion is not proved to stay within any distance.
        """
        # Accelerations are bounded alike in all intervals, before the remainder is added.
        known = np.full(self.starts_s.shape, self.acceleration_m_s2)
        tube = self.tube_under(plan, known, part)
        if self.semi_major_axis_m is None:
            return tube

        assumed = RADIUS_RESERVE * tube.radii
        for _ in range(_MAX_RADIUS_ROUNDS):
            accelerations = known + self.remainder(assumed)
            if not np.isfinite(accelerations).all():
                break
            tube = self.tube_under(plan, accelerations, part)
            # A bound that is smaller than the assumed one excludes a first exit.
            if (tube.radii < assumed).all():
                return tube
            assumed = RADIUS_RESERVE * np.maximum(assumed, tube.radii)
        raise UnboundedCoastError(
            "nonlinear motion without control is not proved to stay near the target; reduce the "
            "errors or the number of periods without control"
        )

    def tube_under(
        self, plan: AffinePlan, accelerations: Floats, part: ProblemPart | None = None
    ) -> CoastTube:
        """Return the bounds of all coasts with accelerations of at most these, shape (K, N).

        The `part` is that of `tube`.
        """
        problem = plan.problem
        count = self.impulses
        to_states = np.eye(6) if part is None else np.eye(6)[:, part.states]
        to_controls = np.eye(3) if part is None else np.eye(3)[:, part.controls]
        impulse = IMPULSE @ to_controls
        middles = plan.nominal_states[:count] @ to_states.T + plan.nominal[:count] @ impulse.T
        known = to_states @ plan.state_columns[:count] + impulse @ plan.control_columns[:count]
        execution = IMPULSE * (problem.execution[:count] @ to_controls.T)[:, None, :]
        columns = np.concatenate([known, execution], axis=2)

        # By the inequality of Cauchy and Schwarz, an acceleration of at most M(t) has an effect
        # along a of at most the root of int M dt times a . (int M Phi B B' Phi' dt) a.
        integrals = np.zeros((count, 1))
        shapes = np.zeros((count, 1, 6, 6))
        steps = self.segments
        for i in range(accelerations.shape[1]):
            moved = steps.transition[:, i] @ shapes[:, i] @ steps.transition[:, i].mT
            moved += accelerations[:, i, None, None] * steps.gramian[:, i]
            shapes = np.concatenate([shapes, moved[:, None]], axis=1)
            total = integrals[:, i] + accelerations[:, i] * self.interval_s
            integrals = np.concatenate([integrals, total[:, None]], axis=1)
        return CoastTube(
            self,
            # Three execution errors of the last impulse come after the errors of the problem.
            problem.errors._replace(size=problem.errors.size + 3),
            np.einsum("kinm,km->kin", self.transitions, middles),
            self.transitions @ columns[:, None],
            integrals[..., None, None] * shapes,
            accelerations,
        )


class DirectionRanges(NamedTuple):
    """Minimum and maximum of d . position, m."""

    lower: Floats
    upper: Floats


@dataclass(frozen=True, eq=False)
class CoastTube:
    """Sets of the states of K coasts at the N + 1 ends of their intervals.

    A state is middle + columns z + an effect of accelerations, z in `errors`; the effect is in an
    ellipsoid, whose extent along a is the square root of a . shape a.

    Parameters
    ----------
    coasting : Coasting
        The motion.
    errors : ErrorSet
        Errors of the problem, then the execution errors of the last impulse.
    middles : ndarray, shape (K, N + 1, 6)
        States without errors, in m and m/s.
    columns : ndarray, shape (K, N + 1, 6, size)
        Effects of the errors.
    shapes : ndarray, shape (K, N + 1, 6, 6)
        Matrices of the ellipsoids.
    accelerations : ndarray, shape (K, N)
        The bounds of the accelerations that the ellipsoids are for, m/s^2.
    """

    coasting: Coasting
    errors: ErrorSet
    middles: Floats
    columns: Floats
    shapes: Floats
    accelerations: Floats

    @cached_property
    def largest(self) -> Floats:
        """The largest magnitudes of the states at the ends, m and m/s, shape (K, N + 1, 6)."""
        above = self.middles + self.errors.maxima(self.columns)
        below = self.errors.maxima(-self.columns) - self.middles
        extents = np.sqrt(np.maximum(np.einsum("kinn->kin", self.shapes), 0.0))
        return np.asarray(np.maximum(above, below) + extents)

    @cached_property
    def sagittas(self) -> Floats:
        """Bounds of the distance of the path from its chord in each interval, m, shape (K, N).

        Raises
        ------
        ValueError
            If the intervals are too long for a bound.
        """
        coasting = self.coasting
        h = coasting.interval_s
        blocks = coasting.rates.reshape(*self.accelerations.shape, 3, 2, 3)
        norms = np.linalg.norm(blocks, ord=2, axis=(2, 4))
        # If M is the largest acceleration, positions and velocities exceed the larger end by at
        # most M h^2 / 8 and M h / 2: M is at most its bound for the ends plus (1 - share) M.
        share = 1.0 - norms[..., 0] * h**2 / 8.0 - norms[..., 1] * h / 2.0
        if not (share > 0.0).all():
            raise ValueError(
                f"intervals of {h:g} s are too long to bound the motion between their ends; divide "
                "the periods into more instants"
            )
        states = np.maximum(self.largest[:, :-1], self.largest[:, 1:])
        at_ends = np.linalg.norm(np.einsum("kian,kin->kia", coasting.rates, states), axis=2)
        return np.asarray(h**2 / 8.0 * (at_ends + self.accelerations) / share)

    @cached_property
    def radii(self) -> Floats:
        """Bounds of the distance from the origin in each interval, m, shape (K, N)."""
        at_ends = np.linalg.norm(self.largest[..., :3], axis=2)
        return np.asarray(np.maximum(at_ends[:, :-1], at_ends[:, 1:]) + self.sagittas)

    def maxima(self, normals: Floats) -> Floats:
        """Return the maxima of normals . state at the ends of the intervals, (K, N + 1, k).

        `normals` have the shape (k, 6).
        """
        along = np.einsum("rn,kinz->kirz", normals, self.columns)
        return np.asarray(
            self.middles @ normals.T + self.errors.maxima(along) + self._pushes(normals)
        )

    def uncontrolled(self, normals: Floats) -> Floats:
        """Return the parts of `maxima` of execution errors and accelerations, (K, N + 1, k).

        `normals` are those of `maxima`.
        """
        execution = self.columns[..., self.errors.size - 3 :]
        along = np.einsum("rn,kine->kire", normals, execution)
        return np.asarray(np.abs(along).sum(axis=-1) + self._pushes(normals))

    def _pushes(self, normals: Floats) -> Floats:
        """Return the extents of the ellipsoids along `normals`, shape (K, N + 1, k)."""
        squares = np.einsum("rn,kinm,rm->kir", normals, self.shapes, normals)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)))

    def overshoots(self, normals: Floats) -> Floats:
        """Return by how much normals . state may exceed both ends of an interval, (K, N, k).

        With an acceleration of at most M the position exceeds its chord by M h^2 / 8, and the
        velocity exceeds both ends by M h / 2. `normals` have the shape (k, 6).
        """
        position = np.linalg.norm(normals[:, :3], axis=1)
        velocity = np.linalg.norm(normals[:, 3:], axis=1)
        # M h / 2 = (4 / h) (M h^2 / 8).
        per_sagitta = position + 4.0 / self.coasting.interval_s * velocity
        return np.asarray(self.sagittas[..., None] * per_sagitta)

    def extents(self, directions: Floats) -> Floats:
        """Return the extents of execution errors and accelerations, m, shape (K, N, 2).

        They are along the `directions`, shape (K, N, 3), at both ends of each interval.
        """
        execution = self.columns[:, :, :3, self.errors.size - 3 :]
        ends = []
        for end in _STARTS_AND_ENDS:
            along = np.einsum("kia,kiae->kie", directions, execution[:, end])
            shapes = self.shapes[:, end, :3, :3]
            squares = np.einsum("kia,kiab,kib->ki", directions, shapes, directions)
            ends.append(np.abs(along).sum(axis=2) + np.sqrt(np.maximum(squares, 0.0)))
        return np.stack(ends, axis=2)

    def certain_distances(self, directions: Floats) -> Floats:
        """Return a lower bound of directions . position in each interval, m, shape (K, N).

        The `directions`, shape (K, N, 3), are unit vectors: it is then a bound of the distance too.
        """
        lowest = np.full(directions.shape[:2], np.inf)
        for end in _STARTS_AND_ENDS:
            middle = np.einsum("kia,kia->ki", directions, self.middles[:, end, :3])
            along = np.einsum("kia,kiaz->kiz", directions, self.columns[:, end, :3])
            shapes = self.shapes[:, end, :3, :3]
            squares = np.einsum("kia,kiab,kib->ki", directions, shapes, directions)
            extent = self.errors.maxima(-along) + np.sqrt(np.maximum(squares, 0.0))
            lowest = np.minimum(lowest, middle - extent)
        return np.asarray(lowest - self.sagittas)

    def nearest(self, directions: Floats) -> Floats:
        """Return the positions with the least directions . position, m, shape (K, N, 3).

        They are points of the sets at the ends of each interval.
        """
        points = []
        heights = []
        for end in _STARTS_AND_ENDS:
            columns = self.columns[:, end, :3]
            worst = farthest(self.errors, -np.einsum("kia,kiaz->kiz", directions, columns))
            shapes = self.shapes[:, end, :3, :3]
            pushed = np.einsum("kiab,kib->kia", shapes, directions)
            squares = np.einsum("kia,kia->ki", directions, pushed)
            # The smallest double keeps the quotient zero where nothing pushes.
            sizes = np.sqrt(np.maximum(squares, np.finfo(float).tiny))[..., None]
            point = self.middles[:, end, :3] + np.einsum("kiaz,kiz->kia", columns, worst)
            point = point - pushed / sizes
            points.append(point)
            heights.append(np.einsum("kia,kia->ki", directions, point))
        is_first = (heights[0] <= heights[1])[..., None]
        return np.asarray(np.where(is_first, points[0], points[1]))


def farthest(errors: ErrorSet, rows: Floats) -> Floats:
    """Return errors z, shape (..., size), that attain the maxima of rows . z."""
    result = np.where(rows < 0.0, -1.0, 1.0)
    if errors.vertices is not None:
        along = rows[..., : errors.start_size] @ errors.vertices.T
        result[..., : errors.start_size] = errors.vertices[along.argmax(axis=-1)]
    return result
