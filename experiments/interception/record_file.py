"""Records of engagements as `.npz` files: a JSON header and plain arrays, no pickle.

The members of the archive are stored, not compressed, so that no file can contain more than its size. The sets are
flat arrays of vertices with offsets. A value that is not known in a step has a mask. The record of an engagement in
space has further members, those of the y axis; the members that a record in a plane also has are those of the z axis.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import math
import os
import warnings
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, make_dataclass
from enum import Enum
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from experiments.common.errors import InputError, input_errors, on_a_screen, shown
from experiments.common.file_kinds import ZIP, read_input, use_of_content
from experiments.common.input_file import read_text, to_toml
from experiments.common.output import library_version, write_file
from infoset import ConvexPolygons, Section
from infoset.arrays import Floats, Integers
from infoset.limits import MAXIMUM
from infoset.sensors import SENSORS
from infoset.set_queries import MIN_RANGE_M
from sim import AxisStep, Inconsistency, Record, Results, Scenario, StepRecord
from sim.columns import Column, columns_of, columns_with_values, values_of
from sim.storage.codec import from_json, to_json

FORMAT = "infoset-record"
SCHEMA = 2
MAX_FILE_BYTES = 1 << 30
MAX_HEADER_BYTES = 1_000_000
LONGEST_NAME, LONGEST_LIBRARY_REASON, LONGEST_REASON = 200, 200, 1000
REMEDY = "make a record with `infoset engage --record FILE.npz`"

Arrays = dict[str, NDArray[Any]]


class Member(NamedTuple):
    """An array of a record."""

    kind: str
    """Type of its elements."""
    rows: Literal["steps", "steps + 1", "sections", "sections + 1", ""]
    """Length; empty if it follows from other members."""
    columns: tuple[int, ...] = ()
    """Further dimensions."""
    along_y: str = ""
    """Name of the same array of the y axis, in space only."""


FLOAT, FLAG, COUNT, BYTE = "<f8", "|b1", "<i8", "|u1"
_OF_AXIS = ("true_angle_rad", "true_rate_rad_s", "impulse_m_s")
"""Numbers of each step and axis that are always known: names of members and of fields of `AxisStep`."""
_MEASURED: dict[str, Member] = {}
"""Members of the sensors; a record written before a kind of sensor was added lacks those of that kind."""
for _sensor in SENSORS:
    _values = f"measured_{_sensor.quantity}"
    _along_y = _values.replace(_sensor.name, f"{_sensor.name}_y") if _sensor.is_lateral else ""
    _MEASURED[f"{_sensor.name}_measured"] = Member(FLAG, "steps")
    _MEASURED[_values] = Member(FLOAT, "steps", along_y=_along_y)
MEMBERS: dict[str, Member] = {
    "header": Member(BYTE, ""),
    "time_s": Member(FLOAT, "steps"),
    **_MEASURED,
    "true_angle_rad": Member(FLOAT, "steps", along_y="true_angle_y_rad"),
    "true_rate_rad_s": Member(FLOAT, "steps", along_y="true_rate_y_rad_s"),
    "true_range_m": Member(FLOAT, "steps"),
    "impulse_m_s": Member(FLOAT, "steps", along_y="impulse_y_m_s"),
    "predicted_miss_exists": Member(FLAG, "steps"),
    "predicted_miss_m": Member(FLOAT, "steps", (2,), "predicted_miss_y_m"),
    "truth_margin_known": Member(FLAG, "steps"),
    "truth_margin_m": Member(FLOAT, "steps"),
    "section_offsets": Member(COUNT, "steps + 1"),
    "section_label_m": Member(FLOAT, "sections"),
    "section_range_m": Member(FLOAT, "sections"),
    "vertex_offsets": Member(COUNT, "sections + 1", along_y="vertex_y_offsets"),
    "vertex_v_m_s_z_m": Member(FLOAT, "", (2,), "vertex_v_m_s_y_m"),
}
_REQUIRED = MEMBERS.keys() - _MEASURED.keys()
OF_Y = {name: member.along_y for name, member in MEMBERS.items() if member.along_y}
"""Members of the y axis, in space only, by those of the z axis."""
MEMBERS |= {along_y: MEMBERS[along_z] for along_z, along_y in OF_Y.items()}
_OFFSETS = {
    "section_offsets": ("section_label_m", 0),
    "vertex_offsets": ("vertex_v_m_s_z_m", 1),
    "vertex_y_offsets": ("vertex_v_m_s_y_m", 1),
}
"""By member of offsets: the member whose rows they divide, and the minimum number of rows between two offsets."""
_RESULT: dict[str, list[Column]] = {}
"""Columns of the result in the header by key; the two components of a start have one key."""
for _column in columns_of(Results):
    if _column.name not in ("run", "phi_held"):
        _RESULT.setdefault(_column.name if _column.component is None else _column.field, []).append(_column)
_LISTED_MEMBER = b"PK\x01\x02"
"""How an entry of an archive's list of members begins."""


