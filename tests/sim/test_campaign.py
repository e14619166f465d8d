from __future__ import annotations

import errno
import io
import itertools
import json
import os
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from infoset.guidance import NoiseKind, TieRule
from infoset.sim import (
    Body,
    Campaign,
    CampaignNoise,
    QuantileName,
    RunsUntil,
    Scenario,
    StoppingRule,
    fly_one,
    simulate,
)
from infoset.sim.campaign import MAX_CHUNK
from infoset.sim.parallel import Task, simulate_task, worker_processes
from infoset.sim.scenario import of_model
from infoset.sim.simulate import ENGAGEMENTS_AT_ONCE
from infoset.sim.storage import Axis, CampaignFolder, StorageError, fingerprint, read_manifest
from infoset.sim.versions import VersionError, versions
from tests.guaranteed import guaranteed
from tests.sensors import linear
from tests.sim.shuffled import Shuffled


def mixed(brief: Scenario, folder: Path, runs: int = 96, chunk: int | None = 16) -> Campaign:
    return Campaign(brief, runs, folder, seed=5, noise=CampaignNoise.MIXED, chunk=chunk)


@pytest.fixture(scope="module")
def reference(brief: Scenario, tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    """96 runs of mixed noise, simulated by one thread."""
    return (
        mixed(brief, tmp_path_factory.mktemp("reference") / "campaign", chunk=None)
        .run(workers=1)
        .runs()
    )


def same(found: pd.DataFrame, expected: pd.DataFrame) -> bool:
    return bool(found.reset_index(drop=True).equals(expected.reset_index(drop=True)))


def shards(folder: Path) -> list[Path]:
    return sorted((folder / "shards").iterdir())


class Stop(Exception):  # noqa: N818
    """Breaks a campaign off."""


def stop_after(chunks: int) -> Callable[[float], None]:
    calls = itertools.count(1)

    def progress(share: float) -> None:
        if next(calls) >= chunks:
            raise Stop

    return progress


def test_rows_equal_results_of_simulate_and_of_fly_one(
    brief: Scenario, reference: pd.DataFrame
) -> None:
    assert reference["run"].tolist() == list(range(96))
    assert reference["noise"].tolist() == ["random", "game"] * 48
    for kind, first in ((NoiseKind.RANDOM, 0), (NoiseKind.GAME, 1)):
        expected = simulate(replace(brief, noise=kind), 96, seed=5).to_dict()
        for name, values in expected.items():
            rows = reference[name][first::2]
            assert [None if pd.isna(value) else value for value in rows] == values[first::2], name
    for run in (0, 77):
        row = reference.iloc[run]
        alone = fly_one(replace(brief, noise=NoiseKind(row["noise"])), run, seed=5).result
        assert (row["miss_m"], row["outcome"]) == (alone.miss_m[0], alone.outcomes[0].value)


@pytest.mark.parametrize(("workers", "chunk"), [(1, 7), (2, 16), (5, 30), (3, None)])
def test_runs_are_bit_identical_with_any_workers_and_chunks(
    workers: int, chunk: int | None, brief: Scenario, reference: pd.DataFrame, tmp_path: Path
) -> None:
    folder = mixed(brief, tmp_path, chunk=chunk).run(workers=workers)
    assert same(folder.runs(), reference)
    assert folder.complete
    # Every reader of Parquet can open the files, and finds the units.
    assert same(
        pd.read_parquet(tmp_path / "shards")[["run", "miss_m"]], reference[["run", "miss_m"]]
    )
    units = {
        field.name: field.metadata[b"unit"].decode()
        for field in pq.read_schema(shards(tmp_path)[0])
    }
    assert (units["miss_m"], units["start_vx_m_s"], units["outcome"]) == ("m", "m/s", "")


@pytest.mark.thorough
def test_runs_are_the_same_on_any_executor(
    brief: Scenario, reference: pd.DataFrame, tmp_path: Path
) -> None:
    with ThreadPoolExecutor(3) as pool:
        assert same(mixed(brief, tmp_path / "threads").run(pool).runs(), reference)
    shuffled = Shuffled()
    assert same(mixed(brief, tmp_path / "shuffled").run(shuffled, workers=4).runs(), reference)
    assert shuffled.most_waiting <= 4
    with worker_processes(2) as pool:
        assert same(mixed(brief, tmp_path / "processes").run(pool).runs(), reference)


def test_guaranteed_misses_are_unknown_where_they_are_not_computed(
    brief: Scenario, tmp_path: Path
) -> None:
    without = Campaign(guaranteed(brief), 8, tmp_path / "without", guarantee=False).run().runs()
    computed = Campaign(guaranteed(brief), 8, tmp_path / "with").run().runs()
    assert without["guaranteed_miss_m"].isna().all()
    assert without["miss_m"].equals(computed["miss_m"])
    assert (computed["miss_m"] <= computed["guaranteed_miss_m"]).all()


def test_interrupted_campaign_is_continued_with_resume(
    brief: Scenario, reference: pd.DataFrame, tmp_path: Path
) -> None:
    campaign = mixed(brief, tmp_path)
    shares = list[float]()
    (tmp_path / ".infoset-1-abc.tmp").write_bytes(b"half")
    for stored in (16, 32):
        with pytest.raises(Stop):
            campaign.run(workers=1, resume=True, progress=stop_after(1))
        folder = CampaignFolder.read(tmp_path)
        assert (folder.complete, folder.finished_runs, folder.wanted_runs) == (False, stored, 96)
        assert same(folder.runs(), reference[:stored])
        (tmp_path / "shards" / ".infoset-2-abc.tmp").write_bytes(b"half")
    assert same(campaign.run(resume=True, progress=shares.append).runs(), reference)
    assert shares == [48 / 96, 64 / 96, 80 / 96, 1.0]
    assert not list(tmp_path.rglob("*.tmp"))
    assert same(campaign.run(resume=True, progress=stop_after(1)).runs(), reference)


def test_more_runs_extend_a_campaign(
    brief: Scenario, reference: pd.DataFrame, tmp_path: Path
) -> None:
    mixed(brief, tmp_path, 40).run()
    folder = mixed(brief, tmp_path, 96, None).run(resume=True)
    assert same(folder.runs(), reference)
    assert len(shards(tmp_path)) == 6  # the third, with 8 runs, is replaced by one with 16
    with pytest.raises(StorageError, match="has 96 runs, more than --runs 90"):
        mixed(brief, tmp_path, 90).run(resume=True)


def flipped(content: bytes) -> bytes:
    column = pq.ParquetFile(io.BytesIO(content)).metadata.row_group(0).column(3)
    at = column.data_page_offset + column.total_compressed_size - 1  # its last value
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


def with_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


def without_a_column(file: Path) -> None:
    table = pq.read_table(file)
    pq.write_table(
        table.drop_columns(["miss_m"]).replace_schema_metadata(table.schema.metadata), file
    )


def with_text(file: Path) -> None:
    table = pq.read_table(file)
    changed = table.set_column(3, "miss_m", [["\x1b[31m"] * len(table)])
    pq.write_table(changed.replace_schema_metadata(table.schema.metadata), file)


BROKEN: dict[str, Callable[[Path], object]] = {
    "cut": lambda file: file.write_bytes(file.read_bytes()[:-100]),
    "empty": lambda file: file.write_bytes(b""),
    "a bit": lambda file: file.write_bytes(flipped(file.read_bytes())),
    "garbage": lambda file: file.write_bytes(b"PAR1" + b"x" * 50 + b"PAR1"),
    "another chunk": lambda file: file.write_bytes(shards(file.parents[1])[0].read_bytes()),
    "another campaign": lambda file: file.write_bytes(
        shards(file.parents[2] / "other")[2].read_bytes()
    ),
    "a folder": with_folder,
    "a column less": without_a_column,
    "a text for a number": with_text,
}


@pytest.mark.parametrize("harm", BROKEN)
def test_a_broken_file_is_named_and_simulated_again_when_it_is_deleted(
    harm: str, brief: Scenario, reference: pd.DataFrame, tmp_path: Path
) -> None:
    campaign = mixed(brief, tmp_path / "campaign", 48)
    campaign.run()
    replace(campaign, folder=tmp_path / "other", seed=6).run()
    file = shards(tmp_path / "campaign")[2]
    BROKEN[harm](file)
    before = {each: each.read_bytes() for each in tmp_path.rglob("*") if each.is_file()}
    for read in (CampaignFolder.read(tmp_path / "campaign"), campaign.run(resume=True)):
        with pytest.raises(StorageError) as refused:
            read.runs()
        assert str(refused.value).startswith(f"{file}: cannot be read: ")
        assert str(refused.value).endswith("; delete it, and simulate its runs again with --resume")
    assert {each: each.read_bytes() for each in tmp_path.rglob("*") if each.is_file()} == before
    file.rmdir() if file.is_dir() else file.unlink()
    assert CampaignFolder.read(tmp_path / "campaign").finished_runs == 32
    assert same(campaign.run(resume=True).runs(), reference[:48])


@pytest.mark.parametrize(
    "change",
    [
        lambda _: b"",
        lambda _: b"[]",
        lambda _: b"\xff\xfe",
        lambda _: b"[" * 100_000,
        lambda text: text.replace(b'"schema": 1', b'"schema": 2'),
        lambda text: text.replace(b'"seed": 5', b'"seed": -5'),
        lambda text: text.replace(b'"seed": 5', b'"seed": true'),
        lambda text: text.replace(b'"noise": "mixed"', b'"noise": "loud"'),
        lambda text: text.replace(b'"strategy": "', b'"strategy": "\\u001b[31m'),
        lambda text: text.replace(
            b'"axes": []', b'"axes": [{"key": "a", "scale": "log", "values": [1]}]'
        ),
        lambda text: text.replace(b'"cell_runs": []', b'"cell_runs": [1, 2]'),
        lambda text: text.replace(b'"sections": 5', b'"sectiones": 5'),
        lambda text: text.replace(b'"nominal_range_m": 595000.0', b'"nominal_range_m": 1e999'),
    ],
)
def test_a_broken_manifest_is_refused(
    change: Callable[[bytes], bytes], brief: Scenario, tmp_path: Path
) -> None:
    file = tmp_path / "manifest.json"
    mixed(brief, tmp_path, 16).manifest().write(tmp_path)
    text = file.read_bytes()
    assert change(text) != text
    file.write_bytes(change(text))
    for read in (
        lambda: read_manifest(tmp_path),
        lambda: mixed(brief, tmp_path, 16).run(resume=True),
    ):
        with pytest.raises(
            StorageError, match=r"manifest\.json: is not a readable manifest: .*restore it"
        ):
            read()
    assert file.read_bytes() == change(text)


@pytest.mark.parametrize(
    ("moment", "error"), [(1, errno.ENOSPC), (5, errno.ENOSPC), (11, errno.EIO)]
)
def test_a_full_disk_leaves_a_valid_folder(
    moment: int,
    error: int,
    brief: Scenario,
    reference: pd.DataFrame,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    real = os.fsync
    calls = itertools.count(1)

    def fsync(descriptor: int) -> None:
        if next(calls) >= moment:
            raise OSError(error, os.strerror(error))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(StorageError, match=os.strerror(error)):
        mixed(brief, tmp_path).run()
    monkeypatch.setattr(os, "fsync", real)
    assert not list(tmp_path.rglob("*.tmp"))
    assert same(mixed(brief, tmp_path).run(resume=True).runs(), reference)


def test_another_campaign_is_refused_and_every_difference_shown(
    brief: Scenario, tmp_path: Path
) -> None:
    campaign = mixed(brief, tmp_path, 32)
    campaign.run()
    before = {each: each.read_bytes() for each in tmp_path.rglob("*") if each.is_file()}
    sensor = replace(linear(brief.angle_sensor), error_at_zero_range_rad=0.0003)
    other = replace(
        brief, **of_model(replace(brief.set_model, angle_sensor=sensor)), tie=TieRule.LOWER
    )
    for changed, lines in (
        (
            replace(campaign, seed=6, chunk=8),
            ["seed: 5 in the folder, 6 now", "chunk: 16 in the folder, 8 now"],
        ),
        (
            replace(campaign, noise=CampaignNoise.GAME),
            [
                'scenario.noise: "random" in the folder, "game" now',
                'noise: "mixed" in the folder, "game" now',
            ],
        ),
        (
            replace(campaign, scenario=replace(brief, body=Body(80.0))),
            ["scenario.body.radius_m: not set in the folder, 80.0 now"],
        ),
        (
            replace(campaign, scenario=other),
            [
                'scenario.tie: "upper" in the folder, "lower" now',
                "scenario.angle_sensor.error_at_zero_range_rad: 0.00023 in the folder, 0.0003 now",
            ],
        ),
    ):
        with pytest.raises(StorageError, match="different settings") as refused:
            changed.run(resume=True)
        assert str(refused.value).split("\n  ")[1:] == lines
    assert {each: each.read_bytes() for each in tmp_path.rglob("*") if each.is_file()} == before


def test_versions_of_packages_must_be_the_same(brief: Scenario, tmp_path: Path) -> None:
    campaign = mixed(brief, tmp_path, 16)
    campaign.run()
    manifest = read_manifest(tmp_path)
    assert set(manifest.versions) == {"infoset", "numpy", "numba", "python"}
    replace(manifest, versions={**manifest.versions, "python": "3.0"}).write(tmp_path)
    assert campaign.run(resume=True).complete
    replace(manifest, versions={**manifest.versions, "numpy": "1.0"}).write(tmp_path)
    with pytest.raises(StorageError, match=r'versions\.numpy: "1.0" in the folder'):
        campaign.run(resume=True)
    task = Task(brief, range(4), 0, versions={**versions(), "numpy": "1.0"})
    with pytest.raises(
        VersionError, match=rf"numpy 1.0 in the campaign, {versions()['numpy']} on the worker"
    ):
        simulate_task(task)


def test_progress_of_runs_with_two_noises_does_not_go_back(brief: Scenario) -> None:
    shares: list[float] = []

    simulate_task(Task(brief, range(5), 0, CampaignNoise.MIXED, progress=shares.append))

    assert shares == sorted(shares)
    # Three of the five runs have random noise.
    assert 0.6 in shares
    assert shares[-1] == 1.0


def test_scenario_read_from_a_manifest_equals_the_written_one(
    brief: Scenario, ranging: Scenario, comet: Scenario
) -> None:
    from infoset import RateSensor
    from infoset.sim import Manoeuvre, Target
    from infoset.sim.storage.codec import from_json, to_json

    rich = replace(
        comet,
        sun=None,
        rate_sensor=RateSensor(0.8, 1e-6),
        target=Target(Manoeuvre.BANG_BANG, 0.1),
        noise=NoiseKind.GAME,
    )
    for scenario in (brief, ranging, comet, rich):
        assert from_json(Scenario, json.loads(json.dumps(to_json(scenario)))) == scenario


@pytest.mark.parametrize("number", [2, np.float64(2.0), np.int64(2)])
def test_numbers_of_other_types_are_the_same_campaign(
    number: Any, brief: Scenario, tmp_path: Path
) -> None:
    plain = replace(brief, thruster=replace(brief.thruster, max_impulse_m_s=2.0))
    other = replace(brief, thruster=replace(brief.thruster, max_impulse_m_s=number))
    assert fingerprint(other) == fingerprint(plain)
    assert (
        mixed(other, tmp_path, 8).manifest().identity
        == mixed(plain, tmp_path, 8).manifest().identity
    )


def test_a_folder_with_other_content_is_left_alone(brief: Scenario, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    for resume in (False, True):
        with pytest.raises(StorageError, match="is not empty, and contains no campaign"):
            mixed(brief, tmp_path).run(resume=resume)
    assert [each.name for each in tmp_path.iterdir()] == ["thesis.tex"]
    with pytest.raises(StorageError, match="is a file"):
        mixed(brief, tmp_path / "thesis.tex").run()
    mixed(brief, tmp_path / "campaign", 16).run()
    with pytest.raises(StorageError, match="contains a campaign already"):
        mixed(brief, tmp_path / "campaign", 16).run()
    with pytest.raises(StorageError, match="no campaign"):
        CampaignFolder.read(tmp_path)


def test_two_campaigns_in_one_folder_at_once(brief: Scenario, tmp_path: Path) -> None:
    def meddle(_: float) -> None:
        with pytest.raises(StorageError, match="another campaign is running"):
            mixed(brief, tmp_path).run(resume=True)

    assert mixed(brief, tmp_path).run(progress=meddle).complete
    script = (
        "import sys; from pathlib import Path; from infoset.sim.storage.files import locked\n"
        "lock = locked(Path(sys.argv[1])); lock.__enter__(); print('held', flush=True); "
        "sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        meddle(0.0)
        other.kill()
        other.wait()
    assert mixed(brief, tmp_path).run(resume=True).complete  # the lock has ended with its process


RULE = StoppingRule(QuantileName("miss_m", 0.5), 1.5)


@pytest.fixture
def until(brief: Scenario, tmp_path: Path) -> Campaign:
    runs = RunsUntil(RULE, max_runs=200)
    return replace(mixed(brief, tmp_path / "stopped"), noise=None, runs=runs)


def test_a_rule_stops_at_the_same_run_with_any_workers(until: Campaign, tmp_path: Path) -> None:
    folder = until.run(workers=1)
    stopped = folder.runs()
    runs = folder.finished_runs
    assert 16 < runs < 200
    assert runs % 16 == 0
    assert folder.complete
    assert folder.manifest.stopped_after == runs
    assert same(replace(until, folder=tmp_path / "late").run(Shuffled(), workers=5).runs(), stopped)
    assert len(shards(tmp_path / "late")) * 16 == runs
    again = replace(until, folder=tmp_path / "broken")
    for _ in range(2):
        with pytest.raises(Stop):
            again.run(Shuffled(), workers=3, resume=True, progress=stop_after(1))
    assert same(again.run(resume=True, workers=2).runs(), stopped)
    shards(tmp_path / "broken")[1].unlink()
    assert same(again.run(resume=True).runs(), stopped)
    whole = replace(again, runs=200).run(resume=True)
    assert (whole.finished_runs, whole.manifest.stopped_after) == (200, None)
    assert same(whole.runs()[:runs], stopped)
    # A rule that comes later removes no runs.
    assert replace(again).run(resume=True).finished_runs == 200


def test_campaign_has_all_runs_if_its_rule_is_never_met(until: Campaign) -> None:
    rule = StoppingRule(QuantileName("miss_m", 0.999), 1e-6)
    folder = replace(until, runs=RunsUntil(rule, max_runs=40)).run()
    assert (folder.finished_runs, folder.manifest.stopped_after) == (40, None)


def test_results_that_are_not_finite_are_not_stored(
    brief: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def overflow(*arguments: Any, **options: Any) -> Any:
        results = simulate(*arguments, **options)
        return replace(results, miss_m=np.full(len(results), np.inf))

    monkeypatch.setattr("infoset.sim.parallel.simulate_runs", overflow)
    with pytest.raises(FloatingPointError, match="not finite"):
        mixed(brief, tmp_path).run()
    assert shards(tmp_path) == []


def test_noise_of_another_type_is_refused(brief: Scenario, tmp_path: Path) -> None:
    with pytest.raises(
        TypeError, match="noise must be None, a CampaignNoise, or have the method measure"
    ):
        Campaign(brief, 4, tmp_path, noise="foo")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("runs", "batches"),
    [
        (1, 1),
        (256 * ENGAGEMENTS_AT_ONCE, 1),
        (256 * ENGAGEMENTS_AT_ONCE + 1, 2),
        (10**9, MAX_CHUNK // ENGAGEMENTS_AT_ONCE),
    ],
)
def test_default_chunk_is_whole_batches_and_grows_with_the_runs(
    runs: int, batches: int, brief: Scenario, tmp_path: Path
) -> None:
    assert mixed(brief, tmp_path, runs, None).manifest().chunk == batches * ENGAGEMENTS_AT_ONCE


@pytest.mark.parametrize(
    ("rule", "max_runs", "min_runs", "error", "name"),
    [
        ("miss_m p99 ci<1", 10, 1, TypeError, "rule"),
        (RULE, 10.0, 1, TypeError, "max_runs"),
        (RULE, 10, 0, ValueError, "min_runs"),
        (RULE, 10, 11, ValueError, "max_runs"),
    ],
)
def test_runs_until_a_rule_are_refused_if_rule_or_limits_are_invalid(
    rule: Any, max_runs: Any, min_runs: int, error: type[Exception], name: str
) -> None:
    with pytest.raises(error, match=f"^{name} "):
        RunsUntil(rule, max_runs, min_runs)


def test_cells_of_a_sweep_are_campaigns_of_their_scenarios(brief: Scenario, tmp_path: Path) -> None:
    cells = tuple(
        replace(brief, thruster=replace(brief.thruster, max_impulse_m_s=each))
        for each in (2.0, 5.0, 9.0)
    )
    axis = Axis("thruster.max_impulse_m_s", (2.0, 5.0, 9.0))
    sweep = Campaign(
        brief,
        40,
        tmp_path / "sweep",
        seed=3,
        noise=CampaignNoise.MIXED,
        chunk=16,
        axes=(axis,),
        cells=cells,
    )
    with pytest.raises(Stop):
        sweep.run(progress=stop_after(3))
    folder = sweep.run(Shuffled(), resume=True)
    assert folder.complete
    assert len(shards(tmp_path / "sweep")) == 9
    whole = folder.runs()
    assert whole["cell"].tolist() == [0] * 40 + [1] * 40 + [2] * 40
    for number, cell in enumerate(cells):
        alone = (
            Campaign(cell, 40, tmp_path / f"cell{number}", seed=3, noise=CampaignNoise.MIXED)
            .run()
            .runs()
        )
        assert same(folder.runs(cell=number).drop(columns="cell"), alone.drop(columns="cell"))
        assert folder.manifest.values_of(number) == {
            "thruster.max_impulse_m_s": axis.values[number]
        }
    with pytest.raises(StorageError, match="cells_hash"):
        replace(sweep, cells=cells[::-1]).run(resume=True)
    with pytest.raises(ValueError, match="a scenario for each combination"):
        replace(sweep, cells=cells[:2])
