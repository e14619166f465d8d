from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from infoset.experiments.common.errors import InputError
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.experiments.interception.strategies import (
    chosen_strategies,
    load_noise,
    load_strategy,
    own_strategy,
)
from infoset.guidance import SymmetricMiss
from infoset.sim import Scenario, simulate
from tests.experiments.command_line import Command

LIKE_PUBLISHED = """
from dataclasses import dataclass
from half import HALF
from infoset.guidance import symmetric_impulse

@dataclass(frozen=True)
class Mine:
    share: float = 2 * HALF
    def start(self, shape):
        return None
    def decide(self, situation, state):
        return self.share * symmetric_impulse(situation.predicted_miss, situation.closing_speed_m_s)
"""


LIKE_RANDOM = """
class Uniform:
    def measure(self, sight, predicted):
        return {
            name: sensor.measured(sight, sight.uniform[name])
            for name, sensor in sight.sensors.items()
        }

class Half:
    def measure(self, sight, predicted):
        return {"angle": 0.0 * sight.range_m[0]}
"""


@pytest.fixture(autouse=True)
def _modules_are_put_back(
    infoset: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Iterator[None]:
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(str(tmp_path)):
            del sys.modules[name]


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    (tmp_path / "half.py").write_text("HALF = 0.5\n")
    file = tmp_path / "mine.py"
    file.write_text(LIKE_PUBLISHED)
    return file


def test_a_strategy_of_a_file_is_simulated_and_can_be_pickled(mine: Path, brief: Scenario) -> None:
    own = own_strategy("mine.py:Mine")
    assert own is not None
    expected = simulate(brief, 2, strategy=SymmetricMiss()).impulse_m_s
    for strategy in (own, pickle.loads(pickle.dumps(own))):
        assert (type(strategy).__module__, type(strategy).__qualname__) == ("mine", "Mine")
        assert (simulate(brief, 2, strategy=strategy).impulse_m_s == expected).all()
    assert own_strategy("patient") is None
    assert own_strategy(None) is None


@pytest.mark.parametrize(
    ("command", "option"),
    [
        ("engage", "--strategy"),
        ("experiment", "--strategy"),
        ("compare", "--strategies"),
        ("bound", "--strategies"),
        ("adversary", "--strategy"),
    ],
)
def test_every_command_takes_a_strategy_of_a_file(
    command: str,
    option: str,
    mine: Path,
    brief_file: Path,
    infoset: Command,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("infoset.sim.bound.lower_bound.REFINEMENTS", 0)
    few = {
        "experiment": ["--runs", 2],
        "compare": ["--runs", 2],
        "bound": ["--budget", 6],
        "adversary": ["--budget", 6],
    }
    numbers: list[Any] = []
    for strategy in ("mine.py:Mine", "symmetric-miss"):
        code, out, err = infoset(
            command, brief_file, option, strategy, *few.get(command, []), "--json", "-"
        )
        assert code == 0, err
        text = out.replace("mine.Mine", "symmetric-miss")
        numbers.append(
            {
                key: value
                for key, value in json.loads(text).items()
                if key not in {"elapsed_s", "strategy"}
            }
        )
    assert numbers[0] == numbers[1]


def test_strategies_of_files_and_built_in_ones_are_compared(mine: Path, brief: Scenario) -> None:
    chosen = chosen_strategies(brief, "patient, mine.py:Mine")
    assert list(chosen) == ["patient", "mine.Mine"]
    assert chosen["patient"] is None
    assert list(chosen_strategies(brief, "mine.py:Mine,mine.py:Mine")) == ["mine.Mine"]


@pytest.mark.parametrize(
    ("text", "code", "part"),
    [
        ("no.py:Mine", None, "of a file that exists"),
        ("mine.py", None, "must be FILE.py:CLASS"),
        ("mine.py:HALF", None, 'mine.py has no class "HALF" with the methods start and decide'),
        ("typo.py:Mine", "\nclass Mine\n", "typo.py, line 2: SyntaxError: "),
        ("leaving.py:Mine", "import sys\nsys.exit(3)\n", "leaving.py, line 2: SystemExit: 3"),
        (
            "needs.py:Mine",
            LIKE_PUBLISHED.replace("share: float = 2 * HALF", "share: float"),
            "TypeError",
        ),
        ("random.py:Mine", LIKE_PUBLISHED, "random.py has the name of another Python module"),
    ],
)
def test_wrong_strategy_file_is_refused_with_one_message(
    text: str, code: str | None, part: str, mine: Path
) -> None:
    if code is not None:
        Path(text.partition(":")[0]).write_text(code)
    with pytest.raises(InputError) as refused:
        load_strategy(text)
    assert part in str(refused.value)


@pytest.mark.parametrize(
    ("method", "body", "message"),
    [
        ("decide", "return situation.nothing", "line 5: AttributeError"),
        (
            "decide",
            "return [1.0, 2.0, 3.0]",
            "must return finite impulses (m/s) of the shape (1, 1)",
        ),
        ("start", "raise RuntimeError('no state')", "line 3: RuntimeError: no state"),
    ],
)
def test_error_of_a_strategy_during_a_run_is_printed_without_traceback(
    method: str, body: str, message: str, brief_file: Path, infoset: Command
) -> None:
    bodies = {"start": "return None", "decide": "return [[0.0]]"} | {method: body}
    Path(f"flying_{method}.py").write_text(
        f"class Mine:\n  def start(self, shape):\n    {bodies['start']}\n"
        f"  def decide(self, situation, state):\n    {bodies['decide']}\n"
    )
    code, out, err = infoset("engage", brief_file, "--strategy", f"flying_{method}.py:Mine")
    assert (code, out) == (2, "")
    assert f"error: --strategy: flying_{method}.py" in err
    assert message in err
    assert err.endswith("correct the file\n")


def test_a_scenario_file_cannot_name_python_code(mine: Path, brief_file: Path) -> None:
    hostile = Path("hostile.toml")
    hostile.write_text(brief_file.read_text().replace('"symmetric-miss"', '"mine.py:Mine"'))
    with pytest.raises(InputError, match=r"strategy: there is no"):
        load_scenario("hostile.toml")
    assert "mine" not in sys.modules


def misses(found: dict[str, Any], noise: str) -> list[Any]:
    """The misses of a noise in the JSON of a command."""
    for key, name in (("curves", "noise"), ("strategies", "noise"), ("samples", "noise")):
        if key in found:
            return [
                [each.get("miss_m"), each.get("miss_m_p50")]
                for each in found[key]
                if each[name] == noise
            ]
    return [found["miss_m"], found["noise"] == noise]


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (["engage"], "noisy.Uniform"),
        (["experiment", "--runs", 3], "noisy.Uniform"),
        (["compare", "--runs", 3, "--strategies", "patient"], "noisy.Uniform"),
        (["campaign", "--runs", 8], "own"),
    ],
)
def test_every_command_that_draws_errors_takes_a_noise_of_a_file(
    arguments: list[Any], name: str, brief_file: Path, infoset: Command
) -> None:
    Path("noisy.py").write_text(LIKE_RANDOM)
    command, *options = arguments
    found = []
    for noise in ("noisy.py:Uniform", "random"):
        folder = ["--out", noise[:5]] if command == "campaign" else []
        found.append(infoset.json(command, brief_file, "--noise", noise, *options, *folder))
    assert misses(found[0], name) == misses(found[1], "random")
    if command == "campaign":
        assert found[0]["own_noise"].startswith("noisy.py:Uniform sha256:")
        report = infoset.json("report", "noisy")
        again = infoset.json(*report["worst"][0]["replay"].split()[1:])
        assert again["miss_m"] == report["worst"][0]["miss_m"]
        Path("noisy.py").write_text(LIKE_RANDOM + "# changed")
        del sys.modules["noisy"]
        resumed = (
            "campaign",
            brief_file,
            "--noise",
            "noisy.py:Uniform",
            "--runs",
            8,
            "--out",
            "noisy",
            "--resume",
        )
        assert "own_noise: " in infoset(*resumed)[2]


