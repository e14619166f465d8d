"""Predicted misses of the members of a set that allows for wrong images, over time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from infoset.arrays import Floats
from infoset.covered_set import CoveredSetView
from infoset.experiments.interception.record_file import replayed
from infoset.sim import Record


@dataclass
class MemberCourse:
    """Predicted misses of a member of a set, from its first step to its last one.

    Parameters
    ----------
    first : int
        First step.
    group : tuple of int or None
        Steps of the images that the member leaves out after a split; None for a class of images.
    intervals_m : list of ndarray, each of shape (C, 2)
        Minimum and maximum predicted miss after the measurement of each step, m.
    is_refuted : bool
        Whether the next measurement refutes the member.
    """

    first: int
    group: tuple[int, ...] | None
    intervals_m: list[Floats] = field(default_factory=list)
    is_refuted: bool = False

    @property
    def steps(self) -> range:
        """Steps of the intervals."""
        return range(self.first, self.first + len(self.intervals_m))


def member_courses(record: Record) -> list[MemberCourse]:
    """Return the courses of all members of the set of an engagement, computed by replay.

    A member that is divided ends, and is not refuted. There are none if the set allows for no wrong
    image.
    """
    ended: list[MemberCourse] = []
    present: dict[int, MemberCourse] = {}
    sets = replayed(record.scenario, record.measured, record.impulse_m_s)
    for number, information in enumerate(sets):
        if not isinstance(information, CoveredSetView):
            return []
        # The sets before and after the measurement of a step follow each other.
        step, is_measured = divmod(number, 2)
        if not is_measured:
            continue

        lower, upper, nonempty = information.predicted_miss_by_member()
        groups = information.groups()
        before = present
        present = {}
        for member in np.flatnonzero(nonempty[0]).tolist():
            group = None if groups is None else groups.get(member)
            course = before.get(member)
            if course is None or course.group != group:
                course = MemberCourse(step, group)
            # The index 0 is that of the only run.
            course.intervals_m.append(np.stack([lower[:, 0, member], upper[:, 0, member]], -1))
            present[member] = course

        for member, course in before.items():
            if present.get(member) is not course:
                course.is_refuted = _is_refuted(course, member, information)
                ended.append(course)
    return [*ended, *present.values()]


def _is_refuted(course: MemberCourse, member: int, information: CoveredSetView) -> bool:
    """Whether a member that ended is refuted, and not divided, nor without a label.

    `information` is the set after the first measurement without it.
    """
    groups = information.groups()
    if groups is None:
        return bool(information.refuted[0, member])

    # After a split: a member that is not refuted, and leaves out only images that the ended one
    # leaves out, is a part of it, or the ended one itself, whose labels have left.
    every = information.model.steps_in(information.model.angle_sensor.period_s)
    classes = information.left_out[member]

    def leaves_out(step: int) -> bool:
        if course.group is not None:
            return step in course.group
        # The images belong to the classes in turn.
        return bool(classes[(step // every) % len(classes)])

    return not any(all(leaves_out(step) for step in group) for group in groups.values())
