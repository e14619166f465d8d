"""Problem files of kind `pareto-encounter`: tables and keys, and the encounter."""

from __future__ import annotations

from dataclasses import astuple, dataclass, fields
from functools import cached_property
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from infoset.experiments.common.orbit_checks import check_angle, check_rate
from infoset.limits import NUMBER, Description, Name, NotNegative, Number, Positive
from infoset.rendezvous.pareto import Component, Craft, Encounter, Meeting
from infoset.rendezvous.relative_motion import ClohessyWiltshire

Vector = Annotated[tuple[float, float, float], NUMBER]


@dataclass(frozen=True)
class TerminalTable:
    """[terminal]: components of the meeting that are not free, in the axes of `ParetoProblem`."""

    x_m: Number = 0.0
    y_m: Number = 0.0
    z_m: Number = 0.0
    vx_m_s: Number = 0.0
    vy_m_s: Number = 0.0
    vz_m_s: Number = 0.0


TERMINAL = {field.name.split("_")[0]: field.name for field in fields(TerminalTable)}
"""Keys of the components of a meeting by their names."""


@dataclass(frozen=True)
class CraftTable:
    """[[craft]]: a craft, its start, and the weight of its excess in the group loss."""

    name: Name
    position_m: Vector
    velocity_m_s: Vector
    weight: NotNegative = 1.0
    start_s: NotNegative = 0.0


@dataclass(frozen=True, kw_only=True)
class ParetoProblem:
    """A problem file of kind `pareto-encounter`.

    Axes: x radially outward, y along the motion, z along the normal.

    Parameters
    ----------
    name, description : str
        Name of the results, and a line about the problem.
    orbit_rate_rad_s : float
        Mean motion of the circular reference orbit.
    duration_s : float
        Time from t = 0 to the meeting.
    free : tuple of str
        Free components of the meeting, of x, y, z, vx, vy, vz.
    meet : Meeting
        A rendezvous, or an intercept: the same position, and any velocities.
    max_control_m_s2 : float or None
        Bound on the control of each craft at all times; it is imposed.
    terminal : TerminalTable
        Components that are not free.
    craft : tuple of CraftTable
        The craft, at most 50.
    """

    kind: ClassVar[str] = "pareto-encounter"
    name: Name = "encounter"
    description: Description = ""
    orbit_rate_rad_s: Positive
    duration_s: Positive
    free: tuple[Literal["x", "y", "z", "vx", "vy", "vz"], ...]
    meet: Meeting = Meeting.RENDEZVOUS
    max_control_m_s2: Positive | None = None
    terminal: TerminalTable = TerminalTable()
    craft: Annotated[tuple[CraftTable, ...], Field(max_length=50)]

    def __post_init__(self) -> None:
        check_rate(self.orbit_rate_rad_s)
        check_angle("duration_s", self.duration_s, self.orbit_rate_rad_s)
        for name in self.free:
            if getattr(self.terminal, TERMINAL[name]) != 0.0:
                raise ValueError(
                    f"terminal.{TERMINAL[name]}: must be left out, because free lists {name}"
                )
        _ = self.encounter  # raises ValueError if the meeting or a craft is wrong

    @cached_property
    def encounter(self) -> Encounter:
        """The encounter that is solved."""
        motion = ClohessyWiltshire(self.orbit_rate_rad_s)
        craft = tuple(
            Craft(
                each.name,
                np.array(each.position_m + each.velocity_m_s),
                motion,
                each.weight,
                each.start_s,
            )
            for each in self.craft
        )
        free = tuple(Component[name.upper()] for name in self.free)
        fixed = np.array(astuple(self.terminal))
        return Encounter(craft, self.duration_s, free, fixed, self.meet)
