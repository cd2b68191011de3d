"""The house stands: imports go downwards only, none hides in a function, and plugins use the front door."""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import nlsolve

HOUSE = Path(nlsolve.__file__).parent
PLUGINS = HOUSE.parent / "plugins"

FLOORS = [
    "series component status columns",
    "laws scenes systems discretizers linear problems assembled predictors globalization solvers",
    "flow algebra compression tangent pressure motion start setup balance march measures estimate audit ledger driver",
    "hookspecs registry nested",
    "studies composition locate errors outcomes shares condense sweeps references runner store tables papers report "
    "plan diagnose figures costs predictions envelope crossover",
    "testing small cli progress __init__",
]
FLOOR = {name: number for number, names in enumerate(FLOORS) for name in names.split()}
MODULES = sorted(HOUSE.rglob("*.py"))
PLUGIN_MODULES = sorted(PLUGINS.rglob("*.py"))
LIBRARIES = {"nlsolve", "numpy", "scipy", "pydantic", "meshio", "rslab", "mpi4py", "petsc4py", "sundials4py"}


def imports(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Module and names of every import of a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, []) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            yield node.module or "", [alias.name for alias in node.names]


def name_of(path: Path) -> str:
    """A module's name inside the house: "march", "figures.line", "figures", "__init__"."""
    parts = path.relative_to(HOUSE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 1 else parts)


NAMES = {name_of(path) for path in MODULES}


def floor_of(name: str) -> int:
    """A package stands on one floor with all its modules."""
    return FLOOR[name.split(".")[0]]


def inside(path: Path) -> set[str]:
    """Modules of the house that a file imports."""
    found = set()
    for module, names in imports(path):
        if module == "nlsolve":
            found |= {name if name in NAMES else "__init__" for name in names}
        elif module.startswith("nlsolve."):
            found.add(module.removeprefix("nlsolve."))
    return found


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_imports_go_downwards(path):
    name = name_of(path)
    assert name.split(".")[0] in FLOOR, "a new module belongs to a floor"
    above = {other for other in inside(path) if floor_of(other) > floor_of(name)}
    assert not above, f"{name} (floor {floor_of(name)}) imports {above}"


def test_neighbours_do_not_import_each_other_in_a_circle():
    TopologicalSorter({name_of(path): inside(path) for path in MODULES}).prepare()


@pytest.mark.parametrize("path", [*MODULES, *PLUGIN_MODULES], ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_no_import_inside_a_function(path):
    for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            hidden = [node for node in ast.walk(function) if isinstance(node, ast.Import | ast.ImportFrom)]
            assert not hidden, f"{path.name}, line {hidden[0].lineno if hidden else 0}"


@pytest.mark.parametrize("path", PLUGIN_MODULES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_plugins_use_public_names_only(path):
    own = path.relative_to(PLUGINS).parts[0]
    for module, names in imports(path):
        top = module.split(".")[0]
        assert top in LIBRARIES | {own} or top in sys.stdlib_module_names, f"{path.name} imports {module}"
        if top == "nlsolve":
            assert module == "nlsolve", f"{path.name} reaches past the public names into {module}"
            assert set(names) <= set(nlsolve.__all__), f"{path.name}: {set(names) - set(nlsolve.__all__)} is not public"


def test_public_names_are_there():
    assert all(hasattr(nlsolve, name) for name in nlsolve.__all__)
