"""Plans of an adversary (start, errors and target of each engagement), and random changes of them.

All probabilities and sizes of changes are chosen: with other values a search finds other
engagements, which are as valid.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, fields
from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.engine.predicted_miss import PredictedMiss
from infoset.guidance import GameNoise, TieRule
from infoset.guidance.noise import draws_of_step
from infoset.sensors import BearingSensor, Sensor
from infoset.sim.scenario import Manoeuvre, Scenario, corners
from infoset.sim.target import amplitudes_m_s2

MAX_CHANGES = 3
"""Maximum number of changes from a plan to the next; chosen: see the numbers of `adversary`."""
LATE_STEPS = 12.0
"""Mean distance from the end, in steps, of the changes near the end; chosen: see `adversary`."""
ANGLE = 0
"""Row of the errors of the angles."""


@dataclass(frozen=True)
class Plans:
    """Plans of n engagements.

    Parameters
    ----------
    start : ndarray, shape (n, 4) or (n, 6)
        (z, x, V_z, V_x) at t = 0, m and m/s; (y, z, x, V_y, V_z, V_x) in space.
    errors : ndarray, shape (n, rows, axes, steps)
        Measurement errors in units of their bounds, one row per sensor, for each lateral axis. A
        sensor that does not measure by axis uses the first.
    sides : ndarray, shape (n, axes, steps)
        Sign of the target's acceleration.
    lineage, changes : ndarray of int, shape (n,)
        Index of the first plan from which a plan was derived, and number of plans from that one to
        this, each with up to `MAX_CHANGES` changes of the one before.
    value : ndarray, shape (n,)
        Value that the search maximises, m; -inf if the engagement does not count. Before it is
        simulated, a first plan has -inf and another one the value of the plan before it.
    """

    start: Floats
    errors: Floats
    sides: Floats
    lineage: Integers
    changes: Integers
    value: Floats

    def __len__(self) -> int:
        return len(self.start)

    def take(self, which: Integers | slice) -> Plans:
        """Return copies of some plans."""
        return Plans(*(getattr(self, field.name)[which].copy() for field in fields(self)))

    def join(self, other: Plans) -> Plans:
        """Return these plans and others."""
        return joined([self, other])


def joined(parts: Sequence[Plans]) -> Plans:
    """Return the plans of all parts."""
    columns = ([getattr(part, field.name) for part in parts] for field in fields(Plans))
    return Plans(*map(np.concatenate, columns))


@dataclass(frozen=True)
class Constructions:
    """How game noise chooses the errors of the angles of n first plans.

    Parameters
    ----------
    choices : ndarray, shape (n, axes, steps)
        The upper extreme where not negative: at ties, or at every step.
    at_every_step : ndarray of bool, shape (n,)
        Whether the extreme is kept at every step, and not only at ties.
    shift_side : ndarray, shape (n,)
        Side to which a shift moves the true state, 1 or -1; 0 if the rule for ties has no shift.
    """

    choices: Floats
    at_every_step: Flags
    shift_side: Floats

    def take(self, which: Integers | slice) -> Constructions:
        """Return the constructions of some plans."""
        return Constructions(*(getattr(self, field.name)[which] for field in fields(self)))

    def noise(self, shift_m: Floats | None, target_side: Floats | None) -> GameNoise:
        """Return the noise of a batch; `GameNoise` describes the arguments."""
        # At a tie the rule RANDOM takes the extreme from the draws, which are the choices here.
        return _ConstructedNoise(
            TieRule.RANDOM,
            by_axis(self.choices),
            shift_m,
            target_side,
            at_every_step=self.at_every_step,
            shift_side=self.shift_side,
        )


@dataclass(frozen=True)
class _ConstructedNoise(GameNoise):
    """Game noise with the rules of `Constructions`, which differ by engagement."""

    _: KW_ONLY
    at_every_step: Flags
    shift_side: Floats

    @property
    def truth_side(self) -> Floats:
        """Side to which a shift moves the true state, shape (B,) or (C, B); 0 for the constructions
        without one.

        It is 0 too if `shift_m` is None. If the target keeps its side, it is that side instead of
        `shift_side`.
        """
        side = np.zeros_like(self.shift_side) if self.shift_m is None else self.shift_side
        if self.target_side is None:
            return side
        return np.where(side == 0.0, 0.0, self.target_side)

    def _upper_is_worse(self, miss: PredictedMiss, step: int) -> Flags:
        chosen = draws_of_step("choices", self.tie_draws, step, miss.upper_m.shape) >= 0.0
        return np.where(self.at_every_step, chosen, super()._upper_is_worse(miss, step))


def by_axis(values: Floats, sensor: Sensor | None = None) -> Floats:
    """Return values of n engagements along C lateral axes, shape (n, C, ...), with the axis first.

    The shape is then (C, n, ...), as engagements take them. A sensor that does not measure by axis
    has those of the first axis, shape (n, ...); None is the angle sensor. The result is a view.
    """
    if sensor is None or sensor.is_lateral:
        return np.moveaxis(values, 1, 0)
    return values[:, 0]


class _Maker(NamedTuple):
    """A construction of first plans: its name, rule for ties, and random choices.

    The rule None keeps the chosen extremes at every step.
    """

    name: str
    tie: TieRule | None
    draw_choices: Callable[[int], Floats]


class Planner:
    """Random plans of a scenario whose flights have `steps` steps.

    In the guaranteed model the target accelerates at the bound of the model, or at the bound of the
    scenario's target if it is greater. In the model `paper` the disturbance is fictitious.

    Attributes
    ----------
    sensors : tuple of Sensor
        Sensors of the rows of the errors, the angle sensor first.
    acceleration_m_s2 : ndarray, shape (axes,)
        Acceleration of the target along each axis, m/s^2; zero leaves the target of the scenario.
    constructions : list of str
        Construction of each first plan so far, by lineage.
    """

    def __init__(self, scenario: Scenario, steps: int, seed: int) -> None:
        model = scenario.set_model
        target = scenario.target
        self._model = model
        self._steps = steps
        self._random = np.random.default_rng(seed)
        others = [sensor for name, sensor in scenario.sensors.items() if name != BearingSensor.name]
        self.sensors: tuple[Sensor, ...] = (scenario.bearing_sensor, *others)
        # Minimum and maximum start, ordered and in units as `Plans.start`.
        self._lower, self._upper = corners(model.bounds)
        self._axes = len(model.axes)

        self.acceleration_m_s2: Floats = np.zeros(self._axes)
        if model.is_guaranteed:
            bounds = [model.axis(axis).disturbance_m_s2 for axis in model.axes]
            self.acceleration_m_s2 = np.array(bounds)
            if target is not None and target.manoeuvre is not Manoeuvre.NONE:
                amplitudes = amplitudes_m_s2(target, self._axes)
                self.acceleration_m_s2 = np.maximum(self.acceleration_m_s2, amplitudes)

        self.constructions: list[str] = []
        # The order and the number are part of what a seed means, and so are the probabilities and
        # sizes in the changes below, which are chosen: another number gives other plans.
        # Moves of the start are listed three times: they are chosen three times as often.
        self._changes: list[Callable[[Plans, int], None]] = [
            self._flip,
            self._move_switch,
            self._give_block,
            self._move_error,
            self._move_start,
            self._move_start,
            self._move_start,
        ]
        if self.acceleration_m_s2.any():
            self._changes.append(self._turn_target)

    def first(self, count: int) -> tuple[Plans, Constructions]:
        """Return first plans and their constructions.

        The numbers of plans of the constructions differ by at most one.
        """
        makers = [
            *(_Maker(f"game noise, tie {tie.value}", tie, self._coins) for tie in TieRule),
            _Maker("extremes kept in random order", None, self._coins),
            _Maker("extremes kept in blocks", None, self._blocks),
        ]
        shares = [len(part) for part in np.array_split(np.arange(count), len(makers))]
        plans: list[Plans] = []
        constructions: list[Constructions] = []
        for maker, share in zip(makers, shares, strict=True):
            made = self._made(maker, share)
            plans.append(made)
            constructions.append(self._construction(maker.tie, made.errors[:, ANGLE]))

        columns = (
            [getattr(c, field.name) for c in constructions] for field in fields(Constructions)
        )
        return joined(plans), Constructions(*map(np.concatenate, columns))

    def _made(self, maker: _Maker, count: int) -> Plans:
        """Return a number of first plans of one construction, and add them to `constructions`.

        The errors of the angles are the choices of `Constructions` until game noise replaces them;
        the other errors are zero.
        """
        errors = np.zeros((count, len(self.sensors), self._axes, self._steps))
        errors[:, ANGLE] = maker.draw_choices(count)
        # Game noise with a shift knows the sign of a constant acceleration.
        in_blocks = (self._random.random((count, 1, 1)) < 0.5) & (maker.tie is None)
        sides = np.where(in_blocks, self._blocks(count), self._coins(count)[:, :, :1])
        lineage = len(self.constructions) + np.arange(count)
        self.constructions += [maker.name] * count
        return Plans(
            start=self._starts(count),
            errors=errors,
            sides=sides,
            lineage=lineage,
            changes=0 * lineage,
            value=np.full(count, -np.inf),
        )

    def _construction(self, tie: TieRule | None, drawn: Floats) -> Constructions:
        """Return game noise with a rule for ties, and for None with the drawn extremes.

        Only the rules UPPER and LOWER have a shift.
        """
        count = len(drawn)
        choices = drawn.copy()
        side = 0.0
        # The shift moves the true state away from the extreme that is kept at ties.
        if tie is TieRule.UPPER:
            side = -1.0
            choices[:] = 1.0
        elif tie is TieRule.LOWER:
            side = 1.0
            choices[:] = -1.0
        elif tie is TieRule.ALTERNATE:
            choices[:] = np.where(np.arange(self._steps) % 2 == 0, 1.0, -1.0)
        return Constructions(choices, np.full(count, tie is None), np.full(count, side))

    def children(self, elite: Plans, count: int) -> Plans:
        """Return changed copies of plans of the elite, which is in descending order of value.

        Plans with a greater value are chosen more often.
        """
        # The square of a uniform number is small more often: rank 0 has the greatest value.
        ranks = np.floor(len(elite) * self._random.random(count) ** 2).astype(np.int64)
        plans = elite.take(ranks)
        for i in range(count):
            for _ in range(int(self._random.integers(1, MAX_CHANGES + 1))):
                change = self._changes[int(self._random.integers(len(self._changes)))]
                change(plans, i)
        plans.changes[:] += 1
        return plans

    def _starts(self, count: int) -> Floats:
        """Return starts in B x D.

        In half of them, each coordinate is at an end of its interval with the probability one half.
        """
        share = self._random.random((count, len(self._lower)))
        at_end = (self._random.random(share.shape) < 0.5) & (self._random.random((count, 1)) < 0.5)
        return self._lower + (self._upper - self._lower) * np.where(at_end, np.round(share), share)

    def _coins(self, count: int) -> Floats:
        """Return independent signs for each step."""
        return np.asarray(self._random.choice([-1.0, 1.0], (count, self._axes, self._steps)))

    def _blocks(self, count: int) -> Floats:
        """Return signs that switch at random, between once in 300 and once in 3 steps."""
        uniform = self._random.random((count, self._axes, self._steps))
        frequency = 10.0 ** self._random.uniform(-2.5, -0.5, (count, self._axes, 1))
        switches = uniform < frequency
        first = self._random.choice([-1.0, 1.0], (count, self._axes, 1))
        return np.asarray(first * (-1.0) ** np.cumsum(switches, axis=2))

    def _last_step(self, plans: Plans, i: int) -> int:
        """Return the last step before the closest approach of a start, plus one."""
        # x comes after the lateral axes, and V_x is last.
        x = float(plans.start[i, self._axes])
        vx = float(plans.start[i, -1])
        return min(self._steps - 1, int(x / (-vx * self._model.step_s)) + 1)

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
        if self._axes == 1:
            return slice(0, 1)
        first, end = ((0, 1), (1, 2), (0, 2))[int(self._random.integers(3))]
        return slice(first, end)

    def _flip(self, plans: Plans, i: int) -> None:
        """Change the sign of the errors of the angles in a block."""
        plans.errors[i, ANGLE, self._some_axes(), self._span(plans, i)] *= -1.0

    def _move_switch(self, plans: Plans, i: int) -> None:
        """Move one switching time by one to four steps; without a switch, change nothing.

        If both axes are chosen, the switch is one of the first axis, and the errors of both change
        their sign in these steps.
        """
        errors = plans.errors[i, ANGLE, self._some_axes()]
        signs = np.sign(errors[0, : self._last_step(plans, i) + 1])
        switches = np.flatnonzero(np.diff(signs))
        if not switches.size:
            return
        begin = int(self._random.choice(switches)) + 1
        by = int(self._random.integers(1, 5))
        if self._random.random() < 0.5:
            errors[:, begin : begin + by] *= -1.0
        else:
            errors[:, max(0, begin - by) : begin] *= -1.0

    def _give_block(self, plans: Plans, i: int) -> None:
        """Set the errors of all sensors in a block, to one value for each sensor and axis."""
        values = [-1.0, 0.0, 1.0, self._random.uniform(-1.0, 1.0)]
        plans.errors[i, ..., self._span(plans, i)] = self._random.choice(
            values, (len(self.sensors), self._axes, 1)
        )

    def _move_error(self, plans: Plans, i: int) -> None:
        """Add a constant to the errors of each sensor and axis in a block, within their bounds."""
        errors = plans.errors[i, ..., self._span(plans, i)]
        deviation = 10.0 ** self._random.uniform(-2.0, 0.0)
        by = self._random.normal(0.0, deviation, (len(self.sensors), self._axes, 1))
        errors[:] = np.clip(errors + by, -1.0, 1.0)

    def _move_start(self, plans: Plans, i: int) -> None:
        """Move the start in some coordinates or in all, or set some coordinates to an end."""
        width = self._upper - self._lower
        which = self._random.random(len(width)) < self._random.choice([0.25, 1.0])
        size = 10.0 ** self._random.uniform(-5.0, -0.5)
        moved = plans.start[i] + width * size * self._random.normal(size=len(width))
        if self._random.random() < 0.1:
            moved = np.where(self._random.random(len(width)) < 0.5, self._lower, self._upper)
        plans.start[i] = np.clip(np.where(which, moved, plans.start[i]), self._lower, self._upper)

    def _turn_target(self, plans: Plans, i: int) -> None:
        """Change the sign of the target's acceleration in a block, or from a step on."""
        span = self._span(plans, i)
        if self._random.random() >= 0.5:
            span = slice(span.start, None)
        plans.sides[i, self._some_axes(), span] = self._random.choice([-1.0, 1.0])
