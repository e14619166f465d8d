"""What the code must never do, looked for in its own text, and what a file from a stranger must not
bring about.
"""

from __future__ import annotations

import ast
import dataclasses
import json
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments.cli import main
from infoset.experiments.interception.page import interception_page
from infoset.experiments.interception.record_file import load_record, write_record
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import Record, fly_one
from tests.built_in import scenario_text
from tests.records import first_steps

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
PACKAGES = {
    name: Path(spec.origin).parent
    for name in (
        "infoset",
        "infoset.guidance",
        "infoset.sim",
        "infoset.rendezvous",
        "infoset.experiments",
    )
    if (spec := find_spec(name)) is not None and spec.origin is not None
} | ({"benchmarks": BENCHMARKS} if BENCHMARKS.is_dir() else {})
"""Where the packages are installed, and in a checkout the benchmarks."""

SOURCES = {name: sorted(folder.rglob("*.py")) for name, folder in PACKAGES.items()}

UNSAFE_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "marshal", "shelve", "yaml"}
"""What runs code that a file holds, or may."""
UNSAFE_CALLS = {"eval", "exec", "compile", "__import__"}


def calls(tree: ast.AST) -> list[ast.Call]:
    return [node for node in ast.walk(tree) if isinstance(node, ast.Call)]


def name_of(call: ast.Call) -> str:
    """The last part of what is called: `load` of `np.load(...)`."""
    if isinstance(call.func, ast.Attribute):
        return call.func.attr
    return call.func.id if isinstance(call.func, ast.Name) else ""


@pytest.fixture(scope="module", params=PACKAGES)
def trees(request: pytest.FixtureRequest) -> dict[Path, ast.Module]:
    """The syntax trees of a package, by file."""
    return {file: ast.parse(file.read_text()) for file in SOURCES[request.param]}


def test_functions_that_run_code_from_files_are_not_called(trees: dict[Path, ast.Module]) -> None:
    found = []
    for file, tree in trees.items():
        for node in ast.walk(tree):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            found += [f"{file}: {name}" for name in names if name.split(".")[0] in UNSAFE_MODULES]
        for call in calls(tree):
            if isinstance(call.func, ast.Name) and call.func.id in UNSAFE_CALLS:
                found.append(f"{file}:{call.lineno} {call.func.id}")
            if any(each.arg == "shell" for each in call.keywords):
                found.append(f"{file}:{call.lineno} shell")
    assert not found


def test_arrays_are_read_and_written_without_pickle(trees: dict[Path, ast.Module]) -> None:
    for file, tree in trees.items():
        for call in calls(tree):
            of_numpy = isinstance(call.func, ast.Attribute) and ast.unparse(call.func).startswith(
                ("np.", "numpy.")
            )
            if of_numpy and name_of(call) in {"load", "read_array", "write_array"}:
                given = {each.arg: each.value for each in call.keywords}
                allowed = given.get("allow_pickle")
                assert isinstance(allowed, ast.Constant), f"{file}:{call.lineno}"
                assert allowed.value is False, f"{file}:{call.lineno}"


ESCAPE = "\x1b]0;owned\x07\x1b[2J"
SCRIPT = "<script>alert(1)</script><img src=x onerror=alert(1)>"


def infoset(*arguments: object) -> int:
    """Run the command; its exit code."""
    with pytest.raises(SystemExit) as left:
        main([str(each) for each in arguments])
    return int(left.value.code or 0)


@pytest.fixture(scope="module")
def record() -> Record:
    whole = fly_one(load_scenario("asteroid-1997"), 3, seed=11)
    return first_steps(whole, 6)


def test_code_named_in_a_file_is_not_run(
    record: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A strategy that is a class in a Python file is loaded only if an option names it."""
    monkeypatch.chdir(tmp_path)
    Path("decoy.py").write_text("open('executed', 'w')\n\nclass Mine:\n    pass\n")
    name = "decoy.py:Mine"
    write_record(dataclasses.replace(record, strategy=name, noise=name), "x.npz")
    Path("mine.toml").write_text(
        scenario_text("asteroid-1997").replace('"symmetric-miss"', f'"{name}"', 1)
    )
    assert infoset("replay", "x.npz", "--html", "page.html") == 0
    assert infoset("engage", "mine.toml") == 2
    assert not Path("executed").exists()


@pytest.mark.parametrize("key", ["strategy", "noise"])
def test_a_record_cannot_steer_the_terminal(
    key: str,
    record: Record,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    write_record(dataclasses.replace(record, **{key: f"x{ESCAPE}"}), "x.npz")  # type: ignore[arg-type]
    assert infoset("replay", "x.npz") == 2
    told = capsys.readouterr()
    assert "control characters" in told.err
    assert "\x1b" not in told.out + told.err


def test_keys_in_messages_cannot_steer_the_terminal(
    record: Record,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """What is wrong is shown, and may be anything: names of files, of keys, of members of an
    archive.
    """
    monkeypatch.chdir(tmp_path)
    write_record(record, "x.npz")
    with np.load("x.npz") as arrays:
        changed = dict(arrays) | {
            "header": np.frombuffer(json.dumps({ESCAPE: 1}).encode(), dtype=np.uint8)
        }
    with Path(f"{ESCAPE.replace('/', '')}.npz").open("wb") as file:
        np.savez(file, **changed)
    Path("mine.toml").write_text('name = "x"\n"a\\u001b[2J" = 1\n["\\u001b]0;owned"]\n')
    assert infoset("replay", f"{ESCAPE}.npz") == 2
    assert infoset("scenarios", "check", "mine.toml") == 2
    assert infoset("engage", f"./{ESCAPE}.toml") == 2
    told = capsys.readouterr()
    assert "\x1b" not in told.out + told.err
    assert told.err.count("error: ") == 3


def test_pages_show_names_as_text(record: Record, tmp_path: Path) -> None:
    scenario = dataclasses.replace(record.scenario, description=SCRIPT)
    file = tmp_path / "x.npz"
    write_record(
        dataclasses.replace(record, scenario=scenario, strategy=SCRIPT, noise=SCRIPT), file
    )
    found = load_record(file)
    assert found.strategy == SCRIPT
    text = interception_page([found])
    assert "<script>alert" not in text
    assert "<img src" not in text
