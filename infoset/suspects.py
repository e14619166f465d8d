"""Images that may be wrong after a wrong image is proved, and the split of the members.

If at most one image is wrong, a proof says more than that a member is empty: the wrong image is one
of the images so far that the other members leave out. They are divided into groups, each of which a
new member leaves out; groups whose member is empty are cleared, and the others are divided further.
See Lemma 24 in docs/guarantee-wrong-images.md.
"""

from __future__ import annotations

import copy

import numpy as np

from infoset.arrays import Flags
from infoset.engine.set_state import SetState


class Suspects:
    """Images of B engagements so far, and those that each of R members leaves out.

    Member m of engagement b is the set b R + m of the members' state.

    Attributes
    ----------
    proof_step : ndarray of int, shape (B,)
        Step at which the first member was refuted; -1 before.
    is_split : ndarray of bool, shape (B,)
        Engagements whose members use all later images.
    """

    def __init__(self, batch: int, left_out: Flags) -> None:
        self._left_out = left_out
        self.proof_step = np.full(batch, -1, dtype=np.int64)
        self.is_split = np.zeros(batch, dtype=bool)
        # Number of refuted members, and step of the last refutation.
        self._refuted = np.zeros(batch, dtype=np.int64)
        self._last_step = np.full(batch, -1, dtype=np.int64)

        # Of each image: its step, its class, its event in the history, and where it was measured.
        self._steps: list[int] = []
        self._classes: list[int] = []
        self._events: list[int] = []
        self._measured: list[Flags] = []
        # Images that each member leaves out, by engagement after its split.
        self._groups: dict[int, dict[int, tuple[int, ...]]] = {}

    def copy(self) -> Suspects:
        """Return an independent copy; `_left_out`, which never changes, is shared."""
        twin = copy.copy(self)
        for name, value in vars(self).items():
            if name != "_left_out":
                # Shallow: what the lists and dictionaries contain is replaced, never changed.
                setattr(twin, name, value.copy())
        return twin

    def record_image(self, state: SetState, image_class: int, measured: Flags) -> None:
        """Note the image that the members are about to be cut by; `measured` has the shape (B,)."""
        self._steps.append(state.elapsed)
        self._classes.append(image_class)
        self._events.append(state.history.events)
        self._measured.append(measured.copy())

    def update(self, state: SetState, wrong_images: int) -> None:
        """Note new refutations, and split the members of their engagements if `wrong_images`, the
        maximum number of wrong images, is 1.
        """
        refuted = self._is_refuted(state)
        count = refuted.sum(axis=1)
        newly = np.flatnonzero(count > self._refuted)
        self._refuted = count
        self._last_step[newly] = state.elapsed
        for engagement in newly.tolist():
            if self.proof_step[engagement] < 0:
                self.proof_step[engagement] = state.elapsed
            if wrong_images == 1 and not refuted[engagement].all():
                self._split(engagement, state)

    def steps(self, engagement: int, state: SetState) -> list[int]:
        """Return the steps of the images at least one of which is wrong.

        They are the images that some member that is not refuted leaves out, until the last
        refutation. There are none before a wrong image is proved, and if all members are refuted.
        """
        if self.proof_step[engagement] < 0:
            return []
        members = self._living(engagement, state)
        images = {image for member in members for image in self._group(engagement, member)}
        steps = [self._steps[image] for image in sorted(images)]
        return [step for step in steps if step <= self._last_step[engagement]]

    def groups(self, engagement: int, state: SetState) -> dict[int, tuple[int, ...]] | None:
        """Return the steps of the images that each member that is not refuted leaves out; None
        before the split.
        """
        if not self.is_split[engagement]:
            return None
        return {
            member: tuple(self._steps[image] for image in self._groups[engagement][member])
            for member in self._living(engagement, state)
            if member in self._groups[engagement]
        }

    def _is_refuted(self, state: SetState) -> Flags:
        """Whether each member is proved to be empty, shape (B, R)."""
        refuted = (state.lost_step >= 0) & ~state.sections.unproved
        return np.asarray(refuted.reshape(-1, len(self._left_out)))

    def _living(self, engagement: int, state: SetState) -> list[int]:
        """Return the members that are not refuted."""
        living: list[int] = np.flatnonzero(~self._is_refuted(state)[engagement]).tolist()
        return living

    def _group(self, engagement: int, member: int) -> tuple[int, ...]:
        """Return the images so far that a member leaves out."""
        if self.is_split[engagement]:
            return self._groups[engagement][member]
        classes = self._left_out[member]
        return tuple(
            image
            for image, measured in enumerate(self._measured)
            if measured[engagement] and classes[self._classes[image]]
        )

    def _split(self, engagement: int, state: SetState) -> None:
        """Replace the members of an engagement by members that leave out as few images as possible.

        The largest group of images is halved until all groups are single images, or no member is
        free. About 2 log2(N) sets are computed by replay for N suspected images.
        """
        members = len(self._left_out)
        first = engagement * members
        groups = {
            member: self._group(engagement, member) for member in self._living(engagement, state)
        }
        rows = [first + member for member in groups]
        # Labels that have left belong to Phi, and a set that becomes empty then is not refuted.
        if state.some_left[rows].any() or not state.tracking[rows].all():
            return

        while True:
            free = [member for member in range(members) if member not in groups]
            largest = max(groups, key=lambda member: len(groups[member]))
            images = groups[largest]
            if len(images) < 2 or not free:
                break

            # With two free members the divided one is kept until the new ones are known.
            middle = len(images) // 2
            halves = {free[0]: images[:middle]}
            halves[free[1] if len(free) > 1 else largest] = images[middle:]
            nonempty = self._replace(halves, images, first, first + largest, state)
            is_kept = largest not in halves
            # A half is cleared only if its set is proved to be empty.
            doubtful = state.sections.unproved[first : first + members]
            if any(doubtful[member] for member in halves if member not in nonempty):
                if is_kept:
                    # The group stays whole.
                    for member in halves:
                        state.retire(first + member)
                else:
                    # Phi is withheld: no set contains the doubtful half.
                    del groups[largest]
                    groups |= halves
                break
            if not nonempty and len(groups) == 1:
                # Every image is cleared: more than one is wrong, and the set goes on as it is.
                state.refute(first + largest)
                break

            if is_kept:
                state.retire(first + largest)
            del groups[largest]
            groups |= nonempty

        self.is_split[engagement] = True
        self._groups[engagement] = groups
        self._refuted[engagement] = members - len(self._living(engagement, state))

    def _replace(
        self,
        halves: dict[int, tuple[int, ...]],
        images: tuple[int, ...],
        first: int,
        divided: int,
        state: SetState,
    ) -> dict[int, tuple[int, ...]]:
        """Give each member of `halves` the set without its half of the `images` that the member in
        row `divided` leaves out. Return those whose set is not empty.

        The member in row `divided` may be the last one of `halves`: the others are computed from
        its set before.
        """
        left_out = state.history.applies[: state.history.events, divided].copy()
        nonempty = {}
        for member, half in halves.items():
            applies = left_out.copy()
            applies[[self._events[image] for image in images if image not in half]] = True
            if state.replace(first + member, divided, applies):
                nonempty[member] = half
        return nonempty
