"""Damaged records are refused in one sentence, or are read as they were written: never a wrong
picture.
"""

from __future__ import annotations

import io
import random
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.experiments.common.errors import InputError
from infoset.experiments.interception import record_file
from infoset.experiments.interception.record_file import load_record, write_record
from infoset.sim import Record

from .measured import Measured, measured
from .mutations import mutated_bytes
from .subjects import attempted, remade_record, same_records, small_record

pytestmark = pytest.mark.thorough

REMEDY = "make a record with `infoset engage --record FILE.npz`"


@pytest.fixture(scope="module", params=["asteroid-1997", "asteroid-1997-space"])
def record(request: pytest.FixtureRequest) -> Record:
    return small_record(request.param)


@pytest.fixture(scope="module")
def content(record: Record, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    file = tmp_path_factory.mktemp("record") / "x.npz"
    write_record(record, file)
    return file.read_bytes()


def damage(content: bytes, draw: random.Random) -> bytes:
    """Damage anywhere, or in the names, sizes and sums that hold the archive together."""
    if draw.random() < 0.5:
        return mutated_bytes(content, draw)
    marks = (b"PK\x03\x04", b"PK\x01\x02", b"PK\x05\x06", b"\x93NUMPY")
    at = content.find(draw.choice(marks), draw.randrange(len(content)))
    head = slice(max(at, 0), max(at, 0) + 130)
    return content[: head.start] + mutated_bytes(content[head], draw) + content[head.stop :]


def read_or_refused(file: Path) -> Record | None:
    found, message = attempted(lambda: load_record(file), InputError)
    if found is None:
        assert message.startswith(f"{file}: is not a readable record: ")
        assert message.endswith(REMEDY)
        assert message.replace("\n  ", " ").isprintable()
    return found


def attack(content: bytes, record: Record, file: Path, times: int, seed: int) -> int:
    draw = random.Random(seed)
    refused = 0
    for _ in range(times):
        damaged = damage(content, draw)
        file.write_bytes(damaged)
        found = read_or_refused(file)
        if found is None:
            refused += 1
            assert damaged != content
        elif damaged != content:
            assert same_records(found, record)
    return refused


def test_record_equals_itself_and_differs_after_the_least_change(
    record: Record, content: bytes, tmp_path: Path
) -> None:
    (tmp_path / "x.npz").write_bytes(content)
    found = load_record(tmp_path / "x.npz")
    assert same_records(found, record)
    found.impulse_m_s[3] = np.nextafter(found.impulse_m_s[3], 9.0)
    assert not same_records(found, record)


def test_5000_damaged_records_are_refused(content: bytes, record: Record, tmp_path: Path) -> None:
    assert attack(content, record, tmp_path / "x.npz", 5000, seed=2) > 2500


def test_damaged_record_with_correct_sums_is_read_or_refused(
    content: bytes, tmp_path: Path
) -> None:
    """It is another record then, valid or refused."""
    draw = random.Random(3)

    def change(header: dict[str, Any], members: dict[str, bytes]) -> None:
        name = draw.choice([*members])
        members[name] = mutated_bytes(members[name], draw)
        if draw.random() < 0.3:
            header[draw.choice([*header])] = draw.choice(
                [None, -1, 1e300, [], {}, "x", "\0", True, 10**400]
            )

    for _ in range(600):
        (tmp_path / "x.npz").write_bytes(remade_record(content, change))
        read_or_refused(tmp_path / "x.npz")


def deflated_bomb(gigabytes: int) -> bytes:
    """An archive of a megabyte a gigabyte: one block of zeros, deflated, again and again."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    block = packer.compress(bytes(1 << 20)) + packer.flush(zlib.Z_FULL_FLUSH)
    data = block * 1024 + packer.flush()
    sizes = struct.pack("<I", 1 << 30)
    out = io.BytesIO()
    names = [f"{name}.npy" for name in record_file.MEMBERS]
    with zipfile.ZipFile(out, "w") as archive:
        for name in names:
            archive.writestr(name, data if name in names[:gigabytes] else b"")
    bomb = bytearray(out.getvalue())
    for mark, kind, size in ((b"PK\x03\x04", 8, 22), (b"PK\x01\x02", 10, 24)):
        at = -1
        for _ in range(gigabytes):
            at = bomb.index(mark, at + 1)
            bomb[at + kind : at + kind + 2] = struct.pack("<H", zipfile.ZIP_DEFLATED)
            bomb[at + size : at + size + 4] = sizes
    with zipfile.ZipFile(io.BytesIO(bomb)) as archive:
        assert sum(each.file_size for each in archive.infolist()) == gigabytes << 30
    return bytes(bomb)


def claiming(content: bytes) -> bytes:
    """A record whose members claim 3.9 GB each."""
    changed = bytearray(content)
    at = -1
    while (at := changed.find(b"PK\x01\x02", at + 1)) >= 0:
        changed[at + 24 : at + 28] = struct.pack("<I", 0xF0000000)
    return bytes(changed)


def array_of_10_gb(content: bytes) -> bytes:
    """A member whose own header claims 10 GB."""
    text = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1250000000,), }".ljust(117) + b"\n"
    return remade_record(
        content, lambda _, members: members.update({"time_s.npy": b"\x93NUMPY\x01\0\x76\0" + text})
    )


def many_members(_: bytes) -> bytes:
    """Twenty megabytes of names, each of which a reader of archives makes an object of."""
    local = b"PK\x03\x04" + bytes(26)
    name = b"PK\x01\x02" + bytes(42)
    count = 400_000
    end = struct.pack(
        "<4s4H2IH", b"PK\x05\x06", 0, 0, count & 0xFFFF, count & 0xFFFF, count * 46, len(local), 0
    )
    return local + name * count + end


def long_header(content: bytes) -> bytes:
    """Nine megabytes of JSON that would become a gigabyte of dicts."""
    return remade_record(content, lambda header, _: header.update(result=[{}] * 2_250_000))


BOMBS: Mapping[str, tuple[Callable[[bytes], bytes], str]] = {
    "deflated": (lambda _: deflated_bomb(10), "compressed"),
    "claiming": (claiming, "are larger than the file"),
    "array": (array_of_10_gb, "EOF"),
    "members": (many_members, "more members"),
    "header": (long_header, "header is too long"),
}


@pytest.fixture(scope="module")
def refusals(content: bytes, tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Measured]:
    folder = tmp_path_factory.mktemp("bombs")
    for name, (bomb, _) in BOMBS.items():
        (folder / f"{name}.npz").write_bytes(bomb(content))
    return dict(
        zip(BOMBS, measured("record", *(folder / f"{name}.npz" for name in BOMBS)), strict=True)
    )


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_refused_in_a_second_and_200_mb(
    name: str, refusals: Mapping[str, Measured]
) -> None:
    assert BOMBS[name][1] in refusals[name].message
    assert refusals[name].seconds < 1.0
    assert refusals[name].megabytes < 200.0
