"""`infoset problems new` and `check`, and files of another kind."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from experiments.common.file_kinds import PROBLEMS, SCENARIO, built_in_files
from experiments.common.input_file import read_text, to_toml
from tests.fuzzing.subjects import text_files

Infoset = Callable[..., tuple[int, str, str]]
EXAMPLES = {file.kind: file.name for file in built_in_files().values() if file.kind != SCENARIO}
"""A built-in problem of each kind."""


@pytest.mark.parametrize("kind", EXAMPLES)
def test_a_new_problem_is_checked_by_kind_and_fingerprint(kind: str, infoset: Infoset) -> None:
    code, out, err = infoset("problems", "new", "mine.toml", "--like", EXAMPLES[kind])
    assert (code, err) == (0, "")
    code, out, _ = infoset("problems", "check", "mine.toml", "--json")
    found = json.loads(out)
    assert (code, found["kind"], found["warnings"]) == (0, kind, [])
    assert infoset("problems", "check", "mine.toml")[1] == f"ok  {found['name']}  {found['problem_hash']}\n"


def test_all_faults_of_a_file_are_listed_one_a_line(infoset: Infoset, tmp_path: Path) -> None:
    text = built_in_files()["service-2"].text
    (tmp_path / "bad.toml").write_text(text.replace("1.13e-3", '"fast"').replace("time_s = 1500.0", "time = 1500.0"))
    code, out, err = infoset("problems", "check", "bad.toml")
    assert (code, out) == (2, "")
    assert sorted(line.split(": ")[-2] for line in err.splitlines()) == ["orbit_rate_rad_s", "target.#1.time"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "kind: must be one of pareto-encounter, multipoint"),
        ('kind = "multipint"', "kind: must be one of"),
        ("kind = [1]", "kind: must be one of"),
        ("kind = ", "is not valid TOML"),
        (built_in_files()["asteroid-1997"].text, "this is a scenario; use infoset engage FILE"),
    ],
)
def test_a_file_without_a_known_kind_is_refused(text: str, message: str, infoset: Infoset, tmp_path: Path) -> None:
    (tmp_path / "odd.toml").write_text(text)
    code, out, err = infoset("problems", "check", "odd.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err


def test_a_new_file_needs_a_known_name(infoset: Infoset) -> None:
    code, _, err = infoset("problems", "new", "mine.toml", "--like", "pareto-2009")
    assert code == 2
    assert 'no built-in problem is called "pareto-2009"; did you mean "pareto-2008"?' in err


PROBLEM_COMMANDS = [*(problem.command for problem in PROBLEMS.values()), "pursuit-map"]
COMMANDS = [*PROBLEM_COMMANDS, "engage", "experiment", "compare", "bound", "adversary"]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_file_of_another_kind_is_one_message_with_its_command(command: str, infoset: Infoset, tmp_path: Path) -> None:
    for name in ("asteroid-1997", "service-3", "pareto-2008"):
        file = built_in_files()[name]
        (tmp_path / "mine.toml").write_text(file.text)
        wanted = "engage" if file.kind == SCENARIO else PROBLEMS[file.kind].command
        if command == wanted or (wanted == "engage" and command not in PROBLEM_COMMANDS):
            continue
        what = "a scenario" if wanted == "engage" else f"a problem of kind {file.kind}"
        assert infoset(command, "mine.toml") == (
            2,
            "",
            f"error: mine.toml: this is {what}; use infoset {wanted} FILE\n",
        )
        assert infoset(command, name) == (2, "", f"error: {name}: this is {what}; use infoset {wanted} {name}\n")


def test_records_campaigns_and_toml_files_are_told_apart(infoset: Infoset, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(built_in_files()["service-3"].text)
    (tmp_path / "flight.npz").write_bytes(b"PK\x03\x04")
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "manifest.json").write_text("{}")
    problem = "this is a problem of kind multipoint; use infoset multipoint FILE"
    record, folder = "this may be a record; use infoset replay FILE", "use infoset report DIR"
    for arguments, message in {
        ("scenarios", "check", "mine.toml"): problem,
        ("replay", "mine.toml"): problem,
        ("report", "mine.toml"): problem,
        ("report", "flight.npz"): record,
        ("engage", "flight.npz"): record,
        ("reach", "flight.npz"): record,
        ("engage", "runs"): folder,
        ("replay", "runs"): folder,
    }.items():
        code, out, err = infoset(*arguments)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert message in err


@pytest.mark.parametrize("name", [file.name for file in built_in_files().values()])
def test_a_written_file_is_read_as_an_equal_one(name: str) -> None:
    kind = text_files()[built_in_files()[name].kind]
    value: Any = read_text(kind.owner, built_in_files()[name].text, name)
    assert read_text(kind.owner, to_toml(value), "written") == value
