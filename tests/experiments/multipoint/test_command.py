from __future__ import annotations

import re
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.common.figure_style import figure_bytes
from experiments.common.file_kinds import built_in_files
from experiments.multipoint.figures import draw_control, draw_costates, draw_path, draw_times
from experiments.multipoint.file import Axes, MultipointProblem, load_multipoint
from experiments.multipoint.report import Scene, cost_curves
from sim.storage.codec import fingerprint
from sim.versions import versions
from tests.built_in import problem_text
from tests.experiments.command_line import strict

FIGURES = ["figure-control", "figure-costates", "figure-path", "figure-times"]
KEYS = [
    *("versions", "problem", "problem_hash", "units", "order_chosen", "times_chosen", "cost_m2_s3", "order", "times_s"),
    *(
        "time_gradient_m2_s4",
        "nodes",
        "costate0",
        "peak_control_m_s2",
        "evaluations",
        "orders_begun",
        "orders_left_out",
        "orders_that_do_not_fit",
        "notes",
    ),
]
NODE_KEYS = ["name", "meet", "position_m", "velocity_m_s", "target_velocity_m_s", "leave_s", "jump_m_s3"]
TWO, THREE, FIVE, TOUR = (problem_text(name) for name in ("service-2", "service-3", "service-5", "asteroid-tour"))
HEAD = THREE.split("[[target]]")[0]

Infoset = Callable[..., tuple[int, str, str]]


@pytest.fixture
def infoset(infoset: Infoset) -> Infoset:
    """Run the command in an empty folder: exit code, stdout and stderr."""
    return partial(infoset, "multipoint")


def changed(old: str, new: str, text: str = THREE) -> str:
    """A problem with its first `old` replaced."""
    assert old in text
    return text.replace(old, new, 1)


def told(infoset: Infoset, *arguments: object) -> Any:
    code, out, err = infoset(*arguments, "--json", "-", "-q")
    assert (code, err) == (0, "")
    return strict(out)


def targets(count: int, apart_s: float = 500.0) -> str:
    """A file of so many targets."""
    table = '[[target]]\nname = "n{0}"\nposition_m = [{0}, 10, 0]\nvelocity_m_s = [0, 0, 0]\ntime_s = {1}\n'
    return HEAD + "".join(table.format(each, apart_s * (each + 1)) for each in range(count))


def test_three_targets_into_a_folder(infoset: Infoset, tmp_path: Path) -> None:
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "notes.txt").write_text("mine")
    code, out, _ = infoset("--out", "results", "--overwrite")
    assert code == 0
    assert (tmp_path / "results" / "notes.txt").read_text() == "mine"
    files = [f"{name}.{kind}" for name in FIGURES for kind in ("pdf", "png")]
    assert sorted(each.name for each in (tmp_path / "results").iterdir()) == sorted(
        [*files, "notes.txt", "problem.toml", "results.json", "trajectories.csv"]
    )
    found = strict((tmp_path / "results" / "results.json").read_text())
    assert list(found) == KEYS
    assert (found["versions"], found["problem"]) == (versions(), "service-3")
    assert found["problem_hash"] == fingerprint(load_multipoint("service-3"))
    assert (found["order_chosen"], found["times_chosen"], found["evaluations"]) == ("given", "given", 1)
    # The acceptance, N = 3.
    assert found["cost_m2_s3"] == pytest.approx(0.021142280110555873, rel=1e-9)
    assert found["order"] == ["T1", "T2", "T3"]
    assert found["times_s"] == [1200.0, 2600.0, 4000.0]
    gradient = [-7.836556601890862e-06, -7.232202376944674e-06, -3.2601679492735453e-06]
    np.testing.assert_allclose(found["time_gradient_m2_s4"], gradient, rtol=1e-9)
    assert [list(each) for each in found["nodes"]] == [NODE_KEYS] * 3
    second = found["nodes"][1]
    np.testing.assert_allclose(
        second["position_m"], [129.00913664506174, 3910.983539171972, 87.2941398534269], rtol=1e-9
    )
    np.testing.assert_allclose(second["velocity_m_s"][0], 0.3308297971586566, rtol=1e-9)
    np.testing.assert_allclose(second["jump_m_s3"][0], 1.3547481759700994e-05, rtol=1e-9)
    assert list(found["costate0"]) == ["position_m_s3", "velocity_m_s2"]
    np.testing.assert_allclose(found["costate0"]["position_m_s3"][1], 1.0260057565247972e-05, rtol=1e-9)
    np.testing.assert_allclose(found["costate0"]["velocity_m_s2"][0], -0.003951812093324485, rtol=1e-9)
    for piece in ("I = 0.02114228", "T1", "flyby", "dI/dt", "costate jump"):
        assert piece in out


