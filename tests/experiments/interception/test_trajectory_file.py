"""`infoset scenarios from-states`: trajectory files and the scenarios that follow from them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments import load_scenario
from experiments.common.input_file import read_text
from experiments.interception.trajectory_file import scenario_of
from infoset.arrays import Floats
from sim.approach import propagate
from sim.kepler import KeplerMotion
from sim.scenario import Scenario, corners
from tests.experiments.command_line import Command

DATA = Path(__file__).parents[2] / "data" / "oem"
EARTH_KM3_S2 = 398600.4418
MISSIONS = ("dart-2022", "deep-impact-2005", "haiv-2013", "asteroid-1997-space")


def vector(values: Floats) -> str:
    return f"[{', '.join(map(repr, values.tolist()))}]"


def toml(craft: Floats, body: Floats, covariance: str, *head: str) -> str:
    """A trajectory file of two states, shape (2, 3), in SI."""
    lines = ['kind = "trajectory"', 'name = "mine"', *head]
    for name, state in (("spacecraft", craft), ("object", body)):
        lines += [f"[{name}]", f"position_m = {vector(state[0])}", f"velocity_m_s = {vector(state[1])}"]
    return "\n".join([*lines, "[covariance]", covariance, ""])


def as_states(scenario: Scenario, turn: Floats) -> tuple[Floats, Floats]:
    """States of both in other axes, by the simulated motion: rows of `turn` are y, z and x of the scenario."""
    start = np.array([[0.0, 0.0, scenario.nominal_range_m, 0.0, 0.0, -scenario.closing_speed_m_s]])
    bodies = KeplerMotion(start[:, :3], start[:, 3:], scenario.sun).bodies()[..., 0]
    craft, body = np.moveaxis(bodies, 0, 1) @ turn
    return craft, body


@pytest.mark.parametrize("name", MISSIONS)
def test_a_scenario_as_states_and_back_has_the_same_numbers(name: str, tmp_path: Path) -> None:
    """The covariance is that whose 2 sigma are the uncertainty; the axes and the epoch are others."""
    scenario = load_scenario(name)
    turn = Rotation.random(random_state=7).as_matrix()
    craft, body = as_states(scenario, turn)
    lower, upper = corners(scenario.uncertainty)
    matrix = np.diag((0.25 * (upper - lower)) ** 2)
    parameter, head = 0.0, [f"pole = {vector(0.3 * turn[2] - turn[1])}"]
    if scenario.sun is not None:
        parameter = scenario.sun.gravitational_parameter_m3_s2
        head.append(f"gravitational_parameter_m3_s2 = {parameter!r}")
    both = np.kron(np.eye(2), turn)
    rows = (both.T @ matrix @ both).tolist()
    text = "matrix_m2 = [{}]".format(", ".join(f"{row}".replace("\n", "") for row in rows))
    (tmp_path / "states.toml").write_text(toml(craft, body, text.replace("],", "],\n"), *head))
    found, written = scenario_of(tmp_path / "states.toml", scenario, 2.0)
    assert read_text(Scenario, written, "written") == found
    assert (found.camera, found.thruster, found.body) == (scenario.camera, scenario.thruster, scenario.body)
    assert found.nominal_range_m == pytest.approx(scenario.nominal_range_m, rel=1e-9)
    assert found.closing_speed_m_s == pytest.approx(scenario.closing_speed_m_s, rel=1e-9)
    scale = np.repeat([scenario.nominal_range_m, scenario.closing_speed_m_s], 3)
    middle = np.array([0.0, 0.0, scenario.nominal_range_m, 0.0, 0.0, -scenario.closing_speed_m_s])
    half = 0.5 * (upper - lower)
    for ends, wanted in zip(corners(found.uncertainty), (middle - half, middle + half), strict=True):
        np.testing.assert_allclose(ends / scale, wanted / scale, rtol=0.0, atol=1e-9)
    assert (found.sun is None) == (scenario.sun is None)
    if scenario.sun is not None and found.sun is not None:
        for key in ("gravitational_parameter_m3_s2", "distance_m", "direction_rad", "elevation_rad"):
            assert getattr(found.sun, key) == pytest.approx(getattr(scenario.sun, key), rel=1e-9, abs=1e-9)
    again, more = as_states(found, turn)
    np.testing.assert_allclose(more - again, body - craft, rtol=0.0, atol=1e-9 * scenario.nominal_range_m)


def test_the_built_in_example_says_where_its_numbers_come_from(infoset: Command) -> None:
    code, out, err = infoset("scenarios", "from-states", "two-states", "--sigma", "4", "--out", "mine.toml")
    assert (code, out) == (0, "")
    assert "wrote mine.toml, with the sensors and the engine of dart-2022" in err
    text = Path("mine.toml").read_text()
    for told in ("4 sigma", "as dart-2022", "B.T = 1.2929", "B.R = 1.1129", "14400 s before"):
        assert told in text
    scenario = load_scenario("mine.toml")
    lower, upper = corners(scenario.uncertainty)
    assert scenario.covariance is not None
    np.testing.assert_allclose(upper - lower, 8.0 * scenario.covariance.sigma, rtol=1e-3)
    assert infoset("scenarios", "check", "mine.toml")[0] == infoset("problems", "check", "two-states")[0] == 0


def test_results_have_b_t_and_b_r_where_the_reference_plane_is_known(infoset: Command) -> None:
    infoset("scenarios", "from-states", "two-states", "--out", "mine.toml", "--quiet")
    long = ("--set", "step_s=600", "--set", "camera.period_s=600", "--runs", 3)
    curve = infoset.json("experiment", "mine.toml", *long)["curves"][0]
    np.testing.assert_allclose(np.hypot(curve["b_dot_t_m"], curve["b_dot_r_m"]), curve["miss_m"], rtol=1e-5)
    np.testing.assert_array_equal(curve["b_dot_t_m"], np.negative(curve["miss_y_m"]))
    assert 0.0 <= curve["redrawn_share"] < 0.5
    without = infoset.json("experiment", "dart-2022", *long)["curves"][0]
    assert not {"b_dot_t_m", "redrawn_share"} & {*without}
    assert "b_plane_t_rad is a value of an engagement in space" in infoset.refused(
        "experiment", "asteroid-1997", "--set", "b_plane_t_deg=0"
    )


CRAFT = np.array([[1.55e11, 0.0, 0.0], [0.0, 29e3, 0.0]])
BODY = np.array([[1.55e11 + 1e9, 1e3, 0.0], [-6e3, 29e3, 0.01]])
SIGMAS = "position_sigma_km = [1.0, 1.0, 1.0]\nvelocity_sigma_m_s = [1e-3, 1e-3, 1e-3]"
SUN = "gravitational_parameter_km3_s2 = 1.327e11"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            toml(CRAFT, BODY, SIGMAS.replace("km", "m", 1).replace("1.0, ", "", 1), SUN),
            "2 deviations of position and 3",
        ),
        (toml(CRAFT, BODY, SIGMAS + "\ncorrelations = [[1]]"), "correlations must have 6 rows: got 1"),
        (toml(CRAFT, BODY, "matrix_km2 = [[1.0], [0.0, 1.0]]"), "must have 6 components: got 2"),
        (toml(1e-3 * CRAFT, 1e-3 * BODY, SIGMAS, SUN), "spacecraft: its speed is 3.13e-05 times that of a circular"),
        (toml(CRAFT, BODY, SIGMAS, "gravitational_parameter_m3_s2 = 1.327e11"), "check the units of positions"),
        (toml(CRAFT, BODY * [[1.0], [0.9]], SIGMAS, SUN), "do not meet"),
        (
            toml(CRAFT, BODY + np.array([[0, 4e8, 0], [0, 0, 0]]), SIGMAS),
            "do not meet: the closest approach is 400001 km, 1.929",
        ),
        (toml(CRAFT, np.array([BODY[0], CRAFT[1]]), SIGMAS), "spacecraft and object have the same velocity"),
        (toml(CRAFT, BODY - [[2e9, 0, 0], [0, 0, 0]], SIGMAS), "1.92901 d before the epoch: give earlier states"),
        (toml(CRAFT, BODY, SIGMAS, "pole = [6e3, 0, -0.01]"), "pole: must not be along the line of"),
        (toml(CRAFT, BODY, SIGMAS, "flight_s = 100.0"), "thruster.last_impulse_s excludes all"),
        (
            toml(CRAFT, BODY, SIGMAS.replace("1e-3", "3e3"), "flight_s = 600.0"),
            "at 3 sigma: uncertainty: StateBox: x_m must be greater than 0",
        ),
        (toml(CRAFT, BODY, SIGMAS).replace("position_m", "oem", 1), "spacecraft.oem"),
        (toml(CRAFT, BODY, SIGMAS).replace("[object]\nposition_m", "[object]\n# "), "object: must have position and"),
        (toml(CRAFT, BODY, SIGMAS).replace("velocity_m_s", "velocity", 1), "did you mean velocity_m_s"),
        (toml(CRAFT, BODY, SIGMAS).replace("trajectory", "states"), 'kind: must be "trajectory"'),
    ],
)
def test_a_wrong_trajectory_is_refused_with_what_to_do(text: str, problem: str, infoset: Command) -> None:
    Path("states.toml").write_text(text)
    assert problem in infoset.refused("scenarios", "from-states", "states.toml", "--out", "mine.toml")
    assert not Path("mine.toml").exists()


def test_files_of_other_kinds_and_scenarios_in_a_plane_are_refused(infoset: Command) -> None:
    assert "use infoset scenarios from-states" in infoset.refused("experiment", "two-states")
    assert "this is a scenario" in infoset.refused("scenarios", "from-states", "dart-2022", "--out", "-")
    plane = infoset.refused("scenarios", "from-states", "two-states", "--out", "-", "--like", "asteroid-1997")
    assert "asteroid-1997 is a scenario in a plane" in plane


def oem_trajectory(folder: Path, **changes: str) -> Path:
    """The satellite of the data file, and an object that it meets head on at 12:10:00, from two orbits of Kepler."""
    row = next(line for line in (DATA / "leo.oem").read_text().splitlines() if line.startswith("2020-06-01T12:10:00"))
    state = 1e3 * np.array(row.split()[1:], dtype=float).reshape(2, 3)
    meeting = np.array([state[0], -state[1], np.zeros(3), np.zeros(3)])
    rows = []
    for minute in range(16):
        moved = 1e-3 * propagate(meeting, EARTH_KM3_S2 * 1e9, 60.0 * (minute - 10))[0][:2]
        rows.append(f"2020-06-01T12:{minute:02}:00.000000 " + " ".join(f"{value:.15e}" for value in moved.ravel()))
    text = (DATA / "leo.oem").read_text()
    head = text[: text.index("META_STOP")].replace("TEST_OBJ", "OBJECT")
    for key, value in changes.items():
        head = "\n".join(f"{key} = {value}" if line.startswith(key) else line for line in head.splitlines()) + "\n"
    (folder / "object.oem").write_text(head + "META_STOP\n\n" + "\n".join(rows) + "\n")
    (folder / "leo.oem").write_text(text)
    lines = (
        *('kind = "trajectory"', 'name = "head-on"', 'epoch = "2020-06-01T12:08:30"'),
        f"gravitational_parameter_km3_s2 = {EARTH_KM3_S2}",
        *("[spacecraft]", 'oem = "leo.oem"', "[object]", 'oem = "object.oem"', "[covariance]", SIGMAS),
    )
    (folder / "states.toml").write_text("\n".join(lines).replace("1.0, 1.0, 1.0", "0.01, 0.01, 0.01"))
    return folder / "states.toml"


def test_two_oem_files_one_of_another_program(tmp_path: Path) -> None:
    """The satellite's file has the higher terms of the Earth's gravity, so the states meet within some metres."""
    pytest.importorskip("oem", reason="needs the extra trajectory: pip install '.[trajectory]'")
    like = load_scenario("asteroid-1997-space", ["information_set.range_threshold_km=1"])
    found, text = scenario_of(oem_trajectory(tmp_path), like, 3.0)
    rows = (DATA / "leo.oem").read_text().splitlines()
    speed_m_s = np.linalg.norm(np.array(next(row for row in rows if "12:10:00" in row).split()[4:], float)) * 1e3
    assert found.closing_speed_m_s == pytest.approx(2.0 * speed_m_s, rel=0.01)  # the orbits turn by 0.1 rad
    assert found.nominal_range_m / found.closing_speed_m_s == pytest.approx(90.0, rel=0.01)
    assert "90.0" in text.split("s before the closest")[0]


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"CENTER_NAME": "Sun"}, "must be the same; convert one of the files"),
        ({"REF_FRAME": "EME2000"}, "object.oem has Earth, EME2000, UTC"),
        ({"TIME_SYSTEM": "TDB"}, "object.oem has Earth, ICRF, TDB"),
        ({"REF_FRAME": "ITRF2000"}, "object.oem: REF_FRAME ITRF2000 rotates"),
        ({"START_TIME": "2020-06-01T12:09:00.000000"}, "object.oem: cannot be read at the epoch"),
    ],
)
def test_oem_files_that_do_not_fit_are_refused(changes: dict[str, str], problem: str, infoset: Command) -> None:
    pytest.importorskip("oem", reason="needs the extra trajectory: pip install '.[trajectory]'")
    oem_trajectory(Path(), **changes)
    assert problem in infoset.refused("scenarios", "from-states", "states.toml", "--out", "mine.toml")


def test_without_the_extra_it_is_named(infoset: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    for library, source in (("oem", 'oem = "leo.oem"'), ("spiceypy", 'spice = "-135"')):
        monkeypatch.setitem(__import__("sys").modules, library, None)
        text = toml(CRAFT, BODY, SIGMAS, 'epoch = "2020-06-01"')
        first, rest = text.split("[object]")
        Path("states.toml").write_text(f"{first.split('[spacecraft]')[0]}[spacecraft]\n{source}\n[object]{rest}")
        message = infoset.refused("scenarios", "from-states", "states.toml", "--out", "-")
        assert f"{library} is not installed" in message
        assert "install infoset with the extra [trajectory]" in message


def test_states_of_spice_kernels(tmp_path: Path) -> None:
    spice: Any = pytest.importorskip("spiceypy", reason="needs the extra trajectory: pip install '.[trajectory]'")
    handle = spice.spkopn(str(tmp_path / "both.bsp"), "test", 0)
    for body, state in ((-999, CRAFT), (2000433, BODY)):
        states = [1e-3 * (state[0] + time * state[1]) for time in (0.0, 86400.0)]
        rows = np.array([[*place, *(1e-3 * state[1])] for place in states])
        spice.spkw08(handle, body, 10, "ECLIPJ2000", 0.0, 86400.0, "straight", 1, 2, rows, 0.0, 86400.0)
    spice.spkcls(handle)
    (tmp_path / "time.tls").write_text(
        "KPL/LSK\n\\begindata\nDELTET/DELTA_T_A = 32.184\nDELTET/K = 1.657D-3\n"
        "DELTET/EB = 1.671D-2\nDELTET/M = ( 6.239996 1.99096871D-7 )\nDELTET/DELTA_AT = ( 10, @1972-JAN-1 )\n"
    )
    text = toml(CRAFT, BODY, SIGMAS, 'epoch = "2000 JAN 01 12:00:00 TDB"', 'kernels = ["both.bsp", "time.tls"]', SUN)
    (tmp_path / "vectors.toml").write_text(text)
    for state, body in ((CRAFT, -999), (BODY, 2000433)):
        text = text.replace(f"position_m = {vector(state[0])}\nvelocity_m_s = {vector(state[1])}", f'spice = "{body}"')
    (tmp_path / "kernels.toml").write_text(text)
    dart = load_scenario("dart-2022")
    found, expected = (scenario_of(tmp_path / f"{name}.toml", dart, 3.0)[0] for name in ("kernels", "vectors"))
    np.testing.assert_allclose(corners(found.dispersion), corners(expected.dispersion), rtol=1e-9, atol=1e-6)
