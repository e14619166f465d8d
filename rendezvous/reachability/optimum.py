"""The least terminal norm, and the polytope of all controls that reach it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rendezvous.polytope import EmptyPolytopeError
from rendezvous.polytope.relative_interior import relative_interior, solutions
from rendezvous.reachability.blocks import Block
from rendezvous.reachability.lifted import Lifted, lift
from rendezvous.reachability.programs import Optimum, deep_point, least_relaxation, quadratic

Floats = NDArray[np.float64]

_REACHED = 1e-9
"""States nearer to zero than this, relative to their bounds, count as zero."""


class EmptyTubeError(ValueError):
    """No control keeps the constraints.

    Parameters
    ----------
    time : int
        The first t until which they cannot be kept.
    relaxation : float
        By which fraction of its size every constraint on states must be relaxed until all can be kept.
    names : tuple of str
        Constraints that conflict then.
    """

    def __init__(self, time: int, relaxation: float, names: tuple[str, ...]) -> None:
        super().__init__(
            f"no control keeps the constraints: they conflict at t = {time} ({', '.join(names)}) and can be kept "
            f"once each is relaxed by {100.0 * relaxation:.3g} % of its bound"
        )
        self.time = time
        self.relaxation = relaxation
        self.names = names


@dataclass(frozen=True, eq=False)
class BlockOptimum:
    """The least terminal norm of a block.

    Parameters
    ----------
    block : Block
    lifted : Lifted
        All admissible controls.
    terminal : ndarray, shape (n,)
        The one terminal state of least norm, scaled; zero, exactly, where that is reachable.
    reached : bool
        Whether it is zero.
    optimal : Lifted
        All optimal controls, in coordinates z of their affine hull; thrust in a ball stays a constraint of them.
    centre : ndarray, shape (d,)
        Deep inside, in these coordinates.
    """

    block: Block
    lifted: Lifted
    terminal: Floats
    reached: bool
    optimal: Lifted
    centre: Floats

    @property
    def miss(self) -> float:
        """The least norm of the block's terminal state, in the units of the problem."""
        return float(np.linalg.norm(self.terminal * self.block.scale))


def block_optimum(block: Block, *, relative: bool = False) -> BlockOptimum:
    """Find the least terminal norm of a block, and all controls that reach it.

    Parameters
    ----------
    block : Block
    relative : bool
        Whether the norm is of states divided by their bounds, and not in the units of the problem.

    Returns
    -------
    BlockOptimum

    Raises
    ------
    EmptyTubeError
        If no control keeps the constraints.

    Notes
    -----
    A linear program tells whether zero can be reached; if not, a quadratic one (Clarabel, then its active rows solved
    for) gives the terminal state, which is unique. A row with a positive multiplier is then tight for every optimal
    control: with the terminal equations these give a face of the set of admissible controls, whose affine hull is
    found by linear programs.
    """
    lifted = lift(block)
    need_admissible(block, lifted)
    if reaches_zero(lifted):
        terminal = lifted.where(lifted.response[-1], -lifted.free[-1])
        return _with_hull(block, lifted, np.zeros(block.size), True, terminal)
    weights = np.ones(block.size) if relative else block.scale / block.scale.max()
    response, free = weights[:, None] * lifted.response[-1], weights * lifted.free[-1]
    found = Optimum(np.zeros(lifted.size), np.zeros(0))
    size = 1.0
    for _ in range(2):  # once more with a least norm of about one, for all its digits
        found = quadratic(lifted, response.T @ response / size**2, response.T @ free / size**2)
        size = max(float(np.linalg.norm(free + response @ found.point)), 1e-12)
    reached = lifted.free[-1] + lifted.response[-1] @ found.point
    gaps = lifted.limits - lifted.rows @ found.point
    pressed = found.multipliers[: len(lifted.rows)]
    held = pressed > np.maximum(gaps, _REACHED * max(1.0, float(pressed.max(initial=0.0))))
    face = _thrust_at_its_bound(lifted, found) if lifted.ball else lifted
    face = face.where(
        np.vstack([lifted.response[-1], lifted.rows[held]]),
        np.concatenate([reached - lifted.free[-1], lifted.rows[held] @ found.point]),
    )
    return _with_hull(block, lifted, reached, False, face)


def reaches_zero(lifted: Lifted) -> bool:
    """Return whether admissible controls lead to zero, within 1e-9 of the bounds.

    Parameters
    ----------
    lifted : Lifted

    Returns
    -------
    bool
    """
    return least_relaxation(lifted.where(lifted.response[-1], -lifted.free[-1]))[0] <= _REACHED


def need_admissible(block: Block, lifted: Lifted) -> None:
    """Refuse constraints that no control keeps.

    Parameters
    ----------
    block : Block
    lifted : Lifted
        Its admissible controls.

    Raises
    ------
    EmptyTubeError
        With the first time they conflict at, found by bisection, a linear program each.
    """
    relaxation, point = least_relaxation(lifted)
    if relaxation <= _REACHED:
        return
    low, high = 0, block.periods
    while high - low > 1:
        middle = (low + high) // 2
        if least_relaxation(lifted.until(middle))[0] <= _REACHED:
            low = middle
        else:
            high = middle
    _, point = least_relaxation(lifted.until(high))
    gaps = lifted.limits - lifted.rows @ point
    tight = (gaps < _REACHED) & (lifted.moments >= 0) & (lifted.moments <= high)
    names = dict.fromkeys(
        f"{block.names[label]} at t = {moment}"
        for label, moment in zip(lifted.labels[tight], lifted.moments[tight], strict=True)
    )
    raise EmptyTubeError(high, relaxation, tuple(names)[:4])


def _with_hull(block: Block, lifted: Lifted, terminal: Floats, reached: bool, face: Lifted) -> BlockOptimum:
    """Find the affine hull of the optimal controls, for which no rounding may leave them empty."""
    try:
        if not lifted.ball:
            hull = relative_interior(face.rows, face.limits, face.equal, face.levels, bounded=True)
            optimal = face.within(hull.point, hull.basis).only(hull.kept)
            return BlockOptimum(block, lifted, terminal, reached, optimal, hull.centre)
        point, basis = solutions(face.equal, face.levels)
    except EmptyPolytopeError as error:
        raise ArithmeticError(f"the optimal controls were lost to rounding: {error}") from error
    optimal = face.within(point, basis)
    moving = np.flatnonzero(np.linalg.norm(optimal.rows, axis=1) > _REACHED)
    optimal = optimal.only(moving)
    return BlockOptimum(block, lifted, terminal, reached, optimal, deep_point(optimal)[0])


def _thrust_at_its_bound(lifted: Lifted, found: Optimum) -> Lifted:
    """Return equations for the periods whose thrust is on the sphere for every optimal control: it is unique there."""
    group = lifted.ball
    pressed = found.multipliers[len(lifted.rows) :].reshape(-1, group + 1)[:, 0]
    fixed = np.repeat(pressed > 1e-7 * max(1.0, float(pressed.max(initial=0.0))), group)
    levels = lifted.controls(found.point)[fixed] - lifted.control_free[fixed]
    return lifted.where(lifted.control_response[fixed], levels)