def test_noise_of_a_file_can_be_pickled_and_its_errors_have_one_message(
    brief: Scenario, brief_file: Path, infoset: Command
) -> None:
    Path("noisy.py").write_text(LIKE_RANDOM)
    noise = pickle.loads(pickle.dumps(load_noise("noisy.py:Uniform")))
    assert (simulate(brief, 2, noise=noise).miss_m == simulate(brief, 2).miss_m).all()
    code, _, err = infoset("engage", brief_file, "--noise", "noisy.py:Half")
    assert code == 2
    assert (
        "noise Half at step 0: angle must be an array of the shape (1, 1): got np.float64(0.0)"
        in err
    )
    assert 'no class "Full" with the method measure' in infoset.refused(
        "engage", "--noise", "noisy.py:Full"
    )
    assert "did you mean gaussian?" in infoset.refused(
        "campaign", "--noise", "gaus", "--runs", 1, "--out", "no"
    )


def test_compare_with_all_noises_prints_the_ratio_of_their_quantiles(
    brief_file: Path, infoset: Command
) -> None:
    options = (
        "--strategies",
        "patient,symmetric-miss",
        "--runs",
        10,
        "--noise",
        "all",
        "--set",
        "noise_sigma=0.5",
    )
    code, out, _ = infoset("compare", brief_file, *options)
    assert code == 0
    assert "maximum / minimum" in out
    assert "within 10% of the least in these runs" in out
    assert "0.5 of the bound, where the errors are truncated; this cuts 4.55 % of a Gaussian" in out
    assert "the time constant of the correlation is 1.026 s" in out
