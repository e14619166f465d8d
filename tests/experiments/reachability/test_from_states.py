"""`infoset problems from-states`: a rendezvous from the OEM files of two craft."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import load_problem
from infoset.experiments.reachability.from_states import problem_of
from infoset.rendezvous.reachability import MotionModel
from infoset.rendezvous.two_body import coast
from tests.experiments.command_line import Command
from tests.oem_text import HEADER, segment

MU = 3.986004418e14
EPOCH = "2026-03-01T12:04:00"
EPOCHS = tuple(f"2026-03-01T12:{minute:02d}:00" for minute in range(9))
RELATIVE = np.array([30.0, -1000.0, 12.0, 0.05, -0.02, 0.01])
"""State of the active craft in Hill's axes, m and m/s."""
ROUNDING_M = 2e-8
"""Ten times the rounding of a coordinate of 1.4e7 m: it is added, written, read and subtracted."""
ROUNDING_M_S = 2e-11
"""Ten times the rounding of a velocity of 1e4 m/s, likewise."""


def passive(axis_m: float, eccentricity: float, anomaly: float) -> Floats:
    """A state on an ellipse, shape (6,), by the equation of the conic in its plane."""
    radius = axis_m * (1.0 - eccentricity**2) / (1.0 + eccentricity * math.cos(anomaly))
    speed = math.sqrt(MU / (axis_m * (1.0 - eccentricity**2)))
    in_plane = [
        [radius * math.cos(anomaly), radius * math.sin(anomaly), 0.0],
        [-speed * math.sin(anomaly), speed * (eccentricity + math.cos(anomaly)), 0.0],
    ]
    return np.array(in_plane)


def active(origin: Floats, relative: Floats) -> Floats:
    """The inertial state of the other craft, (2, 3), in the plane of the first one's orbit.

    The axes turn by the polar angle, whose rate is h / r^2.
    """
    (x, y, _), (vx, vy, _) = origin
    radius = math.hypot(x, y)
    cosine = x / radius
    sine = y / radius
    rate = (x * vy - y * vx) / radius**2
    axes = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    axes_rate = rate * np.array([[-sine, -cosine, 0.0], [cosine, -sine, 0.0], [0.0, 0.0, 0.0]])
    position = axes @ relative[:3]
    velocity = axes_rate @ relative[:3] + axes @ relative[3:]
    return np.asarray(origin + np.array([position, velocity]))


def relative_state(origin: Floats, craft: Floats) -> Floats:
    """The state of a craft in Hill's axes, (6,), of an orbit in the plane: `active` inverted."""
    zero = active(origin, np.zeros(6))
    columns = [(active(origin, unit) - zero).ravel() for unit in np.eye(6)]
    return np.asarray(np.linalg.solve(np.column_stack(columns), (craft - zero).ravel()))


def tilted() -> Floats:
    """Axes of the orbit in inertial axes: any rotation."""
    return np.asarray(np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0])


def write_oem(file: Path, state: Floats, **metadata: str) -> Path:
    """Write states each minute of the two-body motion that has a state at the fifth epoch."""
    turn = tilted()
    states = [coast(state.ravel(), 60.0 * (i - 4), MU).reshape(2, 3) @ turn.T for i in range(9)]
    keys = {"CENTER_NAME": "EARTH", "TIME_SYSTEM": "UTC", **metadata}
    file.write_text(HEADER + segment(EPOCHS, np.array(states), **keys))
    return file


def files(folder: Path, origin: Floats) -> tuple[Path, Path]:
    craft = write_oem(folder / "chaser.oem", active(origin, RELATIVE))
    return craft, write_oem(folder / "target.oem", origin)


@pytest.mark.parametrize(
    ("axis_m", "eccentricity", "anomaly"),
    [(6778137.0, 0.0, 0.0), (6778137.0, 0.001, 2.5), (13556274.0, 0.5, -0.4)],
)
def test_tabulated_states_give_the_relative_state_and_the_orbit_to_rounding(
    axis_m: float, eccentricity: float, anomaly: float, tmp_path: Path
) -> None:
    craft, station = files(tmp_path, passive(axis_m, eccentricity, anomaly))

    found = problem_of(craft, station, EPOCH, "elliptic-guaranteed", ["bounds.position_m=2000"])

    problem = found.problem

    np.testing.assert_allclose(problem.initial.position_m, RELATIVE[:3], atol=ROUNDING_M, rtol=0.0)
    np.testing.assert_allclose(
        problem.initial.velocity_m_s, RELATIVE[3:], atol=ROUNDING_M_S, rtol=0.0
    )
    assert problem.orbit.gravitational_parameter_m3_s2 == MU
    assert problem.orbit.semi_major_axis_m == pytest.approx(axis_m, rel=1e-14)
    assert problem.orbit.eccentricity == pytest.approx(eccentricity, abs=1e-14)
    if eccentricity:
        assert problem.orbit.true_anomaly_rad == pytest.approx(anomaly, abs=1e-14 / eccentricity)
    assert problem.model is MotionModel.TIME_VARYING


