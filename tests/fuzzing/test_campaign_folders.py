"""Damaged campaigns: shards and manifests are refused in one sentence, or read as they were written."""

from __future__ import annotations

import json
import os
import random
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from experiments.cli import main
from experiments.common.input_file import to_toml
from sim import Scenario, Sweep
from sim.storage import Axis, CampaignFolder, ManifestError, StorageError, read_manifest
from sim.storage.manifest import MANIFEST, MAX_BYTES, checksum

from .measured import Measured, measured
from .mutations import mutated_bytes
from .subjects import attempted, named_shard, read_campaign, small_campaign

pytestmark = pytest.mark.thorough

ROWS = 8
"""Of the second shard, which is the one damaged here."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("campaign") / "sound"
    small_campaign(folder)
    return folder


@pytest.fixture
def folder(sound: Path, tmp_path: Path) -> Path:
    shutil.copytree(sound, tmp_path / "campaign")
    return tmp_path / "campaign"


def shard_of(folder: Path) -> Path:
    (last,) = (folder / "shards").glob("chunk-0000001-*.parquet")
    return last


def attack(folder: Path, shards: int, manifests: int, seed: int) -> int:
    """Damage one file at a time, and look at everything that the folder then says."""
    draw, refused = random.Random(seed), 0
    whole = read_campaign(folder)
    beside = [row for row in whole["rows"] if row["run"] < 12]
    for file, times in ((shard_of(folder), shards), (folder / MANIFEST, manifests)):
        content = file.read_bytes()
        for _ in range(times):
            damaged = mutated_bytes(content, draw)
            file.write_bytes(damaged)
            found, message = attempted(lambda: read_campaign(folder), StorageError)
            if found is None:
                refused += 1
                assert message.startswith(f"{file}: is not a readable manifest: ")
                assert len(message) < 1000
                assert file.name == MANIFEST
                assert damaged != content
            elif found["damaged"]:
                refused += 1
                assert file.name != MANIFEST
                assert (found["rows"], found["finished"]) == (beside, 12)
            else:
                assert found == whole
        file.write_bytes(content)
    return refused


def test_100_damaged_shards_and_manifests(folder: Path) -> None:
    assert attack(folder, 50, 50, seed=1) > 80


def test_5000_damaged_shards_and_manifests(folder: Path) -> None:
    assert attack(folder, 2500, 2500, seed=2) > 4000


@pytest.mark.parametrize("key", ["runs", "stopped_after", "until", "seed", "chunk", "noise", "made_by", "sha256"])
def test_every_value_of_a_manifest_counts(key: str, folder: Path) -> None:
    written = json.loads((folder / MANIFEST).read_text())
    other = {"runs": 19, "stopped_after": 12, "until": "miss_m p99 ci<1", "made_by": {"a": "b"}, "noise": "game"}.get(
        key, 13
    )
    assert written[key] != other
    (folder / MANIFEST).write_text(json.dumps({**written, key: other}))
    with pytest.raises(ManifestError, match="the checksum differs"):
        read_manifest(folder)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"chunk": 10**7, "runs": 10**9}, "chunk must be at most 1000000 engagements"),
        ({"kind": "sweep", "axes": [{"key": k, "scale": "log", "values": [1.0, 2.0] * 500} for k in "ab"]}, "cells"),
    ],
)
def test_a_manifest_that_would_take_for_ever(change: Mapping[str, Any], reason: str, folder: Path) -> None:
    other = {**json.loads((folder / MANIFEST).read_text()), **change}
    (folder / MANIFEST).write_text(json.dumps({**other, "sha256": checksum(other)}))
    with pytest.raises(ManifestError, match=reason):
        read_manifest(folder)


def replaced(folder: Path, write: Callable[[Any, Path], None]) -> None:
    """Write another shard in the place of the second, under a name that says what is in it."""
    file, new = shard_of(folder), folder / "new.parquet"
    write(pq.read_table(file), new)
    content = new.read_bytes()
    new.unlink()
    file.unlink()
    (file.parent / named_shard(1, content)).write_bytes(content)


def with_column(table: Any, name: str, values: Any) -> Any:
    place = table.schema.get_field_index(name)
    field = table.schema.field(name).with_type(values.type)
    return table.set_column(place, field, values).replace_schema_metadata(table.schema.metadata)


def hostile(folder: Path, rows: int) -> dict[str, str]:
    """Make the manifest ask for shards of so many rows, and return what the one there will have to say."""
    next((folder / "shards").glob("chunk-0000000-*.parquet")).unlink()
    other = {**json.loads((folder / MANIFEST).read_text()), "chunk": rows, "runs": 2 * rows}
    (folder / MANIFEST).write_text(json.dumps({**other, "sha256": checksum(other)}))
    return {"campaign": read_manifest(folder).identity, "chunk": "1"}


def written(table: Any, file: Path, told: Mapping[str, str], **options: Any) -> None:
    """Write a table whose columns have the types of Parquet alone, so that a dictionary is one of text."""
    with pq.ParquetWriter(file, table.schema, store_schema=False, write_statistics=False, **options) as writer:
        writer.write_table(table, row_group_size=1 << 26)
        writer.add_key_value_metadata(told)


def many_rows(folder: Path, parts: int = 16) -> None:
    """Run lengths: half a gigabyte of equal numbers in a hundred kilobytes."""
    told = hostile(folder, 1_000_000)
    part = pa.DictionaryArray.from_arrays(pa.array(np.zeros(1 << 22, dtype=np.int8)), pa.array([1.5]))
    table = pa.table({"miss_m": pa.chunked_array([part] * parts)})
    replaced(folder, lambda _, file: written(table, file, told))


def check_refused(found: Measured, reason: str) -> None:
    assert reason in found.message
    assert found.seconds < 1.0
    assert found.megabytes < 200.0


def test_millions_of_rows_are_refused_in_a_second_and_200_mb(folder: Path) -> None:
    many_rows(folder)
    (found,) = measured("campaign", folder)
    check_refused(found, "has 67108864 rows instead of 1000000")


def test_billions_of_rows_are_refused_in_a_second_and_200_mb(folder: Path) -> None:
    """1.4e9 of them: over 10 GB."""
    many_rows(folder, 334)
    (found,) = measured("campaign", folder)
    check_refused(found, "has 1400897536 rows instead of 1000000")


def with_first(name: str, first: Iterable[object]) -> Callable[[Any, Path], None]:
    """Return a function that writes a table with other values in the first rows of a column."""

    def write(table: Any, file: Path) -> None:
        values = [*first]
        values += table.column(name).to_pylist()[len(values) :]
        pq.write_table(with_column(table, name, pa.array(values, type=table.schema.field(name).type)), file)

    return write


INVALID: Mapping[str, tuple[str, Iterable[object], str]] = {
    "a miss that is not a number": ("miss_m", [float("nan")], "miss_m contains a value that is not a finite number"),
    "an infinite start": ("x_km", [float("inf")], "x_km contains a value that is not a finite number"),
    "a great miss": ("miss_m", [1e308], "miss_m must be finite, at most 1e+60 in size: got 1e+308"),
    "a negative miss": ("miss_m", [-1.0], "miss_m must be at least 0: got -1"),
    "a negative impulse": ("impulse_m_s", [-1e-3], "impulse_m_s must be at least 0: got -0.001"),
    "a negative guarantee": ("guaranteed_miss_m", [-5.0], "guaranteed_miss_m must be at least 0: got -5"),
    "a far start": ("x_km", [1.0, -1e300], "x_km must be finite, at most 1e+60 in size: got -1e+300"),
    "a great margin": ("truth_margin_m", [-1e200], "truth_margin_m must be finite, at most 1e+60 in size"),
    "an outcome of another version": ("outcome", ["won"], "outcome contains an unknown text"),
    "a control character": ("outcome", ["\x1b[31m"], "outcome contains an unknown text"),
    "an unknown noise": ("noise", ["loud"], "noise contains an unknown text"),
    "an unknown tie": ("tie", ["x" * 40], "tie contains an unknown text"),
    "repeated runs": ("run", [12, 12], "run is 12 in row 1, must be 13"),
    "shifted runs": ("run", range(13, 13 + ROWS), "run is 13 in row 0, must be 12"),
    "negative runs": ("run", [-1], "run is -1 in row 0, must be 12"),
    "runs in another order": ("run", [13, 12], "run is 13 in row 0, must be 12"),
}


@pytest.mark.parametrize("case", INVALID)
def test_invalid_values_under_a_valid_checksum(
    case: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`infoset report` prints one message; `infoset campaign --resume` simulates the runs again."""
    name, values, reason = INVALID[case]
    whole = CampaignFolder.read(folder).table()
    replaced(folder, with_first(name, values))
    shard = shard_of(folder)
    with pytest.raises(StorageError, match="the shard has changed"):
        CampaignFolder.read(folder).table(["hit"])
    monkeypatch.setenv("COLUMNS", "1000")

    def infoset(*arguments: object) -> tuple[object, str, str]:
        with pytest.raises(SystemExit) as left:
            main([str(argument) for argument in arguments])
        return left.value.code, *capsys.readouterr()

    message = f"error: {shard}: the shard has changed or is missing: {reason}"
    for options in ((), ("--out", tmp_path / "out")):
        code, out, err = infoset("report", folder, *options)
        assert (code, out) == (2, "")
        assert err.splitlines()[-1].startswith(message)
        assert err.endswith("; delete it, and simulate its runs again with --resume\n")
        assert "Traceback" not in err
    manifest = read_manifest(folder)
    (tmp_path / "same.toml").write_text(to_toml(manifest.scenario))
    sizes = ("--runs", manifest.runs, "--chunk", manifest.chunk)
    draws = ("--seed", manifest.seed, "--noise", manifest.noise.value)
    code, _, err = infoset("campaign", tmp_path / "same.toml", *sizes, *draws, "--out", folder, "--resume")
    assert (code, f"{shard}: {reason}" in err) == (0, True), err
    assert CampaignFolder.read(folder).table().equals(whole)


