"""The commands, examples and names in the README are correct."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from infoset import experiments

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """Return the code blocks of the README in a language."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.DOTALL | re.MULTILINE)


def command(name: str) -> str:
    """Return one of the marked commands, as it stands."""
    found = re.search(rf"<!-- command: {name} -->\n```sh\n(.+?\n)```", README, flags=re.DOTALL)
    assert found is not None
    return found[1]


@pytest.mark.parametrize("block", blocks("python"))
def test_python_blocks_run(block: str, tmp_path: Path) -> None:
    script = tmp_path / "quickstart.py"
    script.write_text(block.replace("runs=200", "runs=3"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, script], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    published, own = done.stdout.splitlines()
    assert published.startswith("<3 engagements: median miss")
    assert own.startswith("<3 engagements: median miss")
    assert own != published


def test_the_readme_is_short() -> None:
    lines = README.splitlines()
    assert len(lines) < 140
    assert max(map(len, lines)) <= 100


def test_contributing_is_short() -> None:
    assert (ROOT / "CONTRIBUTING.md").stat().st_size < 6000


def test_ci_runs_the_test_command_word_for_word() -> None:
    assert command("tests").strip() in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def test_the_extra_and_the_command_of_the_readme_exist() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert "test" in project["optional-dependencies"]
    assert "infoset" in project["scripts"]
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"version: {project['version']}\n" in cited


def test_constraints_hold_names_and_versions_only() -> None:
    pins = [
        line
        for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
        if line[:1] != "#"
    ]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[A-Za-z0-9.+!]+", pin) for pin in pins)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [*project["dependencies"], *project["optional-dependencies"]["test"]]
    pinned = {normal(pin.split("==")[0]) for pin in pins}
    assert {normal(re.split(r"[^A-Za-z0-9._-]", name)[0]) for name in needed} <= pinned


def normal(name: str) -> str:
    """Return the normalised name of a distribution."""
    return re.sub(r"[-_.]+", "-", name).lower()


def test_exports_of_experiments_are_loaded_late() -> None:
    code = (
        "import sys; from infoset import experiments\n"
        "print('pydantic' in sys.modules, 'numpy' in sys.modules); experiments.load_scenario; "
        "print('pydantic' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False", "False", "True"]


def test_public_names_of_experiments() -> None:
    assert set(experiments.__all__) == {
        name for names in experiments._NAMES.values() for name in names
    }
    for name in experiments.__all__:
        assert callable(getattr(experiments, name))
    package: Any = experiments
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = package.nothing
