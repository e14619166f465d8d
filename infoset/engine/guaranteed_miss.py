"""The guaranteed miss Phi: an upper bound of the true miss over all labels, computed on board.

Labels leave the set step by step as their range passes below the threshold. This module bounds the predicted misses of
the labels that leave, between the replayed labels too, and then follows the impulses until their range is zero.
docs/guarantee.md contains the theorem and its proof.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from infoset._compile import ZERO, allocation_free, entry
from infoset.arrays import Flags, Floats, Integers
from infoset.engine import chains
from infoset.engine.concave_bounds import bound_between
from infoset.engine.history import History
from infoset.engine.location import FIRST, LABEL_RESOLUTION, LAST, locate_end, search_window
from infoset.engine.replays import (
    LOWER,
    PROBE,
    UPPER,
    Past,
    keep_section,
    past_of,
    probe,
    replayed_section,
    run,
    select,
    with_window,
)
from infoset.engine.section_law import SectionLaw, law_of
from infoset.engine.section_life import ALIVE, time_to_go
from infoset.engine.section_passes import Sections
from infoset.engine.section_stack import SectionStack, impulse_doubts

LABELS = 4
"""Labels replayed for one step; one more on each side serves for extrapolation."""
MAX_LABELS = LABELS + 2
PIECES = LABELS + 1
NEAREST_OUTSIDE = 0.005
"""Minimum distance of a label below the others, in their spacing: a nearer one amplifies rounding."""
MAX_LEAVING_WINDOWS = 16
"""Maximum number of windows of the labels that leave at one step, with rates: a power of two."""
LOOSE = 1.25
"""A window is halved if its bound exceeds the maximum value known to be reached by this factor."""
GROUPS = 3000
"""Labels that leave within this part of a flight are bounded together, if they need several steps."""
MINIMUM, MAXIMUM, NEAREST, FARTHEST = range(4)
"""Columns of a piece: bounds of its predicted miss, and the labels of its ends, m."""
SLACK = 1e-9
ROUNDING = 4.0 * chains.EPSILON
"""Rounding error of a miss, relative to the maximum label: of x at the closest approach, also if z is exactly zero."""


@allocation_free
def extremes_along(points: Floats, count: int, tau: float) -> tuple[float, float]:
    """Minimum and maximum z + V tau over the vertices (V, z)."""
    minimum, maximum = np.inf, -np.inf
    for i in range(count):
        value = points[i, 1] + points[i, 0] * tau
        minimum = min(minimum, value)
        maximum = max(maximum, value)
    return minimum, maximum


class Outlines(NamedTuple):
    """Working arrays for the labels replayed for one step.

    Parameters
    ----------
    labels : ndarray, shape (MAX_LABELS,)
        The labels, m.
    points : ndarray, shape (C, MAX_LABELS, CAPACITY, 2)
        Vertices (V, z) of their sections along each axis.
    counts : ndarray of int, shape (C, MAX_LABELS)
        Numbers of vertices.
    supports : ndarray, shape (4, MAX_LABELS)
        Supports of the sections in four directions.
    """

    labels: Floats
    points: Floats
    counts: Integers
    supports: Floats


@allocation_free
def bound_piece(
    outlines: Outlines, number: int, first: int, p: float, q: float, travelled: float, law: SectionLaw
) -> tuple[float, float]:
    """Return bounds of z + V x/e over all sections of an axis with labels from p to q.

    The support of the sections in a fixed direction is a concave function of the label, but the direction of z + V x/e
    turns with the label. With the middle c of the piece, z + V x/e = (z + V x_c/e) + V (x - x_c)/e: the first term has
    a fixed direction, and the V of the second lies within its extrapolated bounds V_c +- r.
    """
    labels, values = outlines.labels, outlines.supports
    points, counts = outlines.points[law.channel], outlines.counts[law.channel]
    e = law.closing_speed
    centre = 0.5 * (p + q)
    tau = (centre - travelled) / e
    for k in range(number):
        minimum, maximum = np.inf, -np.inf
        for i in range(counts[k]):
            minimum = min(minimum, points[k, i, 0])
            maximum = max(maximum, points[k, i, 0])
        values[0, k], values[1, k] = -minimum, maximum
        minimum, maximum = extremes_along(points[k], counts[k], tau)
        values[2, k], values[3, k] = -minimum, maximum
    v_min = -bound_between(labels, values[0], number, first, p, q, 0.0, centre)
    v_max = bound_between(labels, values[1], number, first, p, q, 0.0, centre)
    v_middle = 0.5 * (v_min + v_max)
    room = 0.5 * (v_max - v_min) * (q - p) / (2.0 * e)
    minimum = -bound_between(labels, values[2], number, first, p, q, -v_middle / e, centre) - room
    maximum = bound_between(labels, values[3], number, first, p, q, v_middle / e, centre) + room
    drift = 0.5 * law.disturbance * ((q - travelled) / e) ** 2
    return minimum - drift, maximum + drift


@allocation_free
def bound_leaving(
    lower: float,
    upper: float,
    known: float,
    past: Past,
    errors: Floats | None,
    outlines: Outlines,
    pieces: Floats,
) -> int:
    """Bound the predicted miss of all living labels between two limits, m; return the number of pieces written.

    The pieces of all axes have the same ends; `pieces`, shape (C, >= PIECES, 4), receives them. With rates, the window
    consists of these limits; `errors` are those of the history, as in `replay`. `known` is a label between them that
    lives; less than `lower` if none is known.
    """
    living, limits, laws, elapsed = known, past.room.known, past.laws, past.log.elapsed
    if errors is not None:
        # The living labels need not form an interval, so that the window must be searched.
        first_label = known if known >= lower else 0.5 * (lower + upper)
        if not search_window(lower, upper, first_label, past):
            return 0
        living = limits[1].label
    lower_lives = probe(limits, FIRST, lower, past)
    if lower_lives:
        keep_section(past, LOWER)
    upper_lives = probe(limits, LAST, upper, past)
    if upper_lives:
        keep_section(past, UPPER)
    if lower_lives:
        living = lower
    elif upper_lives:
        living = upper
    if living < lower:
        # The living labels form an interval, and both limits are dead: no label between them lives.
        return 0
    resolution = LABEL_RESOLUTION * upper
    first_dead, last_dead = lower, upper
    first, last = lower, upper
    if not lower_lives:
        first_dead, first = locate_end(limits[0], living, resolution, past, LOWER)
    if not upper_lives:
        last_dead, last = locate_end(limits[2], living, resolution, past, UPPER)
    spacing = (last - first) / (LABELS - 1)
    law = law_of(laws, ZERO)
    travelled = law.closing_speed * (law.step * elapsed)
    number = inner = outer = ZERO
    if spacing <= resolution:
        spacing = 0.0
    for k in range(-1, LABELS + 1):
        outside = k < 0 or k == LABELS
        if (spacing == 0.0 and k != 0) or (k < 0 and not lower_lives) or (k == LABELS and not upper_lives):
            continue
        if outside and errors is not None:
            # The bands are convex only on the window.
            continue
        label = last if k == LABELS - 1 and spacing > 0.0 else first + k * spacing
        if k < 0 and label <= travelled:
            # No section exists behind x = 0. A much shorter distance would amplify rounding errors.
            label = travelled + 0.5 * (first - travelled)
            if first - label < NEAREST_OUTSIDE * spacing:
                continue
        row = PROBE
        if k == 0:
            row = LOWER
        elif k == LABELS - 1:
            row = UPPER
        elif run(label, past)[0] != ALIVE:
            continue
        if outside and k < 0:
            inner = 1
        elif outside:
            outer = 1
        outlines.labels[number] = label
        tau = (label - travelled) / law.closing_speed
        for channel in range(laws.shape[0]):
            section = replayed_section(past, channel, row, label)
            outlines.counts[channel, number] = chains.outline(section, tau, outlines.points[channel, number])
        number += 1
    if spacing == 0.0 or number < 3:
        # The living labels are equal to within the resolution: one outline and a small margin bound them all.
        width = last_dead - first_dead
        tau = (first - travelled) / law.closing_speed
        for channel in range(laws.shape[0]):
            minimum, maximum = extremes_along(outlines.points[channel, 0], outlines.counts[channel, 0], tau)
            magnitude = abs(minimum) + abs(maximum)
            margin = SLACK * magnitude + width * magnitude / max(first - travelled, 1.0)
            drift = 0.5 * law_of(laws, channel).disturbance * tau * tau
            pieces[channel, 0, MINIMUM], pieces[channel, 0, MAXIMUM] = (
                minimum - margin - drift,
                maximum + margin + drift,
            )
            pieces[channel, 0, NEAREST], pieces[channel, 0, FARTHEST] = first_dead, last_dead
        return 1
    made = 0
    inside = number - inner - outer
    for piece in range(inside + 1):
        # The first piece ends at the first living label, the last one begins at the last living label.
        at = inner + piece
        p = first_dead if piece == 0 else outlines.labels[at - 1]
        q = last_dead if piece == inside else outlines.labels[at]
        if q <= p:
            continue
        for channel in range(laws.shape[0]):
            minimum, maximum = bound_piece(outlines, number, at, p, q, travelled, law_of(laws, channel))
            pieces[channel, made, MINIMUM], pieces[channel, made, MAXIMUM] = minimum, maximum
            pieces[channel, made, NEAREST], pieces[channel, made, FARTHEST] = p, q
        made += 1
    return made


@entry
def bound_leaving_all(
    active: Flags,
    lower: Floats,
    upper: Floats,
    floor: Floats,
    past: Past,
    sections: Sections,
    outlines: Outlines,
    pieces: Floats,
    made: Integers,
) -> None:
    """Write the pieces of the active engagements and their numbers.

    With rates, a window of labels is halved while its bound is loose, since the bands that are convex on a window are
    wider on a wider window. `floor` is the bound of the labels that have arrived: Phi is no less.
    """
    slots, used, windows = sections.slots, sections.used, past.room.windows
    errors, laws = past.errors, past.laws
    for b in range(active.shape[0]):
        made[b] = 0
        if not active[b] or lower[b] > upper[b]:
            continue
        select(past, b)
        reached = 0.5 * floor[b]
        windows[0].near, windows[0].far = lower[b], upper[b]
        count = 1
        while count > 0:
            count -= 1
            near, far = windows[count].near, windows[count].far
            known = near - 1.0
            for s in range(used[b]):
                if slots[b, s].living and near <= slots[b, s].label <= far:
                    known = slots[b, s].label
            window, middle = past, 0.5 * (near + far)
            may_halve = errors is not None and MAX_LEAVING_WINDOWS * (far - near) > 1.5 * (upper[b] - lower[b])
            if errors is not None:
                window = with_window(past, near, far)
            spread = 0.0
            if may_halve:
                spread = spread_at(middle, window, outlines.points[0, 0])
                if spread > LOOSE * reached:
                    reached = max(reached, spread_at(middle, past, outlines.points[0, 0]))
            number = ZERO
            new_pieces = pieces[:, b, made[b] :]
            if spread <= LOOSE * reached:
                number = bound_leaving(near, far, known, window, errors, outlines, new_pieces)
                spread = 0.0
                for channel in range(laws.shape[0] if number > 0 else 0):
                    minimum, maximum = np.inf, -np.inf
                    for piece in range(number):
                        minimum = min(minimum, new_pieces[channel, piece, MINIMUM])
                        maximum = max(maximum, new_pieces[channel, piece, MAXIMUM])
                    spread = math.hypot(spread, 0.5 * (maximum - minimum))
            # Later impulses may centre the interval, so that its width determines Phi.
            if may_halve and spread > LOOSE * reached:
                windows[count].near, windows[count].far = near, middle
                windows[count + 1].near, windows[count + 1].far = middle, far
                count += 2
                continue
            made[b] += number


@allocation_free
def spread_at(label: float, past: Past, outline: Floats) -> float:
    """Return half the width of the predicted misses at one label, m, in space half the diagonal; zero if it is dead."""
    if run(label, past)[0] != ALIVE:
        return 0.0
    spread = 0.0
    for channel in range(past.laws.shape[0]):
        law = law_of(past.laws, channel)
        tau = time_to_go(label, past.log.elapsed, law)
        count = chains.outline(replayed_section(past, channel, PROBE, label), tau, outline)
        minimum, maximum = extremes_along(outline, count, tau)
        spread = math.hypot(spread, 0.5 * (maximum - minimum) + 0.5 * law.disturbance * tau * tau)
    return spread


class GuaranteedMiss:
    """Phi of a batch of engagements: an upper bound of the true miss over the labels that have left the set.

    `speed_error` is the maximum |eta|, the relative error of the closing speed.
    """

    def __init__(self, laws: tuple[SectionLaw, ...], batch: int, speed_error: float) -> None:
        self._laws, self._law, self._speed_error = laws, laws[0], speed_error
        self._settled = np.zeros(batch)
        self.exists: Flags = np.zeros(batch, dtype=bool)
        steps = self._law.label_max / (self._law.closing_speed * self._law.step)
        self._group_steps = max(1, int(steps / GROUPS))
        self._bounded_below = np.full(batch, -np.inf)
        # Pieces whose range is not zero yet, so that impulses move them.
        self._pending: list[tuple[Floats, Flags]] = []

    @property
    def bound_m(self) -> Floats:
        """Phi so far, m, shape (B,); zero where no label has left."""
        return np.maximum(self._settled, self._worst(self._pending))

    def copy(self) -> GuaranteedMiss:
        """Return an independent copy."""
        twin = GuaranteedMiss(self._laws, len(self._settled), self._speed_error)
        twin._settled, twin.exists = self._settled.copy(), self.exists.copy()
        twin._bounded_below = self._bounded_below.copy()
        twin._pending = [(pieces.copy(), real.copy()) for pieces, real in self._pending]
        return twin

    def fire(self, impulse_m_s: Floats, elapsed: int) -> None:
        """Apply impulses, m/s, shape (C, B), to the labels that have left but not arrived."""
        if not self._pending:
            return
        e = self._law.closing_speed
        travelled = e * (self._law.step * elapsed)
        doubt = np.stack([impulse_doubts(impulse_m_s, law) for law in self._laws])
        still = []
        for pieces, real in self._pending:
            near = np.maximum(pieces[..., NEAREST] - travelled, 0.0) / e
            far = np.maximum(pieces[..., FARTHEST] - travelled, 0.0) / e
            if not (real & (far > 0.0)).any():
                self._settled = np.maximum(self._settled, self._worst([(pieces, real)]))
                continue
            for_min, for_max = impulse_m_s - doubt, impulse_m_s + doubt
            moves = np.stack([k[..., None] * x for k in (for_min, for_max) for x in (near, far)])
            pieces[..., MINIMUM] -= moves.max(axis=0)
            pieces[..., MAXIMUM] -= moves.min(axis=0)
            still.append((pieces, real))
        self._pending = still

    def leave(self, active: Flags, lower: Floats, upper: Floats, stack: SectionStack, history: History) -> None:
        """Add the bound of the living labels from `lower` to `upper` that leave in this step.

        Each label is replayed from the start. Labels that leave during the following steps of a group are bounded
        too, so that the number of replays does not grow with the number of steps.
        """
        lower = np.maximum(lower, self._bounded_below)
        active = active & (lower <= upper) & (lower < self._min_label(history.elapsed + 1))
        if not active.any():
            return
        below = self._min_label(history.elapsed + self._group_steps)
        upper = np.minimum(upper, below)
        self._bounded_below = np.where(active, below, self._bounded_below)
        channels, batch = len(self._laws), len(active)
        errors = history.errors_if_any
        most = PIECES if errors is None else PIECES * MAX_LEAVING_WINDOWS
        pieces, made = np.zeros((channels, batch, most, 4)), np.zeros(batch, dtype=np.int64)
        bound_leaving_all(
            active,
            lower,
            upper,
            self._settled,
            past_of(history, stack.table),
            stack.sections,
            Outlines(
                np.empty(MAX_LABELS),
                np.empty((channels, MAX_LABELS, chains.CAPACITY, 2)),
                np.empty((channels, MAX_LABELS), dtype=np.int64),
                np.empty((4, MAX_LABELS)),
            ),
            pieces,
            made,
        )
        real = np.arange(most) < made[:, None]
        if real.any():
            self.exists |= real.any(axis=1)
            self._pending.append((pieces, real))

    def _min_label(self, elapsed: int) -> float:
        """Return the minimum label, m, that is not below the range threshold after a number of steps."""
        return self._law.min_range + self._law.closing_speed * (self._law.step * elapsed)

    def _worst(self, parts: list[tuple[Floats, Flags]]) -> Floats:
        worst = np.zeros_like(self._settled)
        for pieces, real in parts:
            modulus = np.hypot.reduce(np.maximum(pieces[..., MAXIMUM], -pieces[..., MINIMUM]), axis=0)
            modulus += ROUNDING * self._law.label_max
            worst = np.maximum(worst, np.where(real, modulus, 0.0).max(axis=1))
        return worst * ((1.0 + self._speed_error) * (1.0 + SLACK))
