"""Members of the set of optimal controls: minimisers of costs, centres, vertices, samples."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.reachability.admissible import (
    Lifted,
    min_l1,
    min_peak,
    min_sum_of_norms,
    quadratic,
)
from infoset.rendezvous.reachability.conic import NoSolutionError
from infoset.rendezvous.reachability.problem import ThrustShape
from infoset.rendezvous.reachability.relative_interior import relative_interior
from infoset.rendezvous.reachability.sets import TooManyVerticesError, combined, optimal_polytope
from infoset.rendezvous.reachability.solve import OptimalControls

MAX_VERTICES = 2000
"""Maximum number of vertices of a set of optimal controls: more would not be read."""
_MAX_NEWTON_STEPS = 200
"""Maximum number of Newton steps to the analytic centre: 20 were enough in published and random
problems."""
_MIN_DECREMENT = 1e-22
"""Square of the Newton decrement at which a point is the analytic centre: its distance from it, in
the norm of the Hessian, is 1e-11."""
_ARMIJO = 1e-4
"""Part of the decrease of the linear model that a step must attain (Armijo's rule). Chosen:
analytic centres of published problems are the same from 2.5e-5 to 0.1 (measured)."""
_ROUNDED_DECREASE = 1e-15
"""Decrease of the barrier, relative to its value, below which it is rounding. Analytic centres of
published problems are the same from 1e-16 to 1e-11 (measured)."""
_STILL = 1e-9
"""Change of a control with v, as a part of its bound, below which the control counts as constant;
the same number as in `admissible`, where its reason stands.
"""
_STEPS_A_DIMENSION = 20
"""Steps of hit-and-run per dimension: with them the mean of 1500 samples is within 3 % of the
centroid of a triangle (test_routes)."""
_INSIDE = 1.0 - 1e-12
"""Part of a chord that is used, so that rounding does not move a point outside."""


@dataclass(frozen=True)
class ControlEffort:
    """Costs of a control, dimensionless.

    `energy` is the sum of the squares of all components, `l1` the sum of their absolute values,
    `norms` the sum of the Euclidean norms of the periods, and `peak` the maximum absolute value.
    """

    energy: float
    l1: float
    norms: float
    peak: float


def effort(controls: Floats) -> ControlEffort:
    """Return the costs of `controls`, shape (T, m)."""
    return ControlEffort(
        float((controls**2).sum()),
        float(np.abs(controls).sum()),
        float(np.linalg.norm(controls, axis=1).sum()),
        float(np.abs(controls).max()),
    )


def minimum_energy(optimal: OptimalControls) -> Floats:
    """Return the `optimal` control of minimum sum of squares, shape (T, m).

    It is unique, and found by a quadratic program.
    """
    return optimal.at(_nearest(optimal.space, optimal.scale))


def minimum_l1(optimal: OptimalControls) -> Floats:
    """Return an `optimal` control of minimum sum of absolute values, shape (T, m).

    It is found by a linear program.
    """
    # A single control needs no program.
    if not optimal.dimension:
        return optimal.at(np.zeros(0))
    return optimal.at(min_l1(optimal.space, optimal.scale))


def minimum_norms(optimal: OptimalControls) -> Floats:
    """Return an `optimal` control of minimum sum of the norms of the periods, shape (T, m).

    The sum is the propellant of a single thruster. The control is found by a cone program.
    """
    # A single control needs no program.
    if not optimal.dimension:
        return optimal.at(np.zeros(0))
    return optimal.at(min_sum_of_norms(optimal.space, optimal.scale, optimal.problem.controls))


def minimum_delta_v(optimal: OptimalControls) -> Floats:
    """Return an `optimal` control of minimum Delta-v, shape (T, m).

    The Delta-v is the sum of absolute values for thrust in a box, where each axis has an engine,
    and the sum of the norms for thrust in a ball, with one engine.
    """
    if optimal.problem.thrust is ThrustShape.BALL:
        return minimum_norms(optimal)
    return minimum_l1(optimal)


def minimum_peak(optimal: OptimalControls) -> Floats:
    """Return the control of minimum energy among the `optimal` controls of minimum peak, (T, m).

    A linear program gives the minimum peak, and a quadratic program the control on the face of the
    set that has this peak. For thrust in a ball the result is a control of minimum peak of the
    norm.
    """
    space = optimal.space
    scale = optimal.scale
    if not space.size:
        return optimal.at(np.zeros(0))

    bound, point = min_peak(space, scale, optimal.problem.controls)
    if space.ball:
        return optimal.at(point)

    # The face |controls| <= bound of the set, in coordinates of its affine hull.
    # A constant control is within the peak already.
    moving = np.linalg.norm(space.control_response, axis=1) > _STILL
    turned = (scale[:, None] * space.control_response)[moving]
    fixed = (scale * space.control_free)[moving]
    rows = np.vstack([space.rows, turned, -turned])
    limits = np.concatenate([space.limits, bound - fixed, bound + fixed])
    face = relative_interior(rows, limits, space.equal, space.levels, point)
    inner = replace(space.within(face.point, face.basis), rows=face.rows, limits=face.limits)

    return optimal.at(face.point + face.basis @ _nearest(inner, scale))


def nearest(optimal: OptimalControls, control: Floats) -> Floats:
    """Return the `optimal` control nearest to a `control`, both of shape (T, m).

    It is found by a quadratic program.
    """
    return optimal.at(_nearest(optimal.space, optimal.scale, control.ravel()))


def chebyshev_centre(optimal: OptimalControls) -> Floats:
    """Return the centre of a largest ball in the set of `optimal` controls, shape (T, m).

    The ball is in the affine hull of the set, for controls divided by their bounds. For thrust in a
    ball it is inside, but may not be the largest.
    """
    return optimal.at(optimal.centre)


def analytic_centre(optimal: OptimalControls) -> Floats:
    """Return the `optimal` control of maximum product of slacks, shape (T, m)."""
    return optimal.at(analytic_point(optimal.space, optimal.centre)[0])


def analytic_point(space: Lifted, start: Floats) -> tuple[Floats, Floats]:
    """Return the analytic centre of a set without equations, and a root of the Hessian there.

    The centre, shape (d,), minimises the barrier - sum log(slack) - sum log(1 - |u(t)|^2), which is
    self-concordant. `start`, shape (d,), is inside the set. The root R, shape (d, d), is upper
    triangular with a positive diagonal; the Hessian of the barrier is R' R.

    Newton's method with halved steps. Raise `NoSolutionError` if it does not converge.
    """
    point = start.copy()
    if not space.size:
        return point, np.zeros((0, 0))
    barrier = _barrier(space, point)
    for _ in range(_MAX_NEWTON_STEPS):
        # The Hessian is factor' factor and the gradient factor' ones. R is computed from the
        # factor, whose condition number is the root of the Hessian's, so that sets 1e-10 thick have
        # a step.
        orthogonal, root = np.linalg.qr(barrier.factor)
        descent = orthogonal.T @ barrier.ones
        step = solve_triangular(root, -descent)
        decrement = float(descent @ descent)
        if decrement < _MIN_DECREMENT:
            return point, _with_positive_diagonal(root)

        rounding = _ROUNDED_DECREASE * max(1.0, abs(barrier.value))
        # Steps are halved until the value decreases enough, or by rounding only.
        length = 1.0
        after = _barrier(space, point + step)
        while (
            not after.value <= barrier.value - _ARMIJO * length * decrement
            and not length * decrement < rounding
        ):
            length *= 0.5
            after = _barrier(space, point + length * step)
        point = point + length * step
        barrier = after
        if length * decrement < rounding:
            _, root = np.linalg.qr(barrier.factor)
            return point, _with_positive_diagonal(root)
    raise NoSolutionError("Newton's method did not reach the analytic centre")


def _with_positive_diagonal(root: Floats) -> Floats:
    signs = np.where(np.diag(root) < 0.0, -1.0, 1.0)
    return np.asarray(signs[:, None] * root)


class _Barrier(NamedTuple):
    """The value of the barrier, infinite outside, and its derivatives.

    The gradient is factor' ones and the Hessian factor' factor, of shapes (d,) and (d, d).
    """

    value: float
    factor: Floats
    ones: Floats


def _barrier(space: Lifted, point: Floats) -> _Barrier:
    """Return the barrier - sum log(slack) - sum log(1 - |u(t)|^2) at a point."""
    size = space.size
    outside = _Barrier(np.inf, np.eye(size), np.zeros(size))
    slack = space.limits - space.rows @ point
    if float(slack.min(initial=np.inf)) <= 0.0:
        return outside
    value = -float(np.log(slack).sum())

    rows = space.rows / slack[:, None]
    if not space.ball:
        return _Barrier(value, rows, np.ones(len(rows)))

    turned = space.control_response.reshape(-1, space.ball, size)
    thrust = space.controls(point).reshape(-1, space.ball)
    moving = np.linalg.norm(turned, axis=(1, 2)) > _STILL
    # A thrust that does not depend on z would add a constant.
    turned = turned[moving]
    thrust = thrust[moving]
    left = 1.0 - (thrust**2).sum(axis=1)
    if float(left.min(initial=np.inf)) <= 0.0:
        return outside
    value -= float(np.log(left).sum())

    pull = 2.0 * np.einsum("tmd,tm->td", turned, thrust) / left[:, None]
    # The second derivative of |u(t)|^2 enters the Hessian only.
    curved = (np.sqrt(2.0 / left)[:, None, None] * turned).reshape(-1, size)
    ones = np.ones(len(rows) + len(pull) + len(curved))
    ones[len(rows) + len(pull) :] = 0.0
    return _Barrier(value, np.vstack([rows, pull, curved]), ones)


def vertices(optimal: OptimalControls, most: int = MAX_VERTICES) -> Floats:
    """Return all vertices of the set of `optimal` controls, shape (v, T, m).

    Raises
    ------
    TooManyVerticesError
        If there are more than `most`, if the set has too many dimensions, or if thrust is in a
        ball.
    ThinSetError
        If the set is so thin that rounding leaves nothing of it.
    """
    corners = []
    for part in optimal.blocks:
        is_unique = part.optimal.size == 0
        corners.append(np.zeros((1, 0)) if is_unique else optimal_polytope(part).vertices)

    count = int(np.prod([len(block) for block in corners]))
    if count > most:
        raise TooManyVerticesError(
            f"the optimal controls have {count} vertices, more than the limit of {most}"
        )
    return optimal.at(combined(corners))


def samples(optimal: OptimalControls, count: int, generator: np.random.Generator) -> Floats:
    """Draw `count` >= 1 random members of the set of `optimal` controls, shape (count, T, m).

    Hit-and-run: each sample is the end of a chain of 20 d steps from the analytic centre. The
    `generator` draws directions, which are scaled by the Hessian of the barrier, and places on the
    chords. The distribution is uniform in the limit. O(count r d) per step.
    """
    space = optimal.space
    start, root = analytic_point(space, optimal.centre)
    points = np.repeat(start[None, :], count, axis=0)
    if not space.size:
        return optimal.at(points)

    # From the coordinates root z, in which the set is about as wide in all directions.
    to_set = solve_triangular(root, np.eye(space.size))
    for _ in range(_STEPS_A_DIMENSION * space.size):
        directions = generator.standard_normal(points.shape) @ to_set.T
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        backward, forward = _chord(space, points, directions)
        along = backward + (forward - backward) * generator.random(count)
        points = points + (_INSIDE * along)[:, None] * directions
    return optimal.at(points)


def _chord(space: Lifted, points: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """Distances from points inside the set to its boundary, backward (negative) and forward.

    `points` and unit `directions` have shape (count, d).
    """
    slack = space.limits - points @ space.rows.T
    speed = directions @ space.rows.T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = slack / speed
    forward = np.where(speed > 0.0, reach, np.inf).min(axis=1, initial=np.inf)
    backward = np.where(speed < 0.0, reach, -np.inf).max(axis=1, initial=-np.inf)

    if space.ball:
        # The roots of |thrust + distance change|^2 = 1, a d^2 + 2 b d + c = 0.
        shape = (len(points), -1, space.ball)
        thrust = (space.control_free + points @ space.control_response.T).reshape(shape)
        change = (directions @ space.control_response.T).reshape(shape)
        a = (change**2).sum(axis=2)
        b = (thrust * change).sum(axis=2)
        c = (thrust**2).sum(axis=2) - 1.0
        # A thrust that does not move along the chord bounds it nowhere.
        moving = a > _STILL**2
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        divisor = np.where(moving, a, 1.0)
        after = np.where(moving, (root - b) / divisor, np.inf)
        before = np.where(moving, (-root - b) / divisor, -np.inf)
        forward = np.minimum(forward, after.min(axis=1))
        backward = np.maximum(backward, before.max(axis=1))
    # Points on the boundary may be outside by rounding.
    return np.minimum(backward, 0.0), np.maximum(forward, 0.0)


def _nearest(space: Lifted, scale: Floats, control: Floats | float = 0.0) -> Floats:
    """The point whose controls, in units `scale`, are nearest to a control, shape (T m,)."""
    turned = scale[:, None] * space.control_response
    return quadratic(space, turned.T @ turned, turned.T @ (scale * space.control_free - control))