def _value_type(column: Column) -> Any:
    def check(value: Any) -> Any:
        if isinstance(value, float) and (problem := column.limits.problem(value)):
            raise ValueError(problem)
        return value

    return Annotated[column.kind | None if column.nullable else column.kind, AfterValidator(check)]


_Result = make_dataclass(
    "_Result",
    [
        (key, _value_type(columns[0]) if len(columns) == 1 else tuple[tuple(map(_value_type, columns))])  # type: ignore[misc]
        for key, columns in _RESULT.items()
    ],
)
_Name = Annotated[str, Field(max_length=LONGEST_NAME)]


@dataclass(frozen=True)
class _Engagement:
    """Keys of the header that are fields of the record as they are."""

    seed: Annotated[int, Field(ge=0)]
    run: Annotated[int, Field(ge=0, lt=2**63)]
    strategy: _Name
    noise: _Name | None
    inconsistency: Inconsistency | None


def write_record(record: Record, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the record of an engagement as an `.npz` file, whole or not at all.

    Raises
    ------
    InputError
        If the file cannot be written, exists already, or no scenario file can contain the record's scenario.
    """
    file = record_path("record", Path(path))
    toml = to_toml(record.scenario)
    if read_text(Scenario, toml, f"the scenario of {file}") != record.scenario:
        raise InputError(
            f"{file}: the scenario {shown(record.scenario.name)} changes when it is written and read again; correct it"
        )
    arrays = _to_arrays(record)
    engagement = to_json(_Engagement(record.seed, record.run, record.strategy, record.noise, record.inconsistency))
    if record.noise is None:
        del engagement["noise"]
    header = {
        "format": FORMAT,
        "schema": SCHEMA,
        "version": library_version(),
        **engagement,
        "result": _result_to_json(record.result),
        "scenario": toml,
    }
    header["sha256"] = _checksum(header, arrays)
    text = json.dumps(header, allow_nan=False).encode()
    content = _pack({"header": np.frombuffer(text, dtype=np.uint8), **arrays})
    if len(content) > MAX_FILE_BYTES:
        raise InputError(
            f"{file}: the record would take {len(content)} bytes, more than the {MAX_FILE_BYTES} that can be read "
            "back; take fewer sections or longer steps"
        )
    write_file(file, content, overwrite=overwrite)


def load_record(path: str | os.PathLike[str]) -> Record:
    """Read the record of an engagement: equal, bit for bit, to the record that was written.

    Raises
    ------
    InputError
        If the file is not a record, or has changed since it was written.
    """
    file = Path(path)
    content = read_input(file, "record", MAX_FILE_BYTES, REMEDY, only_ordinary=True)
    try:
        arrays = _unpack(content)
        header = _read_header(arrays.pop("header"))
        if header.get("sha256") != _checksum(header, arrays):
            raise ValueError("its contents are not what was written (the checksum differs): the file is damaged")
        return _to_record(header, arrays)
    except RecursionError:
        reason = "its header is nested too deeply"
    except (ValueError, InputError) as error:
        reason = on_a_screen(str(error)[:LONGEST_REASON])
    use = None if content.startswith(ZIP) else use_of_content(content)
    raise InputError(f"{file}: {use or f'is not a readable record: {reason}; {REMEDY}'}")


@contextlib.contextmanager
def _library_errors(problem: str, *also: type[Exception]) -> Iterator[None]:
    """Turn any error of a library that reads a hostile file into a `ValueError`; `MemoryError` only if in `also`."""
    try:
        yield
    except Exception as error:
        if isinstance(error, MemoryError) and not isinstance(error, also):
            raise
        reason = " ".join(str(error).split())[:LONGEST_LIBRARY_REASON] or type(error).__name__
        raise ValueError(f"{problem} ({reason})") from None


def record_path(option: str, path: Path) -> Path:
    """Return a path, the value of an option, if it ends in ``.npz``; raise `InputError` otherwise."""
    if path.suffix != ".npz":
        raise InputError(f"{option}: {path} must end in .npz; for example {option} flight.npz")
    return path


def _to_arrays(record: Record) -> Arrays:
    steps = record.steps
    sections = [section for step in steps for section in step.sections]
    along_y = {}
    if record.scenario.is_spatial:
        polygons = [section.polygon_y for section in sections if section.polygon_y is not None]
        arrays = _of_axis([step.axes["y"] for step in steps], polygons)
        along_y = {name: arrays[along_z] for along_z, name in OF_Y.items()}
    return {
        **_of_axis([step.axes["z"] for step in steps], [section.polygon for section in sections]),
        **along_y,
        **_optional("truth_margin_known", "truth_margin_m", [step.truth_margin_m for step in steps]),
        "time_s": _floats(step.time_s for step in steps),
        "true_range_m": _floats(step.true_range_m for step in steps),
        "section_offsets": _offsets([len(step.sections) for step in steps]),
        "section_label_m": _floats(section.label_m for section in sections),
        "section_range_m": _floats(section.range_m for section in sections),
    }


def _of_axis(steps: Sequence[AxisStep], polygons: Sequence[ConvexPolygons]) -> Arrays:
    """Put the steps and the sections of one axis into arrays, named as those of the z axis."""
    vertices = [polygon.polygon() for polygon in polygons]
    arrays: Arrays = {name: _floats(getattr(step, name) for step in steps) for name in _OF_AXIS}
    for sensor in SENSORS:
        values = [step.measured.get(sensor.name) for step in steps]
        arrays |= _optional(f"{sensor.name}_measured", f"measured_{sensor.quantity}", values)
    return {
        **arrays,
        **_optional("predicted_miss_exists", "predicted_miss_m", [step.predicted_miss_m for step in steps], (0.0, 0.0)),
        "vertex_offsets": _offsets([len(outline) for outline in vertices]),
        "vertex_v_m_s_z_m": np.concatenate([np.empty((0, 2)), *vertices]),
    }


def _floats(values: Iterable[float]) -> Floats:
    return np.fromiter(values, dtype=np.float64)


def _optional(mask: str, name: str, values: Sequence[Any], unknown: Any = 0.0) -> Arrays:
    """Return the arrays of values that may be unknown: whether each is known, and its value."""
    known = np.array([value is not None for value in values], dtype=bool)
    return {mask: known, name: np.array([value or unknown for value in values], dtype=np.float64)}


def _offsets(counts: list[int]) -> Integers:
    return np.cumsum([0, *counts], dtype=np.int64)


def _result_to_json(result: Results) -> dict[str, object]:
    known = {column.field for column in columns_with_values(result)}
    values = {
        key: [values_of(result, column)[0] for column in columns]
        for key, columns in _RESULT.items()
        if columns[0].field in known
    }
    return {key: value[0] if len(value) == 1 else value for key, value in values.items()}


def _checksum(header: Mapping[str, object], arrays: Arrays) -> str:
    """Return the SHA-256 of everything but itself."""
    rest = {key: value for key, value in header.items() if key != "sha256"}
    digest = hashlib.sha256(json.dumps(rest, sort_keys=True).encode())
    for name in sorted(arrays):
        digest.update(f"\0{name}{arrays[name].shape}\0".encode())
        digest.update(np.ascontiguousarray(arrays[name]).tobytes())
    return digest.hexdigest()


def _pack(arrays: Arrays) -> bytes:
    """Return an `.npz` archive that depends only on its arrays."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
        for name in (name for name in MEMBERS if name in arrays):
            member = io.BytesIO()
            values = np.ascontiguousarray(arrays[name], dtype=np.dtype(MEMBERS[name].kind))
            np.lib.format.write_array(member, values, version=(1, 0), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0)), member.getvalue())
    return content.getvalue()


