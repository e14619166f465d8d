"""Records of engagements as `.npz` files: a JSON header and plain arrays, no pickle.

The members of the archive are stored, not compressed, so that no file can hold more than its own size. The sets are
flat arrays of vertices with offsets. A value that is not known in a step has a mask. The record of an engagement in
space has further members, those of the y axis; the members that a record in a plane has, too, are those of the z axis.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import struct
import tokenize
import warnings
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from experiments.common.errors import InputError, shown
from experiments.common.file_kinds import ZIP, use_of_file, use_of_folder
from experiments.common.output import library_version, write_file
from experiments.interception.scenario_file import read_scenario, scenario_to_toml
from infoset import ConvexPolygons, Section
from infoset.limits import LARGEST, SMALLEST
from infoset.sensors import SENSORS
from sim import AxisStep, Inconsistency, Record, Results, Scenario, StepRecord
from sim.columns import Column, columns_of, columns_with_values, values_of
from sim.storage.codec import from_json, to_json

FORMAT = "infoset-record"
SCHEMA = 2
LARGEST_FILE_BYTES = 1 << 30
LARGEST_HEADER_BYTES = 1_000_000
LONGEST_NAME = 200
REMEDY = "make a record with `infoset engage --record FILE.npz`"

Floats = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]

_STEPS, _STEPS_2, _STEPS_AND_1, _SECTIONS, _SECTIONS_AND_1, _VERTICES_2, _ANY = range(7)
_FLOAT, _FLAG, _COUNT, _BYTE = "<f8", "|b1", "<i8", "|u1"

_OF_AXIS = ("true_angle_rad", "true_rate_rad_s", "impulse_m_s")
"""Numbers of each step and axis that are always known: names of members and of fields of `AxisStep`."""

_MEASURED: Mapping[str, tuple[str, int]] = {
    name: (kind, _STEPS)
    for sensor in SENSORS
    for name, kind in ((f"{sensor.name}_measured", _FLAG), (f"measured_{sensor.quantity}", _FLOAT))
}
"""Members of the sensors; a record written before a kind of sensor was added lacks those of that kind."""
_MEMBERS: dict[str, tuple[str, int]] = {
    "header": (_BYTE, _ANY),
    "time_s": (_FLOAT, _STEPS),
    **_MEASURED,
    "true_angle_rad": (_FLOAT, _STEPS),
    "true_rate_rad_s": (_FLOAT, _STEPS),
    "true_range_m": (_FLOAT, _STEPS),
    "impulse_m_s": (_FLOAT, _STEPS),
    "predicted_miss_exists": (_FLAG, _STEPS),
    "predicted_miss_m": (_FLOAT, _STEPS_2),
    "truth_margin_known": (_FLAG, _STEPS),
    "truth_margin_m": (_FLOAT, _STEPS),
    "section_offsets": (_COUNT, _STEPS_AND_1),
    "section_label_m": (_FLOAT, _SECTIONS),
    "section_range_m": (_FLOAT, _SECTIONS),
    "vertex_offsets": (_COUNT, _SECTIONS_AND_1),
    "vertex_v_m_s_z_m": (_FLOAT, _VERTICES_2),
}
"""Type and shape of each member."""
_OF_Y: Mapping[str, str] = {
    **{
        f"measured_{kind.quantity}": f"measured_{kind.quantity}".replace(kind.name, f"{kind.name}_y")
        for kind in SENSORS
        if kind.is_lateral
    },
    "true_angle_rad": "true_angle_y_rad",
    "true_rate_rad_s": "true_rate_y_rad_s",
    "impulse_m_s": "impulse_y_m_s",
    "predicted_miss_m": "predicted_miss_y_m",
    "vertex_offsets": "vertex_y_offsets",
    "vertex_v_m_s_z_m": "vertex_v_m_s_y_m",
}
"""Members of the y axis, in space only, by those of the z axis."""
_REQUIRED = [name for name in _MEMBERS if name not in _MEASURED]
_MEMBERS |= {along_y: _MEMBERS[along_z] for along_z, along_y in _OF_Y.items()}
_RESULT: dict[str, list[Column]] = {}
"""Columns of the result in the header by key; the two components of a start have one key."""
for _column in columns_of(Results):
    if _column.name not in ("run", "phi_held"):
        _RESULT.setdefault(_column.name if _column.component is None else _column.field, []).append(_column)
_LISTED_MEMBER = b"PK\x01\x02"
"""How an entry of an archive's list of members begins."""


