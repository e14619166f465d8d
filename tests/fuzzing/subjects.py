"""What is attacked: a small sound file of every kind, and a way to read each to the end."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from infoset.experiments.common.built_in_files import SCENARIO, built_in_files
from infoset.experiments.common.input_file import load_problem, read_text, to_toml
from infoset.experiments.interception import record_file
from infoset.experiments.interception.scenario_file import (
    feasibility_warnings,
    load_scenario,
    scenario_warnings,
)
from infoset.experiments.interception.trajectory_file import Trajectory
from infoset.experiments.multipoint.file import MultipointProblem
from infoset.experiments.observer.file import ObserverProblem
from infoset.experiments.pareto.file import ParetoProblem
from infoset.experiments.pursuit.file import PursuitProblem
from infoset.experiments.reachability.file import Rendezvous
from infoset.experiments.reachability.system_file import ReachableSystem
from infoset.sim import Record, Scenario, fly_one
from tests.records import first_steps

Found = TypeVar("Found")


def attempted(read: Callable[[], Found], refusal: type[Exception]) -> tuple[Found | None, str]:
    """Return what reading gives and no message, or nothing and the message that it is refused
    with.
    """
    try:
        return read(), ""
    except refusal as error:
        return None, str(error)


@dataclass(frozen=True)
class TextFile:
    """A kind of file that a person writes: its dataclass, the built-in ones, and its loader."""

    owner: type
    texts: tuple[str, ...]
    load: Callable[[str], Any]

    def read(self, path: str) -> object:
        """Read a file, ask all of it that costs little, and write it again."""
        found = self.load(path)
        assert read_text(self.owner, to_toml(found), "written again") == found
        if isinstance(found, Scenario):
            scenario_warnings(found)
            feasibility_warnings(found)
        return found


def text_files() -> Mapping[str, TextFile]:
    """Return the kinds of files that people write, by name."""
    readers: dict[str, tuple[type, Callable[[str], Any]]] = {
        SCENARIO: (Scenario, load_scenario),
        "trajectory": (Trajectory, load_problem),
        "pareto-encounter": (ParetoProblem, load_problem),
        "multipoint": (MultipointProblem, load_problem),
        "observer": (ObserverProblem, load_problem),
        "pursuit-evasion": (PursuitProblem, load_problem),
        "reachable-rendezvous": (Rendezvous, load_problem),
        "reachable-system": (ReachableSystem, load_problem),
    }
    return {
        kind: TextFile(
            owner, tuple(each.text for each in built_in_files().values() if each.kind == kind), load
        )
        for kind, (owner, load) in readers.items()
    }


def small_record(scenario: str = "asteroid-1997") -> Record:
    """Return the beginning of an engagement."""
    whole = fly_one(load_scenario(scenario), 3, seed=11)
    return first_steps(whole, 6)


def same_records(one: Record, other: Record) -> bool:
    """Whether two records are equal bit for bit."""
    names = ("scenario", "versions", "seed", "run", "strategy", "noise", "inconsistency")
    arrays = record_file._to_arrays(one)
    others = record_file._to_arrays(other)
    return (
        all(getattr(one, name) == getattr(other, name) for name in names)
        and one.result.outcomes == other.result.outcomes
        and all(arrays[name].tobytes() == others[name].tobytes() for name in arrays)
    )


def remade_record(
    content: bytes, change: Callable[[dict[str, Any], dict[str, bytes]], None]
) -> bytes:
    """Return a record after a change of its header and its members as bytes, with the sums of the
    archive.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    header = json.loads(
        np.lib.format.read_array(
            io.BytesIO(members.pop("header.npy")), allow_pickle=False
        ).tobytes()
    )
    change(header, members)
    text = io.BytesIO()
    np.lib.format.write_array(
        text, np.frombuffer(json.dumps(header).encode(), dtype=np.uint8), allow_pickle=False
    )
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, member in {"header.npy": text.getvalue(), **members}.items():
            archive.writestr(zipfile.ZipInfo(name), member)
    return out.getvalue()
