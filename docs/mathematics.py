"""Mathematics as MathML, which browsers set themselves: pages need no script and no other site."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert

NAME = "mathml"


def mathml(text: str, display: str = "inline") -> str:
    """A formula of LaTeX in MathML. Raises ValueError for a command that is not known."""
    found: str = convert(text, display=display)
    unknown = re.search(r">(\\\w+)<", found)
    if unknown:
        raise ValueError(f"{unknown[1]} in {text!r} cannot be set")
    return found


def inline(writer: Any, node: nodes.math) -> None:
    """Write a formula within a line."""
    writer.body.append(mathml(node.astext()))
    raise nodes.SkipNode


def block(writer: Any, node: nodes.math_block) -> None:
    """Write a formula on a line of its own."""
    writer.body.append(mathml(node.astext(), "block"))
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_html_math_renderer(NAME, (inline, None), (block, None))
    return {"parallel_read_safe": True}
