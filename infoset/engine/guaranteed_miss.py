"""The guaranteed miss Phi: an upper bound of the true miss over all labels, computed on board.

Labels leave the set step by step as their range passes below the threshold. Phi is the maximum of
(10) in docs/guarantee-miss.md over all of them: a search by branch and bound. The labels that leave
in one step are divided into pieces, and `piece_bounds` bounds each piece. The piece with the
maximum bound is divided further until an exact section reaches nearly as much; the other pieces
need no more than their first bounds. If an engagement has several sets, Phi is the maximum over all
of them, and one search.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import numpy as np

from infoset._compile import TRUE, ZERO, allocation_free, entry, pasted
from infoset.arrays import Flags, Floats, Integers
from infoset.engine import chains
from infoset.engine.history import EventLog, History
from infoset.engine.piece_bounds import (
    MAX_LABELS,
    PIECE,
    PIECES,
    SLACK,
    Outlines,
    bound_pieces,
    feasible_part,
    max_exact_miss,
    replay_labels,
)
from infoset.engine.replays import run
from infoset.engine.section_law import Laws, SectionLaw
from infoset.engine.section_passes import Sections
from infoset.engine.workspace import Past, Records, past_of, select

TIGHT = 1.001
"""A piece is divided if its bound exceeds the maximum miss of an exact section by this factor: Phi
is then at most 0.1 % greater than the exact maximum. Chosen: with 1.004 Phi of flights of ten
seconds is up to 0.2 % greater, in 0.7 of the time; with 1.00025 it takes 1.2 times the time
(measured)."""
MAX_DIVIDED = 400
"""Maximum number of pieces that are divided, for each set of an engagement. If more are needed,
Phi is a greater bound: docs/measured/guarantee.md has medians of Phi for 100 and 400 pieces. A
piece takes 0.1 to 0.4 ms.
"""
GROUPS = 3000
"""Labels that leave within 1/GROUPS of a flight are bounded together, from 2 GROUPS steps on; in a
shorter flight those of each step are. A flight of 10 000 steps has a Phi that is 2 % greater
(docs/measured/performance.md). Chosen: it limits the time of long flights.
"""
MISS_ROUNDING = 4.0 * chains.EPSILON
"""Rounding error of a miss, relative to the maximum label: of x at the closest approach, also if z
is exactly zero.
"""


class Leaving(NamedTuple):
    """Labels that leave in each of W steps.

    Parameters
    ----------
    near, far : ndarray, shape (W, B)
        Limits of the labels, m; `near` is greater than `far` if none leaves.
    known : ndarray, shape (W, B)
        A feasible label between them, m; minus infinity if none is known.
    events, elapsed : ndarray of int, shape (W,)
        Numbers of events and of predictions before they leave.
    """

    near: Floats
    far: Floats
    known: Floats
    events: Integers
    elapsed: Integers


@pasted
def list_leaving(leaving: Leaving, b: int, past: Past, pieces: Records, count: int) -> int:
    """Add the labels of a set that leave in each step as one piece, whose bound is infinite, to
    `count` pieces; return the new count. The events of the set must be selected.
    """
    for step in range(leaving.events.shape[0]):
        if leaving.near[step, b] > leaving.far[step, b]:
            continue
        piece = pieces[count]
        piece.near = leaving.near[step, b]
        piece.far = leaving.far[step, b]
        piece.set = b
        piece.step = step
        piece.bound = np.inf
        count += 1
        # Labels are positive; `known` is minus infinity if none is known.
        if past.errors is not None and leaving.known[step, b] > 0.0:
            # The windows of pieces apply the measurements that have cut this label.
            run(leaving.known[step, b], past)
    return count


@allocation_free
def worst_of(pieces: Records, count: int) -> int:
    """Return the index of the piece with the maximum bound; of equal ones the last, which often has
    the maximum miss.
    """
    worst = 0
    for i in range(count):
        if pieces[i].bound >= pieces[worst].bound:
            worst = i
    return worst


@pasted
def divide(
    i: int,
    reached: float,
    leaving: Leaving,
    past: Past,
    outlines: Outlines,
    pieces: Records,
    count: int,
) -> tuple[int, float]:
    """Replace piece `i` of `count` pieces by its parts, with their bounds; by nothing if no label
    of it is feasible.

    Return the new count, and the maximum miss of an exact section so far; it was `reached` before.
    The events of the set of the piece must be selected.
    """
    near = pieces[i].near
    far = pieces[i].far
    b = pieces[i].set
    step = pieces[i].step
    # The last piece takes its place.
    count -= 1
    pieces[i] = pieces[count]

    log = past.log
    until = EventLog(
        log.kinds, log.values, log.applies, leaving.events[step], leaving.elapsed[step]
    )
    window = Past(until, past.errors, past.laws, past.room, near, far, TRUE)
    feasible = feasible_part(leaving.known[step, b], window)
    if not feasible.exists:
        return count, reached

    replayed = replay_labels(feasible, window, outlines)
    before = count
    count = bound_pieces(feasible, replayed, window, outlines, pieces, count)
    for part in range(before, count):
        pieces[part].set = b
        pieces[part].step = step
    return count, max(reached, max_exact_miss(replayed, reached, window, outlines))


@entry
def bound_all(
    leaving: Leaving, past: Past, outlines: Outlines, pieces: Records, phi: Floats
) -> None:
    """Write Phi of each engagement without the error of the speed, m, into `phi`.

    It is minus infinity where no feasible label has left; with rates, none that is feasible with
    the bands of its window. A new piece has an infinite bound; the first division of each is not
    counted in `MAX_DIVIDED`. `pieces` has room for all pieces of an engagement, which has the same
    number of sets as all others.
    """
    members = leaving.near.shape[1] // phi.shape[0]
    for engagement in range(phi.shape[0]):
        count = ZERO
        selected = ZERO
        for b in range(members * engagement, members * (engagement + 1)):
            select(past, b)
            selected = b
            count = list_leaving(leaving, b, past, pieces, count)

        divided = ZERO
        reached = -np.inf
        phi[engagement] = -np.inf
        while count > 0:
            worst = worst_of(pieces, count)
            bound = pieces[worst].bound
            if bound < np.inf:
                phi[engagement] = bound
                divided += 1
                if bound <= TIGHT * reached or divided > members * MAX_DIVIDED:
                    break
            if pieces[worst].set != selected:
                selected = pieces[worst].set
                select(past, selected)
            count, reached = divide(worst, reached, leaving, past, outlines, pieces, count)


class GuaranteedMiss:
    """Phi of a batch of engagements: an upper bound of the true miss over the labels that have left
    the set.

    `batch` sets, `members` in a row for each engagement. `speed_error` is the maximum |eta|, the
    relative error of the closing speed.
    """

    def __init__(self, law: SectionLaw, batch: int, speed_error: float, members: int = 1) -> None:
        self._law = law
        self._members = members
        self._speed_error = speed_error
        steps = law.label_max / (law.closing_speed * law.step)
        self._group_steps = max(1, int(steps / GROUPS))
        # Labels below these, m, have been noted already.
        self._bounded_below = np.full(batch, -np.inf)
        self._leaving: list[Leaving] = []

    def copy(self) -> GuaranteedMiss:
        """Return an independent copy."""
        twin = copy.copy(self)
        twin._leaving = self._leaving.copy()
        return twin

    def leave(
        self, active: Flags, lower: Floats, upper: Floats, sections: Sections, history: History
    ) -> None:
        """Note that the feasible labels from `lower` to `upper`, shape (B,), m, leave in this step.

        Labels that leave during the following steps of a group are noted too, so that the number of
        windows does not grow with the number of steps.
        """
        # Engagements of which a label leaves in this step that was not noted before.
        lower = np.maximum(lower, self._bounded_below)
        active = active & (lower <= upper) & (lower < self._min_label(history.elapsed + 1))
        if not active.any():
            return
        # The group is this step and the following ones: labels below leave in one of them.
        below = self._min_label(history.elapsed + self._group_steps)
        near = np.where(active, lower, np.inf)
        far = np.minimum(upper, below)
        self._bounded_below = np.where(active, below, self._bounded_below)

        slots = sections.slots
        labels = slots["label"]
        is_between = (labels >= near[:, None]) & (labels <= far[:, None])
        is_used = np.arange(slots.shape[1]) < sections.used[:, None]
        is_known = slots["feasible"] & is_between & is_used
        known = np.where(is_known, labels, -np.inf).max(axis=1)
        # Arrays without an axis: `bound` stacks them.
        events = np.array(history.events)
        elapsed = np.array(history.elapsed)
        self._leaving.append(Leaving(near, far, known, events, elapsed))

    def bound(self, laws: Laws, history: History) -> tuple[Floats, Flags]:
        """Return Phi so far, m, and whether a feasible label has left, for each engagement; Phi is
        zero if none has.

        The labels that have left are replayed from the start; the impulses that followed act on
        them. The time is linear in the number of events times the number of the steps in which
        labels leave.
        """
        engagements = len(self._bounded_below) // self._members
        channels = len(laws)
        windows = len(self._leaving)
        phi = np.full(engagements, -np.inf)
        if windows:
            outlines = Outlines(
                labels=np.empty(MAX_LABELS),
                points=np.empty((channels, MAX_LABELS, chains.CAPACITY, 2)),
                counts=np.empty((channels, MAX_LABELS), dtype=np.int64),
                supports=np.empty((4, MAX_LABELS)),
            )
            leaving = Leaving(*(np.stack(each) for each in zip(*self._leaving, strict=True)))
            # A division puts at most `PIECES` pieces in the place of one: each leaving window is
            # divided once, and `MAX_DIVIDED` others for each set.
            pieces = np.recarray(PIECES * (windows + MAX_DIVIDED) * self._members, PIECE)
            bound_all(leaving, past_of(history, laws), outlines, pieces, phi)
        # A miss is not negative; minus infinity stands for none.
        exists = phi >= 0.0
        # A true miss is at most 1 + eta times the miss in the scale of the model.
        factor = (1.0 + self._speed_error) * (1.0 + SLACK)
        return np.where(exists, (phi + MISS_ROUNDING * self._law.label_max) * factor, 0.0), exists

    def _min_label(self, elapsed: int) -> float:
        """Return the minimum label, m, that is not below the range threshold after a number of
        steps.
        """
        return self._law.min_range + self._law.closing_speed * (self._law.step * elapsed)
