"""Records: every value comes back bit for bit, and what is damaged, foreign or hostile is refused
with one message.
"""

from __future__ import annotations

import dataclasses
import io
import json
import math
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset import InformationSetView, Model, RateSensor, Section
from infoset.experiments.common.errors import InputError
from infoset.experiments.interception import record_file
from infoset.experiments.interception.record_file import load_record, write_record
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import LineOfSight, NoiseKind, Situation
from infoset.sim import Record, Scenario, WrongImages, fly_one
from infoset.sim.versions import versions
from tests.long_steps import with_long_steps
from tests.records import first_steps
from tests.space import in_space

Arrays = dict[str, Any]
Change = Callable[[Arrays], object]


class Idle:
    """A strategy that is not registered."""

    def start(self, shape: tuple[int, int]) -> None:
        return None

    def decide(self, situation: Situation, state: object) -> Any:
        return np.zeros_like(situation.last_impulse_m_s)


OUTLIER_AT = 60


class Outlier:
    """Measures without errors, except for one angle that is wrong by five times its bound."""

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Any]:
        errors = {"angle": 5.0 if sight.step == OUTLIER_AT else 0.0, "rate": 0.0}
        return {
            name: sight.sensors[name].measured(sight, errors[name])
            for name in sight.sensors
            if name in errors
        }


@pytest.fixture(scope="module")
def record() -> Record:
    """The beginning of an engagement in space."""
    whole = fly_one(in_space(load_scenario("asteroid-1997")), 3, seed=11)
    return first_steps(whole, 6)


@pytest.fixture(scope="module")
def content(record: Record, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    file = tmp_path_factory.mktemp("record") / "x.npz"
    write_record(record, file)
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
    assert message.isprintable()
    assert len(message) < len(str(tmp_path)) + 500
    return message


def assert_same_section(one: Section, other: Section) -> None:
    assert (one.label_m, one.range_m, one.closing_speed_m_s) == (
        other.label_m,
        other.range_m,
        other.closing_speed_m_s,
    )
    assert np.array_equal(one.polygons.counts, other.polygons.counts)
    assert np.array_equal(one.polygons.vertices, other.polygons.vertices)


def assert_same(one: Record, other: Record) -> None:
    for name in ("scenario", "versions", "seed", "run", "strategy", "noise", "inconsistency"):
        assert getattr(one, name) == getattr(other, name)
    for field in dataclasses.fields(one.result):
        a = getattr(one.result, field.name)
        b = getattr(other.result, field.name)
        if np.ma.isMaskedArray(a):
            assert np.ma.getmaskarray(a).tolist() == np.ma.getmaskarray(b).tolist()
            a = a.filled(0.0)
            b = b.filled(0.0)
        assert np.array_equal(a, b)
        assert getattr(a, "dtype", None) == getattr(b, "dtype", None)
    for name in ("time_s", "true_range_m", "true_angle_rad", "true_rate_rad_s", "impulse_m_s"):
        assert np.array_equal(getattr(one, name), getattr(other, name))
    for name in ("predicted_miss_m", "truth_margin_m"):
        assert np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True)
    assert one.measured.keys() == other.measured.keys()
    assert all(
        np.array_equal(one.measured[name], other.measured[name], equal_nan=True)
        for name in one.measured
    )
    assert [*map(len, one.sections)] == [*map(len, other.sections)]
    for mine, others in zip(one.sections, other.sections, strict=True):
        for a, b in zip(mine, others, strict=True):
            assert_same_section(a, b)


def with_rates(name: str) -> Any:
    return dataclasses.replace(
        with_long_steps(load_scenario(name)), rate_sensor=RateSensor(1.0, 1e-6)
    )


def with_wrong_image(scenario: Scenario) -> Scenario:
    """A scenario whose set allows for one wrong image, and has one."""
    settings = dataclasses.replace(
        scenario.information_set, model=Model.GUARANTEED, initial_set=None, wrong_images=1
    )
    return dataclasses.replace(
        scenario, information_set=settings, wrong_images=WrongImages(1, size=(20.0, 20.0))
    )


