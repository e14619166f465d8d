"""Formulas as MathML, which browsers render without scripts or fonts from the network.

docutils converts LaTeX to MathML. Three things that it does not do are added here: numbers of
equations, bars as brackets, and an accent on a symbol with an index.
"""

from __future__ import annotations

import re
from html import escape
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging
from sphinx.writers.html5 import HTML5Translator

_TAG = re.compile(r"\\tag\{([^}]*)\}")
_LEFT_BAR = re.compile(r"(?<!\\left)\\lvert\b")
_RIGHT_BAR = re.compile(r"(?<!\\right)\\rvert\b")
# docutils puts the index of an accented symbol under it: <munderover> base index accent.
_ACCENT_AND_INDEX = re.compile(
    r"<munderover>\s*(<mi>[^<]*</mi>)\s*(<m[in]>[^<]*</m[in]>)\s*"
    r"(<mo stretchy=\"false\">[^<]*</mo>)\s*</munderover>"
)
_log = logging.getLogger(__name__)


def _markup(node: nodes.Element, *, as_block: bool) -> str:
    source = _TAG.sub("", node.astext()).strip()
    source = _RIGHT_BAR.sub(r"\\right\\rvert", _LEFT_BAR.sub(r"\\left\\lvert", source))
    try:
        markup = tex2mathml(source, as_block=as_block)
    except MathError as error:  # a warning: the build counts it as an error
        _log.warning("cannot render the formula %r: %s", source, error, location=node)
        return f"<code>{escape(source)}</code>"
    markup = _ACCENT_AND_INDEX.sub(r'<msub><mover accent="true">\1\3</mover>\2</msub>', markup)
    # Browsers draw the fractions of a table of equations small, unless it says otherwise.
    return markup.replace("<mtable", '<mtable displaystyle="true"') if as_block else markup


def _visit_inline(translator: HTML5Translator, node: nodes.math) -> None:
    translator.body.append(_markup(node, as_block=False))
    raise nodes.SkipNode


def _visit_block(translator: HTML5Translator, node: nodes.math_block) -> None:
    number = _TAG.search(node.astext())
    label = "" if number is None else f'<span class="eqno">({escape(number[1])})</span>'
    translator.body.append(f'<div class="math">{label}{_markup(node, as_block=True)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the renderer `mathml`."""
    app.add_html_math_renderer(
        "mathml", inline_renderers=(_visit_inline, None), block_renderers=(_visit_block, None)
    )
    return {"version": "1", "parallel_read_safe": True}
