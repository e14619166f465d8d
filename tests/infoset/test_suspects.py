"""Images that may be wrong after a proof, and members that leave out single images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from infoset import InformationSet, SetStatus
from infoset.arrays import Flags, Floats
from infoset.covered_set import CoveredSet
from infoset.engine.guaranteed_miss import TIGHT
from infoset.engine.set_state import SetState
from tests.infoset.test_covered_set import MODEL, X
from tests.infoset.test_information_set import SENSOR, STEP, E

ORDINARY = replace(MODEL, wrong_images=0, image_classes=None)
FLIGHT_STEPS = 200
"""Steps until all labels have left: the farthest are at 6301 km, and a step is 29 km."""


class Flown(NamedTuple):
    """Measured angles, rad, and impulses, m/s, of B engagements, each of shape (steps, 1, B)."""

    alpha_rad: Floats
    impulse_m_s: Floats


def flown(
    steps: int,
    wrong: Mapping[int, Sequence[int]],
    batch: int = 1,
    size: float = 50.0,
    seed: int = 3,
) -> Flown:
    """Fly engagements with errors within the bound, but `size` bounds in the images of `wrong`, by
    engagement.
    """
    random = np.random.default_rng(seed)
    z = random.uniform(-1e3, 1e3, (1, batch))
    v = random.uniform(-50.0, 50.0, (1, batch))
    alpha = np.empty((steps, 1, batch))
    impulse = random.uniform(-3.0, 3.0, (steps, 1, batch))
    for step in range(steps):
        x = X - E * STEP * step
        error = random.uniform(-1.0, 1.0, (1, batch))
        for engagement, images in wrong.items():
            if step in images:
                error[:, engagement] = size
        alpha[step] = z / x + error * SENSOR.error_bound(x)
        v = v - impulse[step]
        z = z + STEP * v
    return Flown(alpha, impulse)


def feed(information: InformationSet, flight: Flown, without: Flags | None = None) -> None:
    """Give a flight to a set, without some images of its engagements, shape (steps, B)."""
    for step, (alpha, impulse) in enumerate(zip(*flight, strict=True)):
        information.measure_angle(alpha, True if without is None else ~without[step])
        information.shift(impulse)
        information.drop_below_threshold()
        information.predict()


def single(flight: Flown, image: int) -> InformationSet:
    """The ordinary set of a flight of one engagement without one image."""
    information = InformationSet(ORDINARY)
    without = np.zeros((len(flight.alpha_rad), 1), dtype=bool)
    without[image] = True
    feed(information, flight, without)
    return information


@pytest.mark.parametrize("classes", [3, 4, 8])
def test_large_wrong_image_is_proved_at_its_step_and_named(classes: int) -> None:
    flight = flown(40, {0: [21]})
    covered = CoveredSet(replace(MODEL, image_classes=classes))
    feed(covered, Flown(*(values[:21] for values in flight)))
    assert covered.proof_step.count() == 0
    assert covered.suspected_steps() == []
    feed(covered, Flown(*(values[21:] for values in flight)))
    assert covered.proof_step.tolist() == [21]
    assert covered.suspected_steps() == [21]
    assert not covered.inconsistent.any()
    assert covered.status == [SetStatus.TRACKING]


@pytest.mark.parametrize(
    ("seed", "size"),
    [
        (3, 1.6),
        # Proved later than at the step of the wrong image.
        (9, 1.3),
        # Several images explain the contradiction.
        (13, 1.3),
        (15, 1.3),
        (22, 1.3),
    ],
)
def test_suspects_are_the_images_without_which_the_set_is_not_empty(seed: int, size: float) -> None:
    steps = 60
    flight = flown(steps, {0: [33]}, size=size, seed=seed)
    covered = CoveredSet(MODEL)
    feed(covered, flight)

    every = Flown(*(np.repeat(values, steps, axis=2) for values in flight))
    singles = InformationSet(ORDINARY, steps)
    feed(singles, every, np.eye(steps, dtype=bool))
    possible = np.flatnonzero(~singles.inconsistent).tolist()
    assert 33 in possible
    assert covered.suspected_steps() == possible


def test_section_after_the_split_equals_that_of_all_images_but_the_wrong_one() -> None:
    flight = flown(60, {0: [21]})
    covered = CoveredSet(MODEL)
    feed(covered, flight)
    ordinary = single(flight, 21)
    (member,) = np.flatnonzero(~covered.refuted[0]).tolist()
    for section in ordinary.sections():
        same = covered.section_at(section.label_m, member=member)
        np.testing.assert_array_equal(same.polygons[0].polygon(), section.polygons[0].polygon())


def test_phi_after_the_split_is_that_of_all_single_images() -> None:
    flight = flown(FLIGHT_STEPS, {0: [70]})
    covered = CoveredSet(MODEL)
    feed(covered, flight)
    phi_m, exists = covered.guaranteed_miss()
    expected_m, expected = single(flight, 70).guaranteed_miss()
    assert exists.all()
    assert expected.all()
    # Both are at most 0.1 % above the exact maximum.
    assert expected_m / TIGHT <= phi_m <= expected_m * TIGHT


def test_engagements_of_a_batch_are_split_at_their_own_steps() -> None:
    flight = flown(40, {0: [12], 2: [30]}, batch=3)
    together = CoveredSet(MODEL, 3)
    feed(together, flight)
    assert together.proof_step.filled(-1).tolist() == [12, -1, 30]
    assert [together.suspected_steps(engagement) for engagement in range(3)] == [[12], [], [30]]
    miss = together.predicted_miss()
    for engagement in range(3):
        alone = CoveredSet(MODEL)
        feed(alone, Flown(*(values[..., [engagement]] for values in flight)))
        assert alone.suspected_steps() == together.suspected_steps(engagement)
        of_one = alone.predicted_miss()
        np.testing.assert_array_equal(of_one.lower_m[:, 0], miss.lower_m[:, engagement])
        np.testing.assert_array_equal(of_one.upper_m[:, 0], miss.upper_m[:, engagement])


def test_second_wrong_image_after_the_split_makes_the_set_inconsistent() -> None:
    covered = CoveredSet(MODEL)
    feed(covered, flown(60, {0: [21, 40]}))
    assert covered.inconsistent.all()
    assert covered.proof_step.tolist() == [21]
    assert covered.suspected_steps() == []
    assert covered.tracking.all()


def test_set_whose_images_are_all_cleared_is_inconsistent(monkeypatch: pytest.MonkeyPatch) -> None:
    """The member without a class is not empty, but each set of all images but one is."""
    flight = flown(60, {0: [21, 25]})
    covered = CoveredSet(MODEL)
    with monkeypatch.context() as patched:
        patched.setattr(covered._suspects, "update", lambda *_: None)
        feed(covered, Flown(*(values[:30] for values in flight)))
    assert (~covered.refuted).sum() == 1

    feed(covered, Flown(*(values[30:] for values in flight)))
    assert covered.inconsistent.all()
    assert covered.suspected_steps() == []
    assert covered.tracking.all()


def test_half_whose_set_is_not_proved_to_be_empty_is_not_cleared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flight = flown(40, {0: [21]})
    covered = CoveredSet(MODEL)
    replaced = SetState.replace

    def without_proof(state: SetState, row: int, source: int, applies: Flags) -> bool:
        is_nonempty = replaced(state, row, source, applies)
        state.sections.unproved[row] = not is_nonempty
        return is_nonempty

    monkeypatch.setattr(SetState, "replace", without_proof)
    feed(covered, flight)

    # The whole class of image 21 stays suspected, and its set contains the truth.
    assert covered.proof_step.tolist() == [21]
    assert covered.suspected_steps() == [1, 5, 9, 13, 17, 21]
    assert covered.status == [SetStatus.TRACKING]


def test_set_that_is_empty_without_a_proof_proves_no_wrong_image(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("infoset.engine.set_state.MAX_DISCARDED", 0)
    flight = flown(FLIGHT_STEPS, {0: [21]})
    covered = CoveredSet(MODEL)
    feed(covered, Flown(*(values[:21] for values in flight)))
    covered._state.sections.unproved[:] = True
    feed(covered, Flown(*(values[21:] for values in flight)))
    assert covered.emptied.sum() == 3
    # Labels have left, but Phi is withheld: an emptied set may contain the truth.
    assert covered._state.some_left.any()
    assert covered.proof_step.count() == 0
    assert covered.suspected_steps() == []
    assert not covered.guaranteed_miss()[1].any()


def test_wrong_images_of_two_classes_are_suspected_by_their_classes() -> None:
    """For q = 2 members are not split: all images so far of their classes are suspected."""
    model = replace(MODEL, wrong_images=2, image_classes=5)
    covered = CoveredSet(model)
    feed(covered, flown(40, {0: [21, 28]}))
    assert not covered.inconsistent.any()
    suspected = covered.suspected_steps()
    assert {21, 28} <= {*suspected}
    assert {step % 5 for step in suspected} == {1, 3}
    assert max(suspected) == 28


def test_lost_images_are_not_suspected() -> None:
    flight = flown(40, {0: [21]})
    lost = np.zeros((40, 1), dtype=bool)
    lost[[1, 5, 9, 21]] = True
    covered = CoveredSet(MODEL)
    feed(covered, flight, lost)
    assert covered.proof_step.count() == 0


def test_copy_of_a_covered_set_goes_on_alone() -> None:
    flight = flown(40, {0: [21]})
    covered = CoveredSet(MODEL)
    feed(covered, Flown(*(values[:15] for values in flight)))
    twin = covered.copy()
    feed(twin, Flown(*(values[15:] for values in flight)))
    assert twin.suspected_steps() == [21]
    assert covered.proof_step.count() == 0
    assert covered.suspected_steps() == []
