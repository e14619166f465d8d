"""Records of engagements as `.npz` files: arrays without pickle, and a JSON header.

The lateral axes of arrays are in the order of `SetModel.axes`. NaN is a value that is not known.
The sets are not stored: they follow from the measurements and the impulses.
"""

from __future__ import annotations

import io
import json
import math
import os
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from infoset.arrays import Floats
from infoset.covered_set import information_set
from infoset.experiments.common.errors import InputError, input_errors, on_a_screen
from infoset.experiments.common.input_file import read_input
from infoset.experiments.common.output import write_file
from infoset.information_set import InformationSet
from infoset.limits import MAXIMUM
from infoset.sensors import SENSORS, Measurements
from infoset.sim import MissCause, Outcome, Record, RecordedInconsistency, Results, Scenario
from infoset.sim.columns import columns_of
from infoset.sim.gravity import on_board_model
from infoset.sim.scenario import MAX_STEPS
from infoset.sim.storage.codec import from_json, to_json
from infoset.sim.wrong_images import proved_columns, suspected_times_s

MAX_FILE_BYTES = 1 << 28
"""Size of the largest record that is read: `MAX_STEPS` steps in space take 14 MB."""
MAX_HEADER_BYTES = 1 << 20
"""Size of the largest JSON header: 500 times the header of a built-in scenario."""
MAX_ARRAY_HEADER_BYTES = 1 << 8
"""Size of the largest header of an array; NumPy writes 128 bytes."""
LONGEST_REASON = 300
"""Maximum number of letters of a reason, which a hostile file can make long."""
MAX_SECTION_STEPS = 5 * MAX_STEPS
"""Maximum number of sections times steps: the longest flight with the five sections of the built-in
missions. A section takes about 1.4 kB a step when a record is read, so this is 0.7 GB."""
REMEDY = "make a record with `infoset engage --record FILE.npz`"

Arrays = dict[str, NDArray[Any]]


class ArrayMember(NamedTuple):
    """Declaration of an array: its shape and type, and whether values may be unknown."""

    shape: tuple[str | int, ...]
    dtype: str = "<f8"
    nullable: bool = False


_MEASURED = {f"measured_{kind.quantity}": kind for kind in SENSORS}
_OF_STEPS = {
    "time_s": ArrayMember(("steps",)),
    "true_range_m": ArrayMember(("steps",)),
    "truth_margin_m": ArrayMember(("steps",), nullable=True),
    **dict.fromkeys(
        ("true_angle_rad", "true_rate_rad_s", "impulse_m_s"), ArrayMember(("steps", "axes"))
    ),
    "predicted_miss_m": ArrayMember(("steps", "axes", 2), nullable=True),
}
"""Arrays of a record that are members as they are."""
_RESULT = {
    f"result_{each.field}": each
    for each in columns_of(Results)
    if not (each.derived or each.optional) and each.kind in (float, bool)
}
"""The last column of each field of a result that is an array of numbers or flags. Optional columns
follow from the measurements, or are not stored."""
_BY_AXIS = {"position_m": ("axes + 1",), "velocity_m_s": ("axes + 1",), "lateral_miss_m": ("axes",)}
_OF_HEADER = ("scenario", "versions", "seed", "run", "strategy", "noise", "inconsistency")
MEMBERS = {
    "header": ArrayMember(("bytes",), "|u1"),
    **_OF_STEPS,
    **{
        name: ArrayMember(("steps", "axes") if kind.is_lateral else ("steps",), nullable=True)
        for name, kind in _MEASURED.items()
    },
    **{
        name: ArrayMember((1, *_BY_AXIS.get(column.field, ())), nullable=column.nullable)
        for name, column in _RESULT.items()
    },
}


@dataclass(frozen=True)
class Header:
    """The JSON of a record: fields of the record, and the outcome."""

    scenario: Scenario
    versions: Mapping[str, str]
    seed: Annotated[int, Field(ge=0)]
    run: Annotated[int, Field(ge=0, lt=2**63)]  # `Results.runs` has integers of 64 bits
    strategy: str
    noise: str | None
    inconsistency: RecordedInconsistency | None
    outcome: Outcome
    cause: MissCause | None
    format: Literal["infoset-record-3"] = "infoset-record-3"


