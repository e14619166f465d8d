"""Branch of extremals: the distance l that the evader keeps at a time T, followed as T grows.

At T -> 0 nu is the line of sight and l the distance, so no guess is needed. Capture is where l has
fallen to the capture radius: l above it before then excludes an earlier capture on this branch.
Nondimensional.

Wang's slides shoot forward from a guess instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.pursuit_evasion._pair import FINE, MAX_RESIDUAL, ROUGH, Node, Pair

_LONGEST_STEP = 0.3
"""Longest step of the duration: 20 in a revolution. Chosen: capture times of `leo-pursuit` and
`geo-pursuit` are the same to 1e-6 s from 0.075 to 1.2 (measured)."""
_SHORTEST_STEP = 1e-6
"""Shortest step of the duration: a branch that needs a shorter one has a fold."""
_PREDICTED_WITHIN = 3e-3
"""Error of a predicted extremal for which steps are chosen: two or three iterations correct it. The
capture times of `_LONGEST_STEP` are the same from 7.5e-4 to 1.2e-2 (measured)."""
_TRACKED = 1e-7
"""Tolerance of the propagation of extremals before the capture: a thousandth of the corrections
that are accepted (`ROUGH`). Captures, and their times, are polished with `FINE`, and do not depend
on it."""

MAX_WORK = 20_000.0
"""Maximum sum of the durations of all extremals that are propagated, in radians. It is enough to
follow a branch to a duration of 15 revolutions in 28 steps a revolution: 420 extremals of 47
radians on average. That takes seconds."""


class Ending(Enum):
    """Reason for the end of a branch."""

    CAPTURE = "capture"
    TIME = "time"
    FOLD = "fold"
    WORK = "work"
    """The work limit is reached."""


@dataclass(frozen=True)
class Branch:
    """A branch of extremals.

    The `nodes` are in ascending order of duration, and `work` is the radians of extremals
    propagated.
    """

    nodes: tuple[Node, ...]
    ending: Ending
    work: float

    @property
    def last(self) -> Node:
        """The last extremal."""
        return self.nodes[-1]


def follow(
    pair: Pair, first: Node, radius: float, latest: float, max_work: float = MAX_WORK
) -> Branch:
    """Follow a branch as the duration grows, to the capture, to `latest`, or to a fold.

    A `radius` of minus infinity follows the branch beyond the capture. `max_work` limits the
    radians of extremals propagated: the same limit on every machine. A capture that ends the branch
    is computed to full precision; whether it is a saddle is not checked. Some 20 steps a
    revolution, of two or three iterations each.
    """
    nodes = [first]
    step = first.duration
    work = 0.0
    while work < max_work:
        node = nodes[-1]
        left = latest - node.duration
        if left <= _SHORTEST_STEP:
            return Branch(tuple(nodes), Ending.TIME, work)
        # No tiny last step.
        step = left if step > 0.9 * left else step
        work += node.duration + step

        guess = _predicted(nodes, node.duration + step)
        after = pair.solve(
            guess,
            node.duration + step,
            node.distance - step * node.closing,
            time_free=False,
            tolerance=_TRACKED,
            linear_tolerance=_TRACKED,
            close=ROUGH,
        )

        # The error of a prediction of order three is as the fourth power of the step. A prediction
        # that missed by up to 8 times the wanted error is used; a worse one is repeated with a
        # shorter step. The factors 0.9, 2 and 0.4 of the step are chosen.
        missed = math.inf if after is None else float(np.abs(after.vector - guess).max())
        if after is not None and pair.is_sound(after) and missed <= 8.0 * _PREDICTED_WITHIN:
            at = first_crossing(node, after, radius)
            if at is None:
                nodes.append(after)
                # 1e-12 only avoids a division by zero: the growth is limited to 2.
                growth = 0.9 * (_PREDICTED_WITHIN / max(missed, 1e-12)) ** 0.25
                step = min(_LONGEST_STEP, step * min(2.0, growth))
                continue
            capture = polish(pair, _predicted(nodes, at), at, radius, latest)
            # The capture of this step, not a later one; if it is not found, a shorter step follows.
            if (
                capture is not None
                and node.duration < capture.duration <= after.duration + _SHORTEST_STEP
            ):
                return Branch((*nodes, capture), Ending.CAPTURE, work)

        if step < _SHORTEST_STEP:
            return Branch(tuple(nodes), Ending.FOLD, work)
        step *= 0.4
    return Branch(tuple(nodes), Ending.WORK, work)


def polish(pair: Pair, guess: Floats, duration: float, radius: float, latest: float) -> Node | None:
    """Return the capture near a guess, shape (15,), at full precision, or None.

    None stands for a failure of Newton's method, or a residual above `MAX_RESIDUAL`.
    """
    rough = pair.solve(guess, duration, radius, time_free=True, tolerance=FINE, latest=latest)
    if rough is None:
        return None
    # Once more, linearised at the solution itself: for its costates, curvature and residual.
    fine = pair.solve(
        rough.vector,
        rough.duration,
        radius,
        time_free=True,
        tolerance=FINE,
        linear_tolerance=FINE,
        latest=latest,
    )
    if fine is None or not fine.residual < MAX_RESIDUAL:
        return None
    return fine


def first_crossing(before: Node, after: Node, radius: float) -> float | None:
    """Return the time at which l first falls to a radius between two extremals, or None.

    It is computed from the cubic through both; `before` is above the radius. If `after` is not, and
    the cubic has no root between them, it is the time of `after`.
    """
    step = after.duration - before.duration
    # Between its ends a cubic falls below the lower one by at most 4/27 of its slopes times the
    # step.
    dip = 4.0 / 27.0 * step * (abs(before.closing) + abs(after.closing))
    if min(before.distance, after.distance) - dip > radius:
        return None

    rise = (after.distance - before.distance) / step
    a = -before.closing
    b = -after.closing
    cubic = np.array(
        [
            (a + b - 2.0 * rise) / step**2,
            (3.0 * rise - 2.0 * a - b) / step,
            a,
            before.distance - radius,
        ]
    )
    # Real roots can have imaginary parts of the size of rounding.
    times = [
        float(root.real)
        for root in np.roots(cubic)
        if abs(root.imag) < 1e-9 and 0.0 < root.real < step
    ]
    if not times and after.distance > radius:
        return None
    return before.duration + min([*times, step])


def _predicted(nodes: list[Node], duration: float) -> Floats:
    """Extrapolate (pursuer, evader, nu) by the cubic through the last two extremals and slopes.

    A single extremal is extrapolated by its slope.
    """
    node = nodes[-1]
    step = duration - node.duration
    guess = node.vector + step * node.slope
    if len(nodes) == 1:
        return guess
    before = nodes[-2]
    apart = node.duration - before.duration
    mean_slope = (node.vector - before.vector) / apart
    second = (node.slope - mean_slope) / apart
    third = (node.slope - 2.0 * mean_slope + before.slope) / apart**2
    return np.asarray(guess + step * step * (second + (step + apart) * third))
