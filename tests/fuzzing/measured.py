"""What it costs to refuse a file, measured in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

_CHILD = """
import json, sys, time
from pathlib import Path

from infoset.experiments.common.errors import InputError
from infoset.experiments.interception.record_file import load_record
from infoset.experiments.interception.scenario_file import load_scenario

def peak():
    # Not `resource`, whose maximum is also that of the process which began this one.
    (line,) = [line for line in open("/proc/self/status") if line.startswith("VmHWM")]
    return int(line.split()[1]) / 1024

read = {"record": load_record, "scenario": load_scenario}[sys.argv[1]]
found = []
for path in sys.argv[2:]:
    Path("/proc/self/clear_refs").write_text("5")  # the maximum size so far is forgotten
    before, begun, message = peak(), time.process_time(), ""
    try:
        read(path)
    except InputError as error:
        message = str(error)
    seconds = time.process_time() - begun
    found.append({"message": message, "seconds": seconds, "megabytes": peak() - before})
print(json.dumps(found))
"""


@dataclass(frozen=True)
class Measured:
    """How a file was refused."""

    message: str
    seconds: float
    megabytes: float


def measured(reader: str, *paths: Path) -> list[Measured]:
    """Read files, one after the other, in a process of their own."""
    if not Path("/proc/self/clear_refs").exists():
        pytest.skip("memory is measured as Linux tells it")
    command = [sys.executable, "-W", "error", "-c", _CHILD, reader, *map(str, paths)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return [Measured(**each) for each in json.loads(done.stdout)]
