"""The stored sections of a batch of engagements, and the passes over them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from infoset import chains, section_life, section_passes
from infoset.chains import Chains
from infoset.history import History
from infoset.section_law import SectionLaw
from infoset.section_passes import Sections

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class SectionStack:
    """B engagements x S slots of one section each, carried in place.

    Parameters
    ----------
    law : SectionLaw
    labels : ndarray, shape (B, S)
        Label of each slot, m; the slots in use come first, in rising order.
    used : ndarray of int, shape (B,)
        Number of slots in use.

    Attributes
    ----------
    least_label : float
        No living section has a lesser label, m.
    """

    def __init__(self, law: SectionLaw, labels: Floats, used: NDArray[np.int64]) -> None:
        self.law = law
        self.sections = section_passes.room_for_sections(labels, used.astype(np.int64))
        self._stale = np.ones(self.batch, dtype=bool)
        self._nobody = np.zeros(self.batch, dtype=bool)
        self._behind = self._nobody
        self._is_stale, self._is_behind, self._has_heights = True, False, False
        self._spare = 0
        self._elapsed = 0
        section_passes.start_all(self.sections, law)
        self.least_label = self._least_label()

    @property
    def batch(self) -> int:
        """Number of engagements B."""
        return int(self.sections.labels.shape[0])

    @property
    def labels(self) -> Floats:
        """Label of every slot, m, shape (B, S)."""
        return self.sections.labels

    @property
    def living(self) -> Flags:
        """Which slots hold a living section, shape (B, S)."""
        return self.sections.living

    @property
    def summaries(self) -> Floats:
        """Summary of each living section but for its heights, shape (B, S, columns), brought up to date."""
        self._summarise()
        return self.sections.summaries

    @property
    def heights(self) -> tuple[Floats, Floats]:
        """Least and greatest z of each living section, m, each (B, S)."""
        if not self._has_heights:
            # Who asks for them will ask for the rest.
            self._summarise(heights_wanted=True)
        summaries = self.sections.summaries
        return summaries[:, :, section_life.Z_LEAST], summaries[:, :, section_life.Z_GREATEST]

    def _summarise(self, heights_wanted: bool = False) -> None:
        """Bring sections and summaries up to date."""
        if self._is_stale or heights_wanted:
            self._pass(self._stale, heights_wanted)
            self._behind = self._stale = self._nobody
            self._is_behind = self._is_stale = False
            self._has_heights |= heights_wanted

    def _pass(self, stale: Flags, heights_wanted: bool) -> None:
        """Move the sections that are behind to the step, and summarise the stale ones."""
        alpha = np.empty(0)
        section_passes.step_all(
            self._behind, self._nobody, stale, heights_wanted, alpha, self._elapsed, 0, self.sections, self.law
        )

    def _catch_up(self) -> None:
        """Bring sections up to date."""
        if self._is_behind:
            self._pass(self._nobody, False)
            self._behind, self._is_behind = self._nobody, False

    def ranges(self, elapsed: int) -> Floats:
        """Range of every slot after a number of steps, m, shape (B, S)."""
        return self.labels - self.law.closing_speed * (self.law.step * elapsed)

    def _make_room(self, active: Flags) -> None:
        """See that each living section may gain what a step adds; mostly that was seen to some steps ago."""
        self._spare -= chains.MOST_ADDED
        if self._spare >= 0:
            return
        elapsed, points = self._elapsed, chains.working_room()
        make_room = section_passes.make_room_all
        floats, spare = make_room(active, chains.ROOM_AHEAD, elapsed, self.sections, self.law, points, False)
        if floats or spare < chains.MOST_ADDED:
            self.sections = self.sections._replace(rings=chains.with_room(self.sections.rings, floats))
            _, spare = make_room(active, chains.ROOM_AHEAD, elapsed, self.sections, self.law, points, True)
        self._spare = spare - chains.MOST_ADDED

    def make_room_for_new(self, wanted: Flags, number: int) -> None:
        """See that there is room for so many sections of any size in each of the wanted engagements."""
        self._catch_up()
        self._has_heights = False
        floats = 2 * (2 * chains.CAPACITY + chains.LINE) * number * int(np.count_nonzero(wanted))
        self.sections = self.sections._replace(rings=chains.with_room(self.sections.rings, floats))

    def note_new(self, spare: int) -> None:
        """Note that there are new sections, of which the fullest may gain so many vertices."""
        self._spare = min(self._spare, spare)
        self.least_label = self._least_label()

    def _least_label(self) -> float:
        return float(np.where(self.sections.living, self.sections.labels, np.inf).min())

    def measure_angle(self, active: Flags, alpha: Floats, elapsed: int, event: int) -> int:
        """Cut the living sections by angle measurements (rad); return how many died."""
        deaths = section_passes.step_all(
            self._behind, active, self._nobody, False, alpha, elapsed, event, self.sections, self.law
        )
        self._behind, self._is_behind = self._nobody, False
        self._measured(active)
        return deaths

    def measure_rate(
        self, active: Flags, omega: Floats, error: float, elapsed: int, event: int, history: History
    ) -> int:
        """Cut the living sections by measured rates of the line of sight (rad/s); return how many died."""
        self._catch_up()
        self._make_room(active)
        room, values, applies = chains.working_room(), np.empty(history.events), np.empty(history.events, dtype=bool)
        deaths = section_passes.measure_rate_all(
            active, omega, error, elapsed, event, history.tapes, values, applies, self.sections, self.law, room
        )
        self._measured(active)
        return deaths

    def _measured(self, active: Flags) -> None:
        """Note that the summaries of the active engagements are fresh, but for the heights."""
        if self._is_stale:
            self._stale = self._stale & ~active
            self._is_stale = bool(self._stale.any())
        self._has_heights = False

    def shift(self, active: Flags, impulse: Floats, elapsed: int) -> None:
        """Shift the living sections, and their summaries, by impulses (m/s)."""
        self._catch_up()
        section_passes.shift_all(active, impulse, elapsed, self.sections, self.law)

    def predict(self, active: Flags, elapsed: int) -> None:
        """Move the living sections to step `elapsed`.

        Notes
        -----
        They are moved when somebody looks at them, or with the next measurement: one pass over the memory, not two.
        """
        self._catch_up()
        self._make_room(active)
        self._behind = active.copy()
        self._stale = self._stale | active if self._is_stale else self._behind
        self._is_behind = self._is_stale = True
        self._has_heights = False
        self._elapsed = elapsed

    def keep_labels(self, least: Floats, greatest: Floats, active: Flags) -> tuple[Flags, int]:
        """Remove the living sections whose labels are outside [least, greatest]; return which, and how many."""
        sections = self.sections
        inside = (least[:, None] <= sections.labels) & (sections.labels <= greatest[:, None])
        used = np.arange(sections.labels.shape[1]) < sections.used[:, None]
        removed = active[:, None] & used & sections.living & ~inside
        sections.living[removed] = False
        return removed, int(np.count_nonzero(removed))

    def margins(self, v: Floats, z: Floats, elapsed: int) -> Floats:
        """Signed margin of states (V, z) in the first slot of each engagement, m."""
        self._catch_up()
        margins = np.empty(self.batch)
        section_passes.margins_all(v, z, elapsed, self.sections, self.law, margins)
        return margins

    def widest(self, elapsed: int) -> tuple[Flags, Floats]:
        """Predicted-miss interval of each engagement, as `section_passes.widest_all` writes it."""
        self._summarise()
        exists, ends = np.zeros(self.batch, dtype=bool), np.zeros((self.batch, 2, 4))
        section_passes.widest_all(elapsed, self.sections, self.law, exists, ends)
        return exists, ends

    def polygon(self, engagement: int, slot: int, elapsed: int) -> Floats:
        """Vertices (V, z) of a living section, counter-clockwise, shape (n, 2)."""
        self._catch_up()
        row = engagement * self.labels.shape[1] + slot
        section = Chains(self.sections.origins, self.sections.rings, self.sections.marks)
        return outline(section, row, float(self.labels[engagement, slot]), elapsed, self.law)

    def copy(self) -> SectionStack:
        """A stack of its own with the same sections."""
        twin = SectionStack.__new__(SectionStack)
        twin.law = self.law
        arrays = {name: array.copy() for name, array in self.sections._asdict().items() if name != "rings"}
        rings = chains.copy_of_rings(self.sections.rings, self.sections.rings.size)
        twin.sections = Sections(**arrays, rings=rings)
        twin._stale, twin._behind, twin._nobody = self._stale, self._behind, self._nobody
        twin._is_stale, twin._is_behind = self._is_stale, self._is_behind
        twin._has_heights, twin._elapsed, twin._spare = self._has_heights, self._elapsed, self._spare
        twin.least_label = self.least_label
        return twin


def outline(section: Chains, row: int, label: float, elapsed: int, law: SectionLaw) -> Floats:
    """Vertices (V, z) of a section, counter-clockwise, shape (n, 2)."""
    points = chains.working_room()
    time_to_go = (label - law.closing_speed * (law.step * elapsed)) / law.closing_speed
    return points[: section_passes.write_outline(*section, row, time_to_go, points)].copy()