def test_order_and_times_override_the_file(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    best = told(infoset, "service-3", "--times", "best")
    assert (best["times_chosen"], best["notes"]) == ("best", ["the times are a local minimum"])
    assert best["cost_m2_s3"] == pytest.approx(0.01835844971766454, rel=1e-9)
    np.testing.assert_allclose(best["times_s"], [1521.3233432870954, 3015.0416119664947, 4000.0], rtol=1e-9)
    both = told(infoset, "service-3", "--order", "best", "--times", "best")
    assert both["order"] == ["T3", "T2", "T1"]
    assert both["cost_m2_s3"] == pytest.approx(0.008734876263, rel=1e-9)
    assert both["orders_begun"] <= 15
    assert both["notes"] == ["the order is the best one found", "the times are a local minimum"]
    slots = told(infoset, "service-3", "--order", "best")
    assert slots["times_s"] == [1200.0, 2600.0, 4000.0]
    assert slots["notes"] == ["no order that fits the times costs less"]
    assert slots["cost_m2_s3"] <= 0.0211422802
    asked = mine(changed("optimise_times = false", "optimise_times = true"))
    assert told(infoset, asked)["cost_m2_s3"] == pytest.approx(best["cost_m2_s3"], rel=1e-12)
    assert told(infoset, asked, "--times", "given")["times_chosen"] == "given"
    assert told(infoset, asked, "--times", "given")["cost_m2_s3"] == pytest.approx(0.021142280110555873, rel=1e-9)


def test_rendezvous_stays_prices_and_eccentric_orbits(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    met = told(infoset, mine(changed('4000.0\nmeet = "flyby"', '4000.0\nmeet = "rendezvous"')))
    assert met["cost_m2_s3"] == pytest.approx(0.023815941208960852, rel=1e-9)
    last = met["nodes"][-1]
    assert list(last) == [*NODE_KEYS, "velocity_jump_m_s2"]
    assert last["velocity_m_s"] == last["target_velocity_m_s"]
    # A free last time with a price: the acceptance of the theory.
    free = changed(
        "latest_s = 3000.0", "price_per_s = 1e-6", changed("optimise_times = false", "optimise_times = true", TWO)
    )
    priced = told(infoset, mine(free))
    np.testing.assert_allclose(priced["times_s"], [2905.083078, 4690.157388], rtol=1e-9)
    assert priced["cost_m2_s3"] == pytest.approx(0.0008170807218, rel=1e-9)
    assert priced["cost_with_price_m2_s3"] == pytest.approx(priced["cost_m2_s3"] + 1e-6 * priced["times_s"][-1])
    # A nearly circular orbit is nearly the circular one, wherever the craft is on it.
    for anomaly in ("0.0", "200.0"):
        orbit = f"eccentricity = 1e-7\ntrue_anomaly_deg = {anomaly}\norbit_rate_rad_s"
        near = told(infoset, mine(changed("orbit_rate_rad_s", orbit)))
        assert near["cost_m2_s3"] == pytest.approx(0.021142280110555873, rel=1e-4)
    costs = [
        told(
            infoset,
            mine(changed(ORBIT, f"eccentricity = 0.3\ntrue_anomaly_deg = {anomaly}\norbit_rate_rad_s = 7e-4")),
        )["cost_m2_s3"]
        for anomaly in ("0.0", "180.0")
    ]
    assert costs[0] != pytest.approx(costs[1], rel=0.05)


def test_a_chaser_that_is_at_its_target_costs_nothing(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    resting = (
        changed("optimise_times = false", "optimise_times = true", TWO[: TWO.index("[[target]]")])
        + """[[target]]
name = "T1"
position_m = [0.0, 0.0, 0.0]
velocity_m_s = [0.0, 0.0, 0.0]
meet = "rendezvous"
[times]
latest_s = 3000.0
"""
    )
    assert told(infoset, mine(resting))["cost_m2_s3"] == 0.0


def test_keys_that_may_be_left_out(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    dropped = ("name", "description", "meet", "optimise_times", "latest_s", "[times]")
    lines = [line for line in THREE.splitlines() if line.split("=")[0].split("#")[0].strip() not in dropped]
    text = "\n".join(lines)
    for name in ("T1", "T2", "T3"):
        text = (
            changed("[[target]]   ", f'[[target]]\nname = "{name}"\n#', text)
            if name == "T1"
            else changed("[[target]]\nposition", f'[[target]]\nname = "{name}"\nposition', text)
        )
    found = told(infoset, mine(text))
    assert found["problem"] == "tour"
    assert found["cost_m2_s3"] == pytest.approx(0.021142280110555873, rel=1e-9)


def test_the_asteroid_tour(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    found = told(infoset, "asteroid-tour")
    assert found["order"] == ["Itokawa", "Bennu", "Ryugu"]
    assert "inertial" in found["units"]
    problem = load_multipoint("asteroid-tour")
    assert problem.times_s is not None
    where = problem.tour.targets.states(np.arange(3), problem.times_s)
    for node, state in zip(found["nodes"], where, strict=True):
        np.testing.assert_allclose(node["position_m"], state[:3], rtol=1e-9)
        assert 0.9 < np.linalg.norm(state[:3]) / 1.495978707e11 < 1.7
    # Elements or the state they mean: the same.
    position, velocity = (part.tolist() for part in np.split(problem.tour.start_state / 1e3, 2))
    elements = TOUR[TOUR.index("[chaser.elements]") : TOUR.index("[[target]]")]
    state = changed(elements, f"[chaser]\nposition_km = {position}\nvelocity_km_s = {velocity}\n", TOUR)
    assert told(infoset, mine(state))["cost_m2_s3"] == pytest.approx(found["cost_m2_s3"], rel=1e-9)


def test_five_targets_as_listed(infoset: Infoset) -> None:
    found = told(infoset, "service-5")
    assert found["times_chosen"] == "best"
    leave = [each["leave_s"] for each in found["nodes"]]
    assert leave[2] == pytest.approx(found["times_s"][2] + 300.0)
    assert (np.array(found["times_s"]) - np.array([0.0, *leave[:-1]]) >= 600.0 * (1.0 - 1e-9)).all()
    assert max(abs(each) for each in found["time_gradient_m2_s4"][:-1]) < 1e-6 * abs(found["time_gradient_m2_s4"][-1])


def test_json_alone_and_nothing_written(infoset: Infoset, tmp_path: Path) -> None:
    code, out, err = infoset("service-2", "--json", "-")
    assert code == 0
    assert strict(out)["problem"] == "service-2"
    assert "T1" in err
    assert infoset("service-2", "-q") == (0, "", "")
    assert list(tmp_path.iterdir()) == []


def test_help_has_an_example(infoset: Infoset) -> None:
    code, out, _ = infoset("--help")
    assert code == 0
    assert "Example: infoset multipoint" in out


def test_every_built_in_problem_is_sound() -> None:
    mine = [each for each in built_in_files().values() if each.kind == MultipointProblem.kind]
    assert {each.name for each in mine} == {"asteroid-tour", "service-2", "service-3", "service-5"}
    for each in mine:
        loaded = load_multipoint(each.name)
        assert loaded.name == each.name
        assert each.description
        assert loaded.axes is (Axes.INERTIAL if each.name == "asteroid-tour" else Axes.HILL)


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["service-4"], ["service-4", "did you mean"]),
        (["pareto-2008"], ["pareto-2008: this is a problem of kind pareto-encounter; use infoset pareto pareto-2008"]),
        (["missing.toml"], ["missing.toml: there is no such file"]),
        (["bad\x1b[31mname"], ["bad?[31mname"]),
        (["--order", "bets"], ['--order: there is no "bets"; did you mean best?']),
        (["--times", ""], ['--times: there is no ""; choose one of: given']),
        (["--json", "missing/x.json"], ["there is no folder missing"]),
        (["--json", "out/results.json", "--out", "out"], ["also a file of --out"]),
        (["--out", "/dev/null"], ["is a file"]),
    ],
)
def test_what_is_wrong_is_said_before_the_work(
    arguments: list[str], parts: list[str], infoset: Infoset, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("rendezvous.multipoint.tour.solve_segments", lambda *_: pytest.fail("began to work"))
    code, out, err = infoset(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("error: ") == 1
    assert "\x1b" not in err
    for part in parts:
        assert part in err
    assert list(tmp_path.iterdir()) == []


OPTIMISED = changed("optimise_times = false", "optimise_times = true")
ORBIT = "orbit_rate_rad_s = 1.13e-3"


@pytest.mark.parametrize(
    ("text", "options", "told"),
    [
        (changed("2600.0", "1200.0"), [], "times must increase: visit 2 is at 1200 s, not after 1200 s"),
        (changed("time_s = 2600.0\n", ""), [], "target.2.time_s: is missing, and optimise_times is false"),
        (OPTIMISED.replace("time_s = 2600.0\n", ""), ["--times", "given"], "--times given: needs time_s"),
        (OPTIMISED.replace("2600.0", "900.0"), ["--times", "given"], "times must increase: visit 2 is at 900 s"),
        (changed('"T2"', '"T1"'), [], "target 'T1' is listed twice"),
        (changed(ORBIT, "orbit_rate_rad_s = 1.13"), [], "orbit_rate_rad_s: the orbit meets the planet"),
        (changed("4000.0", "1e9"), [], "the last of time_s and latest_s is 1.13e+06 radians of the orbit"),
        (changed(ORBIT, ""), [], "orbit_rate_rad_s (Hill's axes) or"),
        (changed(ORBIT, f"{ORBIT}\ngravitational_parameter_m3_s2 = 4e14"), [], "is needed, not both"),
        (changed("velocity_m_s = [0.0, 0.0, 0.0]", ""), [], "chaser: must have position_m and velocity_m_s, or"),
        (changed("[chaser]", "[chaser]\nepoch_s = 1.0"), [], "chaser: elements and epoch_s belong to inertial axes"),
        (changed("latest_s = 4000.0", "latest_s = 3999.0"), [], "times.latest_s: is before the last time_s"),
        (OPTIMISED.replace("latest_s = 4000.0", "latest_s = 1000.0\nmin_gap_s = 400.0"), [], "3 visits do not fit"),
        (changed("[times]\nlatest_s = 4000.0", ""), ["--times", "best"], "--times best: with the last time free"),
        (OPTIMISED.replace("latest_s = 4000.0", ""), [], "times: with the last time free the energy falls to zero"),
        (targets(120), ["--order", "best"], "120 targets have 6.7e+198 orders"),
        (changed('meet = "flyby"', "dwell_s = 5.0"), [], "target 'T1': a flyby cannot dwell"),
        (HEAD, [], "target: is missing"),
        (changed("eccentricity = 0.280177641", "eccentricity = 1.0", TOUR), [],
            "target.#1.elements: an ellipse has a semi-major axis above 0 and an eccentricity from 0 to below 1"),
        (changed("raan_deg = 69.074497", "raan_deg = nan", TOUR), [], "target.#1.elements.raan_deg: must be a finite"),
        (changed("132712440018.0", "1e-50", TOUR), [], "chaser: the orbit is"),
    ],
)  # fmt: skip
def test_unsound_problems_are_told(
    text: str, options: list[str], told: str, infoset: Infoset, mine: Callable[[str], Path], tmp_path: Path
) -> None:
    code, out, err = infoset(mine(text), *options, "--out", tmp_path / "out")
    assert (code, out) == (2, "")
    assert err.count("error: ") == 1
    assert told in err
    assert [each.name for each in tmp_path.iterdir()] == ["mine.toml"]


def test_a_bound_that_the_control_exceeds_says_by_how_much(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    peak = told(infoset, "service-3")["peak_control_m_s2"]
    code, out, err = infoset(mine(changed("[chaser]", "max_control_m_s2 = 0.002\n[chaser]")))
    assert (code, out) == (2, "")
    assert f"reaches {peak:.6g} m/s^2, {peak / 0.002 - 1.0:.2%} over the bound of 0.002 m/s^2" in err
    assert infoset(mine(changed("[chaser]", f"max_control_m_s2 = {peak * 1.0001}\n[chaser]")), "-q")[0] == 0


LONG_LEG = """
kind = "multipoint"
orbit_rate_rad_s = 0.0011
max_control_m_s2 = 1.2334e-06
[chaser]
position_m = [0.0, 0.0, 0.0]
velocity_m_s = [0.0, 0.0, 0.0]
[[target]]
name = "T1"
position_m = [84.146497, 564.105261, 99.171302]
velocity_m_s = [0.04105, -0.101076, 0.078318]
time_s = 363636.364
meet = "rendezvous"
"""


def test_a_bound_is_checked_between_samples_of_a_long_leg(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    code, out, err = infoset(mine(LONG_LEG))
    assert (code, out) == (2, "")
    assert "reaches 1.3052" in err
    assert infoset(mine(LONG_LEG.replace("1.2334e-06", "1.3053e-06")), "-q")[0] == 0


def test_orders_that_do_not_fit_the_times_are_left_out(infoset: Infoset, mine: Callable[[str], Path]) -> None:
    times = iter((1500.0, 3000.0, 4500.0, 7000.0, 10000.0))
    text = re.sub(r"(?m)^time_s = .*$", lambda _: f"time_s = {next(times)}", problem_text("service-5"))
    text = re.sub(r"(?m)^dwell_s = .*$", "dwell_s = 2000.0", text)
    code, out, err = infoset(mine(text), "--order", "best", "--times", "given")
    assert (code, err) == (0, "")
    assert "I = 0.065082" in out
    assert "48 orders do not fit the times" in out
    text = re.sub(r"(?m)^dwell_s = .*$", "dwell_s = 4000.0", text)
    text = text.replace('meet = "flyby"', 'meet = "rendezvous"\ndwell_s = 3500.0')
    code, out, err = infoset(mine(text.replace("latest_s = 11000.0", "latest_s = 99000.0")), "--order", "best",
                             "--times", "given")  # fmt: skip
    assert (code, out) == (2, "")
    assert "no order fits the times" in err


@pytest.mark.parametrize(
    ("number", "told"),
    [(500, "target: Tuple should have at most 200 items"), (10_000, "more than any problem file")],
)
def test_too_many_targets_are_refused_at_once(
    infoset: Infoset, mine: Callable[[str], Path], number: int, told: str
) -> None:
    began = time.process_time()
    code, _, err = infoset(mine(targets(number).replace("10, 0]", "0, 0]")))
    assert code == 2
    assert told in err
    assert time.process_time() - began < 10.0


def test_nothing_is_replaced_unless_told(infoset: Infoset, tmp_path: Path) -> None:
    precious, folder = tmp_path / "x.json", tmp_path / "folder"
    precious.write_text("precious")
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    for option, target in (("--json", precious), ("--out", folder)):
        code, _, err = infoset("service-2", option, target)
        assert code == 2
        assert "--overwrite" in err
    assert precious.read_text() == "precious"
    assert infoset("service-2", "--json", precious, "--overwrite", "-q")[0] == 0
    assert strict(precious.read_text())["problem"] == "service-2"
    assert [each.name for each in folder.iterdir()] == ["notes.txt"]


def test_figures_say_what_they_show() -> None:
    problem = load_multipoint("service-3")
    assert problem.times_s is not None
    path = problem.tour.fly((0, 1, 2), problem.times_s)
    scene = Scene(problem.axes, problem.tour, (0, 1, 2), path)
    curves = cost_curves(scene)
    assert len(curves) == 3
    for index, curve in enumerate(curves):
        at = int(np.flatnonzero(curve.time_s == problem.times_s[index])[0])
        assert curve.cost[at] == path.cost
        moved = problem.times_s.copy()
        moved[index] = curve.time_s[0]
        assert curve.cost[0] == pytest.approx(problem.tour.fly((0, 1, 2), moved).cost, rel=1e-12)
    plane = draw_path(scene).axes[0]
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("y (along-track), km", "x (radial), km")
    assert [each.get_ylabel() for each in draw_control(scene).axes] == ["$u$, mm/s$^2$", "$|u|$, mm/s$^2$"]
    costates = draw_costates(scene).axes[0]
    pieces = [line for line in costates.get_lines() if len(line.get_xydata()) > 2]  # type: ignore[arg-type]
    assert len(pieces) == 9  # three components, broken where they jump
    assert draw_times(scene, curves).axes[0].get_xlabel() == "time of T1, s"


def test_matplotlib_warns_of_nothing_in_the_path_of_a_tour(caplog: pytest.LogCaptureFixture) -> None:
    problem = load_multipoint("asteroid-tour")
    assert problem.times_s is not None
    scene = Scene(problem.axes, problem.tour, (0, 1, 2), problem.tour.fly((0, 1, 2), problem.times_s))
    assert [kind for kind, _ in figure_bytes(draw_path(scene))] == ["pdf", "png"]
    assert [each.message for each in caplog.records if each.name.startswith("matplotlib")] == []
