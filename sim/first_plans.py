"""First plans of a search for the worst engagement."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from guidance import TieRule
from infoset.arrays import Floats
from sim.planned_flights import Plans, PlanSpace, range_m


class FirstPlans:
    """First plans of a search.

    Attributes
    ----------
    constructions : list of str
        Construction of each plan so far, by lineage.
    """

    def __init__(self, space: PlanSpace, random: np.random.Generator) -> None:
        self._space, self._random = space, random
        self.constructions: list[str] = []

    def make(self, count: int) -> list[tuple[Plans, TieRule | None]]:
        """Return `count` first plans, in equal numbers for each construction, with the tie rule of game noise."""
        makers: list[tuple[str, TieRule | None, Callable[[int, Floats], tuple[Floats, bool]]]] = [
            *((f"game noise, tie {tie.value}", tie, self._coins) for tie in TieRule),
            ("extremes kept in random order", None, self._coins),
            ("extremes kept in blocks", None, self._blocks),
            ("extremal errors in blocks", None, self._extremal),
            ("constant bias", None, self._constant),
            ("middle of a pair", None, self._pair),
        ]
        space = self._space
        shares = [len(part) for part in np.array_split(np.arange(count), len(makers))]
        plans: list[tuple[Plans, TieRule | None]] = []
        for (name, tie, maker), share in zip(makers, shares, strict=True):
            if share == 0:
                continue
            start = self._starts(share)
            angle, prescribed = maker(share, start)
            others = self._random.choice([-1.0, 0.0, 1.0], (share, len(space.names) - 1, space.axes, 1))
            others = np.repeat(others, space.steps, axis=3)
            sequence = np.concatenate([angle[:, None], others], axis=1)
            lineage = len(self.constructions) + np.arange(share)
            self.constructions += [name] * share
            none = np.zeros(share, dtype=np.int64)
            all_steps = np.full((share, space.steps), prescribed)
            plans.append((Plans(start, sequence, all_steps, self._sides(share, tie), lineage, none), tie))
        return plans

    def _sides(self, count: int, tie: TieRule | None) -> Floats:
        """Return signs of the target's acceleration: constant, in blocks, or increasing the miss.

        Game noise with a shift knows a constant sign.
        """
        sides = np.ones((count, self._space.axes, self._space.steps))
        if not self._space.has_accelerations:
            return sides
        kinds = (
            self._random.choice(["constant", "blocks", "increasing"], count) if tie is None else ["constant"] * count
        )
        for i, kind in enumerate(kinds):
            if kind == "blocks":
                sides[i] = self._blocks(1, sides)[0]
            else:
                sides[i] = self._random.choice([-1.0, 1.0], (self._space.axes, 1)) if kind == "constant" else 0.0
        return sides

    def _starts(self, count: int) -> Floats:
        """Return starts in B x D; in a quarter of them, some coordinates are at an end of their interval."""
        share = self._random.random((count, len(self._space.lower)))
        at_end = (self._random.random(share.shape) < 0.5) & (self._random.random((count, 1)) < 0.5)
        return self._space.lower + (self._space.upper - self._space.lower) * np.where(at_end, np.round(share), share)

    def _coins(self, count: int, start: Floats) -> tuple[Floats, bool]:
        return self._random.choice([-1.0, 1.0], (count, self._space.axes, self._space.steps)), False

    def _blocks(self, count: int, start: Floats) -> tuple[Floats, bool]:
        one = (count, self._space.axes, 1)
        switches = self._random.random((*one[:2], self._space.steps)) < 10.0 ** self._random.uniform(-2.5, -0.5, one)
        return self._random.choice([-1.0, 1.0], one) * (-1.0) ** np.cumsum(switches, axis=2), False

    def _extremal(self, count: int, start: Floats) -> tuple[Floats, bool]:
        return self._blocks(count, start)[0], True

    def _constant(self, count: int, start: Floats) -> tuple[Floats, bool]:
        return np.repeat(self._random.uniform(-1.0, 1.0, (count, self._space.axes, 1)), self._space.steps, axis=2), True

    def _pair(self, count: int, start: Floats) -> tuple[Floats, bool]:
        """Return errors that show the middle between the true motion and another straight one.

        Shortly before the end the two are two bounds apart and can be distinguished; after that the measurements are
        exact. In space, the two differ along both axes.
        """
        model = self._space.scenario.set_model
        step_s = model.step_s
        x, closing = range_m(start)[:, None, None], -start[:, -1, None, None]
        ranges = np.maximum(x - closing * step_s * np.arange(self._space.steps), 0.0)
        bound = ranges * np.concatenate(
            [model.angle_sensor.axis(axis).error_bound(ranges) for axis in model.axes], axis=1
        )
        time_left = self._random.uniform(1.0, 12.0, (count, 1, 1)) * step_s
        apart_at = np.clip(np.round((x / closing - time_left) / step_s), 1, self._space.steps - 1).astype(int)
        begin = self._random.uniform(-1.0, 1.0, (count, self._space.axes, 1)) * bound[..., :1]
        end = self._random.choice([-1.0, 1.0], (count, self._space.axes, 1)) * np.take_along_axis(
            bound, np.repeat(apart_at, self._space.axes, axis=1), axis=2
        )
        half = begin + (end - begin) * np.arange(self._space.steps) / apart_at
        errors = np.divide(half, bound, out=np.zeros_like(half), where=bound > 0.0)
        return np.where(np.arange(self._space.steps) <= apart_at, np.clip(errors, -1.0, 1.0), 0.0), True
