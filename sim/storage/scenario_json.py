"""A scenario as plain JSON values, in SI units, and back: what a manifest holds of it."""

from __future__ import annotations

import dataclasses
import math
import types
from collections.abc import Mapping
from enum import Enum
from typing import Any, Union, get_args, get_origin, get_type_hints

from sim.scenario import Scenario

Json = dict[str, Any]


def scenario_to_json(scenario: Scenario) -> Json:
    """Return every value of a scenario, whole.

    Parameters
    ----------
    scenario : Scenario

    Returns
    -------
    dict
        Of numbers, text, lists, dicts and None; the names carry the units.
    """
    return {field.name: _plain(getattr(scenario, field.name)) for field in dataclasses.fields(scenario)}


def scenario_from_json(value: object) -> Scenario:
    """Return the scenario that values were made of.

    Parameters
    ----------
    value : object
        What `scenario_to_json` returned, perhaps by way of a file.

    Returns
    -------
    Scenario
        Equal to the one written.

    Raises
    ------
    ValueError
        If they are not the values of a scenario; the message names the key.
    """
    made = _typed(value, Scenario, "scenario")
    assert isinstance(made, Scenario)
    return made


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, tuple | list):
        return [_plain(each) for each in value]
    if value is None or isinstance(value, str | bool | int):
        return value
    return float(value)


def _typed(value: Any, wanted: Any, path: str) -> Any:
    """Return a value as the type a dataclass wants, or say where it is not."""
    origin = get_origin(wanted)
    if origin in (Union, types.UnionType):
        options = [each for each in get_args(wanted) if each is not type(None)]
        return None if value is None else _typed(value, options[0], path)
    if origin is tuple:
        parts = get_args(wanted)
        if not isinstance(value, list) or len(value) != len(parts):
            raise ValueError(f"{path}: must be a list of {len(parts)} values")
        return tuple(
            _typed(each, part, f"{path}[{place}]") for place, (each, part) in enumerate(zip(value, parts, strict=True))
        )
    if dataclasses.is_dataclass(wanted):
        return _object(value, wanted, path)
    if isinstance(wanted, type) and issubclass(wanted, Enum):
        try:
            return wanted(value)
        except ValueError:
            raise ValueError(f"{path}: must be one of {', '.join(str(each.value) for each in wanted)}") from None
    if wanted is float:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ValueError(f"{path}: must be a finite number")
        return float(value)
    if not isinstance(value, wanted) or (wanted is int and isinstance(value, bool)):
        raise ValueError(f"{path}: must be of the type {wanted.__name__}")
    if isinstance(value, str) and not value.isprintable():
        raise ValueError(f"{path}: must be text without control characters")
    return value


def _object(value: Any, wanted: Any, path: str) -> Any:
    if not isinstance(value, Mapping):
        raise ValueError(f"{path}: must be an object")
    hints = get_type_hints(wanted)
    names = [field.name for field in dataclasses.fields(wanted) if field.init]
    strange = [name for name in value if name not in names]
    missing = [name for name in names if name not in value]
    if strange or missing:
        said = [*(f"{name} is not known" for name in strange), *(f"{name} is missing" for name in missing)]
        raise ValueError(f"{path}: {', '.join(said)}")
    try:
        return wanted(**{name: _typed(value[name], hints[name], f"{path}.{name}") for name in names})
    except (TypeError, OverflowError) as error:
        raise ValueError(f"{path}: {error}") from None
