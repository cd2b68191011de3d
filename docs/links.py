"""Links within the documentation, which are the same in the site and where the Markdown is read as it is."""

from __future__ import annotations

import re
import unicodedata
from typing import Any


def slug(heading: str) -> str:
    """The anchor of a heading as GitHub makes it: letters, digits, hyphens; ε₀ is ε, whose index is neither."""
    kept = (
        sign for sign in heading.lower().strip() if re.match(r"[\w\- ]", sign) and unicodedata.category(sign) != "No"
    )
    return "".join(kept).replace(" ", "-")


def within(page: str) -> str:
    """A page whose links to files at the top of the source lead to the pages that include them."""
    return page.replace("](../CONTRIBUTING.md)", "](house/contributing.md)")


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", lambda app, name, source: source.append(within(source.pop())))
    return {"parallel_read_safe": True}
