"""Outputs that pages print are those of the commands above them."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.experiments.command_line import Command

if TYPE_CHECKING:
    from tests.docs.conftest import Page

pytestmark = pytest.mark.docs

IMPACTORS = "docs/impactors.md"
OWN_SCENARIO = "docs/own-scenario.md"
REACH = "docs/guaranteed-rendezvous.md"


@pytest.fixture
def infoset(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Command:
    """Run a command in this process, in an empty folder: exit code, stdout and stderr."""
    return Command.in_folder(tmp_path, capsys, monkeypatch)


def text_of(pages: list[Page], name: str) -> str:
    """Return the text of a page."""
    (page,) = (page for page in pages if page.name == name)
    return page.text


def test_guarantees_of_the_arch_rendezvous_are_those_of_the_page(
    infoset: Command, pages: list[Page]
) -> None:
    code, out, _ = infoset("reach", "approach-guaranteed")

    assert code == 0
    # The other numbers depend on the solver's choice of a plan.
    assert "\n".join(out.splitlines()[:6]) in text_of(pages, REACH)


def create(infoset: Command, page: str, file: Path, like: str) -> None:
    """Write the scenario that a page makes from a built-in one: with the keys of its TOML block."""
    after = page[page.index(f"infoset scenarios new {file.name} --like {like}") :]
    found = re.search("^```toml\n(.*?)^```", after, flags=re.DOTALL | re.MULTILINE)
    assert found is not None
    assert infoset("scenarios", "new", file, "--like", like)[0] == 0
    text = file.read_text(encoding="utf-8")
    if "`[target]` is deleted" in page and like == "dart-2022":
        text = re.sub(r"(?m)^\[target\].*\n(?:[^\[\n].*\n)*", "", text)

    # Lines of the block replace those of the file with the same quantity in the same table.
    table = ""
    for line in found[1].splitlines():
        if line.startswith("["):
            table = line
        elif line:
            text = with_line(text, table, line)
    file.write_text(text, encoding="utf-8")


def with_line(text: str, table: str, line: str) -> str:
    """Return the text of a scenario with a line in a table, in place of that of its quantity."""
    key = line.partition(" ")[0]
    replaced = {
        "pixel_error_urad": "pixel_error_rad",
        "last_impulse_min": "last_impulse_s",
        "semi_axes_m": "radius_m",
    }.get(key, key)
    lines = text.splitlines()
    start = next(
        (i for i, each in enumerate(lines) if each.partition(" ")[0].startswith(table or "name")), 0
    )
    end = next((i for i in range(start + 1, len(lines)) if lines[i].startswith("[")), len(lines))
    kept = [each for each in lines[start:end] if each.partition(" ")[0] != replaced]
    return "\n".join([*lines[:start], kept[0], line, *kept[1:], *lines[end:]]) + "\n"


def outputs(page: str, command: str) -> list[tuple[str, list[str]]]:
    """Return the lines of a page that begin with a command, and the lines printed below them."""
    pattern = rf"^```sh\n({command}[^\n]*)\n```\n\n```text\n(.*?)^```"
    found = re.findall(pattern, page, flags=re.DOTALL | re.MULTILINE)
    return [(line, text.splitlines()) for line, text in found]


@pytest.mark.parametrize(("name", "number"), [(IMPACTORS, 4), (OWN_SCENARIO, 1)])
def test_check_prints_the_lines_of_the_page(
    infoset: Command, pages: list[Page], tmp_path: Path, name: str, number: int
) -> None:
    text = text_of(pages, name)
    if name == IMPACTORS:
        create(infoset, text, tmp_path / "own60.toml", "haiv-2013")
    found = outputs(text, "infoset scenarios check")
    assert len(found) == number

    for line, shown in found:
        code, out, err = infoset(*shlex.split(line)[1:])
        assert code == 0
        printed = [*out.splitlines(), *err.splitlines()]
        assert [each for each in shown if each != "..." and each not in printed] == [], line


def test_check_of_your_own_impactor_prints_the_lines_of_the_page(
    infoset: Command, pages: list[Page], tmp_path: Path
) -> None:
    text = text_of(pages, IMPACTORS)
    create(infoset, text, tmp_path / "own.toml", "dart-2022")
    shown = re.search(r"^```text\n(ok  own  .*?)^```", text, flags=re.DOTALL | re.MULTILINE)
    assert shown is not None
    code, out, _ = infoset("scenarios", "check", "own.toml")
    assert (code, out) == (0, shown[1])


def test_check_of_burns_prints_the_lines_of_the_page(infoset: Command, pages: list[Page]) -> None:
    text = text_of(pages, IMPACTORS)
    pattern = "infoset experiment haiv-2013 --runs 100 (--set step_s=90 .*?)^```"
    command = re.search(pattern, text, flags=re.DOTALL | re.MULTILINE)
    assert command is not None
    settings = command[1].replace("\\\n", " ")
    _, out, _ = infoset("scenarios", "check", "haiv-2013", *shlex.split(settings))
    printed = [line for line in out.splitlines() if line.startswith(("burns: ", "latest "))]
    assert "\n".join(printed) in text
