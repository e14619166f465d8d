"""Files that people write: any sound one is run, and anything else is told in one message with the file and the key."""

from __future__ import annotations

import contextlib
import functools
import json
import random
import re
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, Phase, find, given, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from experiments.cli import main
from experiments.common.errors import InputError
from experiments.common.file_kinds import PROBLEMS, SCENARIO
from experiments.common.input_file import MAX_FILE_BYTES, keys_of, read_text
from experiments.common.units import quantity_and_unit
from sim import Scenario

from .documents import KINDS
from .mutations import VALUES, mutated_toml
from .subjects import attempted, text_files

pytestmark = pytest.mark.thorough

FILES = text_files()
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


def run_any(kind: str, text: str, infoset: Infoset, file: Path) -> bool:
    """Run a sound file; whatever has no answer says so, and nothing that is printed is not a number."""
    command, _ = KINDS[kind]
    FILES[kind].read(str(_written(file, text.encode())))  # it is sound
    code, out, err = infoset(command, file, "--json", "-", "--quiet")
    if code:
        assert code == 2
        assert re.match(r"error: \S", err), err
        assert err.count("error:") == 1
        return False
    json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} in the results of\n{text}"))
    return True


def _written(file: Path, content: bytes) -> Path:
    file.write_bytes(content)
    return file


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=3, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_any_sound_file_is_run(kind: str, data: st.DataObject, infoset: Infoset, tmp_path: Path) -> None:
    run_any(kind, data.draw(KINDS[kind][1]), infoset, tmp_path / "any.toml")


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_many_sound_files_are_run(kind: str, data: st.DataObject, infoset: Infoset, tmp_path: Path) -> None:
    run_any(kind, data.draw(KINDS[kind][1]), infoset, tmp_path / "any.toml")


def check_message(message: str, source: object) -> None:
    """A line for each error, which names the file, or the option --set; at most 50 of them."""
    lines = message.split("\n")
    assert all(line.isprintable() for line in lines), message
    assert len(lines) <= 51
    for line in lines[:50]:
        assert line.startswith((f"{source}: ", "--set: ")), message
        assert len(line) < 500 + len(str(source)), message


def attack(kind: str, times: int, seed: int, file: Path) -> int:
    draw, refused = random.Random(seed), 0
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


@pytest.mark.parametrize("kind", KINDS)
def test_30_mutated_files(kind: str, tmp_path: Path) -> None:
    assert attack(kind, 30, seed=1, file=tmp_path / "mutated.toml") > 12


@pytest.mark.parametrize("kind", KINDS)
def test_2000_mutated_files(kind: str, tmp_path: Path) -> None:
    assert attack(kind, 2000, seed=2, file=tmp_path / "mutated.toml") > 800


def attack_settings(kind: str, times: int, seed: int) -> int:
    draw, refused = random.Random(seed), 0
    owner, keys = FILES[kind].owner, keys_of(FILES[kind].owner)
    for _ in range(times):
        number = draw.choice((".1.", ".0.", ".-1.", ".0000012.", ".99999999999.", ".\u0661.", ".\u00b2.", "."))
        key = draw.choice(keys).replace(".1.", number)
        key = draw.choice((key, key, key, f"{key}.min", key[:-1], key.partition(".")[0], f".{key}", f"{key}.1"))
        setting = f"{key}={draw.choice(VALUES)}"
        read = functools.partial(read_text, owner, draw.choice(FILES[kind].texts), "mine.toml", [setting])
        _, message = attempted(read, InputError)
        if message:
            refused += 1
            check_message(message, "mine.toml")
    return refused


@pytest.mark.parametrize("kind", KINDS)
def test_100_hostile_settings(kind: str) -> None:
    assert attack_settings(kind, 100, seed=4) > 60


@pytest.mark.parametrize("kind", KINDS)
def test_5000_hostile_settings(kind: str) -> None:
    assert attack_settings(kind, 5000, seed=5) > 3000


@pytest.mark.parametrize("kind", KINDS)
def test_a_mutated_file_is_refused_with_exit_code_2(kind: str, infoset: Infoset, tmp_path: Path) -> None:
    draw, file = random.Random(3), tmp_path / "mutated.toml"
    done = 0
    while done < 3:
        file.write_bytes(mutated_toml(draw.choice(FILES[kind].texts), draw))
        if not attempted(lambda: FILES[kind].read(str(file)), InputError)[1]:
            continue
        done += 1
        code, out, err = infoset(KINDS[kind][0], file, "--json", tmp_path / "x.json")
        assert (code, out) == (2, "")
        assert err.startswith(f"error: {file}")
        assert "Traceback" not in err
        assert [each.name for each in tmp_path.iterdir()] == ["mutated.toml"]


LONG: dict[str, tuple[str, Callable[[str], str]]] = {
    "dotted": ("scenario", lambda _: "".join(f"a{place}.{'b.' * 490}c = 1\n" for place in range(100))),
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
            + "[[keep_in]]\nnormals=[[1,0,0],[-1,0,0],[0,1,0],[0,-1,0],[0,0,1],[0,0,-1]]\noffsets_m=[1,1,1,1,1,1]\n"
            * 900
        ),
    ),
}


@pytest.mark.parametrize("name", LONG)
def test_as_much_text_as_is_read_takes_under_two_seconds(name: str, tmp_path: Path) -> None:
    kind, make = LONG[name]
    text, file = make(FILES[kind].texts[0]), tmp_path / "long.toml"
    assert 80_000 < len(text) <= MAX_FILE_BYTES
    file.write_text(text)
    begun = time.process_time()
    _, message = attempted(lambda: FILES[kind].read(str(file)), InputError)
    assert time.process_time() - begun < MAX_SECONDS
    assert message
    assert len(message) < 50_000


def test_every_key_is_in_some_sound_scenario() -> None:
    missing = {quantity_of(key) for key in keys_of(Scenario)}

    def all_seen(text: str) -> bool:
        for name, value in tomllib.loads(text).items():
            keys = [f"{name}.{key}" for key in value] if isinstance(value, dict) else [name]
            missing.difference_update(map(quantity_of, keys))
        return not missing

    whatever = settings(max_examples=1000, derandomize=True, database=None, phases=[Phase.generate])
    with contextlib.suppress(NoSuchExample):
        find(KINDS["scenario"][1], all_seen, settings=whatever)
    assert missing == set()


def quantity_of(key: str) -> str:
    """Return a key without its unit."""
    return quantity_and_unit(key)[0]


def test_the_attacks_reach_every_reader() -> None:
    """A renamed kind would leave its reader in peace."""
    assert FILES.keys() == KINDS.keys() == {SCENARIO, *PROBLEMS}
