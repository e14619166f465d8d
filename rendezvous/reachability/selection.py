"""Members of the set of optimal controls, by choice."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from infoset.polytope import EmptyPolytopeError, Polytope, UncertainHullError, relative_interior
from rendezvous.reachability.conic import NoSolutionError
from rendezvous.reachability.lifted import Lifted
from rendezvous.reachability.optimal_controls import OptimalControls
from rendezvous.reachability.programs import least_l1, least_peak, least_sum_of_norms, quadratic

Floats = NDArray[np.float64]

MOST_VERTICES = 2000
_MOST_DIMENSIONS = 8
_NEWTON_STEPS = 200
_STILL = 1e-9


class TooManyVerticesError(ValueError):
    """The optimal controls have more vertices than can be listed, or, for thrust in a ball, no such thing."""


@dataclass(frozen=True)
class Effort:
    """What a control costs.

    Parameters
    ----------
    energy : float
        Sum of squares of all components.
    l1 : float
        Sum of their absolute values.
    norms : float
        Sum of the Euclidean norms over the periods.
    peak : float
        Greatest absolute value.
    """

    energy: float
    l1: float
    norms: float
    peak: float


def effort(controls: Floats) -> Effort:
    """Return what a control costs.

    Parameters
    ----------
    controls : ndarray, shape (T, m)

    Returns
    -------
    Effort
    """
    return Effort(
        float((controls**2).sum()),
        float(np.abs(controls).sum()),
        float(np.linalg.norm(controls, axis=1).sum()),
        float(np.abs(controls).max()),
    )


def minimum_energy(optimal: OptimalControls) -> Floats:
    """Return the optimal control of least sum of squares, which is unique.

    Parameters
    ----------
    optimal : OptimalControls

    Returns
    -------
    ndarray, shape (T, m)

    Notes
    -----
    A quadratic program.
    """
    return optimal.at(_least_energy(optimal.space, optimal.scale))


def minimum_l1(optimal: OptimalControls) -> Floats:
    """Return an optimal control of least sum of absolute values.

    Parameters
    ----------
    optimal : OptimalControls

    Returns
    -------
    ndarray, shape (T, m)

    Notes
    -----
    A linear program.
    """
    return optimal.at(least_l1(optimal.space, optimal.scale) if optimal.dimension else np.zeros(0))


def minimum_norms(optimal: OptimalControls) -> Floats:
    """Return an optimal control of least sum, over the periods, of Euclidean norms: the propellant of one thruster.

    Parameters
    ----------
    optimal : OptimalControls

    Returns
    -------
    ndarray, shape (T, m)

    Notes
    -----
    A second-order cone program.
    """
    if not optimal.dimension:
        return optimal.at(np.zeros(0))
    return optimal.at(least_sum_of_norms(optimal.space, optimal.scale, optimal.problem.controls))


def minimum_peak(optimal: OptimalControls) -> Floats:
    """Return, of the optimal controls of least greatest component (norm, for a ball), the one of least energy.

    Parameters
    ----------
    optimal : OptimalControls

    Returns
    -------
    ndarray, shape (T, m)

    Notes
    -----
    A linear program for the bound; a quadratic one over the face that keeps it.
    """
    space, scale = optimal.space, optimal.scale
    if not space.size:
        return optimal.at(np.zeros(0))
    bound, point = least_peak(space, scale, optimal.problem.controls)
    if space.ball:
        return optimal.at(point)
    moving = np.linalg.norm(space.control_response, axis=1) > _STILL
    turned, fixed = (scale[:, None] * space.control_response)[moving], (scale * space.control_free)[moving]
    rows = np.vstack([space.rows, turned, -turned])
    limits = np.concatenate([space.limits, bound - fixed, bound + fixed])
    face = relative_interior(rows, limits, space.equal, space.levels, bounded=True, member=point)
    inner = replace(space.within(face.point, face.basis), rows=face.rows, limits=face.limits)
    return optimal.at(face.point + face.basis @ _least_energy(inner, scale))


def nearest(optimal: OptimalControls, control: Floats) -> Floats:
    """Return the optimal control nearest to another one.

    Parameters
    ----------
    optimal : OptimalControls
    control : ndarray, shape (T, m)

    Returns
    -------
    ndarray, shape (T, m)

    Notes
    -----
    A quadratic program.
    """
    space, scale = optimal.space, optimal.scale
    turned = scale[:, None] * space.control_response
    away = scale * space.control_free - control.ravel()
    return optimal.at(quadratic(space, turned.T @ turned, turned.T @ away).point)


def chebyshev_centre(optimal: OptimalControls) -> Floats:
    """Return a centre of a largest ball of controls, within the affine hull, that are all optimal.

    Parameters
    ----------
    optimal : OptimalControls

    Returns
    -------
    ndarray, shape (T, m)
        Controls are compared after division by their bounds. For thrust in a ball the ball is inside, but perhaps not
        the largest.
    """
    return optimal.at(optimal.centre)


def analytic_centre(optimal: OptimalControls) -> Floats:
    """Return the optimal control of greatest product of slacks.

    Parameters
    ----------
    optimal : OptimalControls

    Returns
    -------
    ndarray, shape (T, m)
    """
    return optimal.at(analytic_point(optimal.space, optimal.centre)[0])


def analytic_point(space: Lifted, start: Floats) -> tuple[Floats, Floats]:
    """Return the analytic centre of a set without equations, and the Hessian of its barrier there.

    Parameters
    ----------
    space : Lifted
    start : ndarray, shape (d,)
        Inside.

    Returns
    -------
    point : ndarray, shape (d,)
    hessian : ndarray, shape (d, d)

    Raises
    ------
    NoSolutionError
        If Newton's method does not reach it.

    Notes
    -----
    Newton's method with halved steps on - sum log(slack) - sum log(1 - |u(t)|^2), which is self-concordant.
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


