"""The house stands: each package imports what its own docstring says it may, and plugins use their door."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import nlsolve
import nlsolve.plugin

HOUSE = Path(nlsolve.__file__).parent
PLUGINS = HOUSE.parent / "plugins"
MOST_ENTRIES, MOST_FILES = 15, 10
LIBRARIES = {
    "nlsolve",
    "numpy",
    "scipy",
    "pydantic",
    "meshio",
    "pymklpardiso",
    "rslab",
    "mpi4py",
    "petsc4py",
    "sundials4py",
}
PROMISE = re.compile(r"\bmay import ([a-z, ]+?)\.", re.DOTALL)
DOORS = {"__init__", "plugin"}
MODULES = sorted(HOUSE.rglob("*.py"))
PLUGIN_MODULES = sorted(PLUGINS.rglob("*.py"))


def top_of(path: Path) -> str:
    """The package, or the module, at the top of the house that a file belongs to."""
    return path.relative_to(HOUSE).with_suffix("").parts[0]


def allowed_by(docstring: str) -> set[str]:
    """The packages that a docstring allows: "It may import series, contracts and results.", or nothing."""
    found = PROMISE.search(docstring)
    assert found, f"no sentence 'It may import …' in {docstring!r}"
    return {name for name in re.split(r",\s*|\s+and\s+", found[1].strip())} - {"nothing"}


def rules_of(house: Path) -> dict[str, set[str]]:
    """Package -> packages that it may import; a module at the top that is no door imports nothing."""
    rules: dict[str, set[str]] = {}
    for path in sorted(house.iterdir()):
        if (path / "__init__.py").exists():
            docstring = ast.get_docstring(ast.parse((path / "__init__.py").read_text(encoding="utf-8")))
            rules[path.name] = allowed_by(docstring or "")
        elif path.suffix == ".py" and path.stem not in DOORS:
            rules[path.stem] = set()
    return rules


def imports(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Module and names of every import of a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, []) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            yield node.module or "", [alias.name for alias in node.names]


def tops_imported(path: Path) -> set[str]:
    """What a file imports of the house, by the top of it."""
    return {module.split(".")[1] for module, _ in imports(path) if module.startswith("nlsolve.")} | {
        name for module, names in imports(path) if module == "nlsolve" for name in names
    }


def trespasses(house: Path) -> list[str]:
    """Every import that a package's own docstring does not allow, in a sentence."""
    rules, found = rules_of(house), []
    for path in sorted(house.rglob("*.py")):
        top = path.relative_to(house).with_suffix("").parts[0]
        if top not in DOORS:
            wrong = tops_imported(path) - rules[top] - {top}
            found += [f"{path.relative_to(house)} imports {name}: {top} may not" for name in sorted(wrong)]
    return found


def test_each_package_imports_what_it_says_it_may():
    assert trespasses(HOUSE) == []


def test_the_rules_themselves_go_one_way():
    order = list(TopologicalSorter(rules_of(HOUSE)).static_order())
    assert order[0] == "series"


def test_an_import_that_goes_upwards_is_found(tmp_path):
    """Planted: contracts import solving."""
    (tmp_path / "low").mkdir()
    (tmp_path / "low" / "__init__.py").write_text('"""Low. It may import series."""\n')
    (tmp_path / "high").mkdir()
    (tmp_path / "high" / "__init__.py").write_text('"""High. It may import low and series."""\n')
    (tmp_path / "series.py").write_text("")
    (tmp_path / "high" / "good.py").write_text("from nlsolve.low import thing\nfrom nlsolve.series import Array\n")
    assert trespasses(tmp_path) == []
    (tmp_path / "low" / "bad.py").write_text("def f():\n    from nlsolve.high.good import thing\n")
    assert trespasses(tmp_path) == ["low/bad.py imports high: low may not"]


def module_name(path: Path) -> str:
    parts = path.relative_to(HOUSE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_modules_do_not_import_each_other_in_a_circle():
    names = {module_name(path) for path in MODULES}
    graph = {}
    for path in MODULES:
        if top_of(path) in DOORS:
            continue
        targets = set()
        for module, imported in imports(path):
            targets |= {f"{module}.{name}" for name in imported if f"{module}.{name}" in names}
            targets |= {module} & names if not targets & {f"{module}.{name}" for name in imported} else set()
        graph[module_name(path)] = targets - {module_name(path), "nlsolve"}
    TopologicalSorter(graph).prepare()


@pytest.mark.parametrize("house", [HOUSE, PLUGINS], ids=["nlsolve", "plugins"])
def test_a_listing_can_be_read_at_a_glance(house):
    entries = [path for path in HOUSE.iterdir() if path.name != "__pycache__"]
    assert len(entries) <= MOST_ENTRIES, sorted(path.name for path in entries)
    for folder in {path.parent for path in house.rglob("*.py")} - {house}:
        files = sorted(path.name for path in folder.glob("*.py"))
        assert len(files) <= MOST_FILES, f"{folder.name} holds {len(files)} files: {files}"


@pytest.mark.parametrize("path", [*MODULES, *PLUGIN_MODULES], ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_no_import_inside_a_function(path):
    for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            hidden = [node for node in ast.walk(function) if isinstance(node, ast.Import | ast.ImportFrom)]
            assert not hidden, f"{path.name}, line {hidden[0].lineno if hidden else 0}"


@pytest.mark.parametrize("path", PLUGIN_MODULES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_plugins_use_their_door_only(path):
    own = path.relative_to(PLUGINS).parts[0]
    for module, names in imports(path):
        top = module.split(".")[0]
        assert top in LIBRARIES | {own} or top in sys.stdlib_module_names, f"{path.name} imports {module}"
        if top == "nlsolve":
            assert module == "nlsolve.plugin", f"{path.name} reaches past its door into {module}"
            missing = set(names) - set(nlsolve.plugin.__all__)
            assert not missing, f"{path.name}: {missing} is not public"


@pytest.mark.parametrize("door", [nlsolve, nlsolve.plugin], ids=["users", "plugin-authors"])
def test_public_names_are_there(door):
    assert all(hasattr(door, name) for name in door.__all__)


@pytest.mark.parametrize(
    "statement",
    ["import nlsolve", "import sys; sys.argv = ['nlsolve', '--version']; import nlsolve.cli.main as m; m.main()"],
)
def test_the_door_and_the_version_load_no_heavy_library(statement):
    """In a process of its own: what is loaded is looked at, not how long that takes."""
    heavy = ("matplotlib", "pyarrow", "pandas", "jinja2", "scipy", "typer", "numba")
    code = f"{statement}\nimport sys\nprint([name for name in {heavy!r} if name in sys.modules])"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.splitlines()[-1] == "[]"
