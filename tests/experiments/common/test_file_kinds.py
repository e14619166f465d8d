"""Files of the user as commands read them: pipes, folders, sizes and long names."""

from __future__ import annotations

import os
import sys
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from experiments.common.errors import InputError
from experiments.common.file_kinds import built_in_files, read_input
from experiments.interception.record_file import load_record
from experiments.interception.scenario_file import load_scenario
from experiments.observer.file import load_observer

pipes = pytest.mark.skipif(sys.platform == "win32", reason="the system has no /dev/fd")


@contextmanager
def pipe(content: bytes) -> Iterator[str]:
    """Yield the path of a pipe whose writer has ended."""
    reader, writer = os.pipe()
    try:
        os.write(writer, content)
        os.close(writer)
        yield f"/dev/fd/{reader}"
    finally:
        os.close(reader)


@pipes
@pytest.mark.parametrize(("name", "load"), [("dart-2022", load_scenario), ("vehicle", load_observer)])
def test_a_pipe_is_read_as_a_file_is(name: str, load: Callable[[str], object]) -> None:
    with pipe(built_in_files()[name].text.encode()) as path:
        load(path)


@pipes
def test_a_pipe_with_a_record_is_not_read_again() -> None:
    with pipe(b"PK\3\4") as path, pytest.raises(InputError, match="this may be a record; use infoset replay FILE"):
        load_scenario(path)


@pipes
def test_a_record_is_not_read_from_a_pipe() -> None:
    with pipe(b"PK\3\4") as path, pytest.raises(InputError, match="is not an ordinary file; make a record"):
        load_record(path)


def test_no_more_than_the_limit_is_read(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_bytes(b"x" * 10)
    assert read_input(file, "file", 10, "shorten it") == b"x" * 10
    with pytest.raises(InputError, match="has more than 9 bytes, more than any file; shorten it"):
        read_input(file, "file", 9, "shorten it")


def test_a_small_file_needs_little_memory_whatever_the_limit(tmp_path: Path) -> None:
    file = tmp_path / "x.npz"
    file.write_bytes(b"x" * 10)
    tracemalloc.start()
    try:
        assert read_input(file, "record", 1 << 26, "shorten it", only_ordinary=True) == b"x" * 10
        assert tracemalloc.get_traced_memory()[1] < 1 << 20
    finally:
        tracemalloc.stop()


@pipes
def test_an_endless_device_is_read_to_the_limit_only() -> None:
    with pytest.raises(InputError, match="/dev/zero: has more than 100000 bytes, more than any scenario file"):
        load_scenario("/dev/zero")


def test_a_path_that_is_too_long_is_shortened_in_the_message() -> None:
    with pytest.raises(InputError, match="cannot be read: ") as refusal:
        load_scenario(f"./{'a' * 5000}.toml")
    assert len(str(refusal.value)) < 200