RECORDS: dict[str, Callable[[], Record]] = {
    "plane": lambda: fly_one(with_long_steps(load_scenario("asteroid-1997")), 1, seed=2**70),
    "game": lambda: fly_one(
        dataclasses.replace(load_scenario("asteroid-1997-single"), noise=NoiseKind.GAME)
    ),
    "space": lambda: fly_one(in_space(with_rates("asteroid-1997")), 1),
    "own strategy": lambda: fly_one(
        with_long_steps(load_scenario("asteroid-1997")), strategy=Idle()
    ),
    "wrong image": lambda: fly_one(with_wrong_image(load_scenario("asteroid-1997"))),
    "contradiction": lambda: fly_one(
        dataclasses.replace(
            load_scenario("asteroid-1997-single"), rate_sensor=RateSensor(1.0, 1e-6)
        ),
        noise=Outlier(),
    ),
}


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_comes_back_bit_for_bit(name: str, tmp_path: Path) -> None:
    flown = RECORDS[name]()
    write_record(flown, tmp_path / "x.npz")
    found = load_record(tmp_path / "x.npz")
    assert_same(found, flown)
    assert found.versions == versions()
    assert [each.name for each in tmp_path.iterdir()] == ["x.npz"]
    if name == "contradiction":
        assert found.inconsistency is not None
        assert found.inconsistency.step == OUTLIER_AT
        assert found.noise == "Outlier"
    if name == "wrong image":
        assert len(found.suspected_s) == 1
        assert found.suspected_s == flown.suspected_s
        assert found.result.to_dict() == flown.result.to_dict()
    if name == "own strategy":
        assert found.strategy == f"{Idle.__module__}.Idle"


def test_unknown_values_are_unknown_after_reading(record: Record, tmp_path: Path) -> None:
    begun = first_steps(record, 3)
    unknown = np.ma.MaskedArray([0.0], mask=[True])
    result = dataclasses.replace(record.result, guaranteed_miss_m=unknown, truth_margin_m=unknown)
    changed = dataclasses.replace(
        begun,
        measured={name: values * np.nan for name, values in begun.measured.items()},
        predicted_miss_m=begun.predicted_miss_m * np.nan,
        truth_margin_m=begun.truth_margin_m * np.nan,
        result=result,
    )
    write_record(changed, tmp_path / "x.npz")
    found = load_record(tmp_path / "x.npz")
    assert_same(dataclasses.replace(found, sections=changed.sections), changed)
    assert np.isfinite(
        found.sections[0][0].polygons.vertices
    ).all()  # of a set that nothing was measured of


def test_the_file_is_an_archive_of_numpy_that_depends_on_the_record_only(
    record: Record, content: bytes, tmp_path: Path
) -> None:
    write_record(record, tmp_path / "y.npz")
    assert (tmp_path / "y.npz").read_bytes() == content
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        header = json.loads(arrays["header"].tobytes())
        assert header["scenario"]["name"] == record.scenario.name
        assert arrays["impulse_m_s"].shape == (6, 2)
        assert arrays["header"].size < record_file.MAX_HEADER_BYTES / 100


def test_file_beyond_the_size_limit_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(record_file, "MAX_FILE_BYTES", 10)
    (tmp_path / "y.npz").write_bytes(b"x" * 11)
    with pytest.raises(InputError, match="has more than 10 bytes"):
        load_record(tmp_path / "y.npz")


def archive(**arrays: Any) -> bytes:
    out = io.BytesIO()
    np.savez(out, **arrays)
    return out.getvalue()


