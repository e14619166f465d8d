from __future__ import annotations

import errno
import json
import os
import platform
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray

from guidance import NoiseKind, Situation, TieRule
from sim import (
    Body,
    Campaign,
    CampaignNoise,
    CampaignResult,
    QuantileName,
    Scenario,
    StoppingRule,
    Sweep,
    fly_one,
    simulate,
)
from sim.campaign import Progress
from sim.chunk import Chunk, chunk_size, fly_chunk
from sim.flights import worker_processes
from sim.scenario import of_model
from sim.simulate import ENGAGEMENTS_AT_ONCE
from sim.storage import (
    Axis,
    CampaignFolder,
    DamagedError,
    DiskFullError,
    ManifestError,
    OccupiedError,
    StorageError,
    fingerprint,
    read_manifest,
)
from sim.storage.manifest import checksum
from sim.versions import VersionError

COLUMNS = [
    *("run", "noise", "tie", "range_sensor", "miss_m", "impulse_m_s", "guaranteed_miss_m"),
    *("theorem_8_miss_m", "outcome", "set_emptied", "hit", "truth_margin_m"),
    *("z_km", "x_km", "vz_km_s", "vx_km_s"),
    *("y_km", "vy_km_s", "miss_y_m", "miss_z_m"),
]


@pytest.fixture(scope="module")
def reference(brief: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The table of 96 runs of mixed noise, flown by one thread."""
    folder = tmp_path_factory.mktemp("reference") / "campaign"
    return Campaign(brief, 96, folder, seed=5, noise=CampaignNoise.MIXED).run(workers=1).table


def mixed(brief: Scenario, folder: Path, runs: int = 96, chunk: int | None = 16) -> Campaign:
    return Campaign(brief, runs, folder, seed=5, noise=CampaignNoise.MIXED, chunk=chunk)


def shards(folder: Path) -> list[Path]:
    return sorted((folder / "shards").glob("chunk-*.parquet"))


class Late(Executor):
    """Flies when asked for a result, the last chunk handed over first."""

    def __init__(self) -> None:
        self.waiting: list[tuple[Future[Any], Callable[[], Any]]] = []
        self.most = 0
        self.lock = threading.Lock()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        with self.lock:
            self.waiting.append((future, lambda: fn(*args, **kwargs)))
            self.most = max(self.most, len(self.waiting))
        threading.Thread(target=self._one).start()
        return future

    def _one(self) -> None:
        with self.lock:
            future, work = self.waiting.pop()
        if future.set_running_or_notify_cancel():
            future.set_result(work())


def test_rows_are_those_of_simulate(brief: Scenario, reference: Any) -> None:
    assert reference.column_names == COLUMNS
    assert reference.column("run").to_pylist() == list(range(96))
    assert reference.column("noise").to_pylist() == ["random", "game"] * 48
    assert reference.column("tie").to_pylist() == [None, "upper"] * 48
    for kind, first in ((NoiseKind.RANDOM, 0), (NoiseKind.GAME, 1)):
        flown = simulate(replace(brief, noise=kind), 96, seed=5)
        rows = reference.take(list(range(first, 96, 2)))
        assert rows.column("miss_m").to_pylist() == flown.miss_m[first::2].tolist()
        assert rows.column("impulse_m_s").to_pylist() == flown.impulse_m_s[first::2].tolist()
        assert rows.column("outcome").to_pylist() == [each.value for each in flown.outcomes[first::2]]
        assert rows.column("truth_margin_m").to_pylist() == flown.truth_margin_m[first::2].tolist()
        guaranteed = flown.guaranteed_miss_m[first::2]
        assert rows.column("guaranteed_miss_m").to_pylist() == guaranteed.tolist()
        for place, column in enumerate(("z_km", "x_km")):
            np.testing.assert_array_equal(rows.column(column).to_numpy(), flown.position_m[first::2, place] / 1e3)
        for place, column in enumerate(("vz_km_s", "vx_km_s")):
            np.testing.assert_array_equal(rows.column(column).to_numpy(), flown.velocity_m_s[first::2, place] / 1e3)


def test_columns_carry_their_units(reference: Any) -> None:
    units = {field.name: field.metadata[b"unit"].decode() for field in reference.schema}
    assert units["miss_m"] == units["truth_margin_m"] == "m"
    assert units["impulse_m_s"] == "m/s"
    assert (units["x_km"], units["vx_km_s"]) == ("km", "km/s")
    assert reference.schema.metadata[b"infoset_schema"] == b"2"
    assert all(field.metadata[b"meaning"] for field in reference.schema)


@pytest.mark.parametrize(("workers", "chunk"), [(1, 7), (2, 1), (2, 16), (2, 1000), (5, 30), (3, None)])
def test_workers_and_chunks_change_no_bit(
    workers: int, chunk: int | None, brief: Scenario, reference: Any, tmp_path: Path
) -> None:
    runs = 20 if chunk == 1 else 96
    result = mixed(brief, tmp_path / "campaign", runs, chunk).run(workers=workers)
    assert result.table.equals(reference.slice(0, runs), check_metadata=True)
    assert result.complete
    assert len(result) == runs


def test_any_executor_will_do(brief: Scenario, reference: Any, tmp_path: Path) -> None:
    with ThreadPoolExecutor(3) as pool:
        assert mixed(brief, tmp_path / "threads").run(pool).table.equals(reference)
    late = Late()
    assert mixed(brief, tmp_path / "late").run(late, workers=4).table.equals(reference)
    assert late.most <= 4
    with worker_processes(2) as pool:
        assert mixed(brief, tmp_path / "processes", 64).run(pool).table.equals(reference.slice(0, 64))


def test_a_row_is_the_engagement_flown_alone(brief: Scenario, reference: Any) -> None:
    for run in (0, 1, 77, 95):
        row = reference.slice(run, 1).to_pylist()[0]
        alone = fly_one(replace(brief, noise=NoiseKind(row["noise"])), run, seed=5).result
        assert (row["miss_m"], row["impulse_m_s"]) == (float(alone.miss_m[0]), float(alone.impulse_m_s[0]))
        assert row["outcome"] == alone.outcomes[0].value


def test_shards_are_plain_parquet(brief: Scenario, reference: Any, tmp_path: Path) -> None:
    mixed(brief, tmp_path / "campaign").run()
    files = shards(tmp_path / "campaign")
    assert len(files) == 6
    whole = pa.concat_tables([pq.read_table(each) for each in files])
    assert whole.replace_schema_metadata(reference.schema.metadata).equals(reference)


def test_to_pandas_needs_pandas_of_the_user_only(reference: Any, tmp_path: Path, brief: Scenario) -> None:
    code = "import sys, sim, sim.campaign, sim.storage.tables; print('pandas' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
    result = mixed(brief, tmp_path / "campaign", 20).run()
    called = []

    class Table:
        def to_pandas(self) -> str:
            called.append(True)
            return "frame"

    class Result(CampaignResult):
        @property
        def table(self) -> Any:
            return Table()

    assert Result(result.folder).to_pandas() == "frame"
    assert called


def test_a_campaign_of_ones_own_strategy(brief: Scenario, tmp_path: Path) -> None:
    class Nothing:
        def start(self, batch: int) -> None:
            return None

        def decide(self, situation: Situation, state: object) -> NDArray[np.float64]:
            return np.zeros(len(situation.budget_left_m_s))

    asked = Campaign(brief, 20, tmp_path / "campaign", strategy=Nothing())
    result = asked.run()
    assert result.table.column("impulse_m_s").to_pylist() == [0.0] * 20
    assert read_manifest(tmp_path / "campaign").strategy.endswith("Nothing")
    with pytest.raises(ManifestError, match="strategy: "):
        replace(asked, strategy=None).run(resume=True)


def test_guaranteed_misses_are_null_where_they_were_not_kept(brief: Scenario, tmp_path: Path) -> None:
    from infoset import InitialSet, Model

    model = replace(brief.set_model, model=Model.GUARANTEED, initial_set=InitialSet.BOX)
    guaranteed = replace(brief, **of_model(model))
    without = Campaign(guaranteed, 8, tmp_path / "without", guarantee=False).run().table
    kept = Campaign(guaranteed, 8, tmp_path / "with").run().table
    assert without.column("guaranteed_miss_m").null_count == 8
    assert kept.column("guaranteed_miss_m").null_count == 0
    assert without.column("miss_m").equals(kept.column("miss_m"))
    assert all(
        miss <= bound
        for miss, bound in zip(
            kept.column("miss_m").to_pylist(), kept.column("guaranteed_miss_m").to_pylist(), strict=True
        )
    )


class Stop(Exception):  # noqa: N818
    """Breaks a campaign off."""


def breaking_off_after(runs: int) -> Callable[[Progress], None]:
    def progress(progress: Progress) -> None:
        if progress.flown >= runs:
            raise Stop

    return progress


def test_what_was_broken_off_is_gone_on_with(brief: Scenario, reference: Any, tmp_path: Path) -> None:
    asked, told = mixed(brief, tmp_path / "campaign"), list[Progress]()
    for _ in range(3):
        with pytest.raises(Stop):
            asked.run(workers=2, resume=True, progress=breaking_off_after(16))
    result = asked.run(resume=True, progress=told.append)
    assert result.table.equals(reference)
    assert told[0].done >= 48
    assert told[0].flown == 0
    assert told[-1].done == told[-1].total == 96
    assert told[-1].flown == 96 - told[0].done
    assert [each.done for each in told] == sorted(each.done for each in told)
    assert asked.run(resume=True).table.equals(reference)


def test_an_unfinished_campaign_can_be_read(brief: Scenario, reference: Any, tmp_path: Path) -> None:
    with pytest.raises(Stop):
        mixed(brief, tmp_path).run(workers=1, progress=breaking_off_after(32))
    folder = CampaignFolder.read(tmp_path)
    assert (folder.complete, folder.finished_runs, folder.wanted_runs) == (False, 32, 96)
    assert folder.table().equals(reference.slice(0, 32))


def test_more_runs_extend_a_campaign(brief: Scenario, reference: Any, tmp_path: Path) -> None:
    mixed(brief, tmp_path, 40).run()
    assert len(shards(tmp_path)) == 3
    result = mixed(brief, tmp_path, 96, None).run(resume=True)
    assert result.redone == ()
    assert result.table.equals(reference)
    assert read_manifest(tmp_path).runs == 96
    with pytest.raises(ManifestError, match="has 96 runs, more than --runs 90"):
        mixed(brief, tmp_path, 90).run(resume=True)


@pytest.mark.parametrize("harm", ["cut", "empty", "flipped", "foreign", "garbage"])
def test_a_damaged_shard_is_said_and_flown_again(harm: str, brief: Scenario, reference: Any, tmp_path: Path) -> None:
    mixed(brief, tmp_path / "campaign").run()
    victim = shards(tmp_path / "campaign")[4]
    content = victim.read_bytes()
    if harm == "foreign":
        replace(mixed(brief, tmp_path / "other"), seed=6).run()
        victim.unlink()
        stranger = shards(tmp_path / "other")[4]
        victim = victim.with_name(stranger.name)
        victim.write_bytes(stranger.read_bytes())
    else:
        changed = bytearray(content)
        changed[len(content) // 2] ^= 1
        victim.write_bytes(
            {"cut": content[:-100], "empty": b"", "flipped": bytes(changed), "garbage": b"PAR1" + b"x" * 50}[harm]
        )
    read = CampaignFolder.read(tmp_path / "campaign")
    assert [each.file for each in read.damaged] == [victim]
    assert (read.complete, read.finished_runs) == (False, 80)
    assert victim.exists()  # reading takes nothing away
    result = mixed(brief, tmp_path / "campaign").run(resume=True)
    (redone,) = result.redone
    assert redone.file == victim
    assert {"foreign": "another campaign"}.get(harm, "truncated or changed") in redone.reason
    assert result.table.equals(reference)
    assert CampaignFolder.read(tmp_path / "campaign").damaged == []


def test_a_shard_that_lies_about_itself_is_flown_again(brief: Scenario, reference: Any, tmp_path: Path) -> None:
    import zlib

    mixed(brief, tmp_path).run()
    victim = shards(tmp_path)[2]
    for content, reason in (
        (b"nothing", "is not a Parquet file"),
        (shards(tmp_path)[3].read_bytes(), "another campaign"),
    ):
        victim.unlink()
        victim = victim.with_name(f"chunk-0000002-{zlib.crc32(content):08x}.parquet")
        victim.write_bytes(content)
        result = mixed(brief, tmp_path).run(resume=True)
        assert [reason in each.reason for each in result.redone] == [True]
        assert result.table.equals(reference)
        victim = shards(tmp_path)[2]


def test_a_shard_that_goes_while_it_is_read(brief: Scenario, tmp_path: Path) -> None:
    mixed(brief, tmp_path).run()
    folder = CampaignFolder.read(tmp_path)
    shards(tmp_path)[2].unlink()
    with pytest.raises(DamagedError, match="resume"):
        folder.table()


def test_leftovers_of_a_process_that_died_writing_are_cleared(brief: Scenario, reference: Any, tmp_path: Path) -> None:
    (tmp_path / ".infoset-1-abc.tmp").write_bytes(b"half")
    with pytest.raises(Stop):
        mixed(brief, tmp_path).run(progress=breaking_off_after(16))
    (tmp_path / "shards" / ".infoset-2-abc.tmp").write_bytes(b"half")
    assert mixed(brief, tmp_path).run(resume=True).table.equals(reference)
    assert not list(tmp_path.rglob("*.tmp"))


@pytest.mark.parametrize("moment", [1, 2, 5, 11])
def test_a_full_disk_leaves_a_valid_folder(
    moment: int, brief: Scenario, reference: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, calls = os.fsync, 0

    def fsync(descriptor: int) -> None:
        nonlocal calls
        calls += 1
        if calls >= moment:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(DiskFullError, match="the disk is full"):
        mixed(brief, tmp_path).run()
    monkeypatch.setattr(os, "fsync", real)
    assert not list(tmp_path.rglob("*.tmp"))
    if (tmp_path / "manifest.json").exists():
        folder = CampaignFolder.read(tmp_path)
        assert folder.damaged == []
        assert folder.finished_runs < 96
    assert mixed(brief, tmp_path).run(resume=True).table.equals(reference)


def test_a_disk_that_fails_otherwise(brief: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(StorageError, match="Input/output error"):
        mixed(brief, tmp_path).run()


def test_who_began_it_is_told_and_not_compared(
    brief: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mixed(brief, tmp_path, 16).run()
    begun = read_manifest(tmp_path).made_by
    assert begun == {"python": platform.python_version(), "machine": platform.machine(), "system": platform.system()}
    monkeypatch.setattr(platform, "machine", lambda: "another")
    assert mixed(brief, tmp_path, 32).run(resume=True).complete
    assert read_manifest(tmp_path).made_by == begun


def test_another_campaign_is_refused_and_every_difference_shown(brief: Scenario, tmp_path: Path) -> None:
    asked = mixed(brief, tmp_path, 32)
    asked.run()
    before = {each: each.read_bytes() for each in tmp_path.rglob("*") if each.is_file()}
    sensor = replace(brief.set_model.angle_sensor, error_at_zero_range_rad=0.0003)
    other = replace(brief, **of_model(replace(brief.set_model, angle_sensor=sensor)), tie=TieRule.LOWER)
    for campaign, lines in (
        (replace(asked, seed=6), ["seed: 5 in the folder, 6 now"]),
        (
            replace(asked, noise=CampaignNoise.GAME),
            ['scenario.noise: "random" in the folder, "game" now', 'noise: "mixed" in the folder, "game" now'],
        ),
        (replace(asked, guarantee=False), ["guarantee: true in the folder, false now"]),
        (
            replace(asked, scenario=replace(brief, body=Body(80.0))),
            ["scenario.body.radius_m: not set in the folder, 80.0 now"],
        ),
        (replace(asked, chunk=8), ["chunk: 16 in the folder, 8 now"]),
        (
            replace(asked, scenario=other),
            [
                'scenario.tie: "upper" in the folder, "lower" now',
                "scenario.angle_sensor.error_at_zero_range_rad: 0.00023 in the folder, 0.0003 now",
            ],
        ),
    ):
        with pytest.raises(ManifestError, match="different settings") as refused:
            campaign.run(resume=True)
        assert str(refused.value).split("\n  ")[1:] == lines
    assert {each: each.read_bytes() for each in tmp_path.rglob("*") if each.is_file()} == before


def test_another_version_or_schema_is_refused(brief: Scenario, tmp_path: Path) -> None:
    mixed(brief, tmp_path, 32).run()
    file = tmp_path / "manifest.json"
    written = json.loads(file.read_text())
    other = {**written, "versions": {**written["versions"], "numpy": "1.0"}}
    file.write_text(json.dumps({**other, "sha256": checksum(other)}))
    with pytest.raises(ManifestError, match=r'versions\.numpy: "1.0" in the folder'):
        mixed(brief, tmp_path, 32).run(resume=True)
    file.write_text(json.dumps({**written, "schema": 2}))
    with pytest.raises(ManifestError, match="schema: must be 1, the only one this version reads, found 2"):
        mixed(brief, tmp_path, 32).run(resume=True)


@pytest.mark.parametrize(
    "change",
    [
        lambda _: b"",
        lambda _: b"{",
        lambda _: b"[]",
        lambda _: b"\xff\xfe",
        lambda _: b"[" * 100_000,
        lambda text: text.replace(b'"seed": 5', b'"seed": -5'),
        lambda text: text.replace(b'"seed": 5', b'"seed": true'),
        lambda text: text.replace(b'"runs": 32', b'"runs": 0'),
        lambda text: text.replace(b'"noise": "mixed"', b'"noise": "loud"'),
        lambda text: text.replace(b'"axes": []', b'"axes": [{"key": "a", "scale": "log", "values": [1]}]'),
        lambda text: text.replace(b'"axes": []', b'"axes": 3'),
        lambda text: text.replace(b'"sections": 5', b'"sections": "5"'),
        lambda text: text.replace(b'"sections": 5', b'"sectiones": 5'),
        lambda text: text.replace(b'"nominal_range_m": 595000.0', b'"nominal_range_m": 1e999'),
        lambda text: text.replace(b'"nominal_range_m": 595000.0', b'"nominal_range_m": ' + b"9" * 400),
        lambda text: text.replace(b'"stopped_after": null', b'"stopped_after": 99'),
    ],
)
def test_a_manifest_that_is_none_is_refused(change: Callable[[bytes], bytes], brief: Scenario, tmp_path: Path) -> None:
    mixed(brief, tmp_path, 32).run()
    file = tmp_path / "manifest.json"
    text = file.read_bytes()
    assert change(text) != text
    file.write_bytes(change(text))
    with pytest.raises(ManifestError, match=r"manifest\.json: is not a readable manifest"):
        mixed(brief, tmp_path, 32).run(resume=True)


def test_a_scenario_comes_back_whole(brief: Scenario, ranging: Scenario, comet: Scenario) -> None:
    from infoset import RateSensor
    from sim import Manoeuvre, Target
    from sim.storage.codec import from_json, to_json

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
def test_numbers_of_other_types_are_the_same_campaign(number: Any, brief: Scenario, tmp_path: Path) -> None:
    plain = replace(brief, thruster=replace(brief.thruster, max_impulse_m_s=2.0))
    other = replace(brief, thruster=replace(brief.thruster, max_impulse_m_s=number))
    assert fingerprint(other) == fingerprint(plain)
    result = mixed(other, tmp_path, 8).run(workers=1)
    assert CampaignFolder.read(tmp_path).damaged == []
    assert result.folder.manifest.identity == mixed(plain, tmp_path, 8).manifest().identity
    assert mixed(plain, tmp_path, 8).run(resume=True).complete


def test_a_folder_that_holds_something_is_left_alone(brief: Scenario, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("precious")
    for resume in (False, True):
        with pytest.raises(OccupiedError, match="is not empty, and contains no campaign"):
            mixed(brief, tmp_path).run(resume=resume)
    assert [each.name for each in tmp_path.iterdir()] == ["thesis.tex"]
    with pytest.raises(OccupiedError, match="is a file"):
        mixed(brief, tmp_path / "thesis.tex").run()
    mixed(brief, tmp_path / "campaign", 16).run()
    with pytest.raises(OccupiedError, match="contains a campaign already"):
        mixed(brief, tmp_path / "campaign", 16).run()
    with pytest.raises(ManifestError, match="no campaign"):
        CampaignFolder.read(tmp_path)


def test_two_campaigns_in_one_folder_at_once(brief: Scenario, reference: Any, tmp_path: Path) -> None:
    refused: list[BaseException] = []

    def meddle(progress: Progress) -> None:
        if not refused:
            with pytest.raises(OccupiedError, match="another campaign is running") as caught:
                mixed(brief, tmp_path).run(resume=True)
            refused.append(caught.value)

    assert mixed(brief, tmp_path).run(progress=meddle).table.equals(reference)
    assert refused
    script = (
        "import sys; from pathlib import Path; from sim.storage.files import locked\n"
        "lock = locked(Path(sys.argv[1])); lock.__enter__(); print('held', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        with pytest.raises(OccupiedError, match="another campaign is running"):
            mixed(brief, tmp_path).run(resume=True)
        other.kill()
        other.wait()
    assert mixed(brief, tmp_path).run(resume=True).complete  # the lock has died with its process


@pytest.fixture
def rule() -> StoppingRule:
    return StoppingRule(QuantileName("miss_m", 0.5), 1.5)


@pytest.fixture
def stopped(brief: Scenario, rule: StoppingRule, tmp_path: Path) -> Any:
    """The table of a campaign that a rule stopped, flown in order."""
    result = replace(mixed(brief, tmp_path / "stopped", 200), noise=None, until=rule).run(workers=1)
    assert 16 < len(result) < 200
    assert len(result) % 16 == 0
    assert result.complete
    assert result.folder.manifest.stopped_after == len(result)
    return result.table


def test_a_rule_stops_at_the_same_run_whoever_flies(
    brief: Scenario, rule: StoppingRule, stopped: Any, tmp_path: Path
) -> None:
    asked = replace(mixed(brief, tmp_path / "late", 200), noise=None, until=rule)
    result = asked.run(Late(), workers=5)
    assert result.table.equals(stopped)
    assert len(shards(tmp_path / "late")) * 16 == len(stopped)
    again = replace(asked, folder=tmp_path / "broken")
    for _ in range(2):
        with pytest.raises(Stop):
            again.run(Late(), workers=3, resume=True, progress=breaking_off_after(16))
    assert again.run(resume=True, workers=2).table.equals(stopped)
    assert again.run(resume=True).table.equals(stopped)
    (estimate,) = [result.quantile("miss_m", 0.5)]
    assert estimate.width is not None
    assert estimate.width < 1.5


def test_a_rule_that_comes_later_takes_nothing_away(
    brief: Scenario, rule: StoppingRule, stopped: Any, tmp_path: Path
) -> None:
    plain = replace(mixed(brief, tmp_path / "plain", 200), noise=None)
    whole = plain.run().table
    assert replace(plain, until=rule).run(resume=True).table.equals(stopped)
    assert len(CampaignFolder.read(tmp_path / "plain").table()) == len(stopped)
    told: list[Progress] = []
    assert plain.run(resume=True, progress=told.append).table.equals(whole)
    assert told[-1].flown == 0


def test_a_shard_put_aside_that_is_not_full_is_no_damage_when_more_runs_are_asked(
    brief: Scenario, rule: StoppingRule, stopped: Any, tmp_path: Path
) -> None:
    plain = replace(mixed(brief, tmp_path / "plain", 200), noise=None)
    plain.run()
    assert replace(plain, until=rule).run(resume=True).table.equals(stopped)
    longer = replace(plain, runs=216).run(resume=True)
    assert (len(longer), longer.redone) == (216, ())


def test_a_rule_that_is_never_met_lets_all_runs_fly(brief: Scenario, tmp_path: Path) -> None:
    rule = StoppingRule(QuantileName("miss_m", 0.999), 1e-6)
    result = replace(mixed(brief, tmp_path, 64), until=rule).run()
    assert len(result) == 64
    assert result.folder.manifest.stopped_after is None


def test_results_that_are_no_numbers_are_not_stored(
    brief: Scenario, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def overflow(chunk: Chunk, *_: object) -> Any:
        flown = fly_chunk(chunk)
        return replace(flown, miss_m=np.full(len(flown), np.inf))

    monkeypatch.setattr("sim.flights.fly_chunk", overflow)
    with pytest.raises(FloatingPointError, match="not finite"):
        mixed(brief, tmp_path).run()
    assert shards(tmp_path) == []


def test_a_chunk_of_another_version_is_refused_and_both_named(brief: Scenario) -> None:
    from sim.versions import calculating_versions

    chunk = Chunk(0, 0, brief, range(4), 0, CampaignNoise.RANDOM)
    ours = dict(calculating_versions())
    other = tuple({**ours, "numpy": "1.0"}.items())
    with pytest.raises(VersionError, match=f"numpy 1.0 here, {ours['numpy']} there"):
        fly_chunk(replace(chunk, versions=other))


@pytest.mark.parametrize("wrong", [{"runs": 0}, {"seed": -1}, {"chunk": 0}])
def test_numbers_that_make_no_campaign(wrong: dict[str, int], brief: Scenario, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(wrong))} must be at least"):
        replace(mixed(brief, tmp_path / "campaign"), **wrong)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="at least one worker"):
        mixed(brief, tmp_path / "campaign").run(workers=0)


def test_chunks_suit_the_number_of_runs() -> None:
    batch = ENGAGEMENTS_AT_ONCE
    assert [chunk_size(runs) for runs in (1, batch, 256 * batch, 256 * batch + 1)] == [batch, batch, batch, 2 * batch]
    for runs in (10**5, 10**6, 10**7, 10**9):
        assert chunk_size(runs) % batch == 0
        assert chunk_size(runs) <= 4096
        assert runs / chunk_size(runs) <= max(256, runs / (4096 - batch))


def test_cells_of_a_sweep_are_campaigns_of_their_scenarios(brief: Scenario, tmp_path: Path) -> None:
    cells = tuple(replace(brief, thruster=replace(brief.thruster, max_impulse_m_s=each)) for each in (2.0, 5.0, 9.0))
    axis = Axis("thruster.max_impulse_m_s", (2.0, 5.0, 9.0))
    asked = Sweep(brief, (axis,), cells, 40, tmp_path / "sweep", seed=3, chunk=16, noise=CampaignNoise.MIXED)
    with pytest.raises(Stop):
        asked.run(progress=breaking_off_after(50))
    result = asked.run(Late(), resume=True)
    assert result.complete
    assert len(shards(tmp_path / "sweep")) == 9
    with pytest.raises(OccupiedError, match="contains a sweep already"):
        asked.run()
    whole = result.table
    assert whole.column_names == ["cell", *COLUMNS]
    assert whole.column("cell").to_pylist() == [0] * 40 + [1] * 40 + [2] * 40
    for number, cell in enumerate(cells):
        alone = Campaign(cell, 40, tmp_path / f"cell{number}", seed=3, noise=CampaignNoise.MIXED).run().table
        assert result.folder.table(COLUMNS, number).equals(alone)
        assert result.folder.manifest.values_of(number) == {"thruster.max_impulse_m_s": axis.values[number]}
    other = replace(asked, cells=(cells[0], cells[2], cells[1]))
    with pytest.raises(ManifestError, match="cells_hash"):
        other.run(resume=True)
    with pytest.raises(ManifestError, match="has 40 runs, more than --runs 30"):
        replace(asked, runs=30).run(resume=True)
    with pytest.raises(ValueError, match="a scenario for each combination"):
        replace(asked, cells=cells[:2])


def test_a_noise_that_is_no_choice_is_refused(brief: Scenario, tmp_path: Path) -> None:
    with pytest.raises(TypeError, match=r"noise must be None or one of CampaignNoise\.RANDOM, .*MIXED: got 'foo'"):
        Campaign(brief, 4, tmp_path, noise="foo")  # type: ignore[arg-type]
