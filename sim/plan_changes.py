"""Changes of plans: from the plans with the maximum misses so far to new ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from infoset.arrays import Floats
from sim.planned_flights import ANGLE, Flown, Plans, PlanSpace, range_m

MAX_CHANGES = 3
"""Maximum number of changes from a plan to the next."""
LATE_STEPS = 12.0
"""Mean distance from the end, in steps, of the changes near the end."""


class PlanChanges:
    """Random changes of plans."""

    def __init__(self, space: PlanSpace, random: np.random.Generator) -> None:
        self._space, self._random = space, random
        self._changes: list[Callable[[Plans, int, Flown], None]] = [
            self._flip_step,
            self._flip_block,
            self._move_switch,
            self._roll,
            self._give_block,
            self._move_error,
            self._cross,
            self._move_start,
            self._move_start,
            self._move_start,
        ]
        if space.has_accelerations:
            self._changes.append(self._turn_target)

    def children(self, elite: Flown, count: int) -> Plans:
        """Return changed plans of the elite; plans with a greater miss are chosen more often."""
        ranks = np.floor(len(elite.value) * self._random.random(count) ** 2).astype(np.int64)
        plans = elite.plans.take(ranks)
        for i in range(count):
            for _ in range(int(self._random.integers(1, MAX_CHANGES + 1))):
                change = self._changes[int(self._random.integers(len(self._changes)))]
                change(plans, i, elite)
        plans.changes[:] += 1
        return plans

    def _last_step(self, plans: Plans, i: int) -> int:
        """Return the last step before the closest approach of a start, plus one."""
        x, vx = float(range_m(plans.start[i])), float(plans.start[i, -1])
        return min(self._space.steps - 1, int(x / (-vx * self._space.scenario.set_model.step_s)) + 1)

    def _step(self, plans: Plans, i: int) -> int:
        """Return a random step: anywhere or near the end, with equal probability."""
        last = self._last_step(plans, i)
        if self._random.random() < 0.5:
            return int(self._random.integers(last + 1))
        return max(0, last - int(self._random.exponential(LATE_STEPS)))

    def _span(self, plans: Plans, i: int) -> slice:
        """Return a random block of steps; short ones are more frequent."""
        begin = self._step(plans, i)
        return slice(begin, begin + 1 + int(10.0 ** self._random.uniform(0.0, 2.0)))

    def _some_axes(self) -> slice:
        """Return one lateral axis or both."""
        return slice(0, 1) if self._space.axes == 1 else slice(*((0, 1), (1, 2), (0, 2))[int(self._random.integers(3))])

    def _angle_errors(self, plans: Plans, i: int) -> Floats:
        """Return the errors of the angles along one axis or both, a view of shape (1 or 2, steps)."""
        return np.asarray(plans.sequence[i, ANGLE, self._some_axes()])

    def _flip_step(self, plans: Plans, i: int, elite: Flown) -> None:
        self._angle_errors(plans, i)[:, self._step(plans, i)] *= -1.0

    def _flip_block(self, plans: Plans, i: int, elite: Flown) -> None:
        self._angle_errors(plans, i)[:, self._span(plans, i)] *= -1.0

    def _move_switch(self, plans: Plans, i: int, elite: Flown) -> None:
        """Move one switching time by a few steps; if both axes are moved, one of the first."""
        errors = self._angle_errors(plans, i)
        signs = np.sign(errors[0, : self._last_step(plans, i) + 1])
        switches = np.flatnonzero(np.diff(signs))
        if switches.size:
            at, by = int(self._random.choice(switches)), int(self._random.integers(1, 5))
            if self._random.random() < 0.5:
                errors[:, at + 1 : at + 1 + by] *= -1.0
            else:
                errors[:, max(0, at + 1 - by) : at + 1] *= -1.0

    def _roll(self, plans: Plans, i: int, elite: Flown) -> None:
        """Move the whole plan by a few steps."""
        by = int(self._random.choice([-3, -2, -1, 1, 2, 3]))
        plans.sequence[i] = np.roll(plans.sequence[i], by, axis=-1)
        plans.prescribed[i] = np.roll(plans.prescribed[i], by)
        plans.sides[i] = np.roll(plans.sides[i], by, axis=-1)

    def _give_block(self, plans: Plans, i: int, elite: Flown) -> None:
        """Prescribe the errors of a block, or let the noise keep extremes there."""
        span = self._span(plans, i)
        if plans.prescribed[i, span].all():
            plans.prescribed[i, span] = False
        else:
            plans.prescribed[i, span] = True
            anything = self._random.uniform(-1.0, 1.0)
            plans.sequence[i, ..., span] = self._random.choice(
                [-1.0, 0.0, 1.0, anything], (len(self._space.names), self._space.axes, 1)
            )

    def _move_error(self, plans: Plans, i: int, elite: Flown) -> None:
        """Change the size of the prescribed errors of a block."""
        span = self._span(plans, i)
        moved = plans.sequence[i, ..., span] + 10.0 ** self._random.uniform(-2.0, 0.0) * self._random.normal(
            size=(len(self._space.names), self._space.axes, 1)
        )
        prescribed = plans.prescribed[i, span]
        plans.sequence[i, ..., span] = np.where(prescribed, np.clip(moved, -1.0, 1.0), plans.sequence[i, ..., span])

    def _cross(self, plans: Plans, i: int, elite: Flown) -> None:
        """Replace the end of the plan by that of another plan of the elite."""
        other, begin = int(self._random.integers(len(elite.value))), self._step(plans, i)
        for mine, others in (
            (plans.sequence, elite.plans.sequence),
            (plans.prescribed, elite.plans.prescribed),
            (plans.sides, elite.plans.sides),
        ):
            mine[i, ..., begin:] = others[other, ..., begin:]

    def _move_start(self, plans: Plans, i: int, elite: Flown) -> None:
        """Move the start in some coordinates or in all, or set some coordinates to an end."""
        width = self._space.upper - self._space.lower
        which = self._random.random(len(width)) < self._random.choice([0.25, 1.0])
        moved = plans.start[i] + width * 10.0 ** self._random.uniform(-5.0, -0.5) * self._random.normal(size=len(width))
        if self._random.random() < 0.1:
            moved = np.where(self._random.random(len(width)) < 0.5, self._space.lower, self._space.upper)
        plans.start[i] = np.clip(np.where(which, moved, plans.start[i]), self._space.lower, self._space.upper)

    def _turn_target(self, plans: Plans, i: int, elite: Flown) -> None:
        """Give the target's acceleration another sign in a block, or from a step on, along one axis or both."""
        span, axes = self._span(plans, i), self._some_axes()
        if self._random.random() < 0.5:
            span = slice(span.start, None)
        plans.sides[i, axes, span] = self._random.choice([-1.0, 0.0, 1.0])
