"""The record of one engagement: all values that its figures and pages show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.engine.predicted_miss import PredictedMiss
from infoset.guidance import Strategy
from infoset.guidance.noise import NoiseSource
from infoset.limits import WHOLE
from infoset.sensors import Measurements, Sensor
from infoset.set_queries import Section
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements, Step
from infoset.sim.results import Results, ending
from infoset.sim.scenario import Scenario, noise_name, strategy_name, with_noise, with_strategy
from infoset.sim.versions import versions
from infoset.sim.wrong_images import suspected_times_s


@dataclass(frozen=True)
class RecordedInconsistency:
    """The first measurement that contradicts all states of the set.

    Parameters
    ----------
    label_m : float
        Label nearest to consistency: its range at t = 0.
    """

    step: int
    label_m: float


@dataclass(frozen=True, eq=False)
class Record:
    """One engagement, step by step.

    Arrays have the shape (N, ...) for N steps, (N, C, ...) along C lateral axes. NaN is an unknown
    value.

    Parameters
    ----------
    scenario : Scenario
        Simulated scenario, with the noise, tie rule and range sensor of this engagement.
    seed, run : int
        Root seed and run number; the same values give the same engagement.
    time_s, true_range_m : ndarray, shape (N,)
        Time and true range.
    true_angle_rad, true_rate_rad_s : ndarray, shape (N, C)
        True line of sight in the plane of x and each axis; of a misaligned camera in its axes.
    measured : mapping of str to ndarray
        Measured values by sensor: "angle" (rad) and "rate" (rad/s), shape (N, C), "range" (m),
        shape (N,). NaN where the sensor did not measure.
    predicted_miss_m : ndarray, shape (N, C, 2)
        (pi_*, pi^*) after the measurement and before the impulse; NaN without a set.
    impulse_m_s : ndarray, shape (N, C)
        Impulses of the thruster, before errors of execution.
    truth_margin_m : ndarray, shape (N,)
        Signed margin of the true state in its section at the last measurement; NaN before the
        first.
    sections : tuple of tuple of Section
        Sections after the measurement of each step, in ascending order of range; those of a set
        that allows for wrong images member after member (`Section.member`), and in this order
        within each.
    noise : str or None
        Name of the noise that replaced the scenario's; None if none did.
    inconsistency : RecordedInconsistency or None
        First measurement that contradicts the model; None without one.
    suspected_s : tuple of float
        Times of the images one of which is wrong; empty without a proof.
    versions : mapping of str to str
        Versions of the packages and of Python that simulated it.
    """

    scenario: Scenario
    seed: int
    run: int
    strategy: str
    result: Results
    time_s: Floats
    true_range_m: Floats
    true_angle_rad: Floats
    true_rate_rad_s: Floats
    measured: Measurements
    predicted_miss_m: Floats
    impulse_m_s: Floats
    truth_margin_m: Floats
    sections: tuple[tuple[Section, ...], ...]
    noise: str | None = None
    inconsistency: RecordedInconsistency | None = None
    suspected_s: tuple[float, ...] = ()
    versions: Mapping[str, str] = field(default_factory=versions)

    @property
    def steps(self) -> int:
        """Number of steps N."""
        return len(self.time_s)

    def measures(self, sensor: str) -> Flags:
        """Return the steps in which a sensor measured, shape (N,)."""
        values = self.measured.get(sensor, np.full(self.steps, np.nan))
        return np.asarray(~np.isnan(values.reshape(self.steps, -1)).any(axis=1))

    @property
    def noise_name(self) -> str:
        """Name of the measurement noise."""
        return self.scenario.noise.value if self.noise is None else self.noise

    @property
    def ending(self) -> str:
        """The outcome, and if the body has a size `hit`, or `missed` and why."""
        result = self.result
        cause = result.causes[0]
        return ending(result.outcomes[0].value, result.hit.tolist()[0], cause and cause.value)

    def __repr__(self) -> str:
        result = self.result
        inside = "inside" if result.truth_kept[0] else "not inside"
        exceeds = "" if result.phi_held.filled(True)[0] else ", miss above the bound Phi"
        return (
            f"<engagement of {self.scenario.name}, seed {self.seed}, run {self.run}: "
            f"{self.strategy}, {self.noise_name} noise, {self.steps} steps\n"
            f" {self.ending}, miss {result.miss_m[0]:.4g} m for {result.impulse_m_s[0]:.4g} m/s, "
            f"true state {inside} its section at every step{exceeds}>"
        )


def fly_one(
    scenario: Scenario,
    run: int = 0,
    *,
    seed: int = 0,
    strategy: Strategy | str | None = None,
    noise: NoiseSource | str | None = None,
    target_m_s2: Floats | None = None,
    progress: Callable[[float], None] | None = None,
) -> Record:
    """Simulate one engagement and return the record of its steps.

    Parameters
    ----------
    scenario : Scenario
        Scenario to simulate; `infoset.load_scenario` reads one.
    run, seed : int
        Run `run` of `simulate(..., seed=seed)` is the same engagement, number for number.
    strategy : Strategy, str or None
        A strategy of your own, the name of a registered one, or None for the scenario's.
    noise : MeasurementNoise, callable, str or None
        A noise of your own or the name of a kind, as for `simulate`; None is the scenario's.
    target_m_s2 : ndarray, shape (C, 1, steps), or None
        Accelerations of the target, m/s^2; None is the scenario's target.
    progress : callable or None
        Called after each step with its number as a share of the steps for which errors are drawn;
        a flight usually ends before the last one.

    Raises
    ------
    TypeError, ValueError
        If `run` or `seed` is not a whole number, the strategy is not registered, or a strategy or
        noise of your own returns a value that is not allowed.
    """
    WHOLE.need("run", run)
    WHOLE.need("seed", seed)
    scenario, own_strategy = with_strategy(scenario, strategy)
    scenario, own_noise = with_noise(scenario, noise)
    draws = draw(scenario, [run], seed)
    flight = Engagements(scenario, draws, own_strategy, noise=own_noise, target_m_s2=target_m_s2)

    steps: list[Step] = []
    sections: list[tuple[Section, ...]] = []

    def record(step: Step) -> None:
        steps.append(step)
        # The view of the set shows the present step only.
        sections.append(tuple(step.information.sections()))

    while flight.flying:
        flight.advance(record)
        if progress is not None:
            progress(flight.step / draws.steps)

    def rows(value: Callable[[Step], Any]) -> Floats:
        return np.array([value(step) for step in steps], dtype=np.float64)

    axes = len(scenario.set_model.axes)
    return Record(
        scenario,
        seed,
        run,
        strategy_name(scenario, own_strategy),
        flight.results(np.array([run])),
        time_s=rows(lambda step: step.time_s),
        true_range_m=rows(lambda step: step.sight.range_m[0]),
        true_angle_rad=rows(lambda step: step.sight.alpha_rad[:, 0]),
        true_rate_rad_s=rows(lambda step: step.sight.omega_rad_s[:, 0]),
        measured={
            name: _measured(steps, sensor, axes) for name, sensor in scenario.sensors.items()
        },
        predicted_miss_m=rows(lambda step: _interval(step.predicted_miss)),
        impulse_m_s=rows(lambda step: step.impulse_m_s[:, 0]),
        truth_margin_m=np.array([margin.filled(np.nan)[0] for margin in flight.truth_margins_m()]),
        sections=tuple(sections),
        noise=None if own_noise is None else noise_name(own_noise),
        inconsistency=_inconsistency(flight),
        suspected_s=suspected_times_s(steps[-1].information),
    )


def _measured(steps: Sequence[Step], sensor: Sensor, axes: int) -> Floats:
    """Return the values of a sensor by step; NaN where it did not measure."""
    unknown = np.full((axes, 1) if sensor.is_lateral else 1, np.nan)
    values = [step.measured.get(sensor.name, unknown)[..., 0] for step in steps]
    return np.array(values, dtype=np.float64)


def _interval(miss: PredictedMiss) -> Floats:
    """Return the predicted miss of the engagement, shape (C, 2); NaN without a set."""
    ends = np.stack([miss.lower_m, miss.upper_m], axis=-1)[:, 0]
    return np.where(miss.exists[0], ends, np.nan)


def _inconsistency(flight: Engagements) -> RecordedInconsistency | None:
    steps, labels_m = flight.inconsistency
    if not steps.count():
        return None
    return RecordedInconsistency(int(steps[0]), float(labels_m[0]))
