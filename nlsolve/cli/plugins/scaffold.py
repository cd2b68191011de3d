"""The files of a new plugin, made from templates: a class, its test, a study that uses it, or a whole package."""

from __future__ import annotations

import keyword
import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from nlsolve.registry.installed.contract_version import CONTRACT_VERSION, STATED
from nlsolve.registry.problems import StudyError

TEMPLATES = Path(__file__).parent / "templates"

HOOK = """

{stated} = "{contract}"  # the version of the plugin contract that this is written for


@hookimpl
def nlsolve_components():
    return [{cls}]
"""


@dataclass(frozen=True)
class Contract:
    """What a plugin is checked by: the check of `nlsolve.testing`, what else it imports, and its arguments.

    needs : libraries that the plugin imports and nlsolve does not bring.
    """

    check: str
    arguments: str = ""
    imports: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()


CONTRACTS: Mapping[str, Contract] = {
    "solver": Contract("check_solver"),
    "law": Contract("check_law"),
    "discretizer": Contract("check_discretizer", ", toy_cloud()", ("toy_cloud",)),
    "scene": Contract("check_scene", ", ToyLaw()", ("ToyLaw",)),
    "system": Contract("check_system"),
    "pde": Contract("check_simulation", needs=("scikit-fem>=10",)),
    "linear-solver": Contract("check_linear_solver"),
    "refresh": Contract("check_refresh_rule"),
    "operator": Contract("check_operator"),
    "predictor": Contract("check_predictor"),
    "globalization": Contract("check_globalization"),
    "range": Contract("check_range_rule"),
    "form": Contract("check_homotopy_form"),
}
"""What `nlsolve new` makes, by the word for it."""


def files_of(contract: str, name: str, package: bool) -> dict[str, str]:
    """Path -> text of each file of a new plugin. Raises StudyError for a name that cannot be a kind."""
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name) or keyword.iskeyword(name):
        raise StudyError(f"{name!r} cannot be a kind: write small letters, digits and hyphens, such as my-{contract}")
    module = name.replace("-", "_")
    if find_spec(module) is not None:
        raise StudyError(f"{name!r}: there is a module {module!r} already, which it would hide: choose another name")
    cls = "".join(word.capitalize() for word in name.split("-"))
    study = "study.toml" if package else f"{module}.toml"
    made = CONTRACTS[contract]
    words = {
        "kind": name,
        "module": module,
        "cls": cls,
        "noun": {"pde": "partial differential equation"}.get(contract, contract.replace("-", " ")),
        "dependencies": "".join(f', "{library}"' for library in made.needs),
        "study": study,
        "version": version("nlsolve"),
        "hook_import": ", hookimpl" if package else "",
        "hook": HOOK.format(cls=cls, stated=STATED, contract=CONTRACT_VERSION) if package else "",
        "plugins": "" if package else f'plugins = ["./{module}.py"] # relative to this file\n',
        "imports": ", ".join(sorted((made.check, *made.imports))),
        "call": f"{made.check}({cls}(){made.arguments})",
        "up": ".parent" if package else "",
    }
    templates = {
        f"{module}.py": f"{contract}.py",
        study: f"{contract}.toml",
        f"tests/test_{module}.py" if package else f"test_{module}.py": "test.py",
    }
    if package:
        more = {"pyproject.toml": "pyproject.toml", "README.md": "README.md", ".github/workflows/test.yml": "ci.yml"}
        templates = {f"{name}/{path}": template for path, template in (templates | more).items()}
    return {path: _rendered(template, words) for path, template in templates.items()}


def write(files: Mapping[str, str], folder: Path) -> list[Path]:
    """Write new files. Raises StudyError where one is there already, and writes none then."""
    there = [path for path in files if (folder / path).exists()]
    if there:
        raise StudyError(
            f"{folder / there[0]} is there already, and nothing was written: choose another name or folder"
        )
    for path, text in files.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
    return [folder / path for path in files]


def _rendered(template: str, words: Mapping[str, str]) -> str:
    """The text of a template, in which {{ word }} stands for one of the words."""
    text = (TEMPLATES / f"{template}.txt").read_text(encoding="utf-8")
    return re.sub(r"\{\{ (\w+) \}\}", lambda found: words[found[1]], text).rstrip() + "\n"
