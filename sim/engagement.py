"""The closed loop: a batch of engagements, step by step against the true motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats
from infoset.covered_set import information_set
from infoset.engine.predicted_miss import PredictedMiss
from infoset.guidance import (
    MeasurementNoise,
    Situation,
    Strategy,
    make_strategy,
)
from infoset.guidance.noise import NoiseSource
from infoset.guidance.noise_registry import NoiseBatch, make_noise
from infoset.guidance.strategy import checked_impulses
from infoset.guidance.thruster import modulus
from infoset.information_set import InformationSetView
from infoset.sensors import BearingSensor, Measurements
from infoset.set_queries import MaskedFloats, MaskedIntegers
from infoset.sim.closed_form import worst_shift_m
from infoset.sim.draws import Draws
from infoset.sim.gravity import on_board_model
from infoset.sim.impulse_queue import ImpulseQueue, Opportunity, Pending
from infoset.sim.instruments import Instruments
from infoset.sim.kepler import KeplerMotion, Sight
from infoset.sim.label_ends import LabelEnds
from infoset.sim.miss_cause import DecisionLog
from infoset.sim.results import MaskedFlags, Outcome, Results
from infoset.sim.scenario import Scenario
from infoset.sim.target import constant_side
from infoset.sim.true_flight import Miss, TrueFlight
from infoset.sim.truth_section import TruthSection
from infoset.sim.wrong_images import proved_columns


@dataclass(frozen=True)
class Step:
    """One step of a batch, after the decision and before the impulse.

    Angles, rates, predicted misses and impulses have the shape (C, B), for C lateral axes.

    Parameters
    ----------
    tracking, flying : ndarray of bool, shape (B,)
        Engagements that still measure and decide, and those before their closest approach.
    sight : Sight
        True geometry before the impulse; of a misaligned camera in its axes.
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
        self._model = model = on_board_model(scenario)
        batch = len(draws.position_m)
        lateral = len(model.axes), batch

        self._flight = TrueFlight(scenario, draws, truth, target_m_s2)
        chosen_noise = _make_noise(scenario, draws) if noise is None else _noise_of_batch(noise)
        self._instruments = Instruments(scenario, draws, chosen_noise)
        self._impulses = ImpulseQueue(scenario, lateral)
        self._strategy = strategy or make_strategy(scenario.strategy)
        self._state = self._strategy.start(lateral)

        self._information = information_set(model, batch, guarantee=guarantee)
        self._view = self._information.view()
        self._truth_section = TruthSection(model, batch)
        self._label_ends = LabelEnds(model, batch)
        self._decisions = DecisionLog(scenario, lateral, draws.steps)

    @property
    def flying(self) -> bool:
        """Whether any true motion is before its closest approach or before x = 0, where its label
        leaves the set.

        It is false after the last step for which numbers were drawn.
        """
        return not self._flight.arrived.all() and self.step < self._draws.steps

    @property
    def inconsistency(self) -> tuple[MaskedIntegers, MaskedFloats]:
        """Step at which each set first became empty, and the label (m) nearest to consistency;
        masked without one.
        """
        return self._information.inconsistency

    def advance(self, observe: Callable[[Step], None] | None = None) -> None:
        """Simulate one step; `observe` is called after the decision and before the impulse."""
        sight = self._flight.sight()
        pending = self._impulses.pending()
        tracking = self._flight.flying & self._information.tracking
        seen = sight
        if self._draws.misalignment is not None:
            seen = sight.turned(self._draws.misalignment)
        measured = self._measure(seen, pending, tracking)
        miss = self._information.predicted_miss(pending)
        # A measurement may have ended the tracking of a set.
        tracking = tracking & self._information.tracking

        self._decide(miss, measured, pending, tracking)
        impulse = self._impulses.give(self.step, self._flight.flying)
        if observe is not None:
            observe(
                Step(
                    step=self.step,
                    time_s=self._time_s,
                    tracking=tracking,
                    flying=self._flight.flying.copy(),
                    sight=seen,
                    measured=measured,
                    predicted_miss=miss,
                    impulse_m_s=impulse,
                    information=self._view,
                )
            )

        executed = self._executed(impulse)
        self._flight.fire(executed)
        self._decisions.execute(self.step, executed)
        self._move_sets(impulse)

        self._flight.advance(self.step, sight, impulse, self._instruments.noise_side)
        self.step += 1
        if not self._flight.flying.all():
            self._information.stop(self._flight.arrived)

    def truth_margins_m(self) -> list[MaskedFloats]:
        """Return the signed margins (m) of the true states in their sections, one array of shape
        (B,) per step.

        They are masked before the first measurement. Before the arrival, the label of a true state
        is computed from its motion without further impulses.
        """
        return self._truth_section.margins_m(self._flight.arrivals_s(self.step))[: self.step]

    def any_state_miss_m(self, results: Results) -> Floats:
        """Return the maximum miss of a state of the set, m, shape (B,):
        `LabelEnds.any_state_miss_m`.
        """
        return self._label_ends.any_state_miss_m(results)

    def results(self, runs: NDArray[np.int64]) -> Results:
        """Return the results so far, with these run numbers.

        Without a closest approach so far, the miss is the present distance from the aim point.
        """
        arrivals_s = self._flight.arrivals_s(self.step)
        miss = self._flight.miss()
        hit = self._hit(miss)
        missed = ~hit.filled(True)  # Without a radius nothing counts as missed.
        set_emptied = self._information.inconsistent
        bound_m = self._guaranteed_miss_m()
        aim_m = self._model.lateral_aim_m[:, None]
        return Results(
            runs=runs,
            miss_m=miss.distance_m,
            impulse_m_s=self._impulses.given_m_s(),
            guaranteed_miss_m=bound_m,
            outcomes=self._outcomes(miss.distance_m, set_emptied),
            set_emptied=set_emptied,
            hit=hit,
            certain_hit=self._certain_hit(bound_m),
            hit_probability=self._hit_probability(miss),
            # causes, unguided_miss_m, engine_corrects_m, budget_corrects_m, last_possible_m
            **self._decisions.columns(miss.lateral_m + aim_m, arrivals_s, missed),
            truth_margin_m=self._truth_section.min_margin_m(arrivals_s),
            position_m=self._draws.position_m,
            velocity_m_s=self._draws.velocity_m_s,
            lateral_miss_m=miss.lateral_m.T,
            guarantees=self._model.is_guaranteed,
            redraws=self._draws.redraws,
            # wrong_image_proved_s, suspected_images, wrong_image_s
            **proved_columns(self._information),
            burns_m_s=self._impulses.burns_m_s,
            b_plane_t_rad=self.scenario.b_plane_t_rad,
        )

    @property
    def _time_s(self) -> float:
        return self.step * self.scenario.set_model.step_s

    def _measure(self, sight: Sight, pending: Pending, tracking: Flags) -> Measurements:
        """Measure with the sensors that are due, cut the sets in the order of these sensors, and
        return the values of the sensors that measured.

        `sight` is the geometry in the axes of the camera, which the sets have too. If the image of
        the step can be lost, there is a cut with the image where it was taken and, with other
        sensors due, one without it where it was lost; no engagement is in both.
        """
        measured = self._instruments.measure(self.step, sight, pending, tracking, self._view)
        for values, where in measured.cuts:
            for name, sensor in measured.sensors.items():
                if name in values:
                    sensor.cut(self._information, values, where)
                    counts = where & self._cuts_truth_section(name)
                    sensor.cut(self._truth_section, values, counts)
            self._truth_section.store_state(where, sight)
        return measured.values

    def _cuts_truth_section(self, sensor: str) -> Flags:
        """Return where a measurement of this step cuts the section of the true state, shape (B,).

        A wrong image does not: the section is that of the set that uses no wrong image. There is no
        such set if more images are wrong than the model allows for.
        """
        is_wrong = self._draws.is_wrong
        everywhere = np.ones(self._information.batch, dtype=bool)
        if is_wrong is None or sensor != BearingSensor.name:
            return everywhere
        has_sound_set = is_wrong.sum(axis=1) <= self._model.wrong_images
        return np.asarray(~(is_wrong[:, self.step] & has_sound_set))

    def _decide(
        self, miss: PredictedMiss, measured: Measurements, pending: Pending, tracking: Flags
    ) -> None:
        """Let the strategy decide the impulses of this step."""
        opportunity = self._impulses.opportunity(self._time_s)
        situation = self._situation(miss, measured, pending, opportunity)
        decided = self._strategy.decide(situation, self._state)
        wanted = checked_impulses(decided, situation, tracking, self._strategy)
        wanted = np.where(tracking & opportunity.may_fire, wanted, 0.0)
        if opportunity.may_fire:
            budget_left_m_s = self._impulses.budget_left_m_s
            self._decisions.decide(self.step, tracking, budget_left_m_s, miss)
        fired_s = self._time_s + self._impulses.lead_s
        self._impulses.decide(wanted, self.scenario.nominal_arrival_s - fired_s)

    def _situation(
        self,
        miss: PredictedMiss,
        measured: Measurements,
        pending: Pending,
        opportunity: Opportunity,
    ) -> Situation:
        """Return all that a strategy may use, in copies where it could change a state."""
        instruments = self._instruments
        impulses = self._impulses
        return Situation(
            time_s=self._time_s,
            step=self.step,
            step_s=self.scenario.set_model.step_s,
            predicted_miss=miss,
            budget_left_m_s=impulses.budget_left_m_s.copy(),
            thruster=self.scenario.engine,
            closing_speed_m_s=self.scenario.set_model.closing_speed_m_s,
            measured=instruments.latest,
            last_impulse_m_s=impulses.last_m_s.copy(),
            information=self._view,
            new=frozenset(measured),
            sensors=instruments.sensors,
            may_fire=opportunity.may_fire,
            lead_s=impulses.lead_s,
            later_times_s=opportunity.later_times_s,
            pending=pending,
            seen={name: seen for name, seen in instruments.seen.items() if name in measured},
        )

    def _executed(self, impulse: Floats) -> Floats:
        """Return the executed impulses."""
        size = self._draws.execution
        direction = self._draws.pointing
        return self.scenario.engine.executed(
            impulse,
            None if size is None else size[:, self.step],
            None if direction is None else direction[:, self.step],
        )

    def _move_sets(self, impulse: Floats) -> None:
        """Move the sets by the impulses and to the next step.

        The impulses are those of the thruster: the sets allow for the errors of execution.
        """
        flying = self._flight.flying
        self._information.shift(impulse, flying)
        self._truth_section.shift(impulse, modulus(impulse) > 0.0)
        self._label_ends.fire(impulse, flying, self._time_s)
        self._finish_labels()
        self._information.predict()
        self._truth_section.predict()

    def _finish_labels(self) -> None:
        """Drop labels below the threshold, and store the predicted misses of those whose control
        ends.

        Engagements that have arrived are excluded: their sets and their impulses do not go on with
        the rest of the batch.
        """
        information = self._information
        is_over = self._impulses.is_over(self.step) & ~self._flight.arrived
        if not (self._label_ends.ends_now(is_over) or information.sections_are_leaving()):
            # No section must be stored, as in most steps.
            information.drop_below_threshold()
            return
        feasible = information.feasible.copy()
        labels = information.labels_m.copy()
        misses = np.stack(information.predicted_miss_by_section_m())
        self._label_ends.end(information.drop_below_threshold(), feasible, is_over, labels, misses)

    def _guaranteed_miss_m(self) -> MaskedFloats:
        """Return the bound Phi of the guaranteed model, or the published Phi; masked if unknown."""
        if self._model.is_guaranteed:
            bound_m, known = self._information.guaranteed_miss()
            return np.ma.MaskedArray(bound_m, mask=~known)
        published_m = self._label_ends.published_m.copy()
        return np.ma.MaskedArray(published_m, mask=~self._label_ends.left)

    def _hit(self, miss: Miss) -> MaskedFlags:
        """Return whether each engagement hits; masked if the body has no size.

        A miss that reaches the edge of the body is a hit.
        """
        body = self.scenario.body
        if body is None:
            return np.ma.MaskedArray(np.zeros(len(miss.distance_m), dtype=bool), mask=True)
        if body.is_sphere_around_aim:
            return np.ma.MaskedArray(miss.distance_m <= body.inscribed_m, mask=False)

        # The silhouette is symmetric: the centre seen from the spacecraft is inside where the
        # spacecraft seen from the centre is.
        angle_rad: Floats | float | None = self._draws.axis_angle_rad
        if not body.is_turned_by_chance:
            angle_rad = body.axis_angle_rad
        return np.ma.MaskedArray(body.contains(miss.lateral_m, angle_rad), mask=False)

    def _certain_hit(self, bound_m: MaskedFloats) -> MaskedFlags | None:
        """Return whether Phi proves each hit; None without a size, and in the paper's model."""
        radius_m = self.scenario.certain_radius_m
        if radius_m is None or not self._model.is_guaranteed:
            return None
        within = bound_m.filled(np.inf) <= radius_m
        return np.ma.MaskedArray(within, mask=np.ma.getmaskarray(bound_m))

    def _hit_probability(self, miss: Miss) -> MaskedFloats | None:
        """Return the probability of each hit if the direction of the body's ellipse is unknown."""
        body = self.scenario.body
        if body is None or not body.is_turned_by_chance:
            return None
        distance_m = np.hypot.reduce(miss.lateral_m)
        return np.ma.MaskedArray(body.hit_probability(distance_m), mask=False)

    def _outcomes(self, distance_m: Floats, set_emptied: Flags) -> tuple[Outcome, ...]:
        diverged = distance_m > self.scenario.nominal_range_m
        flags = zip(diverged, set_emptied, self._impulses.is_spent, strict=True)
        return tuple(_outcome(*each) for each in flags)


def _outcome(diverged: bool, lost: bool, spent: bool) -> Outcome:
    if diverged:
        return Outcome.DIVERGED
    if lost:
        return Outcome.SET_EMPTY
    return Outcome.BUDGET_SPENT if spent else Outcome.ARRIVED


def _make_noise(scenario: Scenario, draws: Draws) -> MeasurementNoise:
    batch = NoiseBatch(
        errors=draws.errors,
        bias=draws.bias,
        drift=draws.drift,
        tie=draws.tie,
        worst_shift_m=lambda: worst_shift_m(scenario),
        target_side=lambda: constant_side(scenario.target, draws.target),
    )
    return make_noise(scenario.noise, scenario, batch)


def _noise_of_batch(source: NoiseSource) -> MeasurementNoise:
    noise = source() if callable(source) else source
    if not hasattr(noise, "measure"):
        raise TypeError(f"a noise must have the method measure(sight, predicted): got {noise!r}")
    return noise
