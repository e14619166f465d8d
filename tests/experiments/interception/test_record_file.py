from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import math
import random
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.common.errors import InputError
from experiments.interception import record_file
from experiments.interception.record_file import load_record, write_record
from experiments.interception.scenario_file import load_scenario
from guidance import LineOfSight, NoiseKind, Situation
from infoset import Convention, InformationSetView, RateSensor
from sim import Record, StepRecord, fly_one
from tests.long_steps import with_long_steps
from tests.space import in_space


class Idle:
    """A strategy that nobody has registered."""

    def start(self, batch: int) -> None:
        return None

    def decide(self, situation: Situation, state: object) -> Any:
        return np.zeros(situation.information.batch)


OUTLIER_AT = 60


class Outlier:
    """Measures truly, but for one angle that is wrong by five times its bound."""

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Any]:
        errors = {"angle": 5.0 if sight.step == OUTLIER_AT else 0.0, "rate": 0.0}
        return {name: sight.sensors[name].measured(sight, errors[name]) for name in sight.sensors if name in errors}


@pytest.fixture(scope="module")
def record() -> Record:
    """The beginning of an engagement: small, so that it can be spoilt often."""
    whole = fly_one(load_scenario("asteroid-1997"), 3, seed=11)
    return dataclasses.replace(whole, steps=whole.steps[:6])


