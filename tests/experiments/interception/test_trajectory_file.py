"""`infoset scenarios from-states`: trajectory files and the scenarios that follow from them."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from infoset.arrays import Floats
from infoset.experiments import load_scenario
from infoset.experiments.common.input_file import read_text
from infoset.experiments.interception.trajectory_file import KnownTarget, scenario_of
from infoset.sim.approach import propagate
from infoset.sim.kepler import KeplerMotion
from infoset.sim.scenario import Scenario, corners
from tests.built_in import scenario_text
from tests.experiments.command_line import Command
from tests.oem_text import HEADER, covariance_block, segment

DATA = Path(__file__).parents[2] / "data" / "oem"
EARTH_KM3_S2 = 398600.4418
MISSIONS = ("dart-2022", "deep-impact-2005", "haiv-2013", "asteroid-1997-space")


def vector(values: Floats) -> str:
    return f"[{', '.join(map(repr, values.tolist()))}]"


def toml(craft: Floats, body: Floats, covariance: str, *head: str) -> str:
    """A trajectory file of two states, shape (2, 3), in SI."""
    lines = ['kind = "trajectory"', 'name = "mine"', *head]
    for name, state in (("spacecraft", craft), ("object", body)):
        lines += [
            f"[{name}]",
            f"position_m = {vector(state[0])}",
            f"velocity_m_s = {vector(state[1])}",
        ]
    return "\n".join([*lines, "[covariance]", covariance, ""])


def as_states(scenario: Scenario, turn: Floats) -> tuple[Floats, Floats]:
    """States of both in other axes, by the simulated motion: rows of `turn` are y, z and x of the
    scenario.
    """
    start = np.array([[0.0, 0.0, scenario.nominal_range_m, 0.0, 0.0, -scenario.closing_speed_m_s]])
    bodies = KeplerMotion(start[:, :3], start[:, 3:], scenario.sun).bodies()[..., 0]
    craft, body = np.moveaxis(bodies, 0, 1) @ turn
    return craft, body


@pytest.mark.parametrize("name", MISSIONS)
def test_a_scenario_as_states_and_back_has_the_same_numbers(name: str, tmp_path: Path) -> None:
    """The covariance is that whose 2 sigma are the uncertainty; the axes and the epoch are
    others.
    """
    scenario = load_scenario(name)
    turn = Rotation.random(random_state=7).as_matrix()
    craft, body = as_states(scenario, turn)
    lower, upper = corners(scenario.uncertainty)
    matrix = np.diag((0.25 * (upper - lower)) ** 2)
    parameter = 0.0
    head = [f"pole = {vector(0.3 * turn[2] - turn[1])}"]
    if scenario.sun is not None:
        parameter = scenario.sun.gravitational_parameter_m3_s2
        head.append(f"gravitational_parameter_m3_s2 = {parameter!r}")
    both = np.kron(np.eye(2), turn)
    rows = (both.T @ matrix @ both).tolist()
    text = "matrix_m2 = [{}]".format(", ".join(f"{row}".replace("\n", "") for row in rows))
    (tmp_path / "states.toml").write_text(toml(craft, body, text.replace("],", "],\n"), *head))
    found, written, _, _ = scenario_of(
        tmp_path / "states.toml",
        scenario,
        2.0,
        KnownTarget(scenario.certain_radius_m, disturbance_m_s2=1e-6),
    )
    assert read_text(Scenario, written, "written") == found
    assert (found.camera, found.thruster, found.body) == (
        scenario.camera,
        scenario.thruster,
        scenario.body,
    )
    assert found.information_set == replace(
        scenario.information_set, disturbance_m_s2=1e-6, disturbance_y_m_s2=None
    )
    assert found.target is None
    assert found.nominal_range_m == pytest.approx(scenario.nominal_range_m, rel=1e-9)
    assert found.closing_speed_m_s == pytest.approx(scenario.closing_speed_m_s, rel=1e-9)
    scale = np.repeat([scenario.nominal_range_m, scenario.closing_speed_m_s], 3)
    middle = np.array([0.0, 0.0, scenario.nominal_range_m, 0.0, 0.0, -scenario.closing_speed_m_s])
    half = 0.5 * (upper - lower)
    for ends, wanted in zip(
        corners(found.uncertainty), (middle - half, middle + half), strict=True
    ):
        np.testing.assert_allclose(ends / scale, wanted / scale, rtol=0.0, atol=1e-9)
    assert (found.sun is None) == (scenario.sun is None)
    if scenario.sun is not None and found.sun is not None:
        for key in (
            "gravitational_parameter_m3_s2",
            "distance_m",
            "direction_rad",
            "elevation_rad",
        ):
            assert getattr(found.sun, key) == pytest.approx(
                getattr(scenario.sun, key), rel=1e-9, abs=1e-9
            )
    again, more = as_states(found, turn)
    np.testing.assert_allclose(
        more - again, body - craft, rtol=0.0, atol=1e-9 * scenario.nominal_range_m
    )


def test_the_built_in_example_says_where_its_numbers_come_from(infoset: Command) -> None:
    code, out, err = infoset(
        "scenarios", "from-states", "two-states", "--sigma", "4", "--out", "mine.toml"
    )
    assert (code, out) == (0, "")
    assert "wrote mine.toml, with the sensors and the engine of dart-2022" in err
    text = Path("mine.toml").read_text()
    for told in ("4 sigma", "as dart-2022", "B.T = 1.2929", "B.R = 1.1129", "14400 s before"):
        assert told in text
    scenario = load_scenario("mine.toml")
    lower, upper = corners(scenario.uncertainty)
    assert scenario.covariance is not None
    np.testing.assert_allclose(upper - lower, 8.0 * scenario.covariance.sigma, rtol=1e-3)
    assert (
        infoset("scenarios", "check", "mine.toml")[0]
        == infoset("problems", "check", "two-states")[0]
        == 0
    )


def test_scenario_names_the_phase_angle_and_takes_it_in_place_of_another(
    infoset: Command, tmp_path: Path
) -> None:
    """The angle between -r and the relative velocity, with r after ten days of 28.97 km/s on a
    circle: (154.1, 32.4, -0.1) million km, and (2.55, 5.17, -1.58) km/s.
    """
    position = np.array([154.1, 32.4, -0.1])
    velocity = np.array([2.55, 5.17, -1.58])
    cosine = -position @ velocity / np.linalg.norm(position) / np.linalg.norm(velocity)
    phase_deg = np.degrees(np.arccos(cosine))
    options = ("--body-radius-m", "50", "--overwrite", "--out", "mine.toml")

    assert infoset("scenarios", "from-states", "two-states", *options)[0] == 0
    text = Path("mine.toml").read_text()
    found = re.search(r"by the direction of \[sun\] phase_angle_deg = ([\d.]+), sun_angle", text)
    assert found is not None
    # The orbit is not a circle, and the velocity changes: by about a degree.
    assert float(found[1]) == pytest.approx(phase_deg, abs=2.0)

    lit = tmp_path / "lit.toml"
    lit.write_text(
        scenario_text("dart-2022").replace(
            "[camera]", "[camera]\nphase_angle_deg = 60.0\nsun_angle_deg = 0.0"
        )
    )
    assert infoset("scenarios", "from-states", "two-states", *options, "--like", lit)[0] == 0
    camera = load_scenario("mine.toml").camera
    assert camera is not None
    assert camera.phase_angle_rad is not None
    assert np.degrees(camera.phase_angle_rad) == pytest.approx(float(found[1]), abs=0.05)


def test_model_with_a_phase_angle_needs_the_radius_of_the_target(
    infoset: Command, tmp_path: Path
) -> None:
    lit = tmp_path / "lit.toml"
    lit.write_text(
        scenario_text("dart-2022").replace(
            "[camera]", "[camera]\nphase_angle_deg = 60.0\nsun_angle_deg = 0.0"
        )
    )
    message = infoset.refused(
        "scenarios", "from-states", "two-states", "--out", "mine.toml", "--like", lit
    )
    assert (
        "--like: dart-2022 has camera.phase_angle_deg, which needs the radius of the target: add "
        "--body-radius-m"
    ) in message


def test_results_have_b_t_and_b_r_where_the_reference_plane_is_known(infoset: Command) -> None:
    infoset("scenarios", "from-states", "two-states", "--out", "mine.toml", "--quiet")
    long = ("--set", "step_s=600", "--set", "camera.period_s=600", "--runs", 3)
    curve = infoset.json("experiment", "mine.toml", *long)["curves"][0]
    np.testing.assert_allclose(
        np.hypot(curve["b_dot_t_m"], curve["b_dot_r_m"]), curve["miss_m"], rtol=1e-5
    )
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
            "must have as many values: got 2 and 3",
        ),
        (
            toml(CRAFT, BODY, SIGMAS + "\ncorrelations = [[1]]"),
            "correlations must have 6 rows: got 1",
        ),
        (toml(CRAFT, BODY, "matrix_km2 = [[1.0], [0.0, 1.0]]"), "must have 6 components: got 2"),
        (
            toml(1e-3 * CRAFT, 1e-3 * BODY, SIGMAS, SUN),
            "spacecraft: its speed is 3.13e-05 times that of a circular",
        ),
        (
            toml(CRAFT, BODY, SIGMAS, "gravitational_parameter_m3_s2 = 1.327e11"),
            "check the units of positions",
        ),
        (toml(CRAFT, BODY * [[1.0], [0.9]], SIGMAS, SUN), "do not meet"),
        (
            toml(CRAFT, BODY + np.array([[0, 4e8, 0], [0, 0, 0]]), SIGMAS),
            "do not meet: the closest approach is 400001 km, 1.929",
        ),
        (
            toml(CRAFT, np.array([BODY[0], CRAFT[1]]), SIGMAS),
            "spacecraft and object have the same velocity",
        ),
        (
            toml(CRAFT, BODY - [[2e9, 0, 0], [0, 0, 0]], SIGMAS),
            "1.92901 d before the epoch: give earlier states",
        ),
        (
            toml(CRAFT, BODY, SIGMAS, "pole = [6e3, 0, -0.01]"),
            "pole: must not be along the line of",
        ),
        (toml(CRAFT, BODY, SIGMAS, "flight_s = 100.0"), "thruster.last_impulse_s excludes all"),
        (
            toml(CRAFT, BODY, SIGMAS.replace("1e-3", "3e3"), "flight_s = 600.0"),
            "at 3 sigma: uncertainty: StateBox: x_m must be greater than 0",
        ),
        (toml(CRAFT, BODY, SIGMAS).replace("position_m", "oem", 1), "spacecraft.oem"),
        (
            toml(CRAFT, BODY, SIGMAS).replace("[object]\nposition_m", "[object]\n# "),
            "object: must have position and",
        ),
        (
            toml(CRAFT, BODY, SIGMAS).replace("velocity_m_s", "velocity", 1),
            "did you mean velocity_m_s",
        ),
        (toml(CRAFT, BODY, SIGMAS).replace("trajectory", "states"), 'kind: must be "trajectory"'),
    ],
)
def test_wrong_trajectory_is_refused_with_a_remedy(
    text: str, problem: str, infoset: Command
) -> None:
    Path("states.toml").write_text(text)
    assert problem in infoset.refused(
        "scenarios", "from-states", "states.toml", "--out", "mine.toml"
    )
    assert not Path("mine.toml").exists()


def test_files_of_other_kinds_and_scenarios_in_a_plane_are_refused(infoset: Command) -> None:
    assert "use infoset scenarios from-states" in infoset.refused("experiment", "two-states")
    assert "this is a scenario" in infoset.refused(
        "scenarios", "from-states", "dart-2022", "--out", "-"
    )
    plane = infoset.refused(
        "scenarios", "from-states", "two-states", "--out", "-", "--like", "asteroid-1997"
    )
    assert "asteroid-1997 is a scenario in a plane" in plane


def oem_trajectory(folder: Path, **changes: str) -> Path:
    """The satellite of the data file, and an object that it meets head on at 12:10:00, from two
    orbits of Kepler.
    """
    row = next(
        line
        for line in (DATA / "leo.oem").read_text().splitlines()
        if line.startswith("2020-06-01T12:10:00")
    )
    state = 1e3 * np.array(row.split()[1:], dtype=float).reshape(2, 3)
    meeting = np.array([state[0], -state[1], np.zeros(3), np.zeros(3)])
    rows = []
    for minute in range(16):
        moved = 1e-3 * propagate(meeting, EARTH_KM3_S2 * 1e9, 60.0 * (minute - 10))[0][:2]
        rows.append(
            f"2020-06-01T12:{minute:02}:00.000000 "
            + " ".join(f"{value:.15e}" for value in moved.ravel())
        )
    text = (DATA / "leo.oem").read_text()
    head = text[: text.index("META_STOP")].replace("TEST_OBJ", "OBJECT")
    for key, value in changes.items():
        head = (
            "\n".join(
                f"{key} = {value}" if line.startswith(key) else line for line in head.splitlines()
            )
            + "\n"
        )
    (folder / "object.oem").write_text(head + "META_STOP\n\n" + "\n".join(rows) + "\n")
    (folder / "leo.oem").write_text(text)
    lines = (
        *('kind = "trajectory"', 'name = "head-on"', 'epoch = "2020-06-01T12:08:30"'),
        f"gravitational_parameter_km3_s2 = {EARTH_KM3_S2}",
        *(
            "[spacecraft]",
            'oem = "leo.oem"',
            "[object]",
            'oem = "object.oem"',
            "[covariance]",
            SIGMAS,
        ),
    )
    (folder / "states.toml").write_text(
        "\n".join(lines).replace("1.0, 1.0, 1.0", "0.01, 0.01, 0.01")
    )
    return folder / "states.toml"


def test_two_oem_files_of_different_programs_make_a_scenario(tmp_path: Path) -> None:
    """The satellite's file has the higher terms of the Earth's gravity, so the states meet within
    some metres.
    """
    like = load_scenario("asteroid-1997-space", ["information_set.range_threshold_km=1"])
    found, text, _, warnings = scenario_of(oem_trajectory(tmp_path), like, 3.0)
    rows = (DATA / "leo.oem").read_text().splitlines()
    speed_m_s = (
        np.linalg.norm(np.array(next(row for row in rows if "12:10:00" in row).split()[4:], float))
        * 1e3
    )
    assert found.closing_speed_m_s == pytest.approx(
        2.0 * speed_m_s, rel=0.01
    )  # the orbits turn by 0.1 rad
    assert found.nominal_range_m / found.closing_speed_m_s == pytest.approx(90.0, rel=0.01)
    assert "90.0" in text.split("s before the closest")[0]
    assert "segment 1 of leo.oem, LAGRANGE of degree 7" in text
    assert warnings == []


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"CENTER_NAME": "Sun"}, "must be the same; convert one of them"),
        (
            {"REF_FRAME": "EME2000"},
            "leo.oem has EARTH, ICRF, and object.oem has EARTH, EME2000 (centre, frame)",
        ),
        ({"TIME_SYSTEM": "TDB"}, "epoch: has no time scale, and the OEM files have TDB and UTC"),
        (
            {"REF_FRAME": "ITRF2000"},
            "object.oem: segment 1: REF_FRAME ITRF2000 is not a known inertial frame",
        ),
        ({"START_TIME": "2020-06-01T12:09:00.000000"}, "object.oem: no segment holds the epoch"),
    ],
)
def test_oem_files_that_do_not_fit_are_refused(
    changes: dict[str, str], problem: str, infoset: Command
) -> None:
    oem_trajectory(Path(), **changes)
    assert problem in infoset.refused(
        "scenarios", "from-states", "states.toml", "--out", "mine.toml"
    )


def test_kernels_without_spiceypy_are_refused_with_the_name_of_the_extra(
    infoset: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "spiceypy", None)
    Path("states.toml").write_text(
        with_source(toml(CRAFT, BODY, SIGMAS, 'epoch = "2020-06-01"'), 'spice = "-135"')
    )

    message = infoset.refused("scenarios", "from-states", "states.toml", "--out", "-")

    assert "spiceypy is not installed" in message
    assert "install infoset with the extra [trajectory]" in message


def with_source(text: str, source: str) -> str:
    """A trajectory file whose spacecraft has another source than vectors."""
    first, rest = text.split("[object]")
    return f"{first.split('[spacecraft]')[0]}[spacecraft]\n{source}\n[object]{rest}"


def write_kernel(folder: Path) -> None:
    """Write a kernel in which both craft move on straight lines from J2000 on, -999 and 2000433."""
    spice: Any = pytest.importorskip(
        "spiceypy", reason="needs the extra trajectory: pip install '.[trajectory]'"
    )
    handle = spice.spkopn(str(folder / "both.bsp"), "test", 0)
    for body, state in ((-999, CRAFT), (2000433, BODY)):
        states = [1e-3 * (state[0] + time * state[1]) for time in (-86400.0, 0.0, 86400.0)]
        rows = np.array([[*place, *(1e-3 * state[1])] for place in states])
        spice.spkw08(
            handle,
            body,
            10,
            "ECLIPJ2000",
            -86400.0,
            86400.0,
            "straight",
            1,
            3,
            rows,
            -86400.0,
            86400.0,
        )
    spice.spkcls(handle)


def test_states_of_spice_kernels(tmp_path: Path) -> None:
    write_kernel(tmp_path)
    (tmp_path / "time.tls").write_text(
        "KPL/LSK\n"
        "\\begindata\n"
        "DELTET/DELTA_T_A = 32.184\n"
        "DELTET/K = 1.657D-3\n"
        "DELTET/EB = 1.671D-2\n"
        "DELTET/M = ( 6.239996 1.99096871D-7 )\n"
        "DELTET/DELTA_AT = ( 10, @1972-JAN-1 )\n"
    )
    text = toml(
        CRAFT,
        BODY,
        SIGMAS,
        'epoch = "2000 JAN 01 12:00:00 TDB"',
        'kernels = ["both.bsp", "time.tls"]',
        SUN,
    )
    (tmp_path / "vectors.toml").write_text(text)
    for state, body in ((CRAFT, -999), (BODY, 2000433)):
        text = text.replace(
            f"position_m = {vector(state[0])}\nvelocity_m_s = {vector(state[1])}",
            f'spice = "{body}"',
        )
    (tmp_path / "kernels.toml").write_text(text)
    dart = load_scenario("dart-2022")
    found, expected = (
        scenario_of(tmp_path / f"{name}.toml", dart, 3.0)[0] for name in ("kernels", "vectors")
    )
    np.testing.assert_allclose(
        corners(found.dispersion), corners(expected.dispersion), rtol=1e-9, atol=1e-6
    )


@pytest.mark.parametrize(
    "epoch", ["2000-01-01T12:00:00 TDB", "2000-001T11:58:55.816Z", "2000-01-01T11:58:55.816"]
)
def test_kernels_need_no_leap_seconds_for_common_epochs(epoch: str, tmp_path: Path) -> None:
    """J2000 in TDB is 11:58:55.816 in UTC, to 0.1 ms."""
    write_kernel(tmp_path)
    dart = load_scenario("dart-2022")
    vectors = toml(CRAFT, BODY, SIGMAS, f'epoch = "{epoch}"', 'kernels = ["both.bsp"]', SUN)
    (tmp_path / "vectors.toml").write_text(vectors)
    (tmp_path / "kernel.toml").write_text(with_source(vectors, 'spice = "-999"'))

    expected, found = (
        scenario_of(tmp_path / f"{name}.toml", dart, 3.0).scenario for name in ("vectors", "kernel")
    )

    # 1e-4 s at 29 km/s are 3 m.
    np.testing.assert_allclose(
        corners(found.dispersion), corners(expected.dispersion), rtol=1e-9, atol=5.0
    )


def meeting_oem(
    folder: Path, *, spacecraft_scale: str = "TDB", covariance: str = "", **metadata: str
) -> Path:
    """OEM files of the two craft of `CRAFT` and `BODY` on straight lines from 2000-01-01T12:00
    on.
    """
    seconds = [600.0 * row for row in range(-4, 9)]
    epochs = [f"2000-01-01T{12 + row // 6:02}:{10 * (row % 6):02}:00" for row in range(-4, 9)]
    for name, state, scale in (("spacecraft", CRAFT, spacecraft_scale), ("object", BODY, "TDB")):
        states = np.array([[state[0] + time * state[1], state[1]] for time in seconds])
        text = segment(
            epochs, states, covariance, TIME_SYSTEM=scale, REF_FRAME="ECLIPJ2000", **metadata
        )
        (folder / f"{name}.oem").write_text(HEADER + text)
    text = toml(CRAFT, BODY, SIGMAS, 'epoch = "2000-01-01T12:05:00"')
    text = with_source(text, 'oem = "spacecraft.oem"')
    first, rest = text.split("[object]")
    (folder / "states.toml").write_text(
        f'{first}[object]\noem = "object.oem"\n[covariance]{rest.split("[covariance]")[1]}'
    )
    return folder / "states.toml"


def test_oem_file_beside_a_kernel_is_read_at_the_same_time(tmp_path: Path) -> None:
    """The epoch has the scale of the OEM file; with UTC for the kernel the object was 64 s, 1900
    km, ahead.
    """
    write_kernel(tmp_path)
    file = meeting_oem(tmp_path)
    expected = scenario_of(file, load_scenario("dart-2022"), 3.0).scenario
    text = file.read_text().replace('oem = "object.oem"', 'spice = "2000433"')
    file.write_text(text.replace("[spacecraft]", 'kernels = ["both.bsp"]\n[spacecraft]'))

    found = scenario_of(file, load_scenario("dart-2022"), 3.0).scenario

    # Positions of 1.5e11 m have roundings of 3e-5 m in the kernel, in km, and in the OEM file.
    np.testing.assert_allclose(
        corners(found.dispersion), corners(expected.dispersion), rtol=1e-9, atol=1e-2
    )


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (
            ("ECLIPJ2000", "J2000"),
            "spacecraft.oem has SUN, ECLIPJ2000, and spice 2000433 has SUN, J2000 of SPICE",
        ),
        (("ECLIPJ2000", "IAU_EARTH"), "frame: IAU_EARTH is not an inertial frame of SPICE"),
        (
            ('"SUN"', '"-999"'),
            "spacecraft.oem has SUN, ECLIPJ2000, and spice 2000433 has -999, ECLIPJ2000",
        ),
        (('"SUN"', '"NOWHERE"'), "spice: "),
        (("both.bsp", "missing.bsp"), '"missing.bsp": cannot be read'),
    ],
)
def test_kernels_and_oem_file_with_different_axes_are_refused(
    change: tuple[str, str], problem: str, infoset: Command
) -> None:
    write_kernel(Path())
    file = meeting_oem(Path())
    keys = 'kernels = ["both.bsp"]\nframe = "ECLIPJ2000"\ncentre = "SUN"\n[spacecraft]'
    text = (
        file.read_text()
        .replace('oem = "object.oem"', 'spice = "2000433"')
        .replace("[spacecraft]", keys)
    )
    file.write_text(text.replace(*change))

    assert problem in infoset.refused("scenarios", "from-states", "states.toml", "--out", "-")


def test_target_of_the_model_scenario_is_dropped(infoset: Command) -> None:
    code, _, err = infoset("scenarios", "from-states", "two-states", "--out", "mine.toml")
    text = Path("mine.toml").read_text()
    scenario = load_scenario("mine.toml")

    assert code == 0
    assert (scenario.body, scenario.target, scenario.information_set.disturbance_m_s2) == (
        None,
        None,
        0.0,
    )
    for told in (
        "missing: [body]",
        "add --body-radius-m",
        "missing: information_set.disturbance_m_s2",
        "--disturbance",
    ):
        assert told in err
        assert told in text


def test_target_of_the_options_is_taken(infoset: Command) -> None:
    options = ("--body-radius-m", "50", "--disturbance", "1e-6")

    _, _, err = infoset("scenarios", "from-states", "two-states", "--out", "mine.toml", *options)

    scenario = load_scenario("mine.toml")
    assert (
        scenario.certain_radius_m,
        scenario.information_set.disturbance_m_s2,
        scenario.target,
    ) == (
        50.0,
        1e-6,
        None,
    )
    assert "missing" not in err + Path("mine.toml").read_text()


@pytest.mark.parametrize(
    "options", [("--body-radius-m", "0"), ("--disturbance", "-1"), ("--disturbance", "nan")]
)
def test_impossible_target_is_refused(options: tuple[str, str], infoset: Command) -> None:
    infoset.refused("scenarios", "from-states", "two-states", "--out", "mine.toml", *options)


MATRIX = np.diag([1e4, 4e4, 9e4, 1e-4, 4e-4, 9e-4])
BLOCK = covariance_block("2000-01-01T12:05:00", MATRIX)


def without_covariance(file: Path) -> Path:
    file.write_text(file.read_text().split("[covariance]")[0])
    return file


def test_covariances_of_both_files_are_added(tmp_path: Path) -> None:
    found = scenario_of(
        without_covariance(meeting_oem(tmp_path, covariance=BLOCK)), load_scenario("dart-2022"), 3.0
    )
    with_table = meeting_oem(tmp_path)
    rows = ", ".join(f"{row}" for row in (2.0 * MATRIX).tolist())
    with_table.write_text(
        without_covariance(with_table).read_text() + f"[covariance]\nmatrix_m2 = [{rows}]\n"
    )

    expected = scenario_of(with_table, load_scenario("dart-2022"), 3.0)

    assert found.scenario.covariance is not None
    assert expected.scenario.covariance is not None
    np.testing.assert_allclose(
        found.scenario.covariance.matrix, expected.scenario.covariance.matrix, rtol=1e-9, atol=1e-9
    )
    own = "spacecraft.oem (axes: ECLIPJ2000, as the states)"
    other = "object.oem (axes: ECLIPJ2000, as the states)"
    assert f"covariance: the sum of those of {own} and {other}, taken as independent" in found.notes


def test_covariance_of_one_file_is_used_with_a_note(tmp_path: Path) -> None:
    file = without_covariance(meeting_oem(tmp_path, covariance=BLOCK))
    (tmp_path / "object.oem").write_text(
        (tmp_path / "object.oem").read_text().split("COVARIANCE_START")[0]
    )

    notes = scenario_of(file, load_scenario("dart-2022"), 3.0).notes

    assert (
        "covariance: that of spacecraft.oem (axes: ECLIPJ2000, as the states); the other "
        "state is taken as exact"
    ) in notes


def test_covariance_of_the_trajectory_file_wins(tmp_path: Path) -> None:
    plain = scenario_of(meeting_oem(tmp_path), load_scenario("dart-2022"), 3.0)

    found = scenario_of(meeting_oem(tmp_path, covariance=BLOCK), load_scenario("dart-2022"), 3.0)

    assert found.scenario == plain.scenario


@pytest.mark.parametrize(
    ("covariance", "problem"),
    [
        ("", "covariance: is missing, and the OEM files have none; write the table [covariance]"),
        (
            covariance_block("2000-01-01T12:10:00", MATRIX),
            "no covariance of the epoch, the nearest is of 2000-01-01T12:10",
        ),
        (
            BLOCK.replace("9.000000000000000e-02", "-9.0"),
            "covariance of spacecraft.oem and object.oem: the variances",
        ),
    ],
    ids=["none", "another epoch", "negative"],
)
def test_missing_or_wrong_covariance_is_refused(
    covariance: str, problem: str, infoset: Command
) -> None:
    without_covariance(meeting_oem(Path(), covariance=covariance))

    assert problem in infoset.refused("scenarios", "from-states", "states.toml", "--out", "-")


def test_vectors_without_covariance_are_refused(infoset: Command) -> None:
    Path("states.toml").write_text(toml(CRAFT, BODY, SIGMAS).split("[covariance]")[0])

    assert "covariance is missing" in infoset.refused(
        "scenarios", "from-states", "states.toml", "--out", "-"
    )


def test_interpolation_that_the_covariance_does_not_contain_is_refused(infoset: Command) -> None:
    """LINEAR with steps of 600 s has an error of 6e-3 m/s2 (600 s)^2 / 8 = 270 m beside a star."""
    file = meeting_oem(Path(), INTERPOLATION="LINEAR")
    for name, state in (("spacecraft", CRAFT), ("object", BODY)):
        pair = np.concatenate([state, np.zeros((2, 3))])
        states = np.array([propagate(pair, 1.327e20, 600.0 * row)[0][:2] for row in range(-4, 9)])
        epochs = [f"2000-01-01T{12 + row // 6:02}:{10 * (row % 6):02}:00" for row in range(-4, 9)]
        Path(f"{name}.oem").write_text(
            HEADER + segment(epochs, states, INTERPOLATION="LINEAR", REF_FRAME="ECLIPJ2000")
        )
    head = file.read_text().replace("[spacecraft]", f"{SUN}\n[spacecraft]")
    file.write_text(
        head.replace(
            "position_sigma_km = [1.0, 1.0, 1.0]", "position_sigma_m = [100.0, 100.0, 100.0]"
        )
    )

    message = infoset.refused("scenarios", "from-states", "states.toml", "--out", "-")

    assert "the interpolation has errors of about" in message
    assert "more than the standard deviations of the covariance, 173 m" in message


@pytest.mark.parametrize("name", ["../elsewhere.oem", "/dev/zero"])
def test_file_elsewhere_is_opened_only_if_allowed(name: str, infoset: Command) -> None:
    file = meeting_oem(Path())
    Path("mine").mkdir()
    Path("elsewhere.oem").write_text(Path("spacecraft.oem").read_text())
    Path("mine/object.oem").write_text(Path("object.oem").read_text())
    Path("mine/states.toml").write_text(file.read_text().replace("spacecraft.oem", name))

    assert "is not below the folder" in infoset.refused(
        "scenarios", "from-states", "mine/states.toml", "--out", "-"
    )

    allowed = ("--files-in", Path(name).parent if name.startswith("/") else ".")
    if name == "/dev/zero":
        message = infoset.refused(
            "scenarios", "from-states", "mine/states.toml", "--out", "-", *allowed
        )
        assert "is not a regular file" in message
    else:
        assert (
            infoset("scenarios", "from-states", "mine/states.toml", "--out", "-", *allowed)[0] == 0
        )


@pytest.mark.parametrize("key", ["epoch", "spice", "oem", "kernels", "centre", "frame"])
def test_text_with_a_new_line_cannot_write_keys_into_the_scenario(
    key: str, infoset: Command
) -> None:
    hostile = r'"2000-01-01\nstep_s = 1.0"'
    text = toml(CRAFT, BODY, SIGMAS)
    if key in ("spice", "oem"):
        text = with_source(
            text.replace("[spacecraft]", 'epoch = "2000-01-01"\n[spacecraft]'), f"{key} = {hostile}"
        )
    else:
        value = f"[{hostile}]" if key == "kernels" else hostile
        text = text.replace("[spacecraft]", f"{key} = {value}\n[spacecraft]")
    Path("states.toml").write_text(text)

    assert "must be one line without control characters" in infoset.refused(
        "scenarios", "from-states", "states.toml", "--out", "-"
    )


def test_size_is_limited_before_reading(infoset: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("infoset.experiments.interception.trajectory_file.MAX_OEM_BYTES", 100)
    meeting_oem(Path())

    assert "spacecraft.oem: has more than 100 bytes" in infoset.refused(
        "scenarios", "from-states", "states.toml", "--out", "-"
    )


@pytest.mark.skipif(find_spec("benchmarks") is None, reason="the benchmarks are not installed")
@pytest.mark.parametrize(
    "numbers",
    [pytest.param(range(15)), pytest.param(range(15, 200), marks=pytest.mark.thorough)],
    ids=["15", "200"],
)
def test_random_encounters_from_tables_are_right_or_refused(numbers: range) -> None:
    """B.T and B.R within 10 m of DOP853: five kinds of steps, three interpolations, two segments,
    four time systems.
    """
    from benchmarks.trajectory_tables import ALLOWED_M, outcomes

    found = list(outcomes(numbers.start, len(numbers)))

    assert all(each.refusal or each.error_m <= ALLOWED_M for each in found)
    assert all(each.refusal for each in found if not each.encounter.is_sound)
    assert sum(not each.refusal for each in found) >= len(found) // 3
