from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from experiments.common.errors import InputError
from experiments.interception.scenario_file import load_scenario
from experiments.interception.strategies import chosen_strategies, load_strategy, own_strategy
from guidance import SymmetricMiss
from sim import Scenario, simulate
from tests.experiments.command_line import Command

LIKE_PUBLISHED = """
from dataclasses import dataclass
from half import HALF
from guidance import symmetric_impulse

@dataclass(frozen=True)
class Mine:
    share: float = 2 * HALF
    def start(self, shape):
        return None
    def decide(self, situation, state):
        return self.share * symmetric_impulse(situation.predicted_miss, situation.closing_speed_m_s)
"""


@pytest.fixture(autouse=True)
def _modules_are_put_back(infoset: Command, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
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
    [("engage", "--strategy"), ("experiment", "--strategy"), ("compare", "--strategies"), ("bound", "--strategies"),
     ("adversary", "--strategy")],
)  # fmt: skip
def test_every_command_takes_a_strategy_of_a_file(
    command: str,
    option: str,
    mine: Path,
    brief_file: Path,
    infoset: Command,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sim.bound.lower_bound.REFINEMENTS", 0)
    few = {
        "experiment": ["--runs", 2],
        "compare": ["--runs", 2],
        "bound": ["--budget", 6],
        "adversary": ["--budget", 6],
    }
    numbers: list[Any] = []
    for strategy in ("mine.py:Mine", "symmetric-miss"):
        code, out, err = infoset(command, brief_file, option, strategy, *few.get(command, []), "--json", "-")
        assert code == 0, err
        text = out.replace("mine.Mine", "symmetric-miss")
        numbers.append({key: value for key, value in json.loads(text).items() if key not in {"elapsed_s", "strategy"}})
    assert numbers[0] == numbers[1]


def test_strategies_of_files_and_built_in_ones_are_compared(mine: Path, brief: Scenario) -> None:
    chosen = chosen_strategies(brief, "patient, mine.py:Mine")
    assert list(chosen) == ["patient", "mine.Mine"]
    assert chosen["patient"] is None
    with pytest.raises(InputError, match=r"mine\.Mine is named twice"):
        chosen_strategies(brief, "mine.py:Mine,mine.py:Mine")


@pytest.mark.parametrize(
    ("text", "code", "part"),
    [
        ("no.py:Mine", None, "with a file that exists"),
        ("mine.py", None, "must be FILE.py:CLASS"),
        ("mine.py:HALF", None, 'mine.py has no class "HALF" with the methods start and decide'),
        ("typo.py:Mine", "\nclass Mine\n", "typo.py, line 2: SyntaxError: "),
        ("leaving.py:Mine", "import sys\nsys.exit(3)\n", "leaving.py, line 2: SystemExit: 3"),
        ("needs.py:Mine", LIKE_PUBLISHED.replace("share: float = 2 * HALF", "share: float"), "TypeError"),
        ("random.py:Mine", LIKE_PUBLISHED, "random.py has the name of another Python module"),
    ],
)
def test_what_is_wrong_with_a_file_is_one_message(text: str, code: str | None, part: str, mine: Path) -> None:
    if code is not None:
        Path(text.partition(":")[0]).write_text(code)
    with pytest.raises(InputError) as refused:
        load_strategy(text)
    assert part in str(refused.value)


@pytest.mark.parametrize(
    ("method", "body", "message"),
    [
        ("decide", "return situation.nothing", "line 5: AttributeError"),
        ("decide", "return [1.0, 2.0, 3.0]", "must return finite impulses (m/s) of the shape (1, 1)"),
        ("start", "raise RuntimeError('no state')", "line 3: RuntimeError: no state"),
    ],
)
def test_failures_of_a_flight_are_said_without_a_traceback(
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
