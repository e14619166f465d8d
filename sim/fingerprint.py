"""Short fingerprints of what decides a result."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from enum import Enum
from typing import Any

from sim.scenario import Scenario


def scenario_hash(scenario: Scenario) -> str:
    """Return a short fingerprint of every value that can change a result.

    Parameters
    ----------
    scenario : Scenario
        Its name and description do not count.

    Returns
    -------
    str
        16 hexadecimal digits, the same for equal values on every machine.
    """
    values = _canonical(dataclasses.replace(scenario, name="", description=""))
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def _canonical(value: Any) -> Any:
    """Return a value as JSON that is equal exactly when the values are."""
    if dataclasses.is_dataclass(value):
        return {field.name: _canonical(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple):
        return [_canonical(each) for each in value]
    if value is None or isinstance(value, str):
        return value
    return (float(value) + 0.0).hex()  # adding zero takes the sign off a negative zero