def vertices(optimal: OptimalControls, most: int = MOST_VERTICES) -> Floats:
    """Return every vertex of the set of optimal controls.

    Parameters
    ----------
    optimal : OptimalControls
    most : int
        How many at most.

    Returns
    -------
    ndarray, shape (v, T, m)

    Raises
    ------
    TooManyVerticesError
        If there are more, if they are too many to look for, or if thrust is in a ball.
    UncertainHullError
        If rounding decides which points are vertices.
    """
    parts = []
    for each in optimal.blocks:
        if each.optimal.ball:
            raise TooManyVerticesError("with thrust in a ball the optimal controls have no vertices; choose a box")
        if each.optimal.size > _MOST_DIMENSIONS:
            raise TooManyVerticesError(
                f"the optimal controls of a block span {each.optimal.size} dimensions; vertices are listed to "
                f"{_MOST_DIMENSIONS}: choose samples"
            )
        if not each.optimal.size:
            parts.append(np.zeros((1, 0)))
            continue
        try:
            parts.append(Polytope.from_halfspaces(each.optimal.rows, each.optimal.limits, bounded=True).vertices)
        except EmptyPolytopeError as error:  # the centre is inside
            raise UncertainHullError("the optimal controls of a block are so thin that rounding hides them") from error
    count = int(np.prod([len(part) for part in parts]))
    if count > most:
        raise TooManyVerticesError(f"the optimal controls have {count} vertices, over {most}: choose samples")
    points = parts[0]
    for part in parts[1:]:
        points = np.hstack([np.repeat(points, len(part), axis=0), np.tile(part, (len(points), 1))])
    return optimal.at(points)


def _least_energy(space: Lifted, scale: Floats) -> Floats:
    turned = scale[:, None] * space.control_response
    return quadratic(space, turned.T @ turned, turned.T @ (scale * space.control_free)).point


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
