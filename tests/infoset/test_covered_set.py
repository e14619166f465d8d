"""Sets that leave images out: their members, their queries, and what a wrong image does to them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from math import comb
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from infoset import InformationSet, Model, SetModel, StateBox
from infoset.arrays import Flags, Floats
from infoset.covered_set import CoveredSet, CoveredSetView, classes_left_out, information_set
from infoset.engine.set_state import SetStatus
from tests.infoset.test_information_set import SENSOR, STEP, E

KNOWN = StateBox((-10e3, 10e3), (5301.3e3, 6301.3e3), (-100.0, 100.0), (-59e3, -57e3))
MODEL = SetModel(
    E,
    STEP,
    KNOWN,
    SENSOR,
    disturbance_m_s2=0.005,
    range_threshold_m=5e3,
    wrong_images=1,
    image_classes=4,
    sections=9,
)
X = 5801.3e3


def flown(
    information: InformationSet, steps: int, wrong: int | None = None, seed: int = 0
) -> list[Floats]:
    """Fly a set through measured angles with errors within the bound, but one wrong image."""
    batch = information.batch
    random = np.random.default_rng(seed)
    z = random.uniform(-1e3, 1e3, (1, batch))
    v = random.uniform(-50.0, 50.0, (1, batch))
    x = X
    measured = []
    for step in range(steps):
        error = random.uniform(-1.0, 1.0, (1, batch))
        if step == wrong:
            error[:] = 50.0
        measured.append(z / x + error * SENSOR.error_bound(x))
        information.measure_angle(measured[-1])
        impulse = random.uniform(-3.0, 3.0, (1, batch))
        information.shift(impulse)
        v = v - impulse
        information.drop_below_threshold()
        information.predict()
        z = z + STEP * v
        x = x - E * STEP
    return measured


class InformationSetOfClasses(InformationSet):
    """An ordinary set that is not told of the images of some classes."""

    def __init__(self, model: SetModel, batch: int, left_out: Flags) -> None:
        super().__init__(model, batch)
        self._left_out = left_out
        self._image = 0

    def measure_angle(self, alpha_rad: ArrayLike, where: ArrayLike = True) -> None:
        uses = not self._left_out[self._image % len(self._left_out)]
        self._image += 1
        super().measure_angle(alpha_rad, where if uses else False)


@pytest.mark.parametrize(("wrong", "classes"), [(1, 3), (1, 4), (2, 5), (2, 6), (3, 8)])
def test_every_set_of_wrong_images_is_left_out_by_some_member(wrong: int, classes: int) -> None:
    left_out = classes_left_out(wrong, classes)
    assert left_out.shape == (comb(classes, wrong), classes)
    assert (left_out.sum(axis=1) == wrong).all()
    for of_wrong_images in combinations(range(classes), wrong):
        assert left_out[:, of_wrong_images].all(axis=1).any()


def test_information_set_without_wrong_images_is_an_ordinary_one() -> None:
    assert (
        type(information_set(replace(MODEL, wrong_images=0, image_classes=None))) is InformationSet
    )
    assert type(information_set(MODEL)) is CoveredSet


@pytest.mark.parametrize(("wrong", "classes"), [(1, 4), (2, 5)])
def test_member_equals_an_ordinary_set_without_its_images(wrong: int, classes: int) -> None:
    model = replace(MODEL, wrong_images=wrong, image_classes=classes)
    covered = CoveredSet(model, 2)
    flown(covered, 40)
    ordinary = replace(model, wrong_images=0, image_classes=None)
    lower, upper, _ = covered.predicted_miss_by_member()
    for member, left_out in enumerate(covered.left_out):
        alone = InformationSetOfClasses(ordinary, 2, left_out)
        flown(alone, 40)
        miss = alone.predicted_miss()
        np.testing.assert_array_equal(lower[..., member], miss.lower_m)
        np.testing.assert_array_equal(upper[..., member], miss.upper_m)


def test_predicted_miss_is_the_smallest_interval_of_all_members() -> None:
    covered = CoveredSet(MODEL, 3)
    flown(covered, 60)
    lower, upper, nonempty = covered.predicted_miss_by_member()
    miss = covered.predicted_miss()
    assert nonempty.all()
    np.testing.assert_array_equal(miss.lower_m, lower.min(axis=2))
    np.testing.assert_array_equal(miss.upper_m, upper.max(axis=2))
    by_section = covered.predicted_miss_by_section_m()
    np.testing.assert_array_equal(
        np.where(covered.feasible, by_section[1], -np.inf).max(axis=2), miss.upper_m
    )
    of_member = covered._members.predicted_miss().upper_point.range_m.reshape(1, 3, -1)
    widest = upper.argmax(axis=2)[..., None]
    chosen = np.take_along_axis(of_member, widest, axis=2)[..., 0]
    np.testing.assert_array_equal(miss.upper_point.range_m, chosen)


def test_sections_of_members_have_an_empty_one_between_them() -> None:
    covered = CoveredSet(MODEL, 2)
    flown(covered, 5)
    stored = covered.feasible.shape[1] // 4
    assert not covered.feasible[:, stored - 1 :: stored].any()
    assert len(covered.sections(1)) == covered.section_counts[1]


def test_set_with_more_wrong_images_than_assumed_becomes_inconsistent() -> None:
    covered = CoveredSet(MODEL)
    random = np.random.default_rng(0)
    for step in range(40):
        covered.measure_angle(random.uniform(-0.01, 0.01) if step >= 20 else 0.0)
        covered.predict()
    assert covered.inconsistent.all()
    _, exists = covered.guaranteed_miss()
    assert not exists.any()


def test_member_that_may_be_empty_without_a_proof_withholds_the_guarantee() -> None:
    covered = CoveredSet(MODEL)
    wrong = 21
    flown(covered, wrong + 1, wrong)
    while covered.tracking.any():
        covered.drop_below_threshold()
        covered.predict()
    phi_m, exists = covered.guaranteed_miss()
    assert exists.all()
    assert phi_m.min() > 0.0

    # A search that ended in an interval of labels as short as their rounding, or whose sections
    # were reduced.
    emptied = int(np.flatnonzero(covered.emptied[0])[0])
    covered._state.sections.unproved[emptied] = True
    _, exists = covered.guaranteed_miss()
    assert not exists.any()
    assert not covered.refuted[0, emptied]
    assert covered.emptied[0, emptied]


def after_a_wrong_image(model: SetModel, steps_without_image: int) -> CoveredSet:
    """A covered set after steps without an image, and then four good images and a wrong one."""
    covered = CoveredSet(model)
    for step in range(steps_without_image + 5):
        is_wrong = step == steps_without_image + 4
        covered.measure_angle(0.02 if is_wrong else 0.0, where=step >= steps_without_image)
        covered.predict()
    assert covered.tracking.all()
    return covered


def test_emptiness_of_an_ordinary_set_of_labels_is_proved() -> None:
    covered = after_a_wrong_image(MODEL, 20)
    assert covered.refuted.sum() == 3


def test_emptiness_of_an_exactly_known_label_is_proved() -> None:
    exact = replace(KNOWN, x_m=(X, X), vx_m_s=(-E, -E))
    covered = after_a_wrong_image(replace(MODEL, bounds=exact), 20)
    assert covered.refuted.sum() == 3


@pytest.mark.parametrize(
    ("model", "steps_without_image"),
    [
        # The labels are 4 ulp wide: the search does not look between the two that it evaluates.
        (
            replace(MODEL, bounds=replace(KNOWN, x_m=(X, X * (1.0 + 8.0e-16)), vx_m_s=(-E, -E))),
            20,
        ),
        # Without images a step adds two vertices, up to 256: the sections are reduced.
        (MODEL, 140),
    ],
)
def test_member_leaves_an_image_out_if_it_may_be_empty_without_a_proof(
    model: SetModel, steps_without_image: int
) -> None:
    covered = after_a_wrong_image(model, steps_without_image)
    assert not covered.emptied.any()
    assert covered.proof_step.mask.all()
    # All members are as if the last image had been lost.
    untold = CoveredSet(model)
    for step in range(steps_without_image + 5):
        is_image = steps_without_image <= step < steps_without_image + 4
        untold.measure_angle(0.0, where=is_image)
        untold.predict()
    lower, upper, _ = covered.predicted_miss_by_member()
    expected_lower, expected_upper, _ = untold.predicted_miss_by_member()
    np.testing.assert_allclose(lower, expected_lower, rtol=1e-3)
    np.testing.assert_allclose(upper, expected_upper, rtol=1e-3)


def test_member_that_would_leave_out_many_images_is_empty_without_a_proof() -> None:
    covered = after_a_wrong_image(MODEL, 140)
    for _ in range(5):
        covered.measure_angle(0.02)
        covered.predict()
    assert covered.emptied.any()
    assert covered.tracking.all()
    assert not covered.refuted.any()


def test_member_recovers_only_if_no_other_one_lives() -> None:
    covered = CoveredSet(MODEL)
    flown(covered, 20)
    # Only the set without image 20 lives: it is proved to be wrong.
    covered.measure_angle(0.02)
    assert covered.suspected_steps() == [20]
    assert covered.emptied[0].sum() == 3
    living = ~covered.emptied
    assert covered._nonempty_members().tolist() == living.tolist()
    covered.predict()

    covered.measure_angle(-0.02)
    assert covered.inconsistent.all()
    assert covered._nonempty_members().tolist() == living.tolist()
    assert covered.tracking.all()
    assert not covered.guaranteed_miss()[1].any()


def test_member_whose_labels_have_left_counts_although_the_others_are_empty() -> None:
    near = replace(KNOWN, x_m=(200e3, 400e3))
    covered = CoveredSet(replace(MODEL, bounds=near))
    for _ in range(8):
        covered.measure_angle(0.0)
        covered.drop_below_threshold()
        covered.predict()
    status = covered._members_status()
    assert (status == SetStatus.TRACKING.value).all()
    assert covered._state.some_left.all()

    # Two contradictory images: all members become empty, but labels of all have left.
    for alpha in (0.05, -0.05):
        covered.measure_angle(alpha)
        covered.drop_below_threshold()
        covered.predict()
    assert not covered.tracking.any()
    assert not covered.inconsistent.any()
    assert not covered.refuted.any()
    assert covered.guaranteed_miss()[1].all()


def test_view_and_copy_of_a_covered_set_agree_with_it() -> None:
    covered = CoveredSet(MODEL, 2)
    view = covered.view()
    flown(covered, 11)
    assert type(view) is CoveredSetView
    twin = view.copy()
    np.testing.assert_array_equal(view.feasible, covered.feasible)
    for information in (covered, twin):
        information.measure_angle(0.0)
    np.testing.assert_array_equal(twin.labels_m, covered.labels_m)
    np.testing.assert_array_equal(twin.predicted_miss().upper_m, covered.predicted_miss().upper_m)


def test_extreme_angles_are_those_of_all_members() -> None:
    covered = CoveredSet(MODEL, 2)
    flown(covered, 30)
    lowest, highest, _, _ = covered.min_and_max_alpha()
    for engagement in range(2):
        alphas = np.concatenate(
            [section.omega_alpha[0].polygon()[:, 1] for section in covered.sections(engagement)]
        )
        np.testing.assert_allclose(lowest[0, engagement], alphas.min(), rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(highest[0, engagement], alphas.max(), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"wrong_images": 0}, "image_classes belongs to wrong_images"),
        ({"model": Model.PAPER}, 'wrong_images must be 0 in model = "paper"'),
        ({"wrong_images": 2, "image_classes": 3}, "image_classes must be at least 4"),
        ({"wrong_images": 3, "image_classes": 16}, "at most 64 sets"),
        ({"wrong_images": 4}, "wrong_images must be at most 3"),
    ],
)
def test_model_with_senseless_wrong_images_is_refused(
    changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        replace(MODEL, **changes)


def test_lost_image_does_not_change_the_classes_of_later_images() -> None:
    told = CoveredSet(MODEL)
    untold = CoveredSet(MODEL)
    for step in range(12):
        is_lost = step in (2, 3, 7)
        for information in (told, untold):
            if not is_lost:
                information.measure_angle(1e-5 * step)
        if is_lost:
            told.measure_angle(0.0, where=False)
        told.predict()
        untold.predict()
    for before, after in zip(
        told.predicted_miss_by_member(), untold.predicted_miss_by_member(), strict=True
    ):
        np.testing.assert_array_equal(before, after)


def test_section_of_a_member_that_does_not_exist_is_refused() -> None:
    covered = CoveredSet(MODEL, batch=2)

    # Member 4 of engagement 0 would be member 0 of engagement 1.
    with pytest.raises(ValueError, match="member must be at most 3: got 4"):
        covered.section_at(X, engagement=0, member=4)


def test_rates_are_refused() -> None:
    with pytest.raises(ValueError, match="cannot be cut by rates"):
        CoveredSet(MODEL).measure_rate(0.0, 1e-6)
