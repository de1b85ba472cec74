"""Formulas as MathML, written into the pages at build time: nothing is fetched and no script runs in the reader."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import Any

from latex2mathml.converter import convert
from sphinx.util import logging

from flocking.errors import InvalidInput
from flocking.formula.markup.mathml import to_mathml as own_mathml

logger = logging.getLogger(__name__)


def to_mathml(latex: str, display: str, place: object = None) -> str:
    """MathML of a formula; a command the converter does not know is a warning, which fails the build."""
    # What the converter sets badly, as aligned rows on one line, the library's own typesetting of laws sets well.
    if re.search(r"\\begin\{aligned\}|\\[lr]vert\b", latex):
        with suppress(InvalidInput):
            return own_mathml(latex, block=display == "block")
    found = convert(latex, display=display)
    if unknown := re.search(r">\s*(\\[A-Za-z]+)", found):
        logger.warning("formula uses unknown %s: %s", unknown.group(1), latex, location=place)
    return found


def inline(writer: Any, node: Any) -> None:
    """Write a formula in a line of text."""
    from docutils.nodes import SkipNode

    writer.body.append(to_mathml(node.astext(), "inline", node))
    raise SkipNode


def block(writer: Any, node: Any) -> None:
    """Write a formula on a line of its own."""
    from docutils.nodes import SkipNode

    writer.body.append(
        writer.starttag(node, "div", CLASS="math") + to_mathml(node.astext(), "block", node) + "</div>\n"
    )
    raise SkipNode


def setup(app: Any) -> dict[str, Any]:
    """Register the renderer under the name ``mathml``."""
    app.add_html_math_renderer("mathml", inline_renderers=(inline, None), block_renderers=(block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
