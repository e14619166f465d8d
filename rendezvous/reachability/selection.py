"""Members of the set of optimal controls: those that minimise a cost, centres, vertices and random ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rendezvous._arrays import Floats
from rendezvous.reachability.admissible import Lifted, min_l1, min_peak, min_sum_of_norms, quadratic
from rendezvous.reachability.conic import NoSolutionError
from rendezvous.reachability.relative_interior import relative_interior
from rendezvous.reachability.sets import TooManyVerticesError, combined, optimal_polytope
from rendezvous.reachability.solve import OptimalControls

MAX_VERTICES = 2000
_NEWTON_STEPS = 200
_STILL = 1e-9
_STEPS_A_DIMENSION = 20
_INSIDE = 1.0 - 1e-12
_FLATTEST = 1e-15


@dataclass(frozen=True)
class Effort:
    """Costs of a control, dimensionless.

    `energy` is the sum of squares of all components, `l1` that of their absolute values, `norms` that of the Euclidean
    norms over the periods, and `peak` the maximum absolute value.
    """

    energy: float
    l1: float
    norms: float
    peak: float


def effort(controls: Floats) -> Effort:
    """Return the costs of `controls`, shape (T, m)."""
    return Effort(
        float((controls**2).sum()),
        float(np.abs(controls).sum()),
        float(np.linalg.norm(controls, axis=1).sum()),
        float(np.abs(controls).max()),
    )


def minimum_energy(optimal: OptimalControls) -> Floats:
    """Return the `optimal` control of minimum sum of squares, shape (T, m), which is unique, by a quadratic program."""
    return optimal.at(_nearest(optimal.space, optimal.scale))


def minimum_l1(optimal: OptimalControls) -> Floats:
    """Return an `optimal` control of minimum sum of absolute values, shape (T, m), by a linear program."""
    return optimal.at(min_l1(optimal.space, optimal.scale) if optimal.dimension else np.zeros(0))


def minimum_norms(optimal: OptimalControls) -> Floats:
    """Return an `optimal` control of minimum sum, over periods, of Euclidean norms, shape (T, m), by a cone program.

    The sum is the propellant of a single thruster.
    """
    if not optimal.dimension:
        return optimal.at(np.zeros(0))
    return optimal.at(min_sum_of_norms(optimal.space, optimal.scale, optimal.problem.controls))


def minimum_peak(optimal: OptimalControls) -> Floats:
    """Return, of the `optimal` controls of minimax component, the one of minimum energy, shape (T, m).

    For thrust in a ball it is a control of minimax norm. A linear program gives the bound, and a quadratic one
    the control on the face of the set that keeps the bound.
    """
    space, scale = optimal.space, optimal.scale
    if not space.size:
        return optimal.at(np.zeros(0))
    bound, point = min_peak(space, scale, optimal.problem.controls)
    if space.ball:
        return optimal.at(point)
    moving = np.linalg.norm(space.control_response, axis=1) > _STILL
    turned, fixed = (scale[:, None] * space.control_response)[moving], (scale * space.control_free)[moving]
    rows = np.vstack([space.rows, turned, -turned])
    limits = np.concatenate([space.limits, bound - fixed, bound + fixed])
    face = relative_interior(rows, limits, space.equal, space.levels, point)
    inner = replace(space.within(face.point, face.basis), rows=face.rows, limits=face.limits)
    return optimal.at(face.point + face.basis @ _nearest(inner, scale))


def nearest(optimal: OptimalControls, control: Floats) -> Floats:
    """Return the `optimal` control nearest to a `control`, both of shape (T, m), by a quadratic program."""
    return optimal.at(_nearest(optimal.space, optimal.scale, control.ravel()))


def chebyshev_centre(optimal: OptimalControls) -> Floats:
    """Return a centre of a largest ball, within the affine hull, of `optimal` controls, shape (T, m).

    Controls are compared after division by their bounds. For thrust in a ball the ball is inside, but may not be the
    largest.
    """
    return optimal.at(optimal.centre)


def analytic_centre(optimal: OptimalControls) -> Floats:
    """Return the `optimal` control of maximum product of slacks, shape (T, m)."""
    return optimal.at(analytic_point(optimal.space, optimal.centre)[0])


def analytic_point(space: Lifted, start: Floats) -> tuple[Floats, Floats]:
    """Return the analytic centre, shape (d,), of a set without equations, and the Hessian of its barrier there.

    `start`, shape (d,), is inside. Newton's method with halved steps on - sum log(slack) - sum log(1 - |u(t)|^2), which
    is self-concordant. Raise `NoSolutionError` if Newton's method does not converge.
    """
    point = start.copy()
    if not space.size:
        return point, np.zeros((0, 0))
    value, gradient, hessian = _barrier(space, point)
    for _ in range(_NEWTON_STEPS):
        step = np.linalg.solve(hessian, -gradient)
        decrement = float(-gradient @ step)
        if decrement < 1e-22:
            return point, hessian
        length = 1.0
        while True:
            after = _barrier(space, point + length * step)
            if after[0] <= value - 1e-4 * length * decrement or length * decrement < 1e-15 * max(1.0, abs(value)):
                break
            length *= 0.5
        point = point + length * step
        value, gradient, hessian = after
        if length * decrement < 1e-15 * max(1.0, abs(value)):
            return point, hessian
    raise NoSolutionError("Newton's method did not reach the analytic centre")


def _barrier(space: Lifted, point: Floats) -> tuple[float, Floats, Floats]:
    """Value, gradient and Hessian; infinite outside."""
    size = space.size
    slack = space.limits - space.rows @ point
    nothing = np.zeros(size), np.eye(size)
    if float(slack.min(initial=np.inf)) <= 0.0:
        return np.inf, *nothing
    weighed = space.rows / slack[:, None]
    value, gradient, hessian = -float(np.log(slack).sum()), weighed.sum(axis=0), weighed.T @ weighed
    if space.ball:
        turned = space.control_response.reshape(-1, space.ball, size)
        thrust = space.controls(point).reshape(-1, space.ball)
        moving = np.linalg.norm(turned, axis=(1, 2)) > _STILL
        turned, thrust = turned[moving], thrust[moving]
        left = 1.0 - (thrust**2).sum(axis=1)
        if float(left.min(initial=np.inf)) <= 0.0:
            return np.inf, *nothing
        pull = 2.0 * np.einsum("tmd,tm->td", turned, thrust) / left[:, None]
        value -= float(np.log(left).sum())
        gradient = gradient + pull.sum(axis=0)
        hessian = hessian + pull.T @ pull + 2.0 * np.einsum("tmd,tme,t->de", turned, turned, 1.0 / left)
    return value, gradient, hessian


def vertices(optimal: OptimalControls, most: int = MAX_VERTICES) -> Floats:
    """Return all vertices of the set of `optimal` controls, shape (v, T, m).

    Raises
    ------
    TooManyVerticesError
        If there are more than `most`, if the set has too many dimensions, or if thrust is in a ball.
    UncertainHullError
        If rounding decides which points are vertices.
    """
    corners = [optimal_polytope(part).vertices if part.optimal.size else np.zeros((1, 0)) for part in optimal.blocks]
    count = int(np.prod([len(block) for block in corners]))
    if count > most:
        raise TooManyVerticesError(f"the optimal controls have {count} vertices, more than the limit of {most}")
    return optimal.at(combined(corners))


def samples(optimal: OptimalControls, count: int, generator: np.random.Generator) -> Floats:
    """Draw `count` random members, at least 1, of the set of `optimal` controls, shape (count, T, m).

    Hit-and-run: for each sample a chain of 20 d steps from the analytic centre; the `generator` draws directions, which
    are scaled by the Hessian of the barrier. The distribution is uniform in the limit. O(count r d) per step.
    """
    space = optimal.space
    start, hessian = analytic_point(space, optimal.centre)
    points = np.repeat(start[None, :], count, axis=0)
    if not space.size:
        return optimal.at(points)
    try:
        rounding = np.linalg.inv(np.linalg.cholesky(hessian)).T
    except np.linalg.LinAlgError:  # the set is so thin that the Hessian is singular to rounding
        steep, ways = np.linalg.eigh(hessian)
        rounding = ways / np.sqrt(np.maximum(steep, _FLATTEST * steep[-1]))
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
        a, b, c = (change**2).sum(axis=2), (thrust * change).sum(axis=2), (thrust**2).sum(axis=2) - 1.0
        moving = a > 1e-18
        root = np.sqrt(np.maximum(b * b - a * c, 0.0))
        divisor = np.where(moving, a, 1.0)
        most = np.minimum(most, np.where(moving, (root - b) / divisor, np.inf).min(axis=1))
        minimum = np.maximum(minimum, np.where(moving, (-root - b) / divisor, -np.inf).max(axis=1))
    return np.minimum(minimum, 0.0), np.maximum(most, 0.0)


def _nearest(space: Lifted, scale: Floats, control: Floats | float = 0.0) -> Floats:
    turned = scale[:, None] * space.control_response
    return quadratic(space, turned.T @ turned, turned.T @ (scale * space.control_free - control))
