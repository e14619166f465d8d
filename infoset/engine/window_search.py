"""Search for a feasible label if a rate was measured: the feasible labels need not form an
interval.

All labels are covered with windows, see `section_window`. A window in which no label is feasible
under the bands that are convex on it contains none under the exact bands either.
"""

from __future__ import annotations

import numpy as np

from infoset._compile import allocation_free
from infoset.arrays import Floats
from infoset.engine.label_search import (
    FIRST,
    LAST,
    MIDDLE,
    NARROWEST,
    order_bracket,
    search_bracket,
)
from infoset.engine.replays import empties_later, evaluate_label, run
from infoset.engine.section_life import NEVER_EMPTIED
from infoset.engine.workspace import MAX_HALVED_WINDOWS, Past, with_window


@allocation_free
def search_window(near: float, far: float, past: Past) -> bool:
    """Return whether a label of a window is feasible with the bands that are convex on it.

    If so, it is the middle label of the bracket in the workspace afterwards.
    """
    bracket = past.room.bracket
    window = with_window(past, near, far)
    for i, label in ((MIDDLE, 0.5 * (near + far)), (FIRST, near), (LAST, far)):
        if evaluate_label(bracket, i, label, window):
            bracket[MIDDLE] = bracket[i]
            return True
    order_bracket(window)
    return search_bracket(window)


@allocation_free
def take_window(past: Past, count: int) -> tuple[float, float]:
    """Remove the window whose labels empty last from `count` windows, at least one; return its
    limits, m.

    The last window takes its place: `count` - 1 are left.
    """
    windows = past.room.windows
    best = 0
    for i in range(1, count):
        if empties_later(windows[i], windows[best]):
            best = i
    near = windows[best].near
    far = windows[best].far
    windows[best] = windows[count - 1]
    return near, far


@allocation_free
def search_windows(
    lower: float, upper: float, past: Past, errors: Floats | None
) -> tuple[bool, float]:
    """Find a feasible label from `lower` to `upper`; return whether one was found, and the label,
    m.

    A window without feasible labels under its convex bands is discarded. The others are halved
    until they are as narrow as `NARROWEST`, beginning with the window in which an evaluated label
    empties last with its own bands. Windows as narrow as that, and those left after
    `MAX_HALVED_WINDOWS`, may still contain feasible labels. `past` has the window of a single
    label.

    Without rates no search is necessary. `errors` are the error bounds of the measured rates, an
    argument as in `replay`.
    """
    if errors is None:
        return False, lower
    windows = past.room.windows
    windows[0].near = lower
    windows[0].far = upper
    count = 1
    for _ in range(MAX_HALVED_WINDOWS):
        if count == 0:
            break
        near, far = take_window(past, count)
        count -= 1
        middle = 0.5 * (near + far)
        for half_near, half_far in ((near, middle), (middle, far)):
            if not search_window(half_near, half_far, past):
                continue
            new = windows[count]
            new.near = half_near
            new.far = half_far
            # Emptied before every event: the first of the labels below replaces it.
            new.emptied_at = -1
            new.overlap = -np.inf
            for label in (past.room.bracket[MIDDLE].label, half_near, half_far):
                emptying = run(label, past)
                if emptying.emptied_at == NEVER_EMPTIED:
                    return True, label
                if empties_later(emptying, new):
                    new.emptied_at = emptying.emptied_at
                    new.overlap = emptying.overlap
            count += half_far - half_near > NARROWEST * half_far
    return False, lower
