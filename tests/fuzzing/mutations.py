"""Damage: what a disk, a slip of the hand or somebody hostile may do to a file."""

from __future__ import annotations

import random
import re
from collections.abc import Callable

VALUES = (
    *(
        "nan",
        "inf",
        "-inf",
        "-1",
        "0",
        "-0.0",
        "1e999999999",
        "1e-999999999",
        "1e308",
        "1e15",
        "1e-100",
        "1e-300",
    ),
    *(
        "9" * 400,
        "0x7fffffffffffffffff",
        "true",
        '""',
        '"text"',
        '"\\u0000\\u001b[2J"',
        '"\\ud800"',
        "[]",
        "{}",
    ),
    *(
        "[[]]",
        "[nan, 1]",
        "[1, 2]",
        "[2, 1]",
        "[1, 2, 3]",
        "[1e15, -1e15, 1e-100]",
        "{a.b.c = 1}",
        "1979-05-27",
    ),
    *(
        "07:32:00",
        "'''",
        '"""',
        "[" * 300,
        "[" * 300 + "]" * 300,
        "{a=" * 100 + "1" + "}" * 100,
        "\x00",
        "1__0",
        "١",
    ),
)
"""Values of every type of TOML, and some of none."""

_LINES = (
    *(
        "[target]",
        "[[target]]",
        "[sun]",
        "[[sun]]",
        "[[craft]]",
        "[[keep_in]]",
        "[]",
        "[a.b.c]",
        "kind = 2",
    ),
    *(
        "kind = 3",
        "a" * 2000 + " = 1",
        ".".join("a" * 400) + " = 1",
        "'' = 1",
        '"\\u001b" = 1',
        "= 1",
        "\ufeff",
        "\r",
    ),
)

_BYTES = (
    b"\0",
    b"\xff",
    b"\x80",
    b"\xc0\xaf",
    b"\xed\xa0\x80",
    b"\x7f",
    b"\n",
    b'"',
    b"[",
    b"\xff\xff\xff\xff",
)


def mutated_toml(text: str, draw: random.Random) -> bytes:
    """Return a TOML file with one to three things done to it."""
    for _ in range(draw.choice((1, 1, 2, 3))):
        text = draw.choice(_TEXT_MUTATIONS)(text.split("\n"), draw)
    content = text.encode(errors="surrogatepass")
    return mutated_bytes(content, draw) if draw.random() < 0.15 else content


def mutated_bytes(content: bytes, draw: random.Random) -> bytes:
    """Return bytes with a bit flipped, bytes put in, taken out, repeated or written over, or the
    end cut off.
    """
    at = draw.randrange(len(content) + 1)
    size = draw.choice((1, 1, 2, 4, 8, 100))
    match draw.choice(
        ("flip", "flip", "flip", "put in", "take out", "repeat", "write over", "cut off")
    ):
        case "flip" if content:
            at = min(at, len(content) - 1)
            return content[:at] + bytes([content[at] ^ 1 << draw.randrange(8)]) + content[at + 1 :]
        case "put in":
            return content[:at] + draw.choice((*_BYTES, draw.randbytes(size))) + content[at:]
        case "take out":
            return content[:at] + content[at + size :]
        case "repeat":
            return content[: at + size] + content[at:]
        case "write over":
            piece = draw.choice((*_BYTES, draw.randbytes(size)))
            return content[:at] + piece + content[at + len(piece) :]
    return content[:at]


def _keys(lines: list[str]) -> list[int]:
    """Return the lines that give a key a value."""
    return [at for at, line in enumerate(lines) if re.match(r"\s*[\w.\"-]+\s*=", line)] or [0]


def _drop(lines: list[str], draw: random.Random) -> str:
    at = draw.randrange(len(lines))
    return "\n".join(lines[:at] + lines[at + draw.choice((1, 1, 1, 5)) :])


def _repeat(lines: list[str], draw: random.Random) -> str:
    at = draw.choice(_keys(lines))
    return "\n".join([*lines[: at + 1], *lines[at : at + draw.choice((1, 1, 5))], *lines[at + 1 :]])


def _rename(lines: list[str], draw: random.Random) -> str:
    at = draw.choice(_keys(lines))
    name, equals, value = lines[at].partition("=")
    name = draw.choice(
        (name[:-2], f"x{name}", name.upper(), f'"{name}"', f"a.{name}", "", draw.choice(lines))
    )
    return "\n".join([*lines[:at], name + equals + value, *lines[at + 1 :]])


def _revalue(lines: list[str], draw: random.Random) -> str:
    at = draw.choice(_keys(lines))
    name, equals, _ = lines[at].partition("=")
    return "\n".join([*lines[:at], f"{name}{equals} {draw.choice(VALUES)}", *lines[at + 1 :]])


def _renumber(lines: list[str], draw: random.Random) -> str:
    """Change one number: its sign, its size, its type."""
    text = "\n".join(lines)
    found = list(re.finditer(r"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?", text))
    if not found:
        return text
    number = draw.choice(found)
    exponent = draw.choice((-200, -90, -30, -9, -3, -1, 1, 3, 9, 14, 30, 300))
    new = draw.choice(
        (
            f"-{number[0]}",
            f"{float(number[0][:300])!r}e{exponent}",
            "0",
            "nan",
            "inf",
            f'"{number[0]}"',
        )
    )
    if "e" in number[0].lower() or "e" in repr(float(number[0][:300])):
        new = draw.choice((f"1e{exponent}", f"-1e{exponent}", "0.0", "inf"))
    return text[: number.start()] + new + text[number.end() :]


def _swap(lines: list[str], draw: random.Random) -> str:
    one = draw.randrange(len(lines))
    other = draw.randrange(len(lines))
    lines[one], lines[other] = lines[other], lines[one]
    return "\n".join(lines)


def _insert(lines: list[str], draw: random.Random) -> str:
    at = draw.randrange(len(lines) + 1)
    return "\n".join([*lines[:at], draw.choice(_LINES), *lines[at:]])


def _cut(lines: list[str], draw: random.Random) -> str:
    text = "\n".join(lines)
    return text[: draw.randrange(len(text) + 1)]


_TEXT_MUTATIONS: tuple[Callable[[list[str], random.Random], str], ...] = (
    *(
        _drop,
        _repeat,
        _rename,
        _rename,
        _revalue,
        _revalue,
        _revalue,
        _renumber,
        _renumber,
        _swap,
        _insert,
        _cut,
    ),
)
