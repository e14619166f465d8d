"""infoset adversary: what it writes, what it prints, what it refuses."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from experiments.cli import main
from experiments.interception.record_file import load_record
from experiments.interception.scenario_file import load_scenario, scenario_hash
from sim.adversary import find_worst

KEYS = [
    "version",
    "scenario",
    "scenario_hash",
    "seed",
    "model",
    "range_meter",
    "elapsed_s",
    "strategy",
    "keep_set",
    "worst_miss_m",
    "outcome",
    "truth_kept",
    "evaluations",
    "record",
    "found_from",
    "changes",
    "start",
    "history",
]
BUDGET = 12


@pytest.fixture(autouse=True)
def _plain_screen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.chdir(tmp_path)


class Command:
    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *arguments: object) -> tuple[int, str, str]:
        """Exit code, stdout and stderr."""
        with pytest.raises(SystemExit) as left:
            main([str(each) for each in arguments])
        captured = self._capsys.readouterr()
        assert "Traceback" not in captured.err
        return int(left.value.code or 0), captured.out, captured.err

    def refused(self, *arguments: object) -> str:
        """The one message of a command that must be refused."""
        code, out, err = self("adversary", *arguments)
        assert (code, out) == (2, "")
        assert err.startswith(("error: ", "Usage: "))
        assert err.count("error: ") + err.count("─ Error ─") == 1
        return err if err.startswith("error: ") else " ".join(err.replace("│", " ").split())


@pytest.fixture
def infoset(capsys: pytest.CaptureFixture[str]) -> Command:
    return Command(capsys)


def test_help_has_an_example(infoset: Command) -> None:
    code, out, _ = infoset("adversary", "--help")
    assert code == 0
    assert "Example: infoset adversary" in out


def test_the_worst_as_json_and_as_a_record_that_replays(infoset: Command, tmp_path: Path) -> None:
    code, out, err = infoset(
        "adversary", "--budget", BUDGET, "--seed", 5, "--record", "worst.npz", "--json", "-", "--quiet"
    )
    assert (code, err) == (0, "")
    found: dict[str, Any] = json.loads(out)
    assert list(found) == KEYS
    scenario = load_scenario("asteroid-1997")
    assert found["version"] == version("infoset")
    assert (found["scenario"], found["scenario_hash"]) == (scenario.name, scenario_hash(scenario))
    assert (found["seed"], found["evaluations"], found["record"]) == (5, BUDGET, "worst.npz")
    assert (found["strategy"], found["model"], found["range_meter"]) == ("symmetric-miss", "paper", True)
    worst = find_worst(scenario, budget=BUDGET, seed=5)
    assert found["worst_miss_m"] == worst.miss_m == found["history"][-1]["worst_miss_m"]
    assert list(found["start"].values()) == [*worst.position_m.tolist(), *worst.velocity_m_s.tolist()]

    record = load_record(tmp_path / "worst.npz")
    assert float(record.result.miss_m[0]) == worst.miss_m
    assert record.noise == record.noise_name == "scripted"
    assert record.result.position_m[0].tolist() == worst.position_m.tolist()
    assert record.scenario == worst.scenario
    code, out, _ = infoset("replay", "worst.npz", "--out", "figures")
    assert code == 0
    assert "scripted + range meter" in out
    assert sorted(each.name for each in (tmp_path / "figures").iterdir()) == [
        "figure-2-process.pdf",
        "figure-2-process.png",
        "figure-3-sets.pdf",
        "figure-3-sets.png",
    ]


def test_the_table_says_what_was_found_and_how(infoset: Command, tmp_path: Path) -> None:
    code, out, _ = infoset(
        "adversary", "--budget", BUDGET, "--model", "guaranteed", "--no-range-meter", "--strategy", "patient"
    )
    assert code == 0
    assert "asteroid-1997, without range meter, model guaranteed\n" in out
    lines = ("patient", "worst miss, m", "initial z, x, km", "rounds of changes", "per second")
    for part in (*lines, "greater misses may exist"):
        assert part in out
    assert list(tmp_path.iterdir()) == []


def test_quiet_prints_nothing(infoset: Command) -> None:
    assert infoset("adversary", "--budget", 1, "-q", "--json", "out.json") == (0, "", "")
    found = json.loads(Path("out.json").read_text())
    assert (found["evaluations"], found["record"]) == (1, None)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--budget", "0"], "greater than or equal to 1"),
        (["--budget", "-5"], "greater than or equal to 1"),
        (["--seed", "-1"], "Input should be greater than or equal to 0"),
        (["--record", "worst.txt"], "--record: worst.txt must end in .npz"),
        (["--record", "there.npz"], "there.npz: exists already; choose another name, or give --overwrite"),
        (["--json", "there.npz"], "there.npz: exists already"),
        (["--json", "nowhere/out.json"], "there is no folder nowhere"),
        (["--strategy", "symetric-miss"], '--strategy: there is no "symetric-miss"; did you mean symmetric-miss?'),
        (["--model", "papers"], "'papers' is not one of 'paper', 'guaranteed'"),
        (["asteroid-1998"], "asteroid-1998"),
        (["asteroid-1997-single", "--range-meter"], "has no [range_sensor]"),
    ],
)
def test_what_is_refused_before_anything_is_flown(arguments: list[str], message: str, infoset: Command) -> None:
    Path("there.npz").write_text("something")
    assert message in infoset.refused(*arguments)
    assert Path("there.npz").read_text() == "something"


def test_an_existing_record_is_replaced_when_told(infoset: Command) -> None:
    Path("worst.npz").write_text("something")
    assert infoset("adversary", "--budget", 1, "--record", "worst.npz", "--overwrite", "-q")[0] == 0
    assert load_record("worst.npz").noise == "scripted"


def test_where_no_engagement_counts_it_is_said(infoset: Command, tmp_path: Path) -> None:
    from experiments.interception.scenario_file import scenario_text

    text = scenario_text("asteroid-1997").replace("vx_km_s = [-59.0, -57.0]", "vx_km_s = [-110.1, -110.0]")
    text = text.replace("vx_km_s = [-58.1, -57.9]", "vx_km_s = [-110.05, -110.0]")
    file = tmp_path / "fast.toml"
    file.write_text(text)
    message = infoset("adversary", file, "--keep-set", "--budget", 2, "-q")
    assert message[0] == 2
    assert "in every simulated engagement the set was lost" in message[2]
    assert "omit --keep-set" in message[2]