@pytest.fixture(scope="module")
def content(record: Record, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    file = tmp_path_factory.mktemp("record") / "x.npz"
    write_record(record, file)
    return file.read_bytes()


@pytest.fixture(scope="module")
def spatial_content(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    whole = fly_one(in_space(load_scenario("asteroid-1997")), 3, seed=11)
    file = tmp_path_factory.mktemp("record") / "x.npz"
    write_record(dataclasses.replace(whole, steps=whole.steps[:6]), file)
    return file.read_bytes()


def refused(content: bytes, tmp_path: Path) -> str:
    """The message about a file with this content."""
    file = tmp_path / "bad.npz"
    file.write_bytes(content)
    with pytest.raises(InputError) as refusal:
        load_record(file)
    message = str(refusal.value)
    assert message.startswith(f"{file}: is not a readable record: ")
    assert message.endswith("make a record with `infoset engage --record FILE.npz`")
    return message


def assert_same_step(one: StepRecord, other: StepRecord) -> None:
    for field in dataclasses.fields(StepRecord):
        if field.name != "sections":
            assert getattr(one, field.name) == getattr(other, field.name)
    assert [*one.axes] == [*other.axes]
    assert len(one.sections) == len(other.sections)
    for a, b in zip(one.sections, other.sections, strict=True):
        assert (a.label_m, a.range_m, a.closing_speed_m_s) == (b.label_m, b.range_m, b.closing_speed_m_s)
        assert np.array_equal(a.polygon.polygon(), b.polygon.polygon())
        assert (a.polygon_y is None) == (b.polygon_y is None)
        if a.polygon_y is not None and b.polygon_y is not None:
            assert np.array_equal(a.polygon_y.polygon(), b.polygon_y.polygon())


def assert_same(one: Record, other: Record) -> None:
    assert (one.scenario, one.seed, one.run, one.strategy) == (other.scenario, other.seed, other.run, other.strategy)
    assert (one.noise, one.inconsistency) == (other.noise, other.inconsistency)
    for field in dataclasses.fields(one.result):
        a, b = getattr(one.result, field.name), getattr(other.result, field.name)
        if np.ma.isMaskedArray(a):
            assert np.ma.getmaskarray(a).tolist() == np.ma.getmaskarray(b).tolist()
            a, b = a.filled(0.0), b.filled(0.0)
        assert np.array_equal(a, b)
    assert len(one.steps) == len(other.steps)
    for a, b in zip(one.steps, other.steps, strict=True):
        assert_same_step(a, b)


@pytest.mark.parametrize("noise", NoiseKind)
@pytest.mark.parametrize("name", ["asteroid-1997", "asteroid-1997-single", "comet-fast"])
def test_a_record_comes_back_bit_for_bit(name: str, noise: NoiseKind, tmp_path: Path) -> None:
    flown = fly_one(dataclasses.replace(with_long_steps(load_scenario(name)), noise=noise), 1, seed=2**70)
    write_record(flown, tmp_path / "x.npz")
    assert_same(load_record(tmp_path / "x.npz"), flown)
    assert [each.name for each in tmp_path.iterdir()] == ["x.npz"]


@pytest.mark.parametrize("convention", Convention)
def test_a_record_in_space_comes_back_bit_for_bit(convention: Convention, tmp_path: Path) -> None:
    planar = with_long_steps(load_scenario("asteroid-1997"))
    planar = dataclasses.replace(planar, rate_sensor=RateSensor(1.0, 1e-6))
    flown = fly_one(in_space(planar, convention=convention), 1)
    assert {tuple(step.axes) for step in flown.steps} == {("y", "z")}
    ranges = [[axis.measured.get("range") for axis in step.axes.values()] for step in flown.steps]
    assert any(y is not None for y, _ in ranges)
    assert all(y == z for y, z in ranges)
    write_record(flown, tmp_path / "x.npz")
    assert_same(load_record(tmp_path / "x.npz"), flown)


def test_a_record_in_space_has_the_members_of_a_plane_and_those_of_y(spatial_content: bytes, content: bytes) -> None:
    members = []
    for file in (content, spatial_content):
        with zipfile.ZipFile(io.BytesIO(file)) as archive:
            members.append(archive.namelist())
    planar, spatial = members
    assert spatial[: len(planar)] == planar
    assert sorted(spatial[len(planar) :]) == [
        *("impulse_y_m_s.npy", "measured_angle_y_rad.npy", "measured_rate_y_rad_s.npy", "predicted_miss_y_m.npy"),
        *("true_angle_y_rad.npy", "true_rate_y_rad_s.npy", "vertex_v_m_s_y_m.npy", "vertex_y_offsets.npy"),
    ]


def test_a_record_of_ones_own_strategy(tmp_path: Path) -> None:
    flown = fly_one(load_scenario("asteroid-1997-single"), strategy=Idle())
    write_record(flown, tmp_path / "x.npz")
    found = load_record(tmp_path / "x.npz")
    assert (found.strategy, found.scenario.strategy) == (f"{Idle.__module__}.Idle", "symmetric-miss")
    assert_same(found, flown)


def test_measured_rates_and_where_data_contradict_the_model_come_back(tmp_path: Path) -> None:
    scenario = dataclasses.replace(load_scenario("asteroid-1997-single"), rate_sensor=RateSensor(1.0, 1e-6))
    flown = fly_one(scenario, noise=Outlier())
    assert ["rate" not in step.measured for step in flown.steps[:4]] == [False, True, False, True]
    assert flown.inconsistency is not None
    assert flown.inconsistency.step == OUTLIER_AT
    write_record(flown, tmp_path / "x.npz")
    assert_same(load_record(tmp_path / "x.npz"), flown)


def test_what_is_not_known_comes_back_as_not_known(record: Record, tmp_path: Path) -> None:
    blank = dataclasses.replace(
        record.steps[0],
        axes={"z": dataclasses.replace(record.steps[0].axes["z"], measured={}, predicted_miss_m=None)},
        truth_margin_m=None,
        sections=(),
    )
    result = dataclasses.replace(
        record.result,
        guaranteed_miss_m=np.ma.MaskedArray([0.0], mask=[True]),
        truth_margin_m=np.ma.MaskedArray([0.0], mask=[True]),
    )
    changed = dataclasses.replace(record, steps=(blank, *record.steps[1:3]), result=result)
    write_record(changed, tmp_path / "x.npz")
    assert_same(load_record(tmp_path / "x.npz"), changed)


def test_the_same_record_gives_the_same_bytes(record: Record, content: bytes, tmp_path: Path) -> None:
    write_record(record, tmp_path / "y.npz")
    assert (tmp_path / "y.npz").read_bytes() == content


def test_numpy_reads_it_without_pickle(content: bytes) -> None:
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        header = json.loads(arrays["header"].tobytes())
        assert header["format"] == "infoset-record"
        assert all(np.isfinite(arrays[name]).all() for name in arrays.files)
        assert len(arrays["vertex_v_m_s_z_m"]) == arrays["vertex_offsets"][-1]


def test_nothing_is_replaced_unless_told(record: Record, tmp_path: Path) -> None:
    file = tmp_path / "x.npz"
    file.write_text("precious")
    with pytest.raises(InputError, match="exists already"):
        write_record(record, file)
    assert file.read_text() == "precious"
    write_record(record, file, overwrite=True)
    assert_same(load_record(file), record)
    with pytest.raises(InputError, match=r"must end in \.npz"):
        write_record(record, tmp_path / "x")


def test_what_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there is no such file.*engage --record"):
        load_record(tmp_path / "x.npz")
    with pytest.raises(InputError, match="is a folder"):
        load_record(tmp_path)
    with pytest.raises(InputError, match="not an ordinary file"):
        load_record("/dev/null")
    with pytest.raises(InputError, match="cannot be read"):
        load_record("a\0b")


def test_an_unreadable_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> bytes:  # chmod does not stop root
        raise PermissionError(13, "Permission denied")

    (tmp_path / "x.npz").write_bytes(b"")
    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(InputError, match="cannot be read: Permission denied"):
        load_record(tmp_path / "x.npz")


def test_a_file_too_large_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_file, "MAX_FILE_BYTES", 10)
    (tmp_path / "x.npz").write_bytes(b"x" * 11)
    with pytest.raises(InputError, match="more than any record"):
        load_record(tmp_path / "x.npz")


@pytest.mark.parametrize("foreign", [b"", b"x", b"PK\x03\x04", b"\x93NUMPY\x01\x00", b"\0" * 1000])
def test_what_is_no_archive(foreign: bytes, tmp_path: Path) -> None:
    refused(foreign, tmp_path)


def test_a_foreign_npz(tmp_path: Path) -> None:
    archive = io.BytesIO()
    np.savez(archive, a=np.arange(3))
    assert "another program" in refused(archive.getvalue(), tmp_path)
    archive = io.BytesIO()
    np.savez(archive, header=np.array([{}], dtype=object))
    refused(archive.getvalue(), tmp_path)


def test_truncated_anywhere(content: bytes, tmp_path: Path) -> None:
    draw = random.Random(0)
    sizes = [1, 100, len(content) // 2, len(content) - 1, *(draw.randrange(len(content)) for _ in range(30))]
    for size in sizes:
        refused(content[:size], tmp_path)


def test_a_flipped_bit_is_found_or_harmless(content: bytes, record: Record, tmp_path: Path) -> None:
    draw = random.Random(1)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        heads = [member.header_offset + at for member in archive.infolist() for at in range(0, 180, 7)]
        directory = range(archive.start_dir, len(content), 11)
    file = tmp_path / "x.npz"
    harmless = 0
    for at in [*heads, *directory, *(draw.randrange(len(content)) for _ in range(100))]:
        flipped = bytearray(content)
        flipped[at] ^= 1 << draw.randrange(8)
        file.write_bytes(flipped)
        with contextlib.suppress(InputError):
            found = load_record(file)
            harmless += 1
            if harmless % 20 == 1:
                assert_same(found, record)
    assert harmless < 300  # dates and attributes of the archive's members, which nothing reads


Arrays = dict[str, Any]


def remade(content: bytes, change: Callable[[Arrays], None], *, compression: int = zipfile.ZIP_STORED) -> bytes:
    """The record with something changed and the checksum made to fit again."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        arrays: Arrays = {name: stored[name].copy() for name in stored.files}
    header = json.loads(arrays.pop("header").tobytes())
    arrays["json"] = header
    change(arrays)
    header = arrays.pop("json")
    if isinstance(header, dict) and "sha256" in header:
        header["sha256"] = record_file._checksum(header, arrays)
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", compression) as archive:
        for name, values in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.asarray(values), version=(1, 0))
            archive.writestr(f"{name}.npy", member.getvalue())
    return out.getvalue()


def test_remade_without_a_change_it_is_read(content: bytes, record: Record, tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_bytes(remade(content, lambda arrays: None))
    assert_same(load_record(tmp_path / "x.npz"), record)


def test_a_header_without_a_nullable_column_reads_as_unknown(content: bytes, tmp_path: Path) -> None:
    changed = remade(content, lambda arrays: arrays["json"]["result"].pop("guaranteed_miss_m"))
    (tmp_path / "x.npz").write_bytes(changed)
    assert load_record(tmp_path / "x.npz").result.guaranteed_miss_m.mask.all()


def test_a_record_without_a_kind_of_sensor_has_no_measurement_of_it(content: bytes, tmp_path: Path) -> None:
    def without_rates(arrays: Arrays) -> None:
        del arrays["rate_measured"], arrays["measured_rate_rad_s"]

    (tmp_path / "x.npz").write_bytes(remade(content, without_rates))
    assert all(set(step.measured) <= {"angle", "range"} for step in load_record(tmp_path / "x.npz").steps)


def put(name: str, at: int, value: object) -> Callable[[Arrays], None]:
    def change(arrays: Arrays) -> None:
        arrays[name][at] = value

    return change


def header(**values: object) -> Callable[[Arrays], None]:
    return lambda arrays: arrays["json"].update(values)


def result(**values: object) -> Callable[[Arrays], None]:
    return lambda arrays: arrays["json"]["result"].update(values)


def cast(name: str, kind: str) -> Callable[[Arrays], None]:
    return lambda arrays: arrays.update({name: arrays[name].astype(kind)})


def shorter(name: str) -> Callable[[Arrays], None]:
    return lambda arrays: arrays.update({name: arrays[name][:-1]})


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (lambda arrays: arrays.update(extra=np.zeros(3)), "another program"),
        (lambda arrays: arrays.pop("time_s"), "has no time_s.npy"),
        (header(schema=1), "has the schema 1"),
        (header(schema=True), "has the schema true"),
        (header(schema=[1]), "has the schema"),
        (header(format="other"), "has no format infoset-record"),
        (lambda arrays: arrays.update(json=[1]), "has no format infoset-record"),
        (lambda arrays: arrays["json"].pop("seed"), "its header is wrong: seed: Field required"),
        (lambda arrays: arrays["json"].pop("version"), "its header has no key version"),
        (header(more=1), "more: "),
        (header(seed=-1), "seed: "),
        (header(seed=True), "seed: "),
        (header(seed=0.5), "seed: "),
        (header(run=2**63), "run: "),
        (header(strategy=3), "strategy"),
        (header(strategy="\x1b[2J"), "control characters"),
        (header(strategy="x" * 201), "strategy: "),
        (header(inconsistency={"step": 10**6, "label_m": 1.0}), "not at a step"),
        (header(inconsistency={"step": 1, "label_m": 1e300}), "not at a step"),
        (header(inconsistency={"step": 1}), "inconsistency.label_m: "),
        (header(strategy="\ud800"), "control characters"),
        (header(scenario=5), "its header is wrong: scenario: must be text, found 5;"),
        (header(scenario="schema = 1"), "the scenario in it"),
        (header(scenario="\ud800"), "the scenario in it"),
        (header(scenario="x = ["), "is not valid TOML"),
        (header(result=[]), "wrong result"),
        (result(miss_m=math.nan), "wrong result"),
        (result(miss_m="1"), "wrong result"),
        (result(miss_m=True), "wrong result"),
        (result(more=1), "wrong result"),
        (result(truth_kept=1), "wrong result"),
        (result(truth_margin_m=-1.0), "truth_kept contradicts truth_margin_m"),
        (result(outcome="won"), "outcome"),
        (result(outcome=[]), "outcome"),
        (result(position_m=[1.0]), "wrong result"),
        (result(position_m=[1.0, [2.0]]), "wrong result"),
        (put("time_s", 0, math.nan), "a number that is not finite"),
        (put("vertex_v_m_s_z_m", 0, math.inf), "a number that is not finite"),
        (
            put("vertex_v_m_s_z_m", 0, 1e300),
            "vertex_v_m_s_z_m holds a number that is not finite, or more than 1e+60 in size",
        ),
        (put("impulse_m_s", 1, -1e300), "impulse_m_s holds a number that is not finite, or more than 1e+60 in size"),
        (put("predicted_miss_m", 0, 1e200), "predicted_miss_m holds a number that is not finite, or more"),
        (put("measured_range_m", 0, -1.0), "measured_range_m holds a range below 0"),
        (put("true_range_m", 0, -1.0), "true_range_m holds a range below 0"),
        (put("section_range_m", 0, 1e-100), "section_range_m holds a range below 1e-25"),
        (result(miss_m=1e308), "wrong result"),
        (result(miss_m=-1.0), "miss_m: must be at least 0"),
        (result(impulse_m_s=-1.0), "impulse_m_s: must be at least 0"),
        (result(guaranteed_miss_m=-1.0), "guaranteed_miss_m: must be at least 0"),
        (result(truth_margin_m=-1e300), "wrong result"),
        (result(position_m=[1e300, 1.0]), "wrong result"),
        (put("time_s", 3, 0.0), "time_s does not rise"),
        (put("time_s", 0, -1e-120), "time_s does not rise from a time of at least 0"),
        (lambda arrays: arrays.update(time_s=np.float64(1.0)), "holds float64 of shape (), not <f8 of shape (n,);"),
        (put("section_offsets", 0, 1), "section_offsets does not run"),
        (put("section_offsets", 5, -1), "section_offsets does not run"),
        (put("section_offsets", 5, 2**63 - 1), "section_offsets does not run"),
        (put("section_offsets", 5, 0), "section_offsets does not rise"),
        (put("section_offsets", -1, 7), "section_offsets does not run"),
        (put("vertex_offsets", 1, 0), "vertex_offsets does not rise"),
        (put("section_range_m", 0, 0.0), "section_range_m holds a range below 1e-25"),
        (shorter("impulse_m_s"), "impulse_m_s has"),
        (shorter("vertex_offsets"), "vertex_offsets has"),
        (shorter("vertex_v_m_s_z_m"), "vertex_offsets does not run"),
        (cast("time_s", "<f4"), "holds float32 of shape"),
        (cast("time_s", ">f8"), "holds >f8 of shape"),
        (cast("section_offsets", "<i4"), "holds int32 of shape (7,), not <i8 of shape (n,);"),
        (lambda arrays: arrays.update(predicted_miss_m=np.zeros((6, 3))), "shape"),
        (lambda arrays: arrays.update(predicted_miss_m=np.asfortranarray(arrays["predicted_miss_m"])), "shape"),
        (lambda arrays: arrays.update({name: values[:0] for name, values in arrays.items() if name != "json"}), "rows"),
        (lambda arrays: arrays.update(impulse_y_m_s=np.zeros(6)), "in a plane, and it has impulse_y_m_s.npy"),
        (result(lateral_start=[0.0, 0.0]), "start_y_m is known in a plane"),
    ],
)
def test_what_does_not_fit_together(
    change: Callable[[Arrays], None], part: str, content: bytes, tmp_path: Path
) -> None:
    assert part in refused(remade(content, change), tmp_path)


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (lambda arrays: arrays.pop("impulse_y_m_s"), "in space, and it has no impulse_y_m_s.npy"),
        (lambda arrays: arrays.pop("measured_angle_y_rad"), "in space, and it has no measured_angle_y_rad.npy"),
        (lambda arrays: [arrays.pop(name) for name in [*arrays] if "_y_" in name], "it has no impulse_y_m_s.npy"),
        (lambda arrays: arrays["json"]["result"].pop("lateral_miss"), "miss_y_m is unknown in space"),
        (result(lateral_miss=[None, 1.0]), "miss_y_m is unknown in space"),
        (result(lateral_start=[1.0, None]), "start_vy_m_s is unknown in space"),
        (result(lateral_start=[1.0]), "wrong result"),
        (result(lateral_miss=[1e300, 1.0]), "lateral_miss.0: must be"),
        (put("true_angle_y_rad", 0, math.nan), "true_angle_y_rad holds a number that is not finite"),
        (
            put("vertex_v_m_s_y_m", 0, 1e300),
            "vertex_v_m_s_y_m holds a number that is not finite, or more than 1e+60 in size",
        ),
        (put("vertex_y_offsets", 1, 0), "vertex_y_offsets does not rise"),
        (put("vertex_y_offsets", 5, 2**63 - 1), "vertex_y_offsets does not run"),
        (shorter("vertex_v_m_s_y_m"), "vertex_y_offsets does not run"),
        (shorter("vertex_y_offsets"), "vertex_y_offsets has"),
        (shorter("impulse_y_m_s"), "impulse_y_m_s has 5 rows, not 6"),
        (cast("impulse_y_m_s", "<f4"), "holds float32 of shape"),
        (lambda arrays: arrays.update(predicted_miss_y_m=np.zeros((6, 3))), "shape"),
    ],
)
def test_members_of_y_that_do_not_fit(
    change: Callable[[Arrays], None], part: str, spatial_content: bytes, tmp_path: Path
) -> None:
    assert part in refused(remade(spatial_content, change), tmp_path)


def test_a_record_in_space_without_a_kind_of_sensor_has_no_measurement_of_it(
    spatial_content: bytes, tmp_path: Path
) -> None:
    def without_rates(arrays: Arrays) -> None:
        for name in ("rate_measured", "measured_rate_rad_s", "measured_rate_y_rad_s"):
            del arrays[name]

    (tmp_path / "x.npz").write_bytes(remade(spatial_content, without_rates))
    steps = load_record(tmp_path / "x.npz").steps
    assert all(set(axis.measured) <= {"angle", "range"} for step in steps for axis in step.axes.values())


def test_contents_that_were_changed(content: bytes, tmp_path: Path) -> None:
    with np.load(io.BytesIO(content)) as stored:
        arrays = {name: stored[name].copy() for name in stored.files}
    arrays["impulse_m_s"][0] += 1e-9
    out = io.BytesIO()
    np.savez(out, **arrays)
    assert "checksum" in refused(out.getvalue(), tmp_path)


def test_a_compressed_archive_is_not_unpacked(content: bytes, tmp_path: Path) -> None:
    assert "compressed" in refused(remade(content, lambda _: None, compression=zipfile.ZIP_DEFLATED), tmp_path)


def with_members(content: bytes, members: Mapping[str, bytes]) -> bytes:
    """The record with other bytes of members, or with further members."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as archive, zipfile.ZipFile(out, "w") as changed:
        for name in archive.namelist():
            changed.writestr(name, members.get(name, archive.read(name)))
        for name in members.keys() - set(archive.namelist()):
            changed.writestr(name, members[name])
    return out.getvalue()


def array_bytes(head: bytes, data: bytes = b"") -> bytes:
    return b"\x93NUMPY\x01\x00" + (len(head) + 1).to_bytes(2, "little") + head + b"\n" + data


@pytest.mark.parametrize(
    ("name", "member", "part"),
    [
        ("time_s.npy", array_bytes(b"{'descr': '<f8', 'fortran_order': False, 'shape': (10**9,), }"), "is damaged"),
        (
            "time_s.npy",
            array_bytes(b"{'descr': '<f8', 'fortran_order': False, 'shape': (999999999999,), }"),
            "time_s.npy holds 0 bytes",
        ),
        ("time_s.npy", b"", "record: time_s.npy is damaged (EOF: reading magic string, expected 8 bytes got 0);"),
        ("time_s.npy", array_bytes(b"-" * 9000 + b"1"), "record: time_s.npy is damaged (MemoryError);"),
        (
            "truth_margin_known.npy",
            array_bytes(b"{'descr': '|b1', 'fortran_order': False, 'shape': (6,), }", b"\0\1\2\0\1\1"),
            "truth_margin_known.npy holds flags other than 0 and 1;",
        ),
        ("time_s", b"", 'it has a member "time_s": another program wrote it'),
        (
            "header.npy",
            array_bytes(b"{'descr': '|u1', 'fortran_order': False, 'shape': (1,), }", b"{"),
            "is not JSON (",
        ),
    ],
)
def test_a_damaged_member(name: str, member: bytes, part: str, content: bytes, tmp_path: Path) -> None:
    message = refused(with_members(content, {name: member}), tmp_path)
    assert part in message
    assert len(message) < len(str(tmp_path)) + 400


def test_a_member_twice(content: bytes, tmp_path: Path) -> None:
    out = io.BytesIO(content)
    with zipfile.ZipFile(out, "a") as archive, pytest.warns(UserWarning, match="Duplicate name"):
        archive.writestr("time_s.npy", archive.read("time_s.npy"))
    assert "it has a member twice;" in refused(out.getvalue(), tmp_path)


def test_no_archive_has_a_reason(tmp_path: Path) -> None:
    assert "record: it is not a complete .npz archive (File is not a zip file);" in refused(b"PK\x03\x04", tmp_path)


@pytest.mark.parametrize("error", [EOFError(), AssertionError(), OSError("a\nb" + "c" * 500)])
def test_an_error_of_the_reader_of_archives_has_a_short_reason(
    error: Exception, content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> bytes:
        raise error

    monkeypatch.setattr(zipfile.ZipFile, "read", fail)
    reason = ("a b" + "c" * 197) if isinstance(error, OSError) else type(error).__name__
    assert f"record: it is not a complete .npz archive ({reason});" in refused(content, tmp_path)


@pytest.mark.parametrize("error", [MemoryError, KeyError, AttributeError])
@pytest.mark.parametrize("stage", ["_checksum", "_to_record"])
def test_errors_of_the_program_are_not_errors_of_the_file(
    stage: str, error: type[Exception], content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise error("steps")

    monkeypatch.setattr(record_file, stage, fail)
    (tmp_path / "x.npz").write_bytes(content)
    with pytest.raises(error):
        load_record(tmp_path / "x.npz")


def test_too_little_memory_for_the_archive_is_not_an_error_of_the_file(
    content: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(zipfile.ZipFile, "read", fail)
    (tmp_path / "x.npz").write_bytes(content)
    with pytest.raises(MemoryError):
        load_record(tmp_path / "x.npz")
