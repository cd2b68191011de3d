"""What makes a case run again: its parameters, the files it reads, the source it runs. What does not: all else."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from fakes import COMPONENTS, Honey, registry_of, write_study

import nlsolve
from nlsolve.running.store import sources
from nlsolve.running.store.identity import MISSING, Identity, identity_of
from nlsolve.running.store.sources import NUMERICS, numerics, sources_of
from nlsolve.study.study import Study

LAW = """
from typing import Literal
from nlsolve.plugin import ConstitutiveLaw


class Syrup(ConstitutiveLaw):
    kind: Literal["syrup"] = "syrup"

    def viscosity(self, rate_squared):
        return 2.0 + 0.0 * rate_squared
"""


@pytest.fixture
def importable(tmp_path, monkeypatch):
    """Writes a module or package and imports it anew."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    names: list[str] = []

    def imported(name: str, **texts: str):
        for file, text in texts.items():
            path = tmp_path / (f"{name}.py" if file == "alone" else f"{name}/{file}.py")
            path.parent.mkdir(exist_ok=True)
            path.write_text(text, encoding="utf-8")
        names.append(name)
        forget()
        return import_module(name)

    def forget() -> None:
        for loaded in [loaded for loaded in sys.modules if loaded.partition(".")[0] in names]:
            del sys.modules[loaded]

    yield imported
    forget()


def study_of(tmp_path: Path, *changes: tuple[str, str], **overrides: object) -> Study:
    return Study.from_toml(write_study(tmp_path, *changes), overrides, registry=registry_of())


def keys(study: Study) -> list[str]:
    return [identity_of(case).key for case in study.cases]


def test_a_case_keeps_its_name_whatever_is_asked_shown_or_swept_besides(tmp_path):
    known = keys(study_of(tmp_path))
    assert keys(study_of(tmp_path, ("How many branches?", "Why?"))) == known
    assert keys(study_of(tmp_path, ('name = "branches"', 'name = "b"'))) == known
    swept = '"solver.order" = [10, 20], "solver.tolerance" = [1e-6, 1e-8]'
    turned = '"solver.tolerance" = [1e-8, 1e-6], "solver.order" = [20, 10]'
    assert sorted(keys(study_of(tmp_path, (swept, turned)))) == sorted(known)
    assert set(keys(study_of(tmp_path, ("[10, 20]", "[5, 10, 20]")))) > set(known)
    assert not set(keys(study_of(tmp_path, ('kind = "honey"', 'kind = "honey"\nindex = 0.3')))) & set(known)
    assert keys(study_of(tmp_path, ('kind = "honey"', 'kind = "honey"\nindex = 0.5'))) == known, "the default"


def test_the_code_of_a_case_is_that_of_its_classes(tmp_path):
    identity = identity_of(study_of(tmp_path).cases[0])
    assert set(identity.code) == {"fakes", "nlsolve"}
    assert identity.code["nlsolve"] == numerics()
    assert identity.files == {}
    assert all(set(sources_of(cls)) == {"fakes", "nlsolve"} for cls in COMPONENTS)


def test_an_edited_module_is_another_source(importable):
    before = sources_of(importable("syrup_alone", alone=LAW).Syrup)["syrup_alone"]
    assert sources_of(importable("syrup_alone", alone=LAW).Syrup)["syrup_alone"] == before
    assert sources_of(importable("syrup_alone", alone=LAW.replace("2.0", "3.0")).Syrup)["syrup_alone"] != before


def test_a_package_counts_whole(importable, tmp_path):
    law = "from syrup_package.law import Syrup"
    texts = {"__init__": law, "law": LAW, "helper": "VALUE = 1.0"}
    before = sources_of(importable("syrup_package", **texts).Syrup)["syrup_package"]
    (tmp_path / "syrup_package" / "notes.txt").write_text("nothing that is run", encoding="utf-8")
    assert sources_of(importable("syrup_package", **texts).Syrup)["syrup_package"] == before
    changed = importable("syrup_package", **(texts | {"helper": "VALUE = 2.0"}))
    assert sources_of(changed.Syrup)["syrup_package"] != before


def test_what_is_imported_counts_not_what_was_written_since(importable, tmp_path):
    cls = importable("syrup_later", alone=LAW).Syrup
    before = sources_of(cls)
    (tmp_path / "syrup_later.py").write_text(LAW.replace("2.0", "3.0"), encoding="utf-8")
    assert sources_of(cls) == before


def test_a_base_of_another_package_counts(importable):
    importable("syrup_base", alone=LAW)
    derived = importable("syrup_derived", alone="from syrup_base import Syrup\nclass Thin(Syrup):\n    '''Thin.'''\n")
    assert set(sources_of(derived.Thin)) == {"syrup_derived", "syrup_base", "nlsolve"}


