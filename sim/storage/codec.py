"""Frozen dataclasses as JSON and back, for manifests, record headers and fingerprints."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Callable, Hashable, Iterator
from typing import Any, TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

Kind = TypeVar("Kind")
_STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


@functools.cache
def adapter(kind: Hashable) -> TypeAdapter[Any]:
    """Return the strict reader and writer of a tuple with one dataclass."""
    return TypeAdapter(tuple[kind], config=_STRICT)  # type: ignore[valid-type]  # pydantic takes no config for a dataclass


def to_json(value: Any) -> dict[str, Any]:
    """Return a dataclass as JSON values: enumerations by value, numbers by the field's type."""
    # `dump_json` would replace a KeyboardInterrupt by another error. The fallback is for NumPy's
    # integers.
    codec = adapter(value.__class__)
    values = codec.dump_python(
        (value,), mode="json", warnings=False, fallback=lambda each: each.item()
    )
    (made,) = codec.validate_json(json.dumps(values))
    (plain,) = codec.dump_python((made,), mode="json")
    return dict(plain)


def from_json(kind: Callable[..., Kind], value: object) -> Kind:
    """Return a dataclass from its JSON values.

    A ValueError is raised if a key is missing or unknown, or a value is not of its field's type;
    the message names the key. Text with control characters, which a terminal would execute, is
    refused too.
    """
    if not all(map(str.isprintable, _texts(value))):
        raise ValueError("contains text with control characters")
    try:
        (made,) = adapter(kind).validate_json(json.dumps([value]))
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


def fingerprint(value: Any) -> str:
    """Return a fingerprint of all values of a dataclass except its name and description.

    Names of inner dataclasses count. It has 16 hexadecimal digits (64 bits: collisions are
    negligible), and is equal for equal numbers of any type, on every machine. Results store
    it, and campaign manifests a hash of those of all cells: a change of this function changes the
    hash of every stored scenario.
    """
    values = to_json(value)
    values.pop("name", None)
    values.pop("description", None)
    text = json.dumps(_exact(values), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _exact(value: Any) -> Any:
    """Replace numbers by their exact hexadecimal form."""
    if isinstance(value, dict):
        return {key: _exact(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_exact(inner) for inner in value]
    if isinstance(value, int | float):
        # The sum removes the sign of a negative zero.
        return (float(value) + 0.0).hex()
    return value
