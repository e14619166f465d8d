"""One self-contained HTML document: template, style, scripts and data.

Its policy blocks everything else.

Texts of users (names, descriptions) are JSON in a block that browsers do not run; every character
that could end this block is escaped. The scripts insert these texts as text, never as HTML. The
policy names the style and the scripts by their hashes, so nothing else runs, and nothing is
fetched.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources

from infoset.experiments.common.output import json_value
from infoset.sim.versions import versions

BLOCKS = ("dom.js", "chart.js", "scene.js", "player.js")
"""Scripts of every page, in this order."""

_MARKER = re.compile(r"\{\{(\w+)\}\}")
_ESCAPES = str.maketrans(
    {"<": "\\u003c", ">": "\\u003e", "&": "\\u0026", "\u2028": "\\u2028", "\u2029": "\\u2029"}
)


def page(
    title: str, scripts: Sequence[str], data: Mapping[str, object], own_script: str | None = None
) -> str:
    """Return a page as HTML; raise ValueError if a number is not finite.

    `scripts` are files of the folder `assets`, after the common blocks; `own_script` is the text of
    a script of this page only. The data are values for `to_json`; the keys ``heading`` and
    ``about`` (a list of lines) stand at the top of the page.
    """
    style = asset("page.css")
    programs = [asset(name) for name in (*BLOCKS, *scripts)]
    if own_script is not None:
        programs.append(own_script)
    parts = {
        "title": html.escape(title),
        "version": html.escape(versions()["infoset"]),
        "policy": _policy(style, programs),
        "style": style,
        "data": embedded_json({"version": versions()["infoset"], **data}),
        "scripts": "\n".join(f"<script>{program}</script>" for program in programs),
    }
    return _MARKER.sub(lambda marker: parts[marker[1]], asset("page.html"))


def embedded_json(value: object) -> str:
    """Return a value as JSON that can stand inside a script element of HTML.

    It contains no ``<``, ``>`` and ``&``, and no line separators that are not allowed in scripts.
    A parser of JSON reads the same value from it. The value is one for
    `infoset.experiments.common.output.to_json`.
    """
    text = json.dumps(
        value, allow_nan=False, ensure_ascii=False, separators=(",", ":"), default=json_value
    )
    # Half of a surrogate pair cannot be stored in a file: it is escaped.
    return text.translate(_ESCAPES).encode("utf-8", "backslashreplace").decode("utf-8")


@cache
def asset(name: str) -> str:
    """Return a file of the folder `assets`."""
    return (resources.files("infoset.experiments.common") / "assets" / name).read_text(
        encoding="utf-8"
    )


def _policy(style: str, programs: Sequence[str]) -> str:
    scripts = " ".join(_hash(program) for program in programs)
    return (
        f"default-src 'none'; script-src {scripts}; style-src {_hash(style)}; base-uri 'none'; "
        "form-action 'none'"
    )


def _hash(text: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
