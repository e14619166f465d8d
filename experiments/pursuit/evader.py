"""The policy of the evader in a simulation with feedback: a name, or a script in a CSV file."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from pathlib import Path

from experiments.common.errors import InputError, shown
from experiments.common.options import choice
from rendezvous.pursuit_evasion import Policy, RandomSteering, Script, Steering

LONGEST_SCRIPT = 100_000
"""Characters; fewer than the longest field that the CSV reader accepts."""
_OPTIMAL, _RANDOM = "optimal", "random"
_EXAMPLE = "write lines such as 0,coast and 3600,prograde"

EvaderPolicy = Callable[[int, float], Steering | None]
"""Returns the steering of a run, from its number and the time between plans in seconds; None is optimal."""


def evader_policy(name: str, seed: int) -> EvaderPolicy:
    """Return the policy of the evader: that of a name, or a script in a file that ends in ``.csv``.

    `seed` is the root seed of the random policy. Raise `InputError` if the policy is unknown or the file is not a
    script.
    """
    if name.endswith(".csv"):
        script = _script(name)
        return lambda _run, _hold_s: script
    name = choice("--feedback", name, [_OPTIMAL, _RANDOM, *(policy.value for policy in Policy)])
    if name == _OPTIMAL:
        return lambda _run, _hold_s: None
    if name == _RANDOM:
        return lambda run, hold_s: RandomSteering(seed, run, hold_s)
    return lambda _run, _hold_s: Policy(name).direction


def _script(path: str) -> Script:
    """Read a script: lines of time_s,policy."""
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            text = file.read(LONGEST_SCRIPT + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is not UTF-8 text"
        raise InputError(f"--feedback: {path} cannot be read: {reason}; {_EXAMPLE}") from None
    if len(text) > LONGEST_SCRIPT:
        raise InputError(f"--feedback: {path} is over {LONGEST_SCRIPT // 1000} kB, too large for a script; {_EXAMPLE}")
    times_s, policies = [], []
    for number, row in enumerate(csv.reader(text.splitlines()), start=1):
        if not row or (number == 1 and row[0].strip() == "time_s"):
            continue
        where = f"--feedback: {path}, line {number}"
        if len(row) != 2:
            raise InputError(f"{where}: must be a time and a policy, found {len(row)} values; {_EXAMPLE}")
        try:
            time_s = float(row[0])
        except ValueError:
            time_s = math.nan
        if not math.isfinite(time_s):
            raise InputError(f"{where}: {shown(row[0])} is not a time in seconds; {_EXAMPLE}")
        times_s.append(time_s)
        policies.append(Policy(choice(where, row[1].strip(), [policy.value for policy in Policy])))
    try:
        return Script(tuple(times_s), tuple(policies))
    except ValueError as error:
        raise InputError(f"--feedback: {path}: {error}; {_EXAMPLE}") from None
