"""Members of the set of optimal controls: those that minimise a cost, centres, vertices and random
ones.
"""

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
from infoset.rendezvous.reachability.relative_interior import relative_interior
from infoset.rendezvous.reachability.sets import TooManyVerticesError, combined, optimal_polytope
from infoset.rendezvous.reachability.solve import OptimalControls

MAX_VERTICES = 2000
_NEWTON_STEPS = 200
_STILL = 1e-9
_STEPS_A_DIMENSION = 20
_INSIDE = 1.0 - 1e-12


@dataclass(frozen=True)
class ControlEffort:
    """Costs of a control, dimensionless.

    `energy` is the sum of squares of all components, `l1` that of their absolute values, `norms`
    that of the Euclidean norms over the periods, and `peak` the maximum absolute value.
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
    """Return the `optimal` control of minimum sum of squares, shape (T, m), which is unique, by a
    quadratic program.
    """
    return optimal.at(_nearest(optimal.space, optimal.scale))


def minimum_l1(optimal: OptimalControls) -> Floats:
    """Return an `optimal` control of minimum sum of absolute values, shape (T, m), by a linear
    program.
    """
    return optimal.at(min_l1(optimal.space, optimal.scale) if optimal.dimension else np.zeros(0))


def minimum_norms(optimal: OptimalControls) -> Floats:
    """Return an `optimal` control of minimum sum, over periods, of Euclidean norms, shape (T, m),
    by a cone program.

    The sum is the propellant of a single thruster.
    """
    if not optimal.dimension:
        return optimal.at(np.zeros(0))
    return optimal.at(min_sum_of_norms(optimal.space, optimal.scale, optimal.problem.controls))


def minimum_peak(optimal: OptimalControls) -> Floats:
    """Return, of the `optimal` controls of minimax component, the one of minimum energy, shape (T,
    m).

    For thrust in a ball it is a control of minimax norm. A linear program gives the bound, and a
    quadratic one the control on the face of the set that keeps the bound.
    """
    space = optimal.space
    scale = optimal.scale
    if not space.size:
        return optimal.at(np.zeros(0))
    bound, point = min_peak(space, scale, optimal.problem.controls)
    if space.ball:
        return optimal.at(point)
    moving = np.linalg.norm(space.control_response, axis=1) > _STILL
    turned = (scale[:, None] * space.control_response)[moving]
    fixed = (scale * space.control_free)[moving]
    rows = np.vstack([space.rows, turned, -turned])
    limits = np.concatenate([space.limits, bound - fixed, bound + fixed])
    face = relative_interior(rows, limits, space.equal, space.levels, point)
    inner = replace(space.within(face.point, face.basis), rows=face.rows, limits=face.limits)
    return optimal.at(face.point + face.basis @ _nearest(inner, scale))


def nearest(optimal: OptimalControls, control: Floats) -> Floats:
    """Return the `optimal` control nearest to a `control`, both of shape (T, m), by a quadratic
    program.
    """
    return optimal.at(_nearest(optimal.space, optimal.scale, control.ravel()))


def chebyshev_centre(optimal: OptimalControls) -> Floats:
    """Return a centre of a largest ball, within the affine hull, of `optimal` controls, shape (T,
    m).

    Controls are compared after division by their bounds. For thrust in a ball the ball is inside,
    but may not be the largest.
    """
    return optimal.at(optimal.centre)


def analytic_centre(optimal: OptimalControls) -> Floats:
    """Return the `optimal` control of maximum product of slacks, shape (T, m)."""
    return optimal.at(analytic_point(optimal.space, optimal.centre)[0])


def analytic_point(space: Lifted, start: Floats) -> tuple[Floats, Floats]:
    """Return the analytic centre, shape (d,), of a set without equations, and a root of its
    barrier's Hessian there.

    `start`, shape (d,), is inside. The root R, shape (d, d), is upper triangular with a positive
    diagonal; the Hessian is R' R. Newton's method with halved steps on - sum log(slack) - sum log(1
    - |u(t)|^2), which is self-concordant. Raise `NoSolutionError` if Newton's method does not
    converge.
    """
    point = start.copy()
    if not space.size:
        return point, np.zeros((0, 0))
    barrier = _barrier(space, point)
    for _ in range(_NEWTON_STEPS):
        # The Hessian is factor' factor and the gradient factor' ones: R comes from the factor
        # itself, whose condition is the root of the Hessian's, so that a set 1e-10 thick has a
        # Newton step.
        orthogonal, root = np.linalg.qr(barrier.factor)
        descent = orthogonal.T @ barrier.ones
        step = solve_triangular(root, -descent)
        decrement = float(descent @ descent)
        if decrement < 1e-22:
            break
        length = 1.0
        while True:
            after = _barrier(space, point + length * step)
            is_lower = after.value <= barrier.value - 1e-4 * length * decrement
            if is_lower or length * decrement < 1e-15 * max(1.0, abs(barrier.value)):
                break
            length *= 0.5
        point = point + length * step
        is_last = length * decrement < 1e-15 * max(1.0, abs(barrier.value))
        barrier = after
        if is_last:
            _, root = np.linalg.qr(barrier.factor)
            break
    else:
        raise NoSolutionError("Newton's method did not reach the analytic centre")
    signs = np.where(np.diag(root) < 0.0, -1.0, 1.0)
    return point, signs[:, None] * root


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
    turned = turned[moving]
    thrust = thrust[moving]
    left = 1.0 - (thrust**2).sum(axis=1)
    if float(left.min(initial=np.inf)) <= 0.0:
        return outside
    value -= float(np.log(left).sum())
    pull = 2.0 * np.einsum("tmd,tm->td", turned, thrust) / left[:, None]
    # The second derivative of |u(t)|^2 enters the Hessian only.
    curved = np.sqrt(2.0 / left)[:, None, None] * turned
    curved = curved.reshape(-1, size)
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
    corners = [
        optimal_polytope(part).vertices if part.optimal.size else np.zeros((1, 0))
        for part in optimal.blocks
    ]
    count = int(np.prod([len(block) for block in corners]))
    if count > most:
        raise TooManyVerticesError(
            f"the optimal controls have {count} vertices, more than the limit of {most}"
        )
    return optimal.at(combined(corners))


def samples(optimal: OptimalControls, count: int, generator: np.random.Generator) -> Floats:
    """Draw `count` random members, at least 1, of the set of `optimal` controls, shape (count, T,
    m).

    Hit-and-run: for each sample a chain of 20 d steps from the analytic centre; the `generator`
    draws directions, which are scaled by the Hessian of the barrier. The distribution is uniform in
    the limit. O(count r d) per step.
    """
    space = optimal.space
    start, root = analytic_point(space, optimal.centre)
    points = np.repeat(start[None, :], count, axis=0)
    if not space.size:
        return optimal.at(points)
    rounding = solve_triangular(root, np.eye(space.size))
    for _ in range(_STEPS_A_DIMENSION * space.size):
        directions = generator.standard_normal(points.shape) @ rounding.T
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        minimum, most = _chord(space, points, directions)
        along = minimum + (most - minimum) * generator.random(count)
        points = points + (_INSIDE * along)[:, None] * directions
    return optimal.at(points)


def _chord(space: Lifted, points: Floats, directions: Floats) -> tuple[Floats, Floats]:
    """Lengths of lines through points inside the set, backward and forward."""
    slack = space.limits - points @ space.rows.T
    speed = directions @ space.rows.T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = slack / speed
    most = np.where(speed > 0.0, reach, np.inf).min(axis=1, initial=np.inf)
    minimum = np.where(speed < 0.0, reach, -np.inf).max(axis=1, initial=-np.inf)
    if space.ball:
        shape = (len(points), -1, space.ball)
        thrust = (space.control_free + points @ space.control_response.T).reshape(shape)
        change = (directions @ space.control_response.T).reshape(shape)
        a = (change**2).sum(axis=2)
        b = (thrust * change).sum(axis=2)
        c = (thrust**2).sum(axis=2) - 1.0
        moving = a > 1e-18
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        divisor = np.where(moving, a, 1.0)
        most = np.minimum(most, np.where(moving, (root - b) / divisor, np.inf).min(axis=1))
        minimum = np.maximum(minimum, np.where(moving, (-root - b) / divisor, -np.inf).max(axis=1))
    return np.minimum(minimum, 0.0), np.maximum(most, 0.0)


def _nearest(space: Lifted, scale: Floats, control: Floats | float = 0.0) -> Floats:
    turned = scale[:, None] * space.control_response
    return quadratic(space, turned.T @ turned, turned.T @ (scale * space.control_free - control))