_Name = Annotated[str, Field(max_length=LONGEST_NAME)]
_OTHER_KEYS = ("format", "schema", "version", "sha256", "scenario", "result")


@dataclass(frozen=True)
class _Engagement:
    """Keys of the header that are fields of the record as they are."""

    seed: Annotated[int, Field(ge=0)]
    run: Annotated[int, Field(ge=0, lt=2**63)]
    strategy: _Name
    noise: _Name | None
    inconsistency: Inconsistency | None


class _UnsoundError(Exception):
    """The reason why a file is not a readable record."""


def write_record(record: Record, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write the record of an engagement as an `.npz` file, whole or not at all.

    Parameters
    ----------
    path : str or path
        Name of the file; it ends in ``.npz``.

    Raises
    ------
    InputError
        If the file cannot be written, exists already, or no scenario file can hold the record's scenario.
    """
    file = record_path("record", Path(path))
    toml = scenario_to_toml(record.scenario)
    if read_scenario(toml, f"the scenario of {file}") != record.scenario:
        raise InputError(
            f"{file}: the scenario {shown(record.scenario.name)} changes when it is written and read again; correct it"
        )
    arrays = _to_arrays(record)
    engagement = to_json(_Engagement(record.seed, record.run, record.strategy, record.noise, record.inconsistency))
    inconsistency = engagement.pop("inconsistency")
    if record.noise is None:
        del engagement["noise"]
    header = {
        "format": FORMAT,
        "schema": SCHEMA,
        "version": library_version(),
        **engagement,
        "result": _result_to_json(record.result),
        "inconsistency": inconsistency,
        "scenario": toml,
    }
    header["sha256"] = _checksum(header, arrays)
    text = json.dumps(header, allow_nan=False).encode()
    content = _pack({"header": np.frombuffer(text, dtype=np.uint8), **arrays})
    if len(content) > LARGEST_FILE_BYTES:
        raise InputError(
            f"{file}: the record would take {len(content)} bytes, more than the {LARGEST_FILE_BYTES} that can be read "
            "back; take fewer sections or longer steps"
        )
    write_file(file, content, overwrite=overwrite)


def load_record(path: str | os.PathLike[str]) -> Record:
    """Read the record of an engagement: equal, bit for bit, to the record that was written.

    Parameters
    ----------
    path : str or path
        A file of `write_record` or ``infoset engage --record``.

    Raises
    ------
    InputError
        If the file is not a record, or has changed since it was written.
    """
    file = Path(path)
    try:
        if file.is_dir():
            raise InputError(f"{file}: {use_of_folder(file, 'record')}")
        if file.exists() and not file.is_file():
            raise InputError(f"{file}: is not an ordinary file; {REMEDY}")
        size = file.stat().st_size
        if size > LARGEST_FILE_BYTES:
            raise InputError(f"{file}: has {size} bytes, more than any record ({LARGEST_FILE_BYTES}); {REMEDY}")
        content = file.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{file}: there is no such file; {REMEDY}") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{file}: cannot be read: {reason}; check its name and permissions") from None
    try:
        arrays = _unpack(content)
        header = _read_header(arrays.pop("header"))
        if header.get("sha256") != _checksum(header, arrays):
            raise _UnsoundError("its contents are not what was written (the checksum differs): the file is damaged")
        return _to_record(header, arrays, str(file))
    except _UnsoundError as error:
        use = None if content.startswith(ZIP) else use_of_file(file)
        raise InputError(f"{file}: {use or f'is not a readable record: {error}; {REMEDY}'}") from None


def record_path(option: str, path: Path) -> Path:
    """Return a path, the value of an option, if it ends in ``.npz``; raise `InputError` otherwise."""
    if path.suffix != ".npz":
        raise InputError(f"{option}: {path} must end in .npz; for example {option} flight.npz")
    return path


def _to_arrays(record: Record) -> Arrays:
    """Put the steps of a record into flat arrays."""
    steps = record.steps
    sections = [section for step in steps for section in step.sections]
    along_y = {}
    if record.scenario.is_spatial:
        polygons = [section.polygon_y for section in sections if section.polygon_y is not None]
        arrays = _of_axis([step.axes["y"] for step in steps], polygons)
        along_y = {name: arrays[along_z] for along_z, name in _OF_Y.items()}
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


def _offsets(counts: list[int]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(np.array(counts, dtype=np.int64))]).astype(np.int64)


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
    """Return an `.npz` archive that depends on nothing but its arrays."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_STORED) as archive:
        for name in (name for name in _MEMBERS if name in arrays):
            member = io.BytesIO()
            values = np.ascontiguousarray(arrays[name], dtype=np.dtype(_MEMBERS[name][0]))
            np.lib.format.write_array(member, values, version=(1, 0), allow_pickle=False)
            archive.writestr(zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0)), member.getvalue())
    return content.getvalue()


