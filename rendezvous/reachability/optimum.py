"""The least terminal norm, and the polytope of all controls that reach it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from infoset.polytope import null_space_basis, relative_interior
from rendezvous.reachability.blocks import Block
from rendezvous.reachability.least_norm import least_norm, reaches_zero
from rendezvous.reachability.lifted import Lifted, lift
from rendezvous.reachability.programs import deep_point, least_relaxation

Floats = NDArray[np.float64]

_REACHED = 1e-9
"""Constraints that are broken by less than this, relative to their sizes, count as kept."""
_PRESSED = 1e-7


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
    A cone program gives the terminal state, which is unique, and multipliers (see `least_norm`). A row with a positive
    multiplier is tight for every optimal control: with the terminal equations these give a face of the set of
    admissible controls, whose affine hull is found by linear programs through the solution.
    """
    block = admissible(block)
    lifted = lift(block)
    found = least_norm(lifted, np.ones(block.size) if relative else block.scale / block.scale.max())
    # The solution itself is never outside, by no rounding.
    lifted = replace(lifted, limits=np.maximum(lifted.limits, lifted.rows @ found.point))
    gaps = lifted.limits - lifted.rows @ found.point
    most = max(float(found.multipliers.max(initial=0.0)), float(np.abs(found.pressures).max(initial=0.0)))
    held = (found.multipliers > gaps) & (found.multipliers > _REACHED * most)
    fixed = np.zeros(len(lifted.control_free), dtype=bool)
    if lifted.ball:  # on the sphere the thrust of a period is unique
        pressed = np.linalg.norm(found.pressures.reshape(-1, lifted.ball), axis=1)
        fixed = np.repeat(pressed > max(_PRESSED * most, 1e-300), lifted.ball)
    across = np.vstack([lifted.rows[held], lifted.control_response[fixed]])
    terminal = np.zeros(block.size) if found.reached else lifted.free[-1] + lifted.response[-1] @ found.point
    face = lifted.where(lifted.response[-1], terminal - lifted.free[-1]).where(across, across @ found.point)
    return _with_hull(block, lifted, terminal, found.reached, face, found.point)


def block_reaches_zero(block: Block) -> bool:
    """Return whether admissible controls lead a block to zero.

    Parameters
    ----------
    block : Block

    Returns
    -------
    bool
    """
    relaxation = least_relaxation(lift(block))[0]
    return relaxation <= _REACHED and reaches_zero(lift(_relaxed(block, relaxation)))


def admissible(block: Block) -> Block:
    """Return a block that controls can keep in its constraints: itself, or relaxed by rounding.

    Parameters
    ----------
    block : Block

    Returns
    -------
    Block
        Where no control keeps the constraints by 1e-9 of their sizes, all of them are relaxed until one does.

    Raises
    ------
    EmptyTubeError
        If that takes more than 1e-9, with the first time they conflict at, found by bisection, a linear program each.
    """
    lifted = lift(block)
    relaxation = least_relaxation(lifted)[0]
    if relaxation <= _REACHED:
        return _relaxed(block, relaxation)
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


def _relaxed(block: Block, relaxation: float) -> Block:
    margin = relaxation + _REACHED
    return replace(block, offsets=block.offsets + margin) if margin > 0.0 else block


def _with_hull(
    block: Block, lifted: Lifted, terminal: Floats, reached: bool, face: Lifted, member: Floats
) -> BlockOptimum:
    """Find the affine hull of the optimal controls, through one of them."""
    if lifted.ball:
        optimal = face.within(member, null_space_basis(face.equal))
        optimal = optimal.only(np.flatnonzero(np.linalg.norm(optimal.rows, axis=1) > _REACHED))
        return BlockOptimum(block, lifted, terminal, reached, optimal, deep_point(optimal)[0])
    hull = relative_interior(face.rows, face.limits, face.equal, face.levels, bounded=True, member=member)
    optimal = face.within(hull.point, hull.basis).only(hull.kept)
    return BlockOptimum(block, lifted, terminal, reached, optimal, hull.centre)