def record_bytes(record: Record) -> bytes:
    """Return the content of the `.npz` file of a record.

    Raise `InputError` if the record is too large to be read again.
    """
    with input_errors("record"):
        _check_size(record.scenario, record.steps)
    header = Header(
        **{name: getattr(record, name) for name in _OF_HEADER},
        outcome=record.result.outcomes[0],
        cause=record.result.causes[0],
    )
    text = json.dumps(to_json(header)).encode()
    stream = io.BytesIO()
    np.savez(
        stream, allow_pickle=False, header=np.frombuffer(text, dtype=np.uint8), **_to_arrays(record)
    )
    return stream.getvalue()


def write_record(record: Record, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write a record, completely or not at all.

    Raise `InputError` if the file is not named ``.npz``, cannot be written, or exists already and
    `overwrite` is not set, or if the record is too large to be read again.
    """
    file = Path(path)
    if file.suffix.lower() != ".npz":
        raise InputError(f"{file}: a record is written as .npz; for example {file.stem}.npz")
    write_file(file, record_bytes(record), overwrite=overwrite)


def load_record(path: str | os.PathLike[str]) -> Record:
    """Read the record of an engagement: equal, bit for bit, to the record that was written.

    The sets are computed again; other versions of the packages may give other last digits.
    `InputError` if the file is not a record, or is damaged.
    """
    file = Path(path)
    content = read_input(file, MAX_FILE_BYTES)
    try:
        arrays = _read_arrays(content)
        header = from_json(Header, json.loads(arrays["header"].tobytes()))
        _check(arrays, len(header.scenario.set_model.axes))
        _check_size(header.scenario, len(arrays["time_s"]))
        return _to_record(header, arrays)
    except (ValueError, ArithmeticError, RecursionError) as error:
        reason = on_a_screen(str(error)[:LONGEST_REASON])
    raise InputError(f"{file}: is not a readable record: {reason}; {REMEDY}")


def _to_arrays(record: Record) -> Arrays:
    """Return the members of a record but the header; NaN is a value that is not known."""
    arrays: dict[str, Any] = {name: getattr(record, name) for name in _OF_STEPS}
    unknown = np.full((record.steps, len(record.scenario.set_model.axes)), np.nan)
    for name, kind in _MEASURED.items():
        missing = unknown if kind.is_lateral else unknown[:, 0]
        arrays[name] = record.measured.get(kind.name, missing)
    for name, column in _RESULT.items():
        values: Any = np.ma.asarray(getattr(record.result, column.field), float)
        arrays[name] = np.ma.filled(values, np.nan)
    return {name: np.asarray(values, dtype=MEMBERS[name].dtype) for name, values in arrays.items()}


def _read_arrays(content: bytes) -> Arrays:
    """Read the arrays of an archive, after its directory is checked."""
    # Entries of the directory; the bytes of numbers may look like an entry, too.
    if content.count(b"PK\x01\x02") > 2 * len(MEMBERS):
        raise ValueError("it has more members than a record")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            _check_archive(archive, len(content))
        with np.load(
            io.BytesIO(content), allow_pickle=False, max_header_size=MAX_ARRAY_HEADER_BYTES
        ) as stored:
            # A member that is not an array is read as bytes, which become an array of text.
            return {name: np.asarray(stored[name]) for name in MEMBERS}
    except Exception as error:  # zipfile and numpy raise errors of many types for damaged files
        raise ValueError(" ".join(str(error).split()) or type(error).__name__) from None


def _check_archive(archive: zipfile.ZipFile, size: int) -> None:
    """Raise ValueError if the directory of an archive of `size` bytes is not of a record."""
    names = sorted(each.filename for each in archive.infolist())
    if names != sorted(f"{name}.npy" for name in MEMBERS):
        raise ValueError("its members are not those of a record")
    if any(each.compress_type != zipfile.ZIP_STORED for each in archive.infolist()):
        raise ValueError("it is compressed; records are not")
    if sum(each.file_size for each in archive.infolist()) > size:
        raise ValueError("the declared sizes of its members are larger than the file")
    if archive.getinfo("header.npy").file_size > MAX_HEADER_BYTES:
        raise ValueError("its header is too long")


def _check(arrays: Arrays, axes: int) -> None:
    """Raise ValueError if arrays do not have their declared types, shapes and values.

    `axes` is the number of lateral axes.
    """
    steps = arrays["time_s"].size
    sizes: dict[str | int, int] = {
        "steps": steps,
        "axes": axes,
        "axes + 1": axes + 1,
        "bytes": arrays["header"].size,
    }

    for name, member in MEMBERS.items():
        values = arrays[name]
        shape = tuple(sizes.get(size, size) for size in member.shape)
        if (values.dtype.str, values.shape) != (member.dtype, shape):
            raise ValueError(
                f"{name} is {values.dtype.str} of shape {values.shape}, not {member.dtype} of "
                f"{shape}"
            )
        if values.dtype.kind == "f":
            known = values
            if member.nullable:
                known = values[~np.isnan(values)]
            if not (np.abs(known) <= MAXIMUM).all():
                raise ValueError(f"{name} has a number beyond {MAXIMUM:g}")

    if steps == 0 or (np.diff(arrays["time_s"]) <= 0.0).any():
        raise ValueError("time_s does not increase")
    if arrays["result_velocity_m_s"][0, -1] >= 0.0:
        raise ValueError("result_velocity_m_s does not approach")


def _check_size(scenario: Scenario, steps: int) -> None:
    """Raise ValueError if the sets of a record take too much memory.

    They are counted with the most sections that a set can have, also after a new grid.
    """
    settings = scenario.information_set
    sets = math.comb(settings.classes, settings.wrong_images)
    sections = sets * max(settings.sections, 2 * settings.fewest_sections + 1)
    if sections * steps > MAX_SECTION_STEPS:
        raise ValueError(
            f"it has {sections} sections in {steps} steps, and their product may be at most "
            f"{MAX_SECTION_STEPS}: reduce information_set.sections or increase step_s"
        )


def replayed(
    scenario: Scenario, measured: Measurements, impulse_m_s: Floats
) -> Iterator[InformationSet]:
    """Yield the set of an engagement before and after the measurement of each step.

    The last set is predicted from the last step. It is one object, which changes. It is computed
    from measurements and impulses, arrays as in `Record`, and equals the set of the engagement bit
    for bit if the versions of the packages are the same.
    """
    # Without Phi, which takes time and is in the result of the record.
    information = information_set(on_board_model(scenario), guarantee=False)
    is_known = {
        name: np.asarray(~np.isnan(values.reshape(len(values), -1)).any(axis=1))
        for name, values in measured.items()
    }

    for step, impulse in enumerate(impulse_m_s):
        yield information
        # The last axis is that of the runs, of which there is one; so is that of the impulse.
        values = {
            name: each[step, ..., None] for name, each in measured.items() if is_known[name][step]
        }
        for name, sensor in scenario.sensors.items():
            if name in values:
                sensor.cut(information, values, np.array([True]))
        yield information
        information.shift(impulse[:, None])
        information.drop_below_threshold()
        information.predict()

    yield information


def _to_record(header: Header, arrays: Arrays) -> Record:
    """Return the record of checked arrays, with its sets computed again."""
    first = header.inconsistency
    if first is not None:
        is_step = 0 <= first.step < len(arrays["time_s"])
        if not is_step or not abs(first.label_m) <= MAXIMUM:
            raise ValueError("inconsistency is not at a step of the record")

    fields: dict[str, Any] = {
        "runs": np.array([header.run]),
        "outcomes": (header.outcome,),
        "causes": (header.cause,),
    }

    for name, column in _RESULT.items():
        # Flags are stored as numbers too, because only these can be NaN.
        unknown = np.isnan(arrays[name])
        values: NDArray[Any] = np.where(unknown, 0.0, arrays[name]).astype(column.kind)
        if column.nullable:
            values = np.ma.MaskedArray(values, mask=unknown)
        fields[column.field] = values

    scenario = header.scenario
    measured = {
        kind.name: arrays[name] for name, kind in _MEASURED.items() if kind.name in scenario.sensors
    }
    sections = []
    for number, information in enumerate(replayed(scenario, measured, arrays["impulse_m_s"])):
        if number % 2 == 1:  # after a measurement
            sections.append(tuple(information.sections()))

    # `information` is the last set of the loop: the set at the end of the engagement.
    known: dict[str, Any] = {name: getattr(header, name) for name in _OF_HEADER}
    return Record(
        **known | {name: arrays[name] for name in _OF_STEPS},
        result=Results(
            **fields,
            **proved_columns(information),
            guarantees=scenario.set_model.is_guaranteed,
            b_plane_t_rad=scenario.b_plane_t_rad,
        ),
        measured=measured,
        sections=tuple(sections),
        suspected_s=suspected_times_s(information),
    )