def _unpack(content: bytes) -> Arrays:
    """Read the members of an archive, none of which can be larger than the file."""
    if content.count(_LISTED_MEMBER) > 2 * len(_MEMBERS):  # numbers may look like one, too
        raise _UnsoundError("it has more members than any record")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
            names = [member.filename for member in members]
            wanted = [f"{name}.npy" for name in _MEMBERS]
            unknown = sorted(set(names) - set(wanted))
            missing = [f"{name}.npy" for name in _REQUIRED if f"{name}.npy" not in names]
            if unknown or missing:
                what = f"it has {shown(unknown[0])}" if unknown else f"it has no {missing[0]}"
                raise _UnsoundError(f"{what}: another program wrote it")
            if len(set(names)) != len(names):
                raise _UnsoundError("it has a member twice")
            if any(member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 1 for member in members):
                raise _UnsoundError("it is compressed or encrypted; records are neither")
            if sum(member.file_size for member in members) > len(content):
                raise _UnsoundError("its declared contents are larger than the file")
            return {
                member.filename.removesuffix(".npy"): _read_array(archive.read(member), member.filename)
                for member in members
            }
    except zipfile.BadZipFile as error:
        raise _UnsoundError(f"it is not a complete .npz archive ({error})") from None
    except (OSError, ValueError, EOFError, RuntimeError, struct.error, OverflowError) as error:
        raise _UnsoundError(f"the archive is damaged ({error})") from None


def _read_array(member: bytes, filename: str) -> NDArray[Any]:
    """Read an array after a check of the size in its header."""
    kind, shape_kind = _MEMBERS[filename.removesuffix(".npy")]
    stream = io.BytesIO(member)
    try:
        version = np.lib.format.read_magic(stream)
        if version != (1, 0):
            raise _UnsoundError(f"{filename} has the array format {version}")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the parser, about headers that are refused below
            shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream)
    except (ValueError, TypeError, SyntaxError, KeyError, RecursionError, MemoryError, tokenize.TokenError) as error:
        raise _UnsoundError(f"{filename} is damaged ({str(error)[:200]})") from None
    two = shape_kind in (_STEPS_2, _VERTICES_2)
    if dtype != np.dtype(kind) or fortran or len(shape) != 1 + two or (two and shape[1] != 2) or shape[0] < 0:
        raise _UnsoundError(
            f"{filename} holds {dtype} of shape {shape}, not {kind} of shape {'(n, 2)' if two else '(n,)'}"
        )
    data = member[stream.tell() :]
    if len(data) != shape[0] * (1 + two) * dtype.itemsize:
        raise _UnsoundError(f"{filename} holds {len(data)} bytes, not those of an array of shape {shape}")
    if kind == _FLAG and data.strip(b"\0\1"):
        raise _UnsoundError(f"{filename} holds flags other than true and false")
    return np.frombuffer(data, dtype=dtype).reshape(shape)


