"""`infoset scenarios` and `infoset problems`, and files of another kind."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from experiments.common.built_in_files import SCENARIO, built_in_files
from experiments.common.errors import InputError
from experiments.common.input_file import read_input, read_text, to_toml
from sim.storage.codec import fingerprint
from tests.experiments.command_line import Command
from tests.fuzzing.subjects import text_files

FILES = built_in_files()
MINE = {"scenarios": "own-scenario", "problems": "service-2"}

FACTS = [
    "flight",
    "miss without impulses",
    "miss that the images leave possible, with errors at their bounds",
]


@pytest.mark.parametrize("noun", MINE)
def test_the_list_has_every_built_in_file(noun: str, infoset: Command) -> None:
    files = [file for file in FILES.values() if (file.kind == SCENARIO) == (noun == "scenarios")]
    names = [file.name for file in files]
    code, out, err = infoset(noun)
    assert (code, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()[1:] if not line.startswith(" ")] == names
    assert infoset(noun, "list") == (0, out, "")


@pytest.mark.parametrize("name", FILES)
def test_a_built_in_file_is_shown_copied_checked_and_written_again(name: str, infoset: Command) -> None:
    file = FILES[name]
    noun = "scenarios" if file.kind == SCENARIO else "problems"
    assert infoset(noun, "show", name) == (0, file.text, "")
    assert infoset(noun, "new", "-", "--like", name)[:2] == (0, file.text)
    assert infoset(noun, "new", "mine.toml", "--like", name)[0] == 0
    copy, original = (text.splitlines() for text in (Path("mine.toml").read_text(encoding="utf-8"), file.text))
    other = [line for line, shown in zip(copy, original, strict=True) if line != shown]
    assert [line.partition("#")[0].strip() for line in other] == [
        'name = "mine"',
        f'description = "Copy of {name}, changed"',
    ]
    owner = text_files()[file.kind].owner
    value: Any = read_text(owner, file.text, name)
    assert read_text(owner, to_toml(value), "written") == value
    code, out, _ = infoset(noun, "check", "mine.toml")
    ok, *facts = out.splitlines()
    assert (code, ok) == (0, f"ok  mine  {fingerprint(value)}")
    assert [fact.partition(":")[0] for fact in facts] == (FACTS if noun == "scenarios" else [])
    found = json.loads(infoset(noun, "check", "mine.toml", "--json")[1])
    assert (found["name"], found.get("kind", SCENARIO)) == ("mine", file.kind)
    assert infoset(noun, "check", name, "--quiet") == (0, "", "")


@pytest.mark.parametrize("noun", MINE)
def test_a_file_is_replaced_only_if_asked(noun: str, infoset: Command) -> None:
    file = Path("mine.toml")
    file.write_text("precious")
    assert "--overwrite" in infoset.refused(noun, "new", file)
    assert file.read_text() == "precious"
    assert infoset(noun, "new", file, "--overwrite")[0] == 0
    assert len(file.read_text()) > 500


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("scenarios show asteroid-1996", 'scenario: there is no "asteroid-1996"; did you mean asteroid-1997'),
        ("problems new mine.toml --like pareto-2009", 'there is no "pareto-2009"; did you mean pareto-2008?'),
        ("problems check asteroid-1997", "asteroid-1997: this is a scenario; use infoset engage asteroid-1997"),
        ("scenarios new file/mine.toml", "File exists"),
        ("scenarios check binary", "is not text in UTF-8"),
        ("problems check empty", "kind: must be one of pareto-encounter, multipoint"),
        ("problems check odd", "kind: must be one of"),
        ("problems check broken", "is not valid TOML"),
        ("replay empty", "empty: is not a readable record"),
    ],
)
def test_what_is_wrong_is_one_message(line: str, message: str, infoset: Command) -> None:
    contents = {"file": b"", "empty": b"", "binary": b"\x93NUMPY\xff\x00", "odd": b"kind = [1]", "broken": b"kind = "}
    for name, content in contents.items():
        Path(name).write_bytes(content)
    arguments = [f"./{word}" if word in contents else word for word in line.split()]
    assert message in infoset.refused(*arguments)


def test_no_more_than_the_limit_is_read(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_bytes(b"x" * 10)
    assert read_input(file, 10) == b"x" * 10
    with pytest.raises(InputError, match="has more than 9 bytes"):
        read_input(file, 9)
