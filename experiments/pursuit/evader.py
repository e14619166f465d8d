"""The policy of the evader in a simulation with feedback: a name, or a script in a CSV file."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

from experiments.common.errors import InputError
from experiments.common.input_file import read_input
from experiments.common.options import choice
from rendezvous.pursuit_evasion import Policy, RandomSteering, Script, Steering

MAX_SCRIPT_BYTES = 100_000
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
        script = _script(Path(name))
        return lambda _run, _hold_s: script
    name = choice("--feedback", name, [_OPTIMAL, _RANDOM, *(policy.value for policy in Policy)])
    if name == _OPTIMAL:
        return lambda _run, _hold_s: None
    if name == _RANDOM:
        return lambda run, hold_s: RandomSteering(seed, run, hold_s)
    return lambda _run, _hold_s: Policy(name).direction


def _script(path: Path) -> Script:
    """Read a script: lines of time_s,policy."""
    content = read_input(path, MAX_SCRIPT_BYTES)
    times_s, policies = [], []
    try:
        for time_s, policy in csv.reader(content.decode("utf-8").splitlines()):
            times_s.append(float(time_s))
            policies.append(Policy(policy.strip()))
        return Script(tuple(times_s), tuple(policies))
    except (ValueError, csv.Error) as error:  # also a line with another number of values, or a text that is not UTF-8
        raise InputError(f"--feedback: {path}: {error}; {_EXAMPLE}") from None
