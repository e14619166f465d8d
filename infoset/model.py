"""What the set assumes: the motion, the start, the sensor and how much uncertainty a step adds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from infoset.sensors import AngleSensor

Interval = tuple[float, float]


class Model(Enum):
    """How much uncertainty each step adds."""

    PAPER = "paper"


class InitialSet(Enum):
    """The shape of a section at the start.

    RECTANGLE is the paper's, a rectangle in (omega, alpha); BOX is the one in (z, V).
    """

    RECTANGLE = "rectangle"
    BOX = "box"


@dataclass(frozen=True)
class StateBox:
    """Intervals of relative position and velocity: the paper's B x D.

    Parameters
    ----------
    z_m, x_m : tuple of float
        Least and greatest lateral offset and range, m.
    vz_m_s, vx_m_s : tuple of float
        Least and greatest relative velocity along z and x, m/s (vx is negative: the object approaches).
    """

    z_m: Interval
    x_m: Interval
    vz_m_s: Interval
    vx_m_s: Interval


@dataclass(frozen=True)
class SetModel:
    """Everything an information set needs to know.

    Parameters
    ----------
    closing_speed_m_s : float
        The nominal closing speed e, m/s.
    step_s : float
        The step Delta of observation and control, s.
    bounds : StateBox
        What is known of the state at t = 0.
    angle_sensor : AngleSensor
        Error law of the line-of-sight angle.
    disturbance_m_s2 : float
        Bound nu of the fictitious acceleration along z, m/s^2.
    range_threshold_m : float
        Hypotheses about to fall below this range eps leave the set, m.
    sections : int
        Number of x-sections at the start, on a uniform grid over the possible ranges, ends included.
    fewest_sections : int
        When fewer are left, the set is re-gridded by replay to 2 fewest_sections + 1.
    initial_set : InitialSet
        Shape of a section at the start.
    kind : Model
        How much uncertainty each step adds.

    References
    ----------
    Kumkov and Patsko (1997), equation (9) and section 4.
    """

    closing_speed_m_s: float
    step_s: float
    bounds: StateBox
    angle_sensor: AngleSensor
    disturbance_m_s2: float = 0.0
    range_threshold_m: float = 0.0
    sections: int = 29
    fewest_sections: int = 5
    initial_set: InitialSet = InitialSet.RECTANGLE
    kind: Model = Model.PAPER
