"""Burns in sections: the bounds of their errors, by samples of burns, and the section after one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset import Camera, InformationSet, SetModel, StateBox
from infoset.arrays import Floats
from infoset.engine.section_law import section_laws

E_M_S = 10e3
STEP_S = 60.0
BOX = StateBox(
    z_m=(-3e3, 5e3),
    x_m=(4.0e7, 4.001e7),
    vz_m_s=(-2.0, 1.0),
    vx_m_s=(-10.002e3, -9.998e3),
    y_m=(-3e3, 5e3),
    vy_m_s=(-2.0, 1.0),
)
MODEL = SetModel(
    E_M_S,
    STEP_S,
    BOX,
    Camera(STEP_S, 5e-6, 5.0),
    range_threshold_m=1e3,
    sections=2,
    fewest_sections=2,
    execution_error_relative=0.02,
    pointing_error_rad=0.01,
    burn_acceleration_m_s2=0.02,
)


def random_shares(rng: np.random.Generator, shape: tuple[int, ...]) -> Floats:
    """Random errors in units of their bounds: a third each are -1, 1, and uniform between them."""
    which = rng.integers(0, 3, shape)
    return np.choose(which, [-1.0, 1.0, rng.uniform(-1.0, 1.0, shape)])


def executed(
    model: SetModel, impulses: Floats, tau_s: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Return the changes of V and of the predicted miss along z by n burns, shape (2, n), with
    random errors of size, direction and scale; the last two also change during a burn, which has up
    to 5 equal parts.
    """
    acceleration = model.burn_acceleration_m_s2
    assert acceleration is not None
    number = len(tau_s)
    parts = rng.integers(1, 6, number)
    change = model.execution_error_relative * random_shares(rng, (number,))
    duration_s = np.hypot(*impulses) * (1.0 + change) / acceleration
    eta = model.speed_error * random_shares(rng, (5, number))
    angle_error = model.pointing_error_rad * random_shares(rng, (5, number))
    angle = np.arctan2(impulses[1], impulses[0]) + angle_error
    # Acceleration along z is constant in each part: its moments are exact.
    part = np.arange(5.0)[:, None]
    length_s = np.where(part < parts, duration_s / parts, 0.0)
    given = acceleration * length_s * np.sin(angle) / (1.0 + eta)
    to_go_s = tau_s - (part + 0.5) * length_s
    return given.sum(axis=0), (given * to_go_s).sum(axis=0)


@pytest.mark.parametrize(
    ("delta", "psi", "half_width_m_s"),
    [(0.02, 0.01, 2.0), (0.0, 0.0, 50.0), (0.1, 0.0, 0.0), (0.01, 0.001, 100.0), (0.0, 0.1, 1.0)],
)
def test_no_burn_has_errors_beyond_the_bounds_and_some_reach_them(
    delta: float, psi: float, half_width_m_s: float
) -> None:
    speeds = (-E_M_S - half_width_m_s, -E_M_S + half_width_m_s)
    model = replace(
        MODEL,
        bounds=replace(BOX, vx_m_s=speeds),
        execution_error_relative=delta,
        pointing_error_rad=psi,
    )
    law = section_laws(model)[1]
    rng = np.random.default_rng(8)
    impulses = rng.normal(size=(2, 20_000))
    size = np.hypot(*impulses)
    along = np.abs(impulses[1])
    duration_s = law.burn_time * size
    tau_s = rng.uniform(1.2, 50.0, 20_000) * duration_s

    v, miss = executed(model, impulses, tau_s, rng)
    v -= impulses[1]
    miss -= impulses[1] * (tau_s - 0.5 * duration_s)
    # The error is a sum of vectors along (1, tau) and (1, tau - t).
    late = (v * tau_s - miss) / duration_s
    errors = np.abs([v - late, late])
    bounds = np.array(
        [
            law.early_along * along + law.early_across * size,
            law.late_along * along + law.late_across * size,
        ]
    )
    assert (errors <= bounds + 1e-12 * size).all()
    shares = np.where(bounds > 1e-6 * size, errors / np.maximum(bounds, 1e-6 * size), 0.0)
    most = shares.max(axis=1)
    # Both are attained, up to random numbers and, with a pointing error, to the difference of the
    # modulus and the other component.
    assert most[1] > 0.99
    assert most[0] > 0.99 or law.early_along + law.early_across < 1e-6


def test_the_section_after_a_burn_is_the_one_before_plus_two_segments() -> None:
    """In 400 directions: the support of a sum is the sum of the supports."""
    impulse = np.array([[0.3], [-0.5]])
    sets = [InformationSet(MODEL), InformationSet(MODEL)]
    for each in sets:
        # One band that cuts corners of the box.
        each.measure_angle(np.array([[2e-5], [-3e-5]]))
        each.predict()
        each.measure_angle(np.array([[1e-5], [-3e-5]]))
    before, after = sets
    after.shift(impulse)
    for each in sets:
        each.predict()
    size = float(np.hypot(*impulse[:, 0]))
    for axis, law in enumerate(section_laws(MODEL)):
        duration_s = law.burn_time * size
        along = abs(impulse[axis, 0])
        early = law.early_along * along + law.early_across * size
        late = law.late_along * along + law.late_across * size
        for old, new in zip(before.sections(), after.sections(), strict=True):
            for angle in np.linspace(0.0, 2.0 * np.pi, 400):
                # One step after the burn a change of V at the time s before has changed z by s.
                direction = np.array([1e3 * np.cos(angle), np.sin(angle)])
                by_start, by_middle, by_end = (
                    direction @ [1.0, STEP_S - share * duration_s] for share in (0.0, 0.5, 1.0)
                )
                expected = (
                    old.polygons[axis].support_function(direction)
                    - impulse[axis, 0] * by_middle
                    + early * abs(by_start)
                    + late * abs(by_end)
                )
                found = new.polygons[axis].support_function(direction)
                assert found == pytest.approx(expected, abs=1e-6)


def test_a_burn_that_is_too_long_or_before_an_image_is_refused() -> None:
    information = InformationSet(MODEL)
    with pytest.raises(ValueError, match="a burn must end within the step of 60 s"):
        information.shift(1.19)
    information.shift(0.8)
    with pytest.raises(ValueError, match="a measurement must precede the burn of its step"):
        information.measure_angle(0.0)
    information.predict()
    information.measure_angle(0.0)

    information.shift(0.8, where=False)
    information.shift(0.4)
    with pytest.raises(ValueError, match="a step has one burn"):
        information.shift(0.4)

    near = InformationSet(replace(MODEL, bounds=replace(BOX, x_m=(5.5e5, 5.6e5))))
    near.predict()
    with pytest.raises(ValueError, match="earliest possible arrival"):
        near.shift(0.5)