def _unpack(content: bytes) -> Arrays:
    """Read the members of an archive, none of which can be larger than the file."""
    if content.count(_LISTED_MEMBER) > 2 * len(MEMBERS):  # numbers may look like one, too
        raise ValueError("it has more members than any record")
    incomplete = "it is not a complete .npz archive"
    with _library_errors(incomplete):
        archive = zipfile.ZipFile(io.BytesIO(content))
    members = archive.infolist()
    names = [member.filename for member in members]
    unknown = set(names) - {f"{name}.npy" for name in MEMBERS}
    for name in sorted(unknown) + sorted({f"{name}.npy" for name in _REQUIRED} - set(names)):
        difference = f"a member {shown(name)}" if name in unknown else f"no {name}"
        raise ValueError(f"it has {difference}: another program wrote it")
    if len(names) != len(set(names)):
        raise ValueError("it has a member twice")
    if any(member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 1 for member in members):
        raise ValueError("it is compressed or encrypted; records are neither")
    if sum(member.file_size for member in members) > len(content):
        raise ValueError("its declared contents are larger than the file")
    arrays = {}
    for filename in names:
        with _library_errors(incomplete):
            array = archive.read(filename)
        arrays[filename.removesuffix(".npy")] = _read_array(array, filename.removesuffix(".npy"))
    return arrays