def test_file_of_another_kind_is_refused(content: bytes, tmp_path: Path) -> None:
    foreign = [
        b"",
        b"x",
        b"PK\x03\x04",
        b"\x93NUMPY\x01\x00",
        b"\0" * 1000,
        archive(a=np.arange(3)),
    ]
    foreign += [archive(header=np.array([{}], dtype=object)), content + content[-100:]]
    draw = random.Random(0)
    sizes = [
        1,
        100,
        len(content) // 2,
        len(content) - 1,
        *(draw.randrange(len(content)) for _ in range(30)),
    ]
    for each in [*foreign, *(content[:size] for size in sizes)]:
        refused(each, tmp_path)


def remade(content: bytes, change: Change) -> bytes:
    """The record with changed arrays; `json` is its header as values."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        arrays: Arrays = {name: stored[name].copy() for name in stored.files}
    arrays["json"] = json.loads(arrays["header"].tobytes())
    change(arrays)
    text = arrays.pop("json")
    if "header" in arrays:
        text = text if isinstance(text, bytes) else json.dumps(text).encode()
        arrays["header"] = np.frombuffer(text, dtype=np.uint8)
    return archive(**arrays)


def put(name: str, at: Any, value: object) -> Change:
    def change(arrays: Arrays) -> None:
        arrays[name][at] = value

    return change


def header(**values: object) -> Change:
    return lambda arrays: arrays["json"].update(values)


def new(name: str, values: Callable[[Any], Any]) -> Change:
    return lambda arrays: arrays.update({name: values(arrays[name])})


def without_steps(arrays: Arrays) -> None:
    for name, values in arrays.items():
        if name not in ("json", "header"):
            arrays[name] = values[:0]


def scenario_without(arrays: Arrays, table: str) -> None:
    arrays["json"]["scenario"].pop(table)


CHANGES: list[tuple[Change, str]] = [
    # members
    (lambda arrays: arrays.update(extra=np.zeros(3)), "its members are not those of a record"),
    (lambda arrays: arrays.pop("time_s"), "its members are not those of a record"),
    # the header
    (lambda arrays: arrays.update(json=b"{"), ""),
    (lambda arrays: arrays.update(json=b"[" * 100_000), ""),
    (
        lambda arrays: arrays.update(json=b" " * (record_file.MAX_HEADER_BYTES + 1)),
        "its header is too long",
    ),
    (lambda arrays: arrays["json"].pop("seed"), "seed: Field required"),
    (lambda arrays: scenario_without(arrays, "thruster"), "scenario.thruster: Field required"),
    (
        lambda arrays: arrays["json"]["scenario"].update(nominal_range_m=-1.0),
        "scenario.nominal_range_m: ",
    ),
    (header(more=1), "more: "),
    (header(seed=-1), "seed: "),
    (header(seed=True), "seed: "),
    (header(seed=0.5), "seed: "),
    (header(run=2**63), "run: "),
    (header(strategy="\x1b[2J"), "control characters"),
    (header(strategy="\ud800"), "control characters"),
    (header(outcome="won"), "outcome"),
    (header(inconsistency={"step": 6, "label_m": 1.0}), "not at a step"),
    (header(inconsistency={"step": 1, "label_m": 1e300}), "not at a step"),
    # values
    (put("time_s", 0, math.nan), "time_s has a number beyond"),
    (put("impulse_m_s", 0, math.nan), "impulse_m_s has a number beyond"),
    (put("result_miss_m", 0, math.nan), "result_miss_m has a number beyond"),
    (put("measured_angle_rad", 0, 1e300), "measured_angle_rad has a number beyond"),
    (put("predicted_miss_m", 0, 1e300), "predicted_miss_m has a number beyond"),
    (put("time_s", 3, 0.0), "time_s does not increase"),
    # shapes and types
    (new("impulse_m_s", lambda values: values[:-1]), "of shape"),
    (new("time_s", lambda values: values[:-1]), "of shape"),
    (new("time_s", lambda values: values.astype("<f4")), "time_s is <f4"),
    (new("time_s", lambda values: values.astype(object)), "allow_pickle=False"),
    (new("time_s", lambda values: np.float64(1.0)), "of shape ()"),
    (new("impulse_m_s", lambda values: values[:, :1]), "of shape (6, 1)"),
    (without_steps, "shape"),
]


def test_record_written_again_is_read(content: bytes, record: Record, tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_bytes(remade(content, lambda arrays: None))

    assert_same(load_record(tmp_path / "x.npz"), record)


@pytest.mark.parametrize(("change", "part"), CHANGES)
def test_changed_record_is_refused(
    change: Change, part: str, content: bytes, tmp_path: Path
) -> None:
    assert part in refused(remade(content, change), tmp_path)


def array_bytes(head: bytes, data: bytes = b"") -> bytes:
    return b"\x93NUMPY\x01\x00" + (len(head) + 1).to_bytes(2, "little") + head + b"\n" + data


MEMBERS = {
    "10 GB": array_bytes(b"{'descr': '<f8', 'fortran_order': False, 'shape': (1250000000,), }"),
    "10 PB": array_bytes(
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (1250000000000000,), }"
    ),
    "empty": b"",
    "nested": array_bytes(b"-" * 9000 + b"1"),
    "pickle": array_bytes(
        b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }", b"\x80\x04N."
    ),
}


@pytest.mark.parametrize("name", MEMBERS)
def test_damaged_member_is_refused(name: str, content: bytes, tmp_path: Path) -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as stored, zipfile.ZipFile(out, "w") as changed:
        for member in stored.namelist():
            changed.writestr(
                member, MEMBERS[name] if member == "time_s.npy" else stored.read(member)
            )
    refused(out.getvalue(), tmp_path)


def test_compressed_or_double_members_are_refused(content: bytes, tmp_path: Path) -> None:
    with np.load(io.BytesIO(content)) as stored:
        out = io.BytesIO()
        np.savez_compressed(out, **{name: stored[name] for name in stored.files})
    assert "compressed" in refused(out.getvalue(), tmp_path)
    out = io.BytesIO(content)
    with zipfile.ZipFile(out, "a") as twice, pytest.warns(UserWarning, match="Duplicate name"):
        twice.writestr("time_s.npy", twice.read("time_s.npy"))
    assert "its members are not those of a record" in refused(out.getvalue(), tmp_path)


STEPS_OF_TEN_THOUSAND_SECTIONS = 51
"""Number of steps with 10 000 sections that is just above the limit of half a million."""


def test_record_of_too_many_sections_and_steps_is_refused(content: bytes, tmp_path: Path) -> None:
    """The sections are computed again and take memory, whatever the size of the file is."""
    with np.load(io.BytesIO(content)) as stored:
        arrays = {name: stored[name] for name in stored.files}
    header = json.loads(arrays["header"].tobytes())
    header["scenario"]["information_set"]["sections"] = 10_000
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    steps = len(arrays["time_s"])
    for name, values in arrays.items():
        if len(values) == steps and name != "header":
            arrays[name] = np.resize(values, (STEPS_OF_TEN_THOUSAND_SECTIONS, *values.shape[1:]))
    arrays["time_s"] = np.arange(STEPS_OF_TEN_THOUSAND_SECTIONS, dtype=np.float64)
    out = io.BytesIO()
    np.savez(out, **arrays)

    message = refused(out.getvalue(), tmp_path)

    assert "it has 10000 sections in 51 steps, and their product may be at most 500000" in message


def test_record_too_large_to_be_read_is_not_written(record: Record, tmp_path: Path) -> None:
    settings = dataclasses.replace(record.scenario.information_set, sections=10_000)
    large = dataclasses.replace(
        record,
        scenario=dataclasses.replace(record.scenario, information_set=settings),
        time_s=np.arange(STEPS_OF_TEN_THOUSAND_SECTIONS, dtype=np.float64),
    )
    with pytest.raises(InputError, match=r"^record: it has 10000 sections in 51 steps"):
        write_record(large, tmp_path / "x.npz")
    assert not any(tmp_path.iterdir())