@pytest.mark.parametrize(
    ("name", "values", "reason"),
    [
        ("cell", [0], "cell is 0 in row 0, must be 1"),
        ("miss_m", [1e308], "miss_m must be finite"),
        ("run", [1, 1], "run is 1 in row 0, must be 0"),
    ],
)
def test_invalid_values_in_a_sweep(
    name: str, values: list[float], reason: str, brief: Scenario, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    budgets = (100.0, 200.0)
    cells = tuple(replace(brief, thruster=replace(brief.thruster, budget_m_s=budget)) for budget in budgets)
    Sweep(brief, (Axis("thruster.budget_m_s", budgets),), cells, 3, tmp_path / "sweep").run()
    replaced(tmp_path / "sweep", with_first(name, values))
    with pytest.raises(SystemExit) as left:
        main(["report", str(tmp_path / "sweep")])
    err = capsys.readouterr().err.replace("\n", " ")
    assert left.value.code == 2
    assert reason in err
    assert "simulate its runs again with --resume" in err
    assert err.count("error: ") == 1


def test_a_shard_that_is_no_file_is_not_waited_for(folder: Path) -> None:
    os.mkfifo(folder / "shards" / "chunk-0000001-00000000.parquet")
    (damage,) = CampaignFolder.read(folder).damaged
    assert damage.reason == "is not an ordinary file"


def test_large_files_are_not_read(folder: Path) -> None:
    os.truncate(shard_of(folder), 10**9)  # the file is sparse, and takes no space on the disk
    (damage,) = CampaignFolder.read(folder).damaged
    assert damage.reason == f"has 1000000000 bytes, more than any shard of {ROWS} rows"
    with (folder / MANIFEST).open("a") as stream:
        stream.write(" " * MAX_BYTES)
    with pytest.raises(ManifestError, match="is over 10 MB"):
        read_manifest(folder)


@pytest.mark.parametrize("index", [2, 7, 10**9])
def test_a_shard_past_the_last_is_left_out(index: int, folder: Path) -> None:
    shard = shard_of(folder)
    shard.with_name(shard.name.replace("0000001", f"{index:07d}")).write_bytes(shard.read_bytes())
    (damage,) = CampaignFolder.read(folder).damaged
    assert damage.reason == "is not a chunk of this campaign"


@pytest.mark.parametrize(
    "change",
    [
        lambda table: table.drop_columns(["miss_m"]),
        lambda table: table.drop_columns(["truth_margin_m"]),
        lambda table: table.append_column("more", table.column("run")),
        lambda table: table.select([*table.column_names[::-1]]),
        lambda table: with_column(table, "miss_m", table.column("miss_m").cast(pa.float32())),
        lambda table: with_column(table, "miss_m", pa.array([[1.0]] * ROWS)),
    ],
)
def test_a_shard_of_other_columns(change: Callable[[Any], Any], folder: Path) -> None:
    replaced(folder, lambda table, file: pq.write_table(change(table), file))
    (damage,) = CampaignFolder.read(folder).damaged
    assert damage.reason == "has other columns than a campaign"


def test_a_shard_written_otherwise_is_read(folder: Path) -> None:
    """By other settings of the writer: what counts is what is in it."""
    whole = read_campaign(folder)
    for options in (
        {"compression": "none"},
        {"data_page_version": "2.0"},
        {"row_group_size": 3},
        {"data_page_size": 9},
    ):
        replaced(folder, lambda table, file, given=options: pq.write_table(table, file, **given))  # type: ignore[misc]
        assert read_campaign(folder) == whole