def _read_array(content: bytes, name: str) -> NDArray[Any]:
    """Read an array, whose header must not claim more than its content."""
    member, stream = MEMBERS[name], io.BytesIO(content)
    # Python's parser raises MemoryError for a header, at most 64 kB, that is nested too deeply.
    with _library_errors(f"{name}.npy is damaged", MemoryError), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the parser, about headers that are refused below
        np.lib.format.read_magic(stream)
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    data = content[stream.tell() :]
    fits = dtype == np.dtype(member.kind) and not fortran
    if not fits or len(shape) != 1 + len(member.columns) or shape[1:] != member.columns:
        wanted = str(("n", *member.columns)).replace("'", "")
        raise ValueError(f"{name}.npy holds {dtype} of shape {shape}, not {member.kind} of shape {wanted}")
    if len(data) != dtype.itemsize * math.prod(shape):
        raise ValueError(f"{name}.npy holds {len(data)} bytes, not those of {dtype} of shape {shape}")
    if member.kind == FLAG and data.strip(b"\0\1"):
        raise ValueError(f"{name}.npy holds flags other than 0 and 1")
    return np.frombuffer(data, dtype=dtype).reshape(shape)


def _read_header(header: NDArray[Any]) -> dict[str, Any]:
    if header.size > MAX_HEADER_BYTES:
        raise ValueError("its header is too long")
    with _library_errors("its header is not JSON"):
        values = json.loads(header.tobytes().decode())
    if not isinstance(values, dict) or values.get("format") != FORMAT:
        raise ValueError(f"its header has no format {FORMAT}: another program wrote it")
    if values.get("schema") != SCHEMA or isinstance(values["schema"], bool):
        found = shown(values.get("schema"))
        raise ValueError(f"it has the schema {found}, this version of infoset reads {SCHEMA}; update infoset")
    return values


def _to_record(header: Mapping[str, Any], arrays: Arrays) -> Record:
    known = dict(header)
    for key in ("version", "scenario", "result"):
        if key not in known:
            raise ValueError(f"its header has no key {key}")
    toml, columns, *_ = [known.pop(key) for key in ("scenario", "result", "format", "schema", "version", "sha256")]
    if not isinstance(toml, str):
        raise ValueError(f"its header is wrong: scenario: must be text, found {shown(toml)}")
    scenario = read_text(Scenario, toml, "the scenario in it")
    with input_errors("its header is wrong"):
        engagement = from_json(_Engagement, {"noise": None, **known})
    result = _result_from_json(columns, engagement.run, scenario)
    of_y = {along_y for along_z, along_y in OF_Y.items() if scenario.is_spatial and along_z in arrays}
    for name in sorted(of_y ^ (set(OF_Y.values()) & set(arrays))):
        where = "in space, and it has no" if name in of_y else "in a plane, and it has"
        raise ValueError(f"its scenario is {where} {name}.npy")
    steps = len(arrays["time_s"])
    arrays = {name: np.zeros(steps, dtype=member.kind) for name, member in _MEASURED.items()} | arrays
    _check(arrays)
    first = engagement.inconsistency
    if first is not None and not (0 <= first.step < steps and abs(first.label_m) <= MAXIMUM):
        raise ValueError("its header is wrong: inconsistency is not at a step of the record")
    return Record(scenario=scenario, result=result, steps=_to_steps(arrays, scenario), **vars(engagement))


def _check(arrays: Arrays) -> None:
    steps, sections = len(arrays["time_s"]), len(arrays["section_label_m"])
    sizes = {"steps": steps, "steps + 1": steps + 1, "sections": sections, "sections + 1": sections + 1}
    for name, values in arrays.items():
        wanted = sizes.get(MEMBERS[name].rows, len(values))
        if len(values) != wanted:
            raise ValueError(f"{name} has {len(values)} rows, not {wanted}")
        if values.dtype.kind == "f" and not (np.abs(values) <= MAXIMUM).all():
            raise ValueError(f"{name} holds a number that is not finite, or more than {MAXIMUM:g} in size")
    if steps == 0:
        raise ValueError("it has no step")
    if arrays["time_s"][0] < 0.0 or (np.diff(arrays["time_s"]) <= 0.0).any():
        raise ValueError("time_s does not rise from a time of at least 0")
    for name, (indexed, minimum) in _OFFSETS.items():
        if name not in arrays:
            continue
        offsets, size = arrays[name], len(arrays[indexed])
        # The ends are compared before the differences, and one by one: a difference may overflow.
        if offsets[0] != 0 or offsets[-1] != size or (offsets < 0).any() or (offsets > size).any():
            raise ValueError(f"{name} does not run from 0 to {size}")
        if (np.diff(offsets) < minimum).any():
            raise ValueError(f"{name} does not rise")
    for name, min_m in (("section_range_m", MIN_RANGE_M), ("measured_range_m", 0.0), ("true_range_m", 0.0)):
        if (arrays[name] < min_m).any():
            raise ValueError(f"{name} holds a range below {min_m:g}")