def _read_header(header: NDArray[Any]) -> dict[str, Any]:
    if header.size > LARGEST_HEADER_BYTES:
        raise _UnsoundError("its header is too long")
    try:
        found = json.loads(header.tobytes().decode())
    except (ValueError, RecursionError):
        raise _UnsoundError("its header is not JSON") from None
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise _UnsoundError(f"its header has no format {FORMAT}: another program wrote it")
    if found.get("schema") != SCHEMA or isinstance(found["schema"], bool):
        raise _UnsoundError(
            f"it has the schema {shown(found.get('schema'))}, and this version of infoset reads {SCHEMA}"
        )
    return found


def _to_record(header: Mapping[str, Any], arrays: Arrays, source: str) -> Record:
    missing = [key for key in _OTHER_KEYS if key not in header]
    if missing:
        raise _UnsoundError(f"its header has no key {missing[0]}")
    others = {key: value for key, value in header.items() if key not in _OTHER_KEYS}
    try:
        engagement = from_json(_Engagement, {"noise": None, **others})
        scenario = read_scenario(header["scenario"], f"{source}: the scenario in it")
    except ValueError as error:
        raise _UnsoundError(f"its header is wrong: {error}") from None
    except InputError as error:
        raise _UnsoundError(f"its scenario is unsound: {error}") from None
    of_y = {along_y for along_z, along_y in _OF_Y.items() if scenario.is_spatial and along_z in arrays}
    for name in sorted(of_y ^ (set(_OF_Y.values()) & set(arrays))):
        where = "in space, and it has no" if name in of_y else "in a plane, and it has"
        raise _UnsoundError(f"its scenario is {where} {name}.npy")
    nothing = {name: np.zeros(len(arrays["time_s"]), dtype=kind) for name, (kind, _) in _MEASURED.items()}
    arrays = nothing | arrays
    _check(arrays)
    found = engagement.inconsistency
    if found is not None and not (0 <= found.step < len(arrays["time_s"]) and abs(found.label_m) <= LARGEST):
        raise _UnsoundError("its header is wrong: inconsistency is not at a step of the record")
    return Record(
        scenario=scenario,
        result=_result_from_json(header["result"], engagement.run, scenario),
        steps=_to_steps(arrays, scenario),
        **vars(engagement),
    )


def _check(arrays: Arrays) -> None:
    """Refuse arrays that do not fit together."""
    steps, sections = len(arrays["time_s"]), len(arrays["section_label_m"])
    sizes = {
        _STEPS: steps,
        _STEPS_2: steps,
        _STEPS_AND_1: steps + 1,
        _SECTIONS: sections,
        _SECTIONS_AND_1: sections + 1,
    }
    for name, values in arrays.items():
        wanted = sizes.get(_MEMBERS[name][1])
        if wanted is not None and len(values) != wanted:
            raise _UnsoundError(f"{name} has {len(values)} rows, not {wanted}")
        if values.dtype.kind == "f" and not np.isfinite(values).all():
            raise _UnsoundError(f"{name} holds what is not a finite number")
        if values.dtype.kind == "f" and values.size and np.abs(values).max() > LARGEST:
            raise _UnsoundError(f"{name} holds {np.abs(values).max():.3g}, more than {LARGEST:g} in size")
    if steps == 0:
        raise _UnsoundError("it has no step")
    if (np.diff(arrays["time_s"]) <= 0.0).any() or arrays["time_s"][0] < 0.0:
        raise _UnsoundError("time_s does not rise")
    vertices = {"vertex_offsets": "vertex_v_m_s_z_m", "vertex_y_offsets": "vertex_v_m_s_y_m"}
    sizes_and_least = {
        "section_offsets": (sections, 0),
        **{name: (len(arrays[values]), 1) for name, values in vertices.items() if name in arrays},
    }
    for name, (size, least) in sizes_and_least.items():
        offsets = arrays[name]
        # The ends are compared before the differences, and one by one: a difference may overflow.
        if offsets[0] != 0 or offsets[-1] != size or (offsets < 0).any() or (offsets > size).any():
            raise _UnsoundError(f"{name} does not run from 0 to {size}")
        if (np.diff(offsets) < least).any():
            raise _UnsoundError(f"{name} does not rise")
    if (arrays["section_range_m"] < SMALLEST).any():
        raise _UnsoundError(f"section_range_m holds a range that is not positive, or below {SMALLEST:g}")
    for name in ("measured_range_m", "true_range_m"):
        if (arrays[name] < 0.0).any():
            raise _UnsoundError(f"{name} holds a range that is negative")


