"""Sections compared with linear programs: with an error for each impulse, and with one error of the
speed for all.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import linprog

from infoset import AngleSensor, InformationSet, Model, SetModel, StateBox
from infoset.arrays import Floats

E_M_S = 58e3
STEP_S = 0.5
NU_M_S2 = 0.005
STEPS = 40
LABEL_M = 2.4e6
ETA = 1.0 / 58.0
BOX = StateBox(z_m=(-10e3, 10e3), x_m=(2.3e6, 2.5e6), vz_m_s=(-100.0, 100.0), vx_m_s=(-59e3, -57e3))
SENSOR = AngleSensor(STEP_S, 0.00015, 0.00023, nominal_range_m=5.8e6)


def history(seed: int) -> tuple[Floats, Floats]:
    """Return the angles and impulses of a flight whose impulses are all (1 + eta) times too great
    for the model.
    """
    rng = np.random.default_rng(seed)
    v = rng.uniform(-50.0, 50.0)
    z = rng.uniform(-1e3, 1e3)
    angles = np.zeros(STEPS)
    impulses = rng.uniform(-7.5, 7.5, STEPS)
    for k in range(STEPS):
        x = LABEL_M - E_M_S * STEP_S * k
        bound = 0.00023 - (0.00023 - 0.00015) * x / 5.8e6
        angles[k] = math.atan(z / x) + rng.choice([-0.99, 0.99]) * bound
        v -= impulses[k] / (1.0 + ETA)
        z += v * STEP_S
    return angles, impulses


def program(angles: Floats, impulses: Floats, direction: Floats, shared: bool) -> float:
    """Return the maximum of a linear function of (V, z) after the last image, by a linear program.

    The unknowns are V and z at the start, the changes of V by the disturbance, and the relative
    errors of the impulses: one for each of them, or one for all.
    """
    share = ETA / (1.0 - ETA)
    number = 2 + STEPS + (1 if shared else STEPS)
    start = [(v * (1.0 + share), w * (1.0 + share)) for v, w in (BOX.vz_m_s, BOX.z_m)]
    half = 0.5 * NU_M_S2 / (1.0 - ETA) * STEP_S
    limits = [*start, (-half, half), *[(-2.0 * half, 2.0 * half)] * (STEPS - 1)]
    limits += [(-share, share)] * (number - len(limits))
    v = np.eye(number)[0]
    z = np.eye(number)[1]
    known_v = 0.0
    known_z = 0.0
    v[2] = 1.0
    rows = []
    bounds = []
    for k in range(STEPS):
        x = LABEL_M - E_M_S * STEP_S * k
        # The sensor's bound, which falls with the range, at the minimum true range (1 - eta) x.
        error = 0.00023 - (0.00023 - 0.00015) * (1.0 - ETA) * x / 5.8e6
        rows += [z / x, -z / x]
        bounds += [
            math.tan(angles[k] + error) - known_z / x,
            known_z / x - math.tan(angles[k] - error),
        ]
        if k == STEPS - 1:
            break
        v = v.copy()
        known_v = known_v - impulses[k]
        v[2 + STEPS + (0 if shared else k)] -= impulses[k]
        z = z + v * STEP_S
        known_z = known_z + known_v * STEP_S
        v = v.copy()
        v[3 + k] += 1.0
    # Rows in units of the bound: the solver's tolerances are absolute.
    best = linprog(
        -(direction[0] * v + direction[1] * z),
        1e4 * np.array(rows),
        1e4 * np.array(bounds),
        bounds=limits,
    )
    assert best.success
    return float(direction[0] * known_v + direction[1] * known_z - best.fun)


@pytest.mark.parametrize("seed", range(4))
def test_section_equals_the_linear_program_with_an_error_for_each_impulse(
    seed: int,
) -> None:
    """It contains the set with one error of the speed for all impulses."""
    angles, impulses = history(seed)
    model = SetModel(
        E_M_S, STEP_S, BOX, SENSOR, disturbance_m_s2=NU_M_S2, sections=5, model=Model.GUARANTEED
    )
    information = InformationSet(model)
    for k in range(STEPS):
        information.measure_angle(angles[k])
        if k < STEPS - 1:
            information.shift(impulses[k])
            information.predict()
    polygon = information.section_at(LABEL_M).polygons[0]
    vertices = polygon.vertices[: int(polygon.counts)]
    to_go_s = LABEL_M / E_M_S - STEP_S * (STEPS - 1)
    since_first_s = STEP_S * (STEPS - 1)
    shares = []
    # The predicted miss, V, the height at the first image without impulses, and z.
    for direction in np.array([[to_go_s, 1.0], [1.0, 0.0], [-since_first_s, 1.0], [0.0, 1.0]]):
        both = np.stack([direction, -direction])
        own, one = (
            np.array([program(angles, impulses, side, shared) for side in both])
            for shared in (False, True)
        )
        of_section = (both @ vertices.T).max(axis=1)
        width = own.sum()
        assert of_section == pytest.approx(own, abs=1e-6 * width)
        assert (one <= of_section + 1e-6 * width).all()
        shares.append(one.sum() / width)
    assert 0.4 < shares[0] < 0.7
    assert max(shares) < 1.0
