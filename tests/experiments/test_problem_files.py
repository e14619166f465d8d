"""`infoset problems new` and `check`, and files of another kind."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from experiments.common.file_kinds import PROBLEMS, SCENARIO, built_in_files
from experiments.common.problem_file import problem_toml
from experiments.common.toml_file import load_tables
from experiments.common.toml_form import keys_of, tables_of
from experiments.files import form_and_loader

Infoset = Callable[..., tuple[int, str, str]]
KINDS = list(PROBLEMS)
OTHER_CASES = {"x_m", "z_m", "epoch_s", "description"}
"""Keys that do not go with other values of a template, and the description, whose example is text."""


@pytest.mark.parametrize("kind", KINDS)
def test_a_template_is_valid_and_solved_by_its_command(kind: str, infoset: Infoset) -> None:
    code, out, err = infoset("problems", "new", kind, "mine.toml")
    assert (code, err) == (0, "")
    assert f"infoset {PROBLEMS[kind].command} mine.toml" in out
    code, out, _ = infoset("problems", "check", "mine.toml", "--json")
    assert (code, json.loads(out)["kind"], json.loads(out)["warnings"]) == (0, kind, [])
    assert infoset(PROBLEMS[kind].command, "mine.toml", "--quiet") == (0, "", "")


@pytest.mark.parametrize("kind", KINDS)
def test_a_template_has_every_key_and_optional_keys_have_their_defaults(
    kind: str, infoset: Infoset, tmp_path: Path
) -> None:
    form, load = form_and_loader(kind)
    infoset("problems", "new", PROBLEMS[kind].command, "mine.toml")
    lines = (tmp_path / "mine.toml").read_text().splitlines()
    problem, seen = load("mine.toml"), set()
    table: tuple[str, ...] = ("",)
    for index, line in enumerate(lines):
        if heading := re.match(r"(# )?\[+(\w+)\]+$", line):
            table = (heading[2],) if heading[1] is None else (heading[2], "left out")
        if not (found := re.match(r"(# )?(\w+) = .*  # (.*)$", line)):
            continue
        seen.add((table[0], found[2]))
        field = keys_of(form.tables, table[:1] if table[0] else ())[found[2]]
        assert field.description == found[3]
        if found[1] and field.default is not None and len(table) == 1 and found[2] not in OTHER_CASES:
            (tmp_path / "written.toml").write_text("\n".join([*lines[:index], line[2:], *lines[index + 1 :]]))
            assert load("written.toml").hash == problem.hash, line
    tables = tables_of(form.tables)
    keys = {("", name) for name in keys_of(form.tables) if name not in tables}
    assert seen == keys | {(table, name) for table in tables for name in keys_of(form.tables, (table,))}


@pytest.mark.parametrize("table", ["cone", "keep_in", "disturbance", "navigation"])
def test_the_optional_tables_of_a_template_fit_its_other_values(table: str, infoset: Infoset, tmp_path: Path) -> None:
    infoset("problems", "new", "reach", "mine.toml")
    pieces = (tmp_path / "mine.toml").read_text().split("\n\n")
    written = [re.sub(r"(?m)^# (?=\S+ = |\[)", "", piece) if f"[{table}]" in piece else piece for piece in pieces]
    (tmp_path / "mine.toml").write_text("\n\n".join(written))
    assert written != pieces
    assert infoset("problems", "check", "mine.toml", "--quiet") == (0, "", "")
    assert infoset("reach", "mine.toml", "--select", "energy", "--quiet") == (0, "", "")


def test_all_faults_of_a_file_are_listed_one_a_line(infoset: Infoset, tmp_path: Path) -> None:
    text = built_in_files()["service-2"].text
    (tmp_path / "bad.toml").write_text(text.replace("1.13e-3", '"fast"').replace("time_s = 1500.0", "time = 1500.0"))
    code, out, err = infoset("problems", "check", "bad.toml")
    assert (code, out) == (2, "")
    head, *faults = err.splitlines()
    assert head == "error: bad.toml has 2 problems:"
    assert [fault.split(": ")[1] for fault in faults] == ["orbit_rate_rad_s", "target #1.time"]


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("", ["is empty; start from `infoset problems new KIND FILE`"]),
        ("schema = 1", ["kind: is missing, must be one of pareto-encounter", 'kind = "pareto-encounter"']),
        ('kind = "multipint"', ['found "multipint"', "did you mean multipoint?"]),
        ("kind = [1]", ["found [1]"]),
        ("kind = ", ["is not valid TOML"]),
        (built_in_files()["asteroid-1997"].text, ["this is a scenario; use infoset engage FILE"]),
    ],
)
def test_a_file_without_a_known_kind_is_refused(text: str, parts: list[str], infoset: Infoset, tmp_path: Path) -> None:
    (tmp_path / "odd.toml").write_text(text)
    code, out, err = infoset("problems", "check", "odd.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert [part for part in parts if part not in err] == []


def test_a_new_file_needs_a_known_kind(infoset: Infoset) -> None:
    code, _, err = infoset("problems", "new", "pursuit-evasoin", "mine.toml")
    assert code == 2
    assert "did you mean pursuit-evasion?" in err


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


@pytest.mark.parametrize("name", [file.name for file in built_in_files().values() if file.kind != SCENARIO])
def test_the_written_problem_is_the_changed_one(name: str, tmp_path: Path) -> None:
    form, load = form_and_loader(built_in_files()[name].kind)
    tables = load_tables(form, name, ["name=mine"])
    (tmp_path / "problem.toml").write_text(problem_toml(tables))
    again = load_tables(form, tmp_path / "problem.toml")
    assert again == tables
    assert load(str(tmp_path / "problem.toml")).hash == load(name).hash