def _result_from_json(found: object, run: int, scenario: Scenario) -> Results:
    # A record written before a nullable column was added lacks it, and one in a plane the columns of space.
    optional = {
        key: None if len(columns) == 1 else [None] * len(columns)
        for key, columns in _RESULT.items()
        if columns[0].nullable
    }
    if not isinstance(found, dict) or set(optional | found) != set(_RESULT):
        raise _UnsoundError("its header has a wrong result")
    found = optional | found
    fields: dict[str, Any] = {"runs": np.array([run]), "guarantees": scenario.set_model.is_guaranteed}
    for key, columns in _RESULT.items():
        values = [found[key]] if len(columns) == 1 else found[key]
        if not isinstance(values, list) or len(values) != len(columns):
            raise _UnsoundError("its header has a wrong start")
        for column, value in zip(columns, values, strict=True):
            problem = _problem(column, value)
            if column.optional and (value is None) == scenario.is_spatial:
                problem = f"is {'unknown in space' if value is None else 'known in a plane'}"
            if problem is not None:
                raise _UnsoundError(f"its header has a wrong result: {column.name} {problem}")
        fields[columns[0].field] = _array(columns[0], values)
    kept = fields.pop("truth_kept")
    result = Results(**fields)
    if (result.truth_kept != kept).any():
        raise _UnsoundError("its header has a wrong result: truth_kept contradicts truth_margin_m")
    return result


def _problem(column: Column, value: object) -> str | None:
    """Return what is wrong with a value of a column, or None."""
    if issubclass(column.kind, Enum):
        try:
            column.kind(value)
        except ValueError:
            return f"is {shown(value)}"
        return None
    if value is None and column.nullable:
        return None
    if type(value) is not column.kind:
        return f"must be of the type {column.kind.__name__}"
    return column.limits.problem(value) if column.kind is float else None


def _array(column: Column, values: list[Any]) -> Any:
    """Return the values of a field of `Results` for a batch of one."""
    if issubclass(column.kind, Enum):
        return (column.kind(values[0]),)
    if column.nullable:
        unknown = [value is None for value in values]
        known = np.ma.MaskedArray([value or 0 for value in values], mask=unknown, dtype=column.kind)
        return known if column.component is None else known[None]
    return np.array(values if column.component is None else [values])


def _to_steps(arrays: Arrays, scenario: Scenario) -> tuple[StepRecord, ...]:
    along = {"z": arrays}
    if scenario.is_spatial:
        of_y = {along_z: arrays[along_y] for along_z, along_y in _OF_Y.items() if along_y in arrays}
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
    """Return the sections of one axis."""
    vertices = arrays["vertex_v_m_s_z_m"]
    return [
        ConvexPolygons.unchecked(vertices[first:last].copy(), np.asarray(last - first))
        for first, last in pairwise(arrays["vertex_offsets"].tolist())
    ]


def _axis_steps(arrays: Arrays) -> list[AxisStep]:
    """Return the steps of one axis."""
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
