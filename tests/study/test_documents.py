"""Studies that extend one another and that bring plugins of one file: what is merged, and where mistakes are told."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
from fakes import STUDY, Box, Homotopy, Honey, Newton, Plugin, registry_of

from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import Registry
from nlsolve.study.documents import command_of, read_document
from nlsolve.study.study import Study
from nlsolve.study.sweeps import parse_assignments

REGISTRY = registry_of()
HALF = """\
from typing import Any, Literal

from nlsolve.plugin import NonlinearSolver, Step


class Half(NonlinearSolver):
    kind: Literal["half"] = "half"
    length: float = 0.5

    def steps(self, problem: Any, tangent: Any, start: Any) -> Any:
        yield Step(start)
"""


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text(text, encoding="utf-8")
    return path


def told(path: Path, folder: Path, **options) -> str:
    with pytest.raises(StudyError) as caught:
        Study.from_toml(path, registry=REGISTRY, **options)
    return str(caught.value).replace(f"{folder}/", "")


class TestExtends:
    def test_tables_are_merged_and_the_rest_is_replaced(self, tmp_path):
        write(tmp_path, "base.toml", STUDY)
        text = (
            'extends = "base.toml"\nquestion = "And then?"\nlaw.index = 0.3\nsolver = { kind = "newton" }\n'
            '[[sweep]]\ngrid = { "scene.side" = ["left", "right"] }\n'
            '[[table]]\nname = "t"\nrows = "scene.side"\nvalue = "tangents"\n'
        )
        study = Study.from_toml(write(tmp_path, "more.toml", text), registry=REGISTRY)
        assert (study.name, study.question) == ("more", "And then?")
        assert [case.parts.scene.side for case in study.cases] == ["left", "right"]
        assert all(case.parts.law == Honey(index=0.3) and case.parts.solver == Newton() for case in study.cases)
        assert [table.name for table in study.tables] == ["t"]
        assert study.has_quick

    def test_over_several_files_in_several_folders(self, tmp_path):
        write(tmp_path, "deep/base.toml", STUDY)
        write(tmp_path, "deep/middle.toml", 'extends = "base.toml"\nscene.side = "right"\n')
        top = write(tmp_path, "top.toml", 'extends = "deep/middle.toml"\nlaw.index = 0.3\n')
        case = Study.from_toml(top, registry=REGISTRY).cases[0]
        assert (case.parts.scene, case.parts.law.index) == (Box(side="right"), 0.3)

    def test_each_mistake_is_told_in_its_own_file(self, tmp_path):
        write(tmp_path, "base.toml", STUDY.replace('kind = "honey"', 'kind = "honey"\nindx = 1'))
        top = write(tmp_path, "top.toml", 'extends = "base.toml"\nlaw.index = -1.0\nsolver.order = 0\n')
        assert told(top, tmp_path) == (
            "top.toml, line 2: law.index = -1.0: should be greater than 0\n"
            "base.toml, line 8: law.indx = 1: no such field; did you mean 'index'?"
        )
        sweep = '[[sweep]]\ngrid = { "solver.order" = [0] }\n'
        top = write(tmp_path, "top.toml", f'extends = "base.toml"\nlaw = {{ kind = "honey" }}\n{sweep}')
        assert told(top, tmp_path) == "top.toml, line 4: solver.order = 0: should be greater than or equal to 2"
        quick = write(tmp_path, "top.toml", 'extends = "base.toml"\nlaw = { kind = "honey" }\nquick."scene.sid" = 1\n')
        assert told(quick, tmp_path, quick=True) == (
            "top.toml, line 3: scene.sid = 1: no such field; did you mean 'side'?"
        )

    def test_lines_of_replaced_values_are_forgotten(self, tmp_path):
        write(tmp_path, "base.toml", STUDY)
        top = write(tmp_path, "top.toml", 'extends = "base.toml"\nlaw.index = 0.3\nsweep = []\n')
        document, source = read_document(top)
        assert document["sweep"] == []
        assert source.at(("sweep", 0, "grid")) == f"{top}, line 3"
        assert source.at(("law", "index")) == f"{top}, line 2"
        assert source.at(("law", "kind")) == f"{tmp_path / 'base.toml'}, line 7"
        assert source.at(("table", 0, "rows")) == f"{tmp_path / 'base.toml'}, line 20"

    def test_a_circle_an_absent_file_and_other_values(self, tmp_path):
        write(tmp_path, "a.toml", 'extends = "b.toml"\n')
        circle = write(tmp_path, "b.toml", 'question = "q"\nextends = "a.toml"\n')
        assert told(circle, tmp_path) == (
            "a.toml, line 1: extends = 'b.toml': studies cannot extend one another in a circle: "
            "b.toml extends a.toml extends b.toml"
        )
        for written, sentence in (
            ('"a.tml"', "extends = 'a.tml': there is no file a.tml"),
            ("3", "extends = 3: should be the path of a study, relative to this one"),
            ('""', "extends = '': should be the path of a study, relative to this one"),
        ):
            assert told(write(tmp_path, "c.toml", f"extends = {written}\n"), tmp_path) == f"c.toml, line 1: {sentence}"
        with pytest.raises(StudyError, match=r"extends = 'a.toml': a study in a dictionary extends none"):
            Study.from_dict({"question": "q", "extends": "a.toml"}, registry=REGISTRY)

    def test_a_base_that_is_no_toml_is_told_there(self, tmp_path):
        write(tmp_path, "base.toml", "law = ]")
        top = write(tmp_path, "top.toml", 'extends = "base.toml"\n')
        assert told(top, tmp_path) == "base.toml, line 1, column 7: not valid TOML: Invalid value"


class TestPlugins:
    def test_paths_are_relative_to_the_file_they_are_written_in(self, tmp_path):
        write(tmp_path, "deep/half.py", HALF)
        mine = STUDY[: STUDY.index("[[sweep]]")].replace('kind = "anm"', 'kind = "half"\nlength = 0.25')
        path = write(tmp_path, "deep/study.toml", f'plugins = ["./half.py"]\n{mine}')
        study = Study.from_toml(path, registry=REGISTRY)
        assert study.cases[0].parameters["solver.length"] == 0.25
        assert "solver.class" not in study.cases[0].parameters
        assert study.plugins == (tmp_path / "deep" / "half.py",)
        top = write(tmp_path, "top.toml", 'extends = "deep/study.toml"\nsolver.length = 1.0\n')
        assert Study.from_toml(top, registry=REGISTRY).cases[0].parts.solver.length == 1.0
        assert "half" not in REGISTRY.classes("solver")

    def test_mistakes_have_their_line(self, tmp_path):
        path = write(tmp_path, "study.toml", f'{STUDY.splitlines()[0]}\nplugins = [\n  "nowhere.py",\n]\n')
        sentence = "plugins[0]: the plugin nowhere.py cannot be read: No such file or directory"
        assert told(path, tmp_path) == f"study.toml, line 3: {sentence}"
        for written in ('"half.py"', "[3]", "{ a = 1 }"):
            path = write(tmp_path, "study.toml", f"plugins = {written}\n{STUDY}")
            assert told(path, tmp_path).startswith("study.toml, line 1: plugins")


class OtherNewton(Newton):
    """A stranger's."""


