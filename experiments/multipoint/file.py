"""Problem files of kind `multipoint`: their tables and keys, and the tour they describe."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from infoset.arrays import Floats
from infoset.experiments.common.orbit_checks import check_angle, check_flight, check_rate
from infoset.limits import NUMBER, Description, Name, NotNegative, Number, Part, Positive
from infoset.rendezvous.multipoint import KeplerTour, Meet, TimeLimits, Tour, TourTarget
from infoset.rendezvous.relative_motion import (
    ClohessyWiltshire,
    EllipticOrbit,
    LinearMotion,
    TschaunerHempel,
)
from infoset.rendezvous.two_body import OrbitalElements, coast

Vector = Annotated[tuple[float, float, float], NUMBER]


@dataclass(frozen=True, kw_only=True)
class BodyTable:
    """[chaser]: a state at t = 0 in Hill's axes, or at an epoch in inertial axes.

    In inertial axes, orbital elements may replace the state.
    """

    position_m: Vector | None = None
    velocity_m_s: Vector | None = None
    elements: OrbitalElements | None = None
    epoch_s: Number = 0.0

    def __post_init__(self) -> None:
        given = [value is not None for value in (self.position_m, self.velocity_m_s, self.elements)]
        if given not in ([True, True, False], [False, False, True]):
            raise ValueError("must have position_m and velocity_m_s, or elements")

    def state(self, mu_m3_s2: float | None) -> Floats:
        """Return the state at its epoch, shape (6,)."""
        # `MultipointProblem` refuses elements without a gravitational parameter.
        if self.elements is not None and mu_m3_s2 is not None:
            return np.concatenate(self.elements.state(mu_m3_s2))
        return np.array([self.position_m, self.velocity_m_s]).ravel()


@dataclass(frozen=True, kw_only=True)
class TargetTable(BodyTable):
    """[[target]]: a target, and its visit; `time_s` is a first guess if times are optimised."""

    name: Name
    time_s: Positive | None = None
    meet: Meet = Meet.FLYBY
    dwell_s: NotNegative = 0.0


@dataclass(frozen=True, kw_only=True)
class MultipointProblem:
    """A problem file of kind `multipoint`.

    Parameters
    ----------
    name, description : str
        Name of the results, and a line about the problem.
    orbit_rate_rad_s, eccentricity, true_anomaly_rad : float
        Mean motion of the reference orbit, which makes the axes those of Hill; its eccentricity and
        anomaly at t = 0.
    gravitational_parameter_m3_s2 : float
        Gravity of the attracting point, in place of `orbit_rate_rad_s`, which makes the axes
        inertial.
    max_control_m_s2 : float or None
        Bound on the control at all times: imposed in Hill's axes, checked in inertial ones.
    optimise_times : bool
        Whether the times of the visits are optimised.
    chaser : BodyTable
        Start of the chaser.
    target : tuple of TargetTable
        Targets in the order of their visits, at most 200.
    times : TimeLimits or None
        Limits of the times.
    """

    kind: ClassVar[str] = "multipoint"
    name: Name = "tour"
    description: Description = ""
    orbit_rate_rad_s: Positive | None = None
    eccentricity: Part = 0.0
    true_anomaly_rad: Number = 0.0
    gravitational_parameter_m3_s2: Positive | None = None
    max_control_m_s2: Positive | None = None
    optimise_times: bool = False
    chaser: BodyTable
    target: Annotated[tuple[TargetTable, ...], Field(max_length=200)]
    times: TimeLimits | None = None

    def __post_init__(self) -> None:
        if (self.orbit_rate_rad_s is None) is (self.gravitational_parameter_m3_s2 is None):
            raise ValueError(
                "orbit_rate_rad_s (Hill's axes) or gravitational_parameter_m3_s2 (inertial axes) "
                "is needed, not both"
            )
        bodies = {"chaser": self.chaser}
        for number, target in enumerate(self.target, start=1):
            bodies[f"target.{number}"] = target
        rate = self.orbit_rate_rad_s
        mu = self.gravitational_parameter_m3_s2
        if rate is not None:
            check_rate(rate, self.eccentricity)
            given = [*(target.time_s for target in self.target), self.latest_s]
            times = [time for time in given if time is not None]
            if times:
                check_angle("the last of time_s and latest_s", max(times), rate)
        elif self.eccentricity > 0.0:
            raise ValueError("eccentricity: belongs to the reference orbit of Hill's axes")
        for key, body in bodies.items():
            if mu is not None:
                # From its epoch a body moves back to t = 0, and on to the last visit.
                with np.errstate(all="ignore"):  # elements of any size are refused here
                    before_s = max(body.epoch_s, 0.0)
                    after_s = max(self.last_s - body.epoch_s, 0.0)
                    check_flight(key, body.state(mu), mu, before_s, after_s)
            elif body.elements is not None or body.epoch_s != 0.0:
                raise ValueError(
                    f"{key}: elements and epoch_s belong to inertial axes, not to those of Hill"
                )
        _ = self.tour  # raises ValueError if a target is wrong

    @property
    def times_s(self) -> Floats | None:
        """The times of the file, by target as listed; None if one is missing."""
        times = [target.time_s for target in self.target]
        return None if None in times else np.array(times, dtype=np.float64)

    @property
    def latest_s(self) -> float | None:
        """The latest time of the last visit."""
        return None if self.times is None else self.times.latest_s

    @property
    def last_s(self) -> float:
        """The last time that a visit may have; infinite if nothing limits it."""
        times = [target.time_s for target in self.target if target.time_s is not None]
        if self.latest_s is not None:
            times.append(self.latest_s)
        # With a price of time alone, or without a time of each target, the visits can be later.
        elif self.times is not None or len(times) < len(self.target):
            return np.inf
        return max(times, default=np.inf)

    def limits(self) -> TimeLimits:
        """Return the limits of the times.

        Raise ValueError if the last time has neither a limit nor a price.
        """
        return self.times or TimeLimits()

    @cached_property
    def tour(self) -> Tour | KeplerTour:
        """The visits that are solved."""
        mu = self.gravitational_parameter_m3_s2
        targets = tuple(TourTarget(each.name, each.meet, each.dwell_s) for each in self.target)
        states = np.array([each.state(mu) for each in self.target])
        start = self.chaser.state(mu)
        if mu is not None:
            epochs_s = np.array([each.epoch_s for each in self.target])
            return KeplerTour(targets, states, epochs_s, mu, coast(start, -self.chaser.epoch_s, mu))
        assert self.orbit_rate_rad_s is not None
        motion: LinearMotion = ClohessyWiltshire(self.orbit_rate_rad_s)
        if self.eccentricity > 0.0:
            motion = TschaunerHempel(
                EllipticOrbit(self.orbit_rate_rad_s, self.eccentricity, self.true_anomaly_rad)
            )
        return Tour(motion, targets, states, start)
