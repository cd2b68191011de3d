"""Links within the documentation, which are the same in the site and where the Markdown is read as it is."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path
from typing import Any


def slug(heading: str) -> str:
    """The anchor of a heading as GitHub makes it: letters, digits, hyphens; ε₀ is ε, whose index is neither."""
    kept = (
        sign for sign in heading.lower().strip() if re.match(r"[\w\- ]", sign) and unicodedata.category(sign) != "No"
    )
    return "".join(kept).replace(" ", "-")


CODE = re.compile(r"^ *```.*?^ *```", flags=re.MULTILINE | re.DOTALL)


def slugs(page: str) -> set[str]:
    """The anchors of the headings of a page; of several that are the same the later ones are numbered."""
    found = [slug(heading) for heading in re.findall(r"^#+ (.+)$", CODE.sub("", page), flags=re.MULTILINE)]
    return {name if name not in found[:i] else f"{name}-{found[:i].count(name)}" for i, name in enumerate(found)}


def broken(path: Path) -> list[str]:
    """The links of a page to files, and to headings of pages, that are not there."""
    links = re.findall(r"\]\(([^)\s]+)\)", CODE.sub("", path.read_text(encoding="utf-8")))
    return [link for link in links if "://" not in link and not leads(link, path)]


WEB = re.compile(r"https://[a-z0-9-]+(\.[a-z0-9-]+)+(/[\w.,~%+@!$&'*;=:/?#-]*)?")
"""What a link to another site looks like: https, a host with a domain, and no letter that would have to be quoted."""


def malformed(path: Path) -> list[str]:
    """What of a page begins like a link to another site, in brackets or bare, and is not written like one."""
    text = re.sub(r"`[^`\n]*`", "", CODE.sub("", path.read_text(encoding="utf-8")))
    found = re.findall(r"\]\(<?([a-zA-Z]+:[^)\s]*)", text) + re.findall(r"(?<![(\w])(https?:[^\s)>\]\"]*)", text)
    return [link for link in found if not WEB.fullmatch(link.rstrip(".,;>"))]


def leads(link: str, path: Path) -> bool:
    """Whether what a link of the page at `path` names is there."""
    file, _, anchor = link.partition("#")
    target = path.parent / file if file else path
    return target.exists() and (not anchor or anchor in slugs(target.read_text(encoding="utf-8")))


def within(page: str) -> str:
    """A page whose links to files at the top of the source lead to the pages that include them."""
    return page.replace("](../CONTRIBUTING.md)", "](house/contributing.md)")


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", lambda app, name, source: source.append(within(source.pop())))
    return {"parallel_read_safe": True}
