"""Formulas as MathML, which browsers render without scripts or fonts from the network."""

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
_log = logging.getLogger(__name__)


def _markup(node: nodes.Element, *, as_block: bool) -> str:
    source = node.astext()
    try:
        return tex2mathml(_TAG.sub("", source).strip(), as_block=as_block)
    except MathError as error:  # a warning: the build counts it as an error
        _log.warning("cannot render the formula %r: %s", source, error, location=node)
        return f"<code>{escape(source)}</code>"


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
    app.add_html_math_renderer("mathml", inline_renderers=(_visit_inline, None), block_renderers=(_visit_block, None))
    return {"version": "1", "parallel_read_safe": True}
