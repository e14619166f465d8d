"""A scenario: every number of an engagement, in SI units."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from guidance.noise import NoiseKind, TieRule
from guidance.strategy import Strategy
from guidance.thruster import Thruster
from infoset.model import SetModel, StateBox
from infoset.sensors import RangeSensor, RateSensor


@dataclass(frozen=True)
class Sun:
    """The attracting body both craft move about.

    Parameters
    ----------
    gravitational_parameter_m3_s2 : float
        K, m^3/s^2.
    distance_m : float
        Distance from the spacecraft at t = 0, m.
    direction_rad : float
        Direction of the Sun seen from the spacecraft at t = 0, from the x axis toward z, rad.
    """

    gravitational_parameter_m3_s2: float
    distance_m: float
    direction_rad: float


class Manoeuvre(Enum):
    """How the target accelerates along z, within its bound.

    NONE is not at all; CONSTANT always the same way; BANG_BANG changes sides at even times; RANDOM_TELEGRAPH at random
    times; WORST_CASE pushes the truth's predicted miss further out, the way it is already.
    """

    NONE = "none"
    CONSTANT = "constant"
    BANG_BANG = "bang-bang"
    RANDOM_TELEGRAPH = "random-telegraph"
    WORST_CASE = "worst-case"


@dataclass(frozen=True)
class Target:
    """A target that manoeuvres.

    Parameters
    ----------
    manoeuvre : Manoeuvre
    acceleration_m_s2 : float
        Its acceleration along z, m/s^2.
    switching_period_s : float
        Time between changes of side (bang-bang), or its mean (random telegraph), s.
    """

    manoeuvre: Manoeuvre
    acceleration_m_s2: float
    switching_period_s: float = 10.0


@dataclass(frozen=True)
class Scenario:
    """An interception: truth, sensors, engine, guidance and noise.

    Parameters
    ----------
    name, description : str
        What a person calls it, and a line about it.
    sun : Sun or None
        None is free space.
    nominal_range_m : float
        Nominal range at t = 0, m.
    dispersion : StateBox
        Where the truth starts (B0 x D0), uniform; unknown on board. A fixed value has equal ends.
    set_model : SetModel
        What is known and assumed on board; it holds the closing speed, the step and the angle sensor.
    range_sensor : RangeSensor or None
        The range meter, if there is one.
    thruster : Thruster
        Limits of the engine.
    strategy : str
        Name of the guidance strategy.
    noise : NoiseKind
        How measurement errors are chosen.
    tie : TieRule
        The game noise's choice between equally bad extremes.
    rate_sensor : RateSensor or None
        The sensor of the line of sight's rate, if there is one.
    target : Target or None
        None does not manoeuvre.
    """

    name: str
    description: str
    sun: Sun | None
    nominal_range_m: float
    dispersion: StateBox
    set_model: SetModel
    range_sensor: RangeSensor | None
    thruster: Thruster
    strategy: str = "symmetric-miss"
    noise: NoiseKind = NoiseKind.RANDOM
    tie: TieRule = TieRule.UPPER
    rate_sensor: RateSensor | None = None
    target: Target | None = None


def strategy_name(scenario: Scenario, own: Strategy | None) -> str:
    """Return what files call the strategy flown: its registered name, or module and class of one's own."""
    if own is None:
        return scenario.strategy
    return f"{type(own).__module__}.{type(own).__qualname__}"