def test_states_between_the_epochs_give_the_coasted_relative_state(tmp_path: Path) -> None:
    origin = passive(13556274.0, 0.5, -0.4)
    craft, station = files(tmp_path, origin)

    found = problem_of(craft, station, "2026-03-01T12:04:30", "elliptic-guaranteed")

    origin_later, craft_later = (
        coast(state.ravel(), 30.0, MU).reshape(2, 3) for state in (origin, active(origin, RELATIVE))
    )
    expected = relative_state(origin_later, craft_later)
    # The states move by 250 km in these 30 s, and are interpolated from tables 60 s apart.
    np.testing.assert_allclose(found.problem.initial.position_m, expected[:3], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(
        found.problem.initial.velocity_m_s, expected[3:], rtol=0.0, atol=1e-9
    )
    assert any("HERMITE of degree 7, estimated errors" in note for note in found.notes)


def test_written_file_has_the_states_and_the_values_of_the_other_problem(
    infoset: Command, tmp_path: Path
) -> None:
    files(tmp_path, passive(13556274.0, 0.5, -0.4))

    code, out, err = infoset(
        *("problems", "from-states", "chaser.oem", "target.oem", "--epoch", EPOCH),
        *("--out", "mine.toml", "--set", "sensor.position_error_m=2"),
    )

    assert (code, out) == (0, "")
    assert "active craft: segment 1 of chaser.oem, a tabulated state" in err
    assert "then: infoset reach mine.toml" in err
    text = Path("mine.toml").read_text(encoding="utf-8")
    assert f"# Written by infoset problems from-states from the states at {EPOCH}." in text
    problem = load_problem("mine.toml")
    model = load_problem("elliptic-guaranteed", ["sensor.position_error_m=2"])
    assert problem.name == "mine"
    assert problem.description == f"As elliptic-guaranteed, from two states at {EPOCH}"
    np.testing.assert_allclose(problem.initial.position_m, RELATIVE[:3], rtol=0.0, atol=ROUNDING_M)
    assert (problem.sensor, problem.goal, problem.cone) == (model.sensor, model.goal, model.cone)


@pytest.mark.parametrize(
    ("metadata", "options", "message"),
    [
        ({"REF_FRAME": "ICRF"}, [], "they must be the same; convert one of them"),
        ({"CENTER_NAME": "MOON"}, [], "the files have the centres EARTH, MOON; convert them"),
        ({}, ["--epoch", "2026-03-02"], "no segment holds the epoch"),
        ({}, ["--epoch", "tomorrow"], '--epoch: "tomorrow" is not an epoch'),
        (
            {},
            ["--gravitational-parameter", "1e13"],
            "target.oem: the state at the epoch: the orbit is a parabola or a hyperbola",
        ),
        (
            {},
            ["--set", "bounds.position_m=900", "--set", "initial.position_m=[0, -800, 0]"],
            "the initial state is outside its constraints: y by 100; change them with --set",
        ),
        ({}, ["--like", "service-2"], "this is a problem of kind multipoint"),
    ],
)
def test_states_that_give_no_rendezvous_are_refused(
    infoset: Command, tmp_path: Path, metadata: dict[str, str], options: list[str], message: str
) -> None:
    origin = passive(13556274.0, 0.5, -0.4)
    write_oem(tmp_path / "chaser.oem", active(origin, RELATIVE))
    write_oem(tmp_path / "target.oem", origin, **metadata)

    told = infoset.refused(
        *("problems", "from-states", "chaser.oem", "target.oem", "--epoch", EPOCH),
        *("--out", "mine.toml", *options),
    )

    assert message in told
    assert not Path("mine.toml").exists()


def test_centre_that_is_not_known_needs_its_gravitational_parameter(tmp_path: Path) -> None:
    origin = passive(13556274.0, 0.5, -0.4)
    craft, station = (
        write_oem(tmp_path / name, state, CENTER_NAME="EROS")
        for name, state in (("chaser.oem", active(origin, RELATIVE)), ("target.oem", origin))
    )

    with pytest.raises(InputError, match="of EROS is not known; give it with --gravitational-"):
        problem_of(craft, station, EPOCH, "elliptic-guaranteed")

    found = problem_of(craft, station, EPOCH, "elliptic-guaranteed", mu_m3_s2=MU)
    assert found.problem.orbit.gravitational_parameter_m3_s2 == MU


def test_file_that_is_no_ephemeris_is_refused_with_its_name(
    infoset: Command, tmp_path: Path
) -> None:
    files(tmp_path, passive(13556274.0, 0.5, -0.4))
    Path("chaser.oem").write_text("<oem>")

    told = infoset.refused(
        *("problems", "from-states", "chaser.oem", "target.oem", "--epoch", EPOCH, "--out", "-")
    )

    assert "chaser.oem: is XML" in told