def test_a_class_typed_at_a_prompt_counts_by_its_methods():
    def typed(text: str) -> str:
        names: dict = {"__name__": "typed_at_a_prompt"}
        exec(compile(text, "<stdin>", "exec"), names)
        return sources_of(names["Syrup"])["typed_at_a_prompt"]

    assert typed(LAW) == typed(LAW + "\n# the same\n")
    assert typed(LAW) != typed(LAW.replace("2.0", "3.0"))


def test_a_file_that_is_loaded_under_another_name_has_its_own(tmp_path):
    """As a study's `plugins = ["./my_law.py"]` may do, with a name that follows from the text."""
    (tmp_path / "my_law.py").write_text(LAW, encoding="utf-8")
    names: dict = {"__name__": "loaded_under_another_name"}
    exec(compile(LAW, str(tmp_path / "my_law.py"), "exec"), names)
    assert set(sources_of(names["Syrup"])) == {"my_law.py", "nlsolve"}


def test_a_version_counts(importable, monkeypatch):
    monkeypatch.setattr(sources, "_versions", lambda: {"syrup_versioned": "1.0"})
    before = sources_of(importable("syrup_versioned", alone=LAW).Syrup)
    monkeypatch.setattr(sources, "_versions", lambda: {"syrup_versioned": "1.1"})
    after = sources_of(importable("syrup_versioned", alone=LAW).Syrup)
    old, new = (Identity("c", code, {}) for code in (before, after))
    assert old.key != new.key
    assert new.changes_since(old) == ("changed plugin syrup_versioned 1.0 -> 1.1",)


def test_versions_are_those_of_the_entry_points():
    versions = sources._versions()
    assert "nlsolve_laws" not in versions, "nlsolve's own plugins count by their source"


def test_numerics_are_there_and_an_edit_elsewhere_is_none_of_them(tmp_path):
    """In a copy of the package, by a process of its own."""
    home = Path(nlsolve.__file__).parent
    assert all((home / name).exists() for name in NUMERICS)
    copy = tmp_path / "nlsolve"
    shutil.copytree(home, copy, ignore=shutil.ignore_patterns("__pycache__"))
    code = "from nlsolve.running.store.sources import numerics, __file__ as place; print(place, numerics())"

    def told() -> str:
        ran = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
        place, found = ran.stdout.split()
        assert Path(place).is_relative_to(tmp_path)
        return found

    assert told() == numerics()
    for elsewhere in ("cli/app.py", "show/report.py", "running/runner.py"):
        with (copy / elsewhere).open("a", encoding="utf-8") as file:
            file.write("\n# edited\n")
    assert told() == numerics()
    with (copy / "solving" / "driver.py").open("a", encoding="utf-8") as file:
        file.write("\n# edited\n")
    assert told() != numerics()


def test_an_edited_file_is_another_case(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    nodes = 'kind = "channel"\nnodes = { kind = "file", path = "nodes.csv" }'
    text = f'question = "?"\n[scene]\n{nodes}\n[law]\nkind = "power-law"\n[discretizer]\nkind = "mls"\n'
    (tmp_path / "study.toml").write_text(text + '[solver]\nkind = "newton"\n', encoding="utf-8")

    def identity() -> Identity:
        return identity_of(Study.from_toml(tmp_path / "study.toml").cases[0])

    lacking = identity()
    assert lacking.files == {"nodes.csv": MISSING}
    (tmp_path / "nodes.csv").write_text("x,y,group\n0,0,\n", encoding="utf-8")
    first = identity()
    assert first.case == lacking.case
    assert first.changes_since(lacking) == ("changed file nodes.csv",)
    (tmp_path / "nodes.csv").write_text("x,y,group\n0,1,\n", encoding="utf-8")
    assert identity().key != first.key
    (tmp_path / "nodes.csv").write_text("x,y,group\n0,0,\n", encoding="utf-8")
    assert identity() == first
    assert {"nlsolve_scenes", "nlsolve_laws", "nlsolve_solvers"} < set(first.code)


def test_several_changes_are_all_told():
    old = Identity("c", {"nlsolve": "aa", "honey": "1.0 bb", "wax": "cc"}, {"a.csv": "x"})
    new = Identity("c", {"nlsolve": "ab", "honey": "1.0 bd", "wax": "cc"}, {"a.csv": "y"})
    assert new.changes_since(old) == ("changed plugin honey", "changed nlsolve", "changed file a.csv")
    assert new.changes_since(new) == ()


def test_fields_of_instances_count(tmp_path):
    document = {"scene": {"kind": "box"}, "discretizer": {"kind": "grid"}, "solver": {"kind": "newton"}}
    first, second = (
        Study.from_dict({"question": "?", "law": Honey(index=index), **document}, registry=registry_of()).cases[0]
        for index in (0.2, 0.3)
    )
    assert identity_of(first).key != identity_of(second).key
    assert identity_of(first).code == identity_of(second).code