def _result_from_json(values: object, run: int, scenario: Scenario) -> Results:
    # A record written before a nullable column was added lacks it, and one in a plane the columns of space.
    unknown = {
        key: None if len(columns) == 1 else [None] * len(columns)
        for key, columns in _RESULT.items()
        if columns[0].nullable
    }
    if not isinstance(values, dict):
        raise ValueError("its header has a wrong result")
    fields: dict[str, Any] = {"runs": np.array([run]), "guarantees": scenario.set_model.is_guaranteed}
    try:
        stored = from_json(_Result, unknown | values)
    except ValueError as error:
        raise ValueError(f"its header has a wrong result: {error}") from None
    for key, value in vars(stored).items():
        columns = _RESULT[key]
        components = value if isinstance(value, tuple) else (value,)
        for column, component in zip(columns, components, strict=True):
            if column.optional and column.component is not None and (component is None) == scenario.is_spatial:
                state = "unknown in space" if component is None else "known in a plane"
                raise ValueError(f"its header has a wrong result: {column.name} is {state}")
        fields[columns[0].field] = _array(columns[0], components)
    kept = fields.pop("truth_kept")
    result = Results(**fields)
    if (result.truth_kept != kept).any():
        raise ValueError("its header has a wrong result: truth_kept contradicts truth_margin_m")
    return result


def _array(column: Column, values: Sequence[Any]) -> Any:
    """Return the values of a field of `Results` for a batch of one."""
    if issubclass(column.kind, Enum):
        return tuple(values)
    if column.nullable:
        unknown = [value is None for value in values]
        known = np.ma.MaskedArray([value or 0 for value in values], mask=unknown, dtype=column.kind)
        return known if column.component is None else known[None]
    return np.array(values if column.component is None else [values])


def _to_steps(arrays: Arrays, scenario: Scenario) -> tuple[StepRecord, ...]:
    along = {"z": arrays}
    if scenario.is_spatial:
        of_y = {along_z: arrays[along_y] for along_z, along_y in OF_Y.items() if along_y in arrays}
        along = {"y": arrays | of_y, "z": arrays}
    numbers = (arrays[name].tolist() for name in ("section_label_m", "section_range_m"))
    sections = [
        Section(label, now, scenario.set_model.closing_speed_m_s, *polygons)
        for label, now, *polygons in zip(*numbers, *map(_polygons, reversed(along.values())), strict=True)
    ]
    columns = (
        arrays["time_s"].tolist(),
        [dict(zip(along, step, strict=True)) for step in zip(*map(_axis_steps, along.values()), strict=True)],
        arrays["true_range_m"].tolist(),
        _known(arrays, "truth_margin_known", "truth_margin_m"),
        [tuple(sections[first:last]) for first, last in pairwise(arrays["section_offsets"].tolist())],
    )
    return tuple(StepRecord(*row) for row in zip(*columns, strict=True))


def _polygons(arrays: Arrays) -> list[ConvexPolygons]:
    vertices = arrays["vertex_v_m_s_z_m"]
    return [
        ConvexPolygons.unchecked(vertices[first:last].copy(), np.asarray(last - first))
        for first, last in pairwise(arrays["vertex_offsets"].tolist())
    ]


def _axis_steps(arrays: Arrays) -> list[AxisStep]:
    by_sensor = [_known(arrays, f"{sensor.name}_measured", f"measured_{sensor.quantity}") for sensor in SENSORS]
    columns = (
        [
            {sensor.name: value for sensor, value in zip(SENSORS, values, strict=True) if value is not None}
            for values in zip(*by_sensor, strict=True)
        ],
        *(arrays[name].tolist() for name in _OF_AXIS),
        [miss and tuple(miss) for miss in _known(arrays, "predicted_miss_exists", "predicted_miss_m")],
    )
    return [AxisStep(*row) for row in zip(*columns, strict=True)]


def _known(arrays: Arrays, mask: str, values: str) -> list[Any]:
    """Return the values of an array, None where they are not known."""
    return [
        value if known else None for known, value in zip(arrays[mask].tolist(), arrays[values].tolist(), strict=True)
    ]
