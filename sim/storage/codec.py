"""Frozen dataclasses as JSON and back, strictly: the one codec of manifests, record headers and fingerprints."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Callable, Hashable, Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from infoset.limits import ADDED_LATER
from sim.scenario import Scenario

Kind = TypeVar("Kind")
_STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


@functools.cache
def _adapter(kind: Hashable) -> TypeAdapter[Any]:
    return TypeAdapter(tuple[kind], config=_STRICT)  # type: ignore[valid-type]  # pydantic takes no config for a dataclass


def to_json(value: Any) -> dict[str, Any]:
    """Return a dataclass as JSON values: enumerations by value, a number as the type of its field.

    A field marked `ADDED_LATER` is omitted if it has its default. Files and fingerprints of values that do not use the
    field are then those of the versions before it.
    """
    adapter = _adapter(value.__class__)
    # `dump_json` would replace a KeyboardInterrupt by another error. The fallback is for NumPy's integers.
    values = adapter.dump_python((value,), mode="json", warnings=False, fallback=lambda number: number.item())
    (made,) = adapter.validate_json(json.dumps(values))
    (plain,) = adapter.dump_python((made,), mode="json")
    return dict(_used(made, plain))


def _used(value: Any, plain: Any) -> Any:
    """Omit the fields added later that have their default, at any depth."""
    if is_dataclass(value):
        return {
            field.name: _used(getattr(value, field.name), plain[field.name])
            for field in fields(value)
            if not (ADDED_LATER.items() <= field.metadata.items() and getattr(value, field.name) == field.default)
        }
    if isinstance(value, tuple):
        return [_used(*pair) for pair in zip(value, plain, strict=True)]
    return plain


def from_json(kind: Callable[..., Kind], value: object) -> Kind:
    """Return a dataclass from its JSON values.

    A ValueError is raised if a key is missing or unknown, or a value is not of its field's type; the message names the
    key. Text with control characters, which could steer a terminal, is refused too.
    """
    if not all(map(str.isprintable, _texts(value))):
        raise ValueError("contains text with control characters")
    try:
        (made,) = _adapter(kind).validate_json(json.dumps([value]))
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        key = ".".join(map(str, first["loc"][1:]))
        message = first["msg"].removeprefix("Value error, ")
        raise ValueError(f"{key}: {message}" if key else message) from None
    return made  # type: ignore[no-any-return]


def _texts(value: object) -> Iterator[str]:
    """Yield every text in JSON values, keys included."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        yield from value
        for inner in value.values():
            yield from _texts(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner)


def scenario_hash(scenario: Scenario) -> str:
    """Return a fingerprint of all values of a scenario except its name and description.

    16 hexadecimal digits, the same for equal values on every machine.
    """
    values = _exact(to_json(replace(scenario, name="", description="")))
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]


def _exact(value: Any) -> Any:
    """Replace numbers by their exact hexadecimal form."""
    if isinstance(value, dict):
        return {key: _exact(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_exact(inner) for inner in value]
    if isinstance(value, int | float):
        return (float(value) + 0.0).hex()  # adding zero removes the sign of a negative zero
    return value
