"""The version of the plugin contract: what a plugin was written for, and whether this nlsolve serves it.

A plugin states it at the top of its module, as `nlsolve_contract = "1.0"`. It is read from the text, before the module
is imported: a plugin for another contract would else fail in its own words, where a name that it imports is not there.
A plugin that states none is taken as it is.

The first number rises when plugins must change, the second when something is added that older plugins do without.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from importlib.metadata import EntryPoint, version
from importlib.util import find_spec
from pathlib import Path

CONTRACT_VERSION = "1.0"
"""The version of the contracts in `nlsolve.plugin`."""

STATED = "nlsolve_contract"
"""The name by which a module states the version that it was written for."""


def unserved(text: str, own: str = CONTRACT_VERSION) -> str:
    """Why a plugin with this text cannot be used here, with the way out; empty when it can, or states no version.

    own : the version that is served.
    """
    stated = next(_stated(text), None)
    if stated is None:
        return ""
    if not isinstance(stated, str) or not re.fullmatch(r"\d+\.\d+", stated):
        return f'its {STATED} = {stated!r} is no version of the plugin contract: write {STATED} = "{own}"'
    major, minor = map(int, stated.split("."))
    own_major, own_minor = map(int, own.split("."))
    if major == own_major and minor <= own_minor:
        return ""
    here = f"it was written for plugin contract {stated}, and nlsolve {version('nlsolve')} has {own}"
    if (major, minor) > (own_major, own_minor):
        return f"{here}: install a newer nlsolve, or an older version of the plugin"
    return f'{here}: install a newer version of the plugin, or change it as CHANGELOG.md says, then {STATED} = "{own}"'


def text_of(entry: EntryPoint) -> str:
    """The text of the module of an entry point, which is not imported (its packages are); empty where there is none.

    Raises whatever its packages raise.
    """
    try:
        spec = find_spec(entry.module)
    except ValueError:  # a module that was made by hand
        return ""
    file = Path(spec.origin) if spec is not None and spec.has_location and spec.origin is not None else None
    return file.read_text(encoding="utf-8") if file is not None and file.suffix == ".py" else ""


def _stated(text: str) -> Iterator[object]:
    """The value that the top of a module gives to the name; nothing where it is not written out."""
    if STATED not in text:
        return
    try:
        body = ast.parse(text).body
    except SyntaxError:  # told where the module is imported
        return
    for line in body:
        if isinstance(line, ast.Assign) and STATED in map(ast.unparse, line.targets):
            yield line.value.value if isinstance(line.value, ast.Constant) else ast.unparse(line.value)
