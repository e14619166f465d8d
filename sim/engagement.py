"""The closed loop: a batch of engagements, step by step against the true motion."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats, some
from infoset.engine.predicted_miss import PredictedMiss
from infoset.guidance import (
    GameNoise,
    LineOfSight,
    MeasurementNoise,
    NoiseKind,
    RandomNoise,
    Situation,
    Strategy,
    make_strategy,
)
from infoset.guidance.gaussian_noise import gaussian_noise
from infoset.guidance.noise import NoiseSource, checked_measurements
from infoset.guidance.strategy import checked_impulses
from infoset.guidance.thruster import MIN_FLOAT, modulus
from infoset.information_set import InformationSet, InformationSetView
from infoset.sensors import BearingSensor, Measurements
from infoset.set_queries import MaskedFloats, MaskedIntegers
from infoset.sim.closed_form import worst_shift_m
from infoset.sim.draws import Draws
from infoset.sim.gravity import on_board_model
from infoset.sim.kepler import KeplerMotion, Sight
from infoset.sim.label_ends import LabelEnds
from infoset.sim.miss_cause import DecisionLog
from infoset.sim.results import Outcome, Results
from infoset.sim.scenario import Scenario
from infoset.sim.target import acceleration_m_s2, constant_side
from infoset.sim.truth_section import TruthSection

Pending = tuple[tuple[float, Floats], ...]
"""Impulses that are decided and not given yet: times from now, s, and impulses, m/s."""


@dataclass(frozen=True)
class Step:
    """One step of a batch, after the decision and before the impulse.

    Angles, rates, predicted misses and impulses have the shape (C, B), for C lateral axes.

    Parameters
    ----------
    tracking, flying : ndarray of bool, shape (B,)
        Engagements that still measure and decide, and those before their closest approach.
    measured : mapping of str to ndarray
        Values measured in this step, by sensor, shape (C, B), of ranges (B,); without the sensors
        that measured in no engagement.
    predicted_miss : PredictedMiss
        After the measurement, before the impulse.
    impulse_m_s : ndarray, shape (C, B)
        Impulses of the thruster, before errors of execution.
    information : InformationSetView
        The set after the measurement.
    """

    step: int
    time_s: float
    tracking: Flags
    flying: Flags
    sight: Sight
    measured: Measurements
    predicted_miss: PredictedMiss
    impulse_m_s: Floats
    information: InformationSetView


class Engagements:
    """A batch of engagements in flight.

    `strategy`, `truth`, `noise` and `target_m_s2`, shape (C, B, steps), replace the strategy, the
    Kepler motion, the measurement noise and the accelerations of the targets of the scenario.
    `guarantee` computes the bound Phi in the guaranteed model; a run takes 1.1 to 1.9 times as
    long, with a rate sensor 1.4 to 9 times.

    One step: measure and cut, decide, shift, drop labels below the threshold, predict; then the
    true motion advances, and its closest approach is detected. Of the true motion, the strategy
    gets the measurements only.
    """

    def __init__(
        self,
        scenario: Scenario,
        draws: Draws,
        strategy: Strategy | None = None,
        truth: KeplerMotion | None = None,
        noise: NoiseSource | None = None,
        *,
        target_m_s2: Floats | None = None,
        guarantee: bool = True,
    ) -> None:
        self.scenario = scenario
        self.step = 0
        self._draws = draws
        batch = len(draws.position_m)
        self._noise = _make_noise(scenario, draws) if noise is None else _noise_of_batch(noise)
        self._target_m_s2 = target_m_s2
        self._truth = truth or KeplerMotion(draws.position_m, draws.velocity_m_s, scenario.sun)
        self._strategy = strategy or make_strategy(scenario.strategy)
        self._model = model = on_board_model(scenario)
        lateral = len(model.axes), batch
        self._state = self._strategy.start(lateral)
        self._information = InformationSet(model, batch, guarantee=guarantee)
        self._view = self._information.view()
        self._truth_section = TruthSection(model, batch)
        self._arrival_s = self._truth.arrival_s()
        self._sensors = scenario.sensors
        self._every = {
            name: model.steps_in(sensor.period_s) for name, sensor in self._sensors.items()
        }
        self._measured: dict[str, Floats] = {}
        self._seen: dict[str, Flags] = {}
        self._flying = np.ones(batch, dtype=bool)
        self._arrived = np.zeros(batch, dtype=bool)
        self._tracking = np.ones(batch, dtype=bool)
        self._miss = np.full(batch, np.inf)
        self._lateral_miss = np.zeros(lateral)
        self._budget = np.full(batch, float(scenario.thruster.budget_m_s))
        self._impulse = np.zeros(lateral)
        self._spent = np.zeros(batch, dtype=bool)
        steps = scenario.impulse_steps
        self._impulse_times_s = None if steps is None else np.array(steps) * model.step_s
        self._last_impulse_step = None if steps is None else steps[-1]
        self._number_of_burn = {
            step: i for i, step in enumerate(steps or ()) if scenario.thruster.is_scheduled
        }
        self._burns_m_s = np.zeros((batch, len(self._number_of_burn)))
        # Impulses that are decided and not given yet, one for each of the next steps.
        self._queue = [self._impulse] * scenario.thruster.delay_steps
        self._lead_s = scenario.thruster.delay_steps * model.step_s
        self._not_given = np.zeros(batch)
        self._label_ends = LabelEnds(model, batch)
        self._decisions = DecisionLog(scenario, lateral, draws.steps)

    @property
    def flying(self) -> bool:
        """Whether any true motion is before its closest approach or before x = 0, where its label
        leaves the set.
        """
        return not self._arrived.all() and self.step < self._draws.steps

    @property
    def inconsistency(self) -> tuple[MaskedIntegers, MaskedFloats]:
        """Step at which each set first became empty, and the label (m) nearest to consistency;
        masked without one.
        """
        return self._information.inconsistency

    def advance(self, observe: Callable[[Step], None] | None = None) -> None:
        """Simulate one step while `flying`; `observe` is called after the decision, before the
        impulse.
        """
        model = self.scenario.set_model
        thruster = self.scenario.thruster
        sight = self._truth.sight()
        self._tracking = self._flying & self._information.tracking
        pending = self._pending()
        measured = self._measure(sight, pending)
        miss = self._information.predicted_miss(pending)
        tracking = self._tracking = self._tracking & self._information.tracking
        situation = self._situation(miss, measured, pending)
        wanted = checked_impulses(
            self._strategy.decide(situation, self._state), situation, tracking, self._strategy
        )
        wanted = np.where(tracking & situation.may_fire, wanted, 0.0)
        if situation.may_fire:
            self._decisions.decide(self.step, tracking, self._budget, miss)
        spent = self._budget < thruster.min_impulse_m_s
        if some(spent):
            self._spent |= spent & (modulus(wanted) >= thruster.min_impulse_m_s)
        self._queue.append(thruster.give(wanted, self._budget))
        self._budget = np.maximum(self._budget - modulus(self._queue[-1]), 0.0)
        self._impulse = self._give()
        given = modulus(self._impulse)
        if self.step in self._number_of_burn:
            self._burns_m_s[:, self._number_of_burn[self.step]] = given
        if observe is not None:
            time_s = self.step * model.step_s
            flying = self._flying.copy()
            observe(
                Step(
                    self.step,
                    time_s,
                    tracking,
                    flying,
                    sight,
                    measured,
                    miss,
                    self._impulse,
                    self._view,
                )
            )
        executed = self._executed(self._impulse)
        self._truth.fire(executed)
        self._decisions.execute(self.step, executed)
        self._information.shift(self._impulse, self._flying)
        self._truth_section.shift(self._impulse, given > 0.0)
        self._label_ends.fire(self._impulse, self._flying, self.step * model.step_s)
        self._finish_labels()
        self._information.predict()
        self._truth_section.predict()
        passage = self._truth.advance(model.step_s, self._manoeuvre(sight))
        # A target that accelerates can return before x = 0, and Phi bounds the minimum distance
        # until then.
        passed = passage.passed & ~self._arrived
        if some(passed):
            self._miss = np.where(passed, passage.min_distance_m, self._miss)
            self._lateral_miss = np.where(passed, passage.lateral_m, self._lateral_miss)
        passing = self._flying & passed
        if some(passing):
            self._arrival_s = np.where(
                passing, self.step * model.step_s + passage.arrival_s, self._arrival_s
            )
            self._flying &= ~passing
        self.step += 1
        if not self._flying.all():
            # The label leaves at x = 0, which may come after the closest approach.
            self._arrived |= ~self._flying & (self._arrival_s <= self.step * model.step_s)
            self._information.stop(self._arrived)

    def truth_margins_m(self) -> list[MaskedFloats]:
        """Return the signed margins (m) of the true states in their sections, one array of shape
        (B,) per step.

        They are masked before the first measurement. Before arrival, a section is that of a motion
        without further impulses.
        """
        return self._truth_section.margins_m(self._arrivals_s())[: self.step]

    def _arrivals_s(self) -> Floats:
        """Return the times of x = 0, s, without further impulses for flights that have not
        arrived.
        """
        if not self._flying.any():
            return self._arrival_s
        ahead_s = self.step * self.scenario.set_model.step_s + self._truth.arrival_s()
        return np.where(self._flying, ahead_s, self._arrival_s)

    def _measure(self, sight: Sight, pending: Pending) -> Measurements:
        """Measure with the sensors that are due, cut the sets, and return the values of the sensors
        that measured.

        Where the image of a camera is lost, the set is cut by the other measurements.
        """
        before_s = self.scenario.nominal_arrival_s - self.step * self.scenario.set_model.step_s
        due = {
            name: sensor
            for name, sensor in self._sensors.items()
            if self.step % self._every[name] == 0 and sensor.measures_at(before_s)
        }
        self._seen = {}
        if not due or not some(self._tracking):
            return {}
        uniform = {
            name: self._draws.errors[name][..., self.step]
            for name in due
            if name in self._draws.errors
        }
        time_s = self.step * self.scenario.set_model.step_s
        asked = LineOfSight(
            self.step,
            sight.alpha_rad,
            sight.omega_rad_s,
            sight.range_m,
            due,
            pending,
            time_s,
            uniform,
        )
        measured = kept = checked_measurements(
            self._noise.measure(asked, self._view), asked, self._noise
        )
        cuts = [(measured, self._tracking)]
        camera = BearingSensor.name
        images = self._draws.images
        if images is not None and camera in measured:
            seen = images[:, self.step] >= self.scenario.set_model.angle_sensor.miss_probability
            self._seen = {name: seen if name == camera else np.ones_like(seen) for name in measured}
            others = {name: values for name, values in measured.items() if name != camera}
            kept = others | {
                camera: np.where(seen, measured[camera], self._measured.get(camera, np.nan))
            }
            cuts = [(measured, self._tracking & seen)]
            if others:
                cuts.append((others, self._tracking & ~seen))
            if not cuts[0][1].any():
                measured = others
        for values, where in cuts:
            for name, sensor in due.items():
                if name in values:
                    sensor.cut(self._information, values, where)
                    sensor.cut(self._truth_section, values, where)
            self._truth_section.store_state(where, sight)
        self._measured = self._measured | kept
        return measured

    def _executed(self, impulse: Floats) -> Floats:
        """Return the executed impulses."""
        size = self._draws.execution
        direction = self._draws.pointing
        return self.scenario.thruster.executed(
            impulse,
            None if size is None else size[:, self.step],
            None if direction is None else direction[:, self.step],
        )

    def _manoeuvre(self, sight: Sight) -> Floats | None:
        """Return the acceleration of the targets over this step; None without a target that
        manoeuvres.
        """
        if self._target_m_s2 is not None:
            return np.asarray(self._target_m_s2[:, :, self.step])
        target = self.scenario.target
        draws = self._draws.target
        if target is None or draws is None:
            return None
        # Signed misses of the true states without further impulses.
        left_s = np.maximum(self._arrival_s - self.step * self.scenario.set_model.step_s, 0.0)
        predicted = np.asarray((sight.omega_rad_s * sight.range_m - self._impulse) * left_s)
        if isinstance(self._noise, GameNoise):
            side = self._noise.truth_side
            predicted = np.where(side == 0.0, predicted, side)
        return acceleration_m_s2(
            target, draws, self.step, self.scenario.set_model.step_s, predicted
        )

    def _pending(self) -> Pending:
        """Return the impulses that are decided and not given yet, with the times from now to them,
        s.
        """
        step_s = self.scenario.set_model.step_s
        return tuple(
            (step * step_s, impulse) for step, impulse in enumerate(self._queue) if impulse.any()
        )

    def _give(self) -> Floats:
        """Return the impulses that are due, m/s; those of engagements after their closest approach
        are not given.
        """
        due = self._queue.pop(0)
        if self._lead_s == 0.0:
            return due
        self._not_given += np.where(self._flying, 0.0, modulus(due))
        return np.where(self._flying, due, 0.0)

    def _situation(
        self, miss: PredictedMiss, measured: Measurements, pending: Pending
    ) -> Situation:
        time_s = self.step * self.scenario.set_model.step_s
        lead_s = self._lead_s
        later_times_s = self._impulse_times_s
        may_fire = True
        if later_times_s is not None:
            # Half a step separates the times of different steps, whatever their rounding errors
            # are.
            half_s = 0.5 * self.scenario.set_model.step_s
            first, after = np.searchsorted(
                later_times_s, (time_s + lead_s - half_s, time_s + lead_s + half_s)
            ).tolist()
            may_fire = after > first
            later_times_s = later_times_s[after:]
        return Situation(
            time_s=time_s,
            step=self.step,
            step_s=self.scenario.set_model.step_s,
            predicted_miss=miss,
            budget_left_m_s=self._budget.copy(),
            thruster=self.scenario.thruster,
            closing_speed_m_s=self.scenario.set_model.closing_speed_m_s,
            measured=self._measured,
            last_impulse_m_s=self._impulse.copy(),
            information=self._view,
            new=frozenset(measured),
            sensors=self._sensors,
            may_fire=may_fire,
            lead_s=lead_s,
            later_times_s=later_times_s,
            pending=pending,
            seen={name: seen for name, seen in self._seen.items() if name in measured},
        )

    def _finish_labels(self) -> None:
        """Drop labels below the threshold, and store the predicted misses of those whose control
        ends.
        """
        information = self._information
        is_over = self._control_is_over()
        if not (self._label_ends.ends_now(is_over) or information.sections_are_leaving()):
            information.drop_below_threshold()
            return
        feasible = information.feasible.copy()
        labels = information.labels_m.copy()
        misses = np.stack(information.predicted_miss_by_section_m())
        self._label_ends.end(information.drop_below_threshold(), feasible, is_over, labels, misses)

    def _control_is_over(self) -> Flags:
        """Return whether no later step can give an impulse: after the last one of the schedule, or
        without budget.

        Not in engagements that have arrived: their sets and their impulses do not go on with the
        rest of the batch.
        """
        if self._last_impulse_step is not None and self.step >= self._last_impulse_step:
            is_over = np.ones_like(self._tracking)
        else:
            is_over = self._budget < max(self.scenario.thruster.min_impulse_m_s, MIN_FLOAT)
        for queued in self._queue:
            is_over &= modulus(queued) == 0.0
        return is_over & ~self._arrived

    def any_state_miss_m(self, results: Results) -> Floats:
        """Return the maximum miss of a state of the set, m, shape (B,):
        `LabelEnds.any_state_miss_m`.
        """
        return self._label_ends.any_state_miss_m(results)

    def results(self, runs: NDArray[np.int64]) -> Results:
        """Return the results so far, with these run numbers."""
        arrivals_s = self._arrivals_s()
        lost = self._information.inconsistent
        margin = self._truth_section.min_margin_m(arrivals_s)
        payoff = self._label_ends.published_m.copy()
        known = self._label_ends.left
        if self._model.is_guaranteed:
            payoff, known = self._information.guaranteed_miss()
        # Without a closest approach within the maximum number of steps, the miss is the present
        # range.
        passed = np.isfinite(self._miss)
        present = self._truth.position_m.T[:-1]
        miss = np.where(passed, self._miss, self._truth.sight().range_m)
        radius_m = self.scenario.radius_m
        not_given = self._not_given + sum(map(modulus, self._queue))
        hit = np.ma.MaskedArray(miss <= (radius_m or 0.0), mask=radius_m is None)
        lateral = np.where(passed, self._lateral_miss, present)
        return Results(
            runs=runs,
            miss_m=miss,
            impulse_m_s=np.maximum(
                self.scenario.thruster.budget_m_s - self._budget - not_given, 0.0
            ),
            guaranteed_miss_m=np.ma.MaskedArray(payoff, mask=~known),
            outcomes=tuple(
                _outcome(*flags)
                for flags in zip(
                    miss > self.scenario.nominal_range_m, lost, self._spent, strict=True
                )
            ),
            set_emptied=lost,
            hit=hit,
            **self._decisions.columns(lateral, arrivals_s, ~hit.filled(True)),
            truth_margin_m=margin,
            position_m=self._draws.position_m,
            velocity_m_s=self._draws.velocity_m_s,
            lateral_miss_m=lateral.T,
            guarantees=self._model.is_guaranteed,
            redraws=self._draws.redraws,
            burns_m_s=self._burns_m_s.copy() if self._number_of_burn else None,
            b_plane_t_rad=self.scenario.b_plane_t_rad,
        )


def _outcome(diverged: bool, lost: bool, spent: bool) -> Outcome:
    if diverged:
        return Outcome.DIVERGED
    if lost:
        return Outcome.SET_EMPTY
    return Outcome.BUDGET_SPENT if spent else Outcome.ARRIVED


def _make_noise(scenario: Scenario, draws: Draws) -> MeasurementNoise:
    if scenario.noise is NoiseKind.GAME:
        side = constant_side(scenario.target, draws.target)
        return GameNoise(scenario.tie, draws.tie, worst_shift_m(scenario), side)
    if scenario.noise is NoiseKind.RANDOM:
        return RandomNoise(draws.errors, draws.bias)
    is_correlated = scenario.noise is NoiseKind.CORRELATED
    correlation = math.exp(-scenario.step_s / scenario.correlation_time_s) if is_correlated else 0.0
    return gaussian_noise(draws.errors, draws.bias, scenario.noise_sigma, correlation)


def _noise_of_batch(source: NoiseSource) -> MeasurementNoise:
    noise = source() if callable(source) else source
    if not hasattr(noise, "measure"):
        raise TypeError(f"a noise must have the method measure(sight, predicted): got {noise!r}")
    return noise