class TestQualifiedKinds:
    @pytest.fixture
    def registry(self) -> Registry:
        found = registry_of()
        found.add(Plugin(OtherNewton), "my-pkg 2.0 (mine)")
        return found

    def test_they_stand_wherever_a_kind_stands(self, registry):
        sweep = [{"grid": {"solver": [{"kind": "my-pkg:newton"}, {"kind": "fakes:newton"}, {"kind": "fakes:anm"}]}}]
        base = {"question": "q", "scene": {"kind": "fakes:box"}, "law": {"kind": "honey"}, "sweep": sweep}
        start = {"solver": {"kind": "my-pkg:newton"}}
        cases = Study.from_dict(base | {"discretizer": {"kind": "grid"}, "start": start}, registry=registry).cases
        assert [type(case.parts.solver) for case in cases] == [OtherNewton, Newton, Homotopy]
        assert [case.parameters["solver.kind"] for case in cases] == ["my-pkg:newton", "fakes:newton", "anm"]
        assert len({case.id for case in cases}) == 3
        assert type(cases[0].parts.start.solver) is OtherNewton
        assert cases[0].parameters["start.solver.kind"] == "my-pkg:newton"

    def test_who_asks_without_a_package_is_told_the_names(self, registry, tmp_path):
        text = STUDY[: STUDY.index("[[sweep]]")].replace('"anm"', '"newton"')
        path = write(tmp_path, "study.toml", text)
        with pytest.raises(StudyError) as caught:
            Study.from_toml(path, registry=registry)
        sentence = (
            "solver 'newton' is offered by fakes 1.0 and my-pkg 2.0 (mine): ask for 'fakes:newton' or 'my-pkg:newton'"
        )
        assert str(caught.value).splitlines() == [
            f"{path}: start.solver.kind = 'newton': {sentence}",
            f"{path}, line 13: solver.kind = 'newton': {sentence}",
        ]

    def test_wrong_fields_of_a_qualified_kind(self, registry, tmp_path):
        solver = 'kind = "my-pkg:newton"\nordr = 3'
        path = write(tmp_path, "study.toml", STUDY[: STUDY.index("[[sweep]]")].replace('kind = "anm"', solver))
        with pytest.raises(StudyError, match=r"line 14: solver.ordr = 3: no such field; there are 'kind'"):
            Study.from_toml(path, overrides={"start.solver.kind": "my-pkg:newton"}, registry=registry)


def test_the_command_of_a_study_runs_it_again(tmp_path):
    """What a table in LaTeX says of how it was made: every setting as --set reads it."""
    path = tmp_path / "my study.toml"
    path.write_text(STUDY, encoding="utf-8")
    settings = {"solver.order": 5, "scene.kind": "box", "solver.tolerance": 1e-7}
    words = shlex.split(Study.from_toml(path, settings, quick=True, registry=REGISTRY).command)
    assert words[:3] == ["nlsolve", "run", str(path)]
    assert words[-1] == "--quick"
    assert parse_assignments(words[4:-1:2]) == settings
    assert command_of("s.toml", {}, False, [Path("a.py")]) == "nlsolve run s.toml --plugin a.py"
