"""Damaged files of users and hostile settings are refused in one message with the file and the
key.
"""

from __future__ import annotations

import functools
import random
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from infoset.experiments.cli import main
from infoset.experiments.common.built_in_files import PROBLEMS, SCENARIO
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import MAX_FILE_BYTES, keys_of, read_text

from .mutations import VALUES, mutated_toml
from .subjects import attempted, text_files

pytestmark = pytest.mark.thorough

FILES = text_files()
COMMANDS = {SCENARIO: "engage", **{kind: problem.command for kind, problem in PROBLEMS.items()}}
MAX_SECONDS = 2.0

Infoset = Callable[..., tuple[int, str, str]]


@pytest.fixture
def infoset(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Infoset:
    """Run a command: exit code, stdout and stderr."""
    monkeypatch.setenv("NO_COLOR", "1")

    def run(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main([str(each) for each in arguments])
        captured = capsys.readouterr()
        return int(left.value.code or 0), captured.out, captured.err

    return run


def check_message(message: str, source: object) -> None:
    """A line for each error, which names the file, or the option --set; at most 50 of them."""
    lines = message.split("\n")
    assert all(line.isprintable() for line in lines), message
    assert len(lines) <= 51
    for line in lines[:50]:
        assert line.startswith((f"{source}: ", "--set: ")), message
        assert len(line) < 500 + len(str(source)), message


def attack(kind: str, times: int, seed: int, file: Path) -> int:
    draw = random.Random(seed)
    refused = 0
    file.write_text(FILES[kind].texts[0])
    FILES[kind].read(str(file))  # imports modules and compiles kernels
    for _ in range(times):
        content = mutated_toml(draw.choice(FILES[kind].texts), draw)
        file.write_bytes(content)
        begun = time.process_time()
        _, message = attempted(lambda: FILES[kind].read(str(file)), InputError)
        assert time.process_time() - begun < MAX_SECONDS, content
        if message:
            refused += 1
            check_message(message, file)
    return refused


@pytest.mark.parametrize("kind", FILES)
def test_2000_mutated_files_are_read_or_refused(kind: str, tmp_path: Path) -> None:
    assert attack(kind, 2000, seed=2, file=tmp_path / "mutated.toml") > 800


def attack_settings(kind: str, times: int, seed: int) -> int:
    draw = random.Random(seed)
    refused = 0
    owner = FILES[kind].owner
    keys = keys_of(FILES[kind].owner)
    for _ in range(times):
        number = draw.choice(
            (".1.", ".0.", ".-1.", ".0000012.", ".99999999999.", ".\u0661.", ".\u00b2.", ".")
        )
        key = draw.choice(keys).replace(".1.", number)
        key = draw.choice(
            (key, key, key, f"{key}.min", key[:-1], key.partition(".")[0], f".{key}", f"{key}.1")
        )
        setting = f"{key}={draw.choice(VALUES)}"
        read = functools.partial(
            read_text, owner, draw.choice(FILES[kind].texts), "mine.toml", [setting]
        )
        _, message = attempted(read, InputError)
        if message:
            refused += 1
            check_message(message, "mine.toml")
    return refused


@pytest.mark.parametrize("kind", FILES)
def test_5000_hostile_settings_are_applied_or_refused(kind: str) -> None:
    assert attack_settings(kind, 5000, seed=5) > 3000


@pytest.mark.parametrize("kind", FILES)
def test_a_mutated_file_is_refused_with_exit_code_2(
    kind: str, infoset: Infoset, tmp_path: Path
) -> None:
    draw = random.Random(3)
    file = tmp_path / "mutated.toml"
    done = 0
    while done < 3:
        file.write_bytes(mutated_toml(draw.choice(FILES[kind].texts), draw))
        if not attempted(lambda: FILES[kind].read(str(file)), InputError)[1]:
            continue
        done += 1
        option = "--out" if kind == "trajectory" else "--json"
        code, out, err = infoset(*COMMANDS[kind].split(), file, option, tmp_path / "x.json")
        assert (code, out) == (2, "")
        assert err.startswith(f"error: {file}")
        assert "Traceback" not in err
        assert [each.name for each in tmp_path.iterdir()] == ["mutated.toml"]


LONG: dict[str, tuple[str, Callable[[str], str]]] = {
    "dotted": (
        "scenario",
        lambda _: "".join(f"a{place}.{'b.' * 18}c = 1\n" for place in range(2000)),
    ),
    "a dotted key": ("scenario", lambda _: f"{'b.' * 45_000}c = 1\n"),
    "a dotted header": ("scenario", lambda _: f"[{'b.' * 45_000}c]\n"),
    "a dotted key in a table": ("scenario", lambda _: f"x = {{{'b.' * 45_000}c = 1}}\n"),
    "keys below a dotted header": (
        "scenario",
        lambda _: (
            f"[{'b.' * 19}c]\n" + "".join(f"k{place}.{'d.' * 18}e = 1\n" for place in range(2000))
        ),
    ),
    "a line of numbers": ("scenario", lambda _: f"x = [{'1.5, ' * 19_000}]\n"),
    "a line of tables": ("scenario", lambda _: f"x = [{'{a = 1}, ' * 10_000}]\n"),
    "quotes": ("scenario", lambda _: '"' * 95_000),
    "escapes": ("scenario", lambda _: 'x = "' + "\\" * 95_000),
    "triple quotes": ("scenario", lambda _: 'x = """' + '""\\' * 30_000),
    "tables": ("scenario", lambda _: "".join(f"[a{place}]\n" for place in range(12_000))),
    "arrays": ("scenario", lambda _: "x = [\n" + "[],\n" * 24_000 + "]"),
    "keys": ("scenario", lambda text: text + "".join(f"k{place} = 1\n" for place in range(8_000))),
    "targets": ("multipoint", lambda text: text + "[[target]]\n" * 8_000),
    "craft": ("pareto-encounter", lambda text: text + "[[craft]]\n" * 8_000),
    "empty": ("reachable-rendezvous", lambda text: text + "[[keep_in]]\n" * 8_000),
    "boxes": (
        "reachable-rendezvous",
        lambda text: (
            text
            + (
                "[[keep_in]]\n"
                "normals=[[1,0,0],[-1,0,0],[0,1,0],[0,-1,0],[0,0,1],[0,0,-1]]\n"
                "offsets_m=[1,1,1,1,1,1]\n"
            )
            * 900
        ),
    ),
}


@pytest.mark.parametrize("name", LONG)
def test_longest_text_that_is_read_takes_under_two_seconds(name: str, tmp_path: Path) -> None:
    kind, make = LONG[name]
    text = make(FILES[kind].texts[0])
    file = tmp_path / "long.toml"
    assert 80_000 < len(text) <= MAX_FILE_BYTES
    file.write_text(text)
    begun = time.process_time()
    _, message = attempted(lambda: FILES[kind].read(str(file)), InputError)
    assert time.process_time() - begun < MAX_SECONDS
    assert message
    assert len(message) < 50_000
