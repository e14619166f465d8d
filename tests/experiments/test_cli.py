"""The command line: help, messages, exit codes and files, with the commands `experiment`, `engage`
and `replay`.
"""

from __future__ import annotations

import csv
import io
import json
import math
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest

from infoset.experiments.common import screen
from infoset.experiments.common.errors import on_a_screen
from infoset.experiments.common.output import to_json, write_file
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import Scenario, simulate
from infoset.sim.columns import csv_text
from infoset.sim.storage.codec import fingerprint
from infoset.sim.versions import versions
from tests.built_in import scenario_text
from tests.experiments.command_line import Command

pytestmark = pytest.mark.usefixtures("unrendered")

CURVE_KEYS = [
    *(
        "published_curve",
        "noise",
        "range_sensor",
        "miss_m",
        "impulse_m_s",
        "guaranteed_miss_m",
        "outcome",
    ),
    *(
        "set_emptied",
        "cause",
        "unguided_miss_m",
        "engine_corrects_m",
        "budget_corrects_m",
        "last_possible_m",
    ),
    *("truth_kept", "truth_margin_m", "phi_held", "miss_z_m"),
]
OUTCOMES = {"arrived", "set-empty", "budget-spent", "diverged"}


def names_in(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def test_version_option_prints_the_version(infoset: Command) -> None:
    assert infoset("--version") == (0, f"infoset {versions()['infoset']}\n", "")


def test_help_and_commands_without_figures_do_not_import_heavy_libraries() -> None:
    heavy = [
        "numpy",
        "numba",
        "pydantic",
        "matplotlib",
        "scipy",
        "shapely",
        "rich",
        "infoset.model",
        "infoset.sim",
    ]
    drawing = ["matplotlib", "PIL", "scipy.stats"]
    code = (
        "import importlib, sys; from infoset.experiments.cli import RUNS; "
        f"print([name for name in {heavy} if name in sys.modules]); "
        "[importlib.import_module(module) for module in RUNS.values()]; "
        f"print([name for name in {drawing} if name in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["[]", "[]"]


@pytest.mark.parametrize(
    ("line", "part"),
    [
        ("replay", "Missing argument"),
        ("experiment --runs 0", "'--runs'"),
        ("pursuit --delay-s nan", "'--delay-s'"),
        ("experiment --strategy symetric-miss", "did you mean symmetric-miss?"),
        ("engage asteroid-1997-single --range-sensor", "[range_sensor]"),
        ("experiment no/such.toml", "no/such.toml: cannot be read: No such file"),
        ("experiment .", "error: .: cannot be read: Is a directory"),
        ("engage --json - --csv -", "is given twice"),
        ("engage --csv /dev/null --overwrite", "/dev/null: exists already"),
        (f"engage --json {'n' * 300}", "File name too long"),
        (
            "engage --record out.txt",
            "--record: out.txt: the file must end in .npz; for example out.npz",
        ),
        ("engage --noise both --record out", "--record: out-random: the file must end in .npz"),
        ("adversary --record worst", "--record: worst: the file must end in .npz"),
        (
            "replay no.npz --html a.txt",
            "--html: a.txt: the file must end in .html; for example a.html",
        ),
        ("replay no.npz --gif a.png", "--gif: a.png: the file must end in .gif; for example a.gif"),
        ("pareto --html a.txt", "--html: a.txt: the file must end in .html"),
        ("engage --out /dev/null/figures", "/dev/null/figures: cannot be written: Not a directory"),
        (
            "experiment --out /dev/null/figures",
            "/dev/null/figures: cannot be written: Not a directory",
        ),
        ("compare --csv /dev/null/a/b.csv", "/dev/null/a: cannot be written: Not a directory"),
        ("pareto --json /dev/null/a.json", "/dev/null: cannot be written: "),
        ("campaign --model guaranteed --runs 2 --out /dev/null/runs", "/dev/null/runs"),
        (
            "sweep --model guaranteed --vary thruster.budget_m_s=1:2:2 --out /dev/null/runs",
            "/dev/null/runs",
        ),
    ],
)
def test_wrong_option_is_refused_with_one_message_before_the_work(
    line: str, part: str, infoset: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "infoset.sim.parallel.simulate_runs", lambda *_: pytest.fail("began to work")
    )
    monkeypatch.setattr(
        "infoset.experiments.interception.runs.engage.fly_one",
        lambda *_: pytest.fail("began to work"),
    )
    assert part in " ".join(infoset.refused(*line.split()).split())
    assert names_in(tmp_path) == []


def test_experiment_as_json(infoset: Command, tmp_path: Path) -> None:
    found = infoset.json("experiment", "--runs", 3, "--seed", 5)
    assert list(found)[6:] == ["strategy", "seed", "runs", "curves", "notes"]
    scenario = load_scenario("asteroid-1997")
    assert found["versions"] == versions()
    assert found["scenario"] == "asteroid-1997"
    assert found["scenario_hash"] == fingerprint(scenario)
    assert (found["seed"], found["runs"]) == (5, 3)
    assert found["elapsed_s"] > 0.0
    curves = found["curves"]
    assert [list(curve) for curve in curves] == [CURVE_KEYS] * 4
    assert [
        (curve["published_curve"], curve["noise"], curve["range_sensor"]) for curve in curves
    ] == [
        (1, "random", False),
        (2, "random", True),
        (3, "game", False),
        (4, "game", True),
    ]
    for curve in curves:
        assert all(len(curve[key]) == 3 for key in CURVE_KEYS[3:])
        assert all(
            isinstance(each, float) and math.isfinite(each)
            for each in curve["miss_m"] + curve["impulse_m_s"]
        )
        assert all(each is None or each >= 0.0 for each in curve["guaranteed_miss_m"])
        assert set(curve["outcome"]) <= OUTCOMES
    assert curves[1]["miss_m"] == simulate(scenario, 3, seed=5).miss_m.tolist()
    assert names_in(tmp_path) == []


def test_experiment_without_range_sensor_has_two_curves_and_a_line_about_it(
    infoset: Command,
) -> None:
    code, out, err = infoset("experiment", "asteroid-1997-single", "--runs", 1, "--json", "-")
    assert code == 0
    assert [curve["published_curve"] for curve in json.loads(out)["curves"]] == [1, 3]
    assert "no [range_sensor]: curves 1 and 3 only" in err


def test_warnings_are_printed_and_are_in_the_json(infoset: Command, tmp_path: Path) -> None:
    file = tmp_path / "wide.toml"
    file.write_text(scenario_text("asteroid-1997-single").replace("z_km = -8.0", "z_km = -10.5"))
    code, out, err = infoset("engage", file, "--json", "-")
    assert code == 0
    assert "warning: dispersion.z_m reaches 500 m below" in err
    assert json.loads(out)["warnings"][0].startswith("dispersion.z_m reaches 500 m below")
    assert infoset.json("experiment", file, "--runs", 1)["warnings"] == json.loads(out)["warnings"]


def test_a_run_of_the_experiment_is_the_same_engagement(infoset: Command) -> None:
    curves = infoset.json("experiment", "--runs", 3, "--seed", 7, "--set", "tie=random")["curves"]
    cases = product(("random", "game"), ("--no-range-sensor", "--range-sensor"))
    for curve, (noise, switch) in zip(curves, cases, strict=True):
        one = infoset.json(
            "engage", "--noise", noise, switch, "--seed", 7, "--run", 2, "--set", "tie=random"
        )
        assert {key: one[key] for key in CURVE_KEYS} == {
            key: value[2] if isinstance(value, list) else value for key, value in curve.items()
        }


def test_the_guaranteed_model_shows_its_certificate(infoset: Command) -> None:
    code, out, _ = infoset("experiment", "--runs", 4, "--model", "guaranteed")
    assert code == 0
    sets = (
        "true state inside the set at every step: 4 of 4 runs (100 %); set became empty: 0 of 4 "
        "runs (0 %)"
    )
    assert out.count(f"{sets}; miss within the bound Phi: 4 of 4 runs") == 4
    reason = "(manoeuvres 0.005 and gravity 3.8e-07, divided by 1 - 0.0172)"
    assert (
        f"acceleration along z at most 0.0050881 m/s^2 {reason}" in out
    )  # (0.005 + 3.8e-7) / (1 - 1 / 58)
    one = infoset.json("engage", "--model", "guaranteed", "--run", 3)
    assert one["phi_held"] is True
    assert one["truth_margin_m"] == min(step["truth_margin_m"] for step in one["steps"]) >= 0.0
    assert one["miss_m"] <= one["guaranteed_miss_m"]


def test_engage_as_json(infoset: Command, tmp_path: Path) -> None:
    found = infoset.json("engage")
    assert {*CURVE_KEYS, "run", "seed", "strategy", "hit", "inconsistency", "steps"} <= {*found}
    assert found["scenario_hash"] == fingerprint(load_scenario("asteroid-1997"))
    assert (found["run"], found["seed"], found["noise"], found["range_sensor"]) == (
        0,
        0,
        "random",
        True,
    )
    assert found["outcome"] in OUTCOMES
    steps = found["steps"]
    columns = [
        *(
            "step",
            "time_s",
            "true_range_m",
            "measured_range_m",
            "impulse_m_s",
            "measured_angle_z_rad",
        ),
        *("measured_rate_z_rad_s", "true_angle_z_rad", "true_rate_z_rad_s", "impulse_z_m_s"),
        *("predicted_miss_z_lower_m", "predicted_miss_z_upper_m", "truth_margin_m", "sections"),
    ]
    assert all(list(step) == columns for step in steps)
    assert [step["time_s"] for step in steps[:3]] == [0.0, 0.5, 1.0]
    first = steps[0]
    last = steps[-1]
    assert first["predicted_miss_z_lower_m"] < first["predicted_miss_z_upper_m"]
    assert last["time_s"] == 0.5 * (len(steps) - 1)
    assert all(
        (step["predicted_miss_z_lower_m"] is None) == (step["sections"] == 0) for step in steps
    )
    assert math.isclose(sum(step["impulse_m_s"] for step in steps), found["impulse_m_s"])
    assert names_in(tmp_path) == []


def test_engage_under_both_noises(infoset: Command, tmp_path: Path) -> None:
    folder = tmp_path / "figures"
    record = tmp_path / "flight.npz"
    steps = tmp_path / "steps.csv"
    arguments = ["engage", "asteroid-1997-single", "--noise", "both"]
    code, out, _ = infoset(*arguments, "--out", folder, "--record", record, "--csv", steps)
    assert code == 0
    drawn = [
        f"figure-{name}.{kind}"
        for name in ("2-process", "3-sets", "approach")
        for kind in ("pdf", "png")
    ]
    assert names_in(folder) == [
        *(
            *drawn,
            "record-game.npz",
            "record-random.npz",
            "results.json",
            "scenario.toml",
            "steps.csv",
        )
    ]
    for part in ("arrived", "the paper's Phi (not a bound here), m"):
        assert part in out
    found = json.loads((folder / "results.json").read_text())
    assert [key for key in found if key in {"random", "game"}] == ["random", "game"]
    assert found["versions"] == versions()
    assert found["game"]["steps"]
    alone = infoset.json(*arguments[:2], "--noise", "game")
    same = [key for key in found["game"] if key != "elapsed_s"]
    assert {key: found["game"][key] for key in same} == {key: alone[key] for key in same}
    rows = list(csv.DictReader(io.StringIO(steps.read_text())))
    assert {row["noise"] for row in rows} == {"random", "game"}
    assert len(rows) == len(found["random"]["steps"]) + len(found["game"]["steps"])
    assert rows[0]["measured_range_m"] == ""
    assert (tmp_path / "flight-random.npz").read_bytes() == (
        folder / "record-random.npz"
    ).read_bytes()


@pytest.mark.parametrize(
    ("option", "name"),
    [("--json", "x.json"), ("--csv", "x.csv"), ("--record", "x.npz"), ("--out", "x")],
)
def test_existing_file_is_replaced_only_with_overwrite(
    option: str, name: str, infoset: Command, brief_file: Path, tmp_path: Path
) -> None:
    target = tmp_path / name
    precious = target
    if option == "--out":
        target.mkdir()
        precious = target / "results.json"
    precious.write_text("precious")
    message = infoset.refused("engage", brief_file, option, target)
    assert "--overwrite" in message
    assert precious.read_text() == "precious"
    assert infoset("engage", brief_file, option, target, "--overwrite", "-q")[0] == 0
    assert precious.read_bytes() != b"precious"
    assert names_in(tmp_path) == [name]


def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    file = tmp_path / "x"
    file.write_text("old")
    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="No space left on device"):
        write_file(file, "new", overwrite=True)
    assert file.read_text() == "old"
    assert names_in(tmp_path) == ["x"]


def test_json_and_csv_of_odd_values() -> None:
    assert csv_text(["a", "b_m"], [[None, 0.1], [True, -1e-300], ['x,"', 3]]) == (
        'a,b_m\n,0.1\ntrue,-1e-300\n"x,""",3\n'
    )
    with pytest.raises(ValueError, match="not JSON compliant"):
        to_json({"a": math.nan})


def test_results_that_are_not_finite_are_refused(
    infoset: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def overflowing(scenario: Scenario, runs: int, **_: object) -> object:
        results = simulate(scenario, runs)
        results.miss_m[:] = math.inf
        return results

    monkeypatch.setattr("infoset.sim.parallel.simulate_runs", overflowing)
    assert "not finite" in infoset.refused("experiment", "--runs", 1)


def test_interrupted_command_exits_with_130_and_one_line(
    infoset: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("infoset.sim.parallel.simulate_runs", interrupt)
    code, out, err = infoset("experiment", "--out", "out")
    # Before it, perhaps, that kernels are compiled.
    assert (code, out, err.splitlines()[-1]) == (130, "", "interrupted")
    assert names_in(tmp_path) == []


@pytest.mark.thorough
def test_closed_pipe_on_stdout_ends_the_command_without_an_error() -> None:
    # Ample output, and a reader that closes at once.
    process = subprocess.Popen(
        [sys.executable, "-m", "infoset", "engage", "--json", "-", "--quiet"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    err = process.stderr.read()
    process.stderr.close()
    process.wait(60)
    assert err == b""


def test_a_message_keeps_its_lines_and_its_letters() -> None:
    assert on_a_screen("läuft:\n  Ü – 標\x1b[31m\r\u202e") == "läuft:\n  Ü – 標?[31m??"


def test_a_log_has_lines_of_progress(capsys: pytest.CaptureFixture[str]) -> None:
    now_s = 0.0
    with screen.progress_bar(quiet=False, clock=lambda: now_s) as begin:
        report = begin("patient")
        report(0.25)
        now_s = screen.LINE_EVERY_S
        report(0.5)
    assert capsys.readouterr().err == "patient: estimated time 90 s\npatient: 50 %, 1 min left\n"


def test_long_command_prints_its_time_once_and_the_time_left(
    capsys: pytest.CaptureFixture[str],
) -> None:
    now_s = 0.0
    with screen.progress_bar(quiet=False, clock=lambda: now_s) as begin:
        one = begin("one")
        two = begin("two")
        now_s = 50.0  # kernels are compiled before the first report
        one(0.01)
        now_s = 51.0
        one(0.03)
        assert "estimated" not in capsys.readouterr().err
        now_s = 53.0
        one(0.13)  # of both bars 6 % in 3 s, after the first half per cent
        assert capsys.readouterr().err == "estimated time 50 s\n"
        now_s = 90.0
        two(0.4)
    assert capsys.readouterr().err == "two: 40 %, 113 s left\n"


def test_short_command_prints_no_time(capsys: pytest.CaptureFixture[str]) -> None:
    now_s = 0.0
    with screen.progress_bar(quiet=False, clock=lambda: now_s) as begin:
        report = begin("one")
        for second in range(10):
            now_s = float(second)
            report(0.11 * second)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    "error", [OSError(28, "No space left on device", "k.nbi"), MemoryError("Unable to allocate")]
)
def test_error_of_the_system_is_one_message(
    error: Exception, infoset: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("infoset.experiments.file_commands.built_in", fail)
    assert infoset.refused("scenarios", "show", "dart-2022") == f"error: {error}\n"
