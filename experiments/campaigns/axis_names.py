"""Names and units of the axes of a sweep."""

from __future__ import annotations

from experiments.common.display_units import split_unit

SCALE = "scale"
"""Name, after the table of a sensor, of the factor of its error bounds."""

_BEFORE_ARRIVAL = ("first_image_s", "last_image_s", "last_impulse_s")
"""Times that count from the nominal arrival back."""


def tied_keys(key: str) -> list[str]:
    """Return the keys of an axis: several if they have the same values, `a.one_m=b.two_m`."""
    return key.split("=")


def unit_of(key: str) -> str:
    """Return the unit in the name of a key; empty if it has none."""
    return split_unit(_parts(tied_keys(key)[0])[1])[1]


def key_label(key: str) -> str:
    """Return a key as the label of an axis: `angle sensor: error at nominal range, rad`."""
    tables = [_parts(single)[0] for single in tied_keys(key)]
    names = [_words(single) for single in tied_keys(key)]
    if len(set(tables)) == 1:
        label = f"{tables[0]}: {' = '.join(names)}"
    else:
        label = " = ".join(f"{table}: {name}" for table, name in zip(tables, names, strict=True))
    unit = unit_of(key)
    label = label.replace("_", " ")
    return f"{label}, {unit}" if unit else label


def _words(key: str) -> str:
    _, name, end = _parts(key)
    if name == SCALE:
        return "factor of the error bounds"
    return f"{split_unit(name)[0]} {'before arrival' if name in _BEFORE_ARRIVAL else end}".strip()


def _parts(key: str) -> tuple[str, str, str]:
    """Return the table, the name, and the end of a pair or an empty text."""
    table, _, rest = key.rpartition(".") if key.count(".") < 2 else key.partition(".")
    name, _, end = rest.partition(".")
    return table, name, end
