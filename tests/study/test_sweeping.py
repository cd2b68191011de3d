"""What a study may write in place of lists of values: generators, seeds, and cases that are left out."""

from __future__ import annotations

import tomllib
from typing import Any

import pytest
from fakes import STUDY, registry_of

from nlsolve.registry.problems import StudyError
from nlsolve.study.generators import generated
from nlsolve.study.study import Study

REGISTRY = registry_of()
BASE = STUDY[: STUDY.index("[[sweep]]")]


def study(text: str, **options: Any) -> Study:
    return Study.from_dict(tomllib.loads(BASE + text), registry=REGISTRY, **options)


def told(text: str, tmp_path: Any, **options: Any) -> str:
    path = tmp_path / "study.toml"
    path.write_text(BASE + text, encoding="utf-8")
    with pytest.raises(StudyError) as caught:
        Study.from_toml(path, registry=REGISTRY, **options)
    return str(caught.value).replace(f"{tmp_path}/", "")


class TestGenerators:
    @pytest.mark.parametrize(
        ("written", "values"),
        [
            ({"linspace": [0.1, 0.5, 5]}, [0.1, 0.2, 0.3, 0.4, 0.5]),
            ({"linspace": [3, 3, 1]}, [3.0]),
            ({"logspace": [1e-8, 1e-2, 4]}, [1e-8, 1e-6, 1e-4, 1e-2]),
            ({"logspace": [1, 2, 3]}, [1.0, 1.41421356237, 2.0]),
            ({"range": [10, 25, 5]}, [10, 15, 20, 25]),
            ({"range": [10, 24, 5]}, [10, 15, 20]),
            ({"range": [1.0, 0.5, -0.1]}, [1.0, 0.9, 0.8, 0.7, 0.6, 0.5]),
            ([1, "auto"], [1, "auto"]),
        ],
    )
    def test_values(self, written, values):
        made = generated(written)
        assert made == values
        assert [type(value) for value in made] == [type(value) for value in values]

    @pytest.mark.parametrize(
        ("written", "sentence"),
        [
            ('"law.index" = { linspace = [0.1, 1.0] }', "linspace needs [first, last, count]: numbers, evenly spaced"),
            ('"law.index" = { linspace = [0.1, 1.0, 2.5] }', "linspace needs a count of at least 1, and has 2.5"),
            ('"law.index" = { linspace = [0.1, 1.0, 0] }', "linspace needs a count of at least 1, and has 0"),
            ('"law.index" = { linspace = [0.1, inf, 3] }', "linspace needs [first, last, count]"),
            ('"law.index" = { logspace = [0.0, 1.0, 3] }', "logspace needs positive numbers, and goes from 0.0 to 1.0"),
            ('"law.index" = { range = [1, 3, -1] }', "range goes from 1 to 3 by steps of -1, which never arrive"),
            ('"law.index" = { range = [1, 3, 0] }', "range goes from 1 to 3 by steps of 0, which never arrive"),
            ('"law.index" = { }', "should be a list of values, or { linspace = … }"),
        ],
    )
    def test_mistakes_are_told_with_their_line(self, tmp_path, written, sentence):
        message = told(f"[[sweep]]\ngrid = {{ {written} }}\n", tmp_path)
        assert message.startswith("study.toml, line 16: sweep[0].grid.law.index")
        assert sentence in message
        assert "\n" not in message

    def test_they_stand_in_a_grid_and_in_a_zip(self):
        sweep = '[[sweep]]\ngrid = { "solver.order" = { range = [10, 20, 10] }, law.index = [0.5, 1.0] }\n'
        cases = study(sweep).cases
        assert [(c.parts.solver.order, c.parts.law.index) for c in cases] == [
            (10, 0.5),
            (10, 1.0),
            (20, 0.5),
            (20, 1.0),
        ]
        sweep = (
            "[[sweep]]\nzip = { solver.order = { linspace = [10, 20, 2] }, law.index = { linspace = [0.5, 1.0, 2] } }\n"
        )
        cases = study(sweep).cases
        assert [(c.parts.solver.order, c.parts.law.index) for c in cases] == [(10, 0.5), (20, 1.0)]
        assert [case.label for case in cases] == [
            "law.index = 0.5, solver.order = 10",
            "law.index = 1.0, solver.order = 20",
        ]

    def test_a_value_of_a_generator_that_is_refused_has_its_line(self, tmp_path):
        sweep = '[[sweep]]\ngrid = { "solver.order" = { range = [0, 20, 10] } }\n'
        assert told(sweep, tmp_path) == ("study.toml, line 16: solver.order = 0: should be greater than or equal to 2")

    def test_a_field_called_range_is_no_generator(self):
        solver = {"kind": "anm"}
        ranges = {"solver": {"range": ["ratio", "last-term"]}}
        document = {"question": "q", "scene": {"kind": "bratu", "nodes": 4}, "solver": solver}
        cases = Study.from_dict(document | {"sweep": [{"grid": ranges}]}).cases
        assert [case.parameters["solver.range.kind"] for case in cases] == ["ratio", "last-term"]


class TestRepeat:
    def test_seeds_follow_one_another(self):
        sweep = '[scene.nodes]\nkind = "random"\n[start]\nperturbation = 0.1\n[[sweep]]\nrepeat = '
        cases = study(sweep + '{ times = 3, seeds = "start.seed" }\n').cases
        assert [case.parts.start.seed for case in cases] == [0, 1, 2]
        assert [case.label for case in cases] == ["start.seed = 0", "start.seed = 1", "start.seed = 2"]
        both = '{ times = 2, seeds = ["start.seed", "scene.nodes.seed"], first = 7 }\n'
        cases = study(sweep + both).cases
        assert [(case.parts.start.seed, case.parts.scene.nodes.seed) for case in cases] == [(7, 7), (8, 8)]

    @pytest.mark.parametrize(
        ("written", "sentence"),
        [
            ("{ times = 0, seeds = 'start.seed' }", "line 16: sweep[0].repeat.times = 0: should be greater than 0"),
            ("{ times = 2 }", "line 16: sweep[0].repeat.seeds: required, and missing"),
            ("{ times = 2, seeds = [] }", "line 16: sweep[0].repeat.seeds"),
            ("{ times = 2, seeds = 'start.sed' }", "line 16: start.sed = 0: no such field; did you mean 'seed'?"),
            ("{ times = 2, seeds = 'strt.seed' }", "line 16: strt.seed = []: not a parameter; did you mean 'start'?"),
            ("3", "line 16: sweep[0].repeat = 3: "),
        ],
    )
    def test_mistakes(self, tmp_path, written, sentence):
        assert sentence in told(f"[[sweep]]\nrepeat = {written}\n", tmp_path)


SWEEP = '[[sweep]]\ngrid = { "solver.order" = [10, 20], "solver.tolerance" = [1e-6, 1e-8] }\n'


class TestExpect:
    @pytest.mark.parametrize(
        ("rule", "sentence"),
        [
            ("at_most = 1", "line 17: expect[0].column: required, and missing"),
            ('column = "tangents"', "line 17: expect[0]"),
            ('column = "tangnts"\nat_most = 1', "line 18: expect[0].column = 'tangnts': no such column of the results"),
            (
                'column = "tangents"\nat_most = 1\nwhere = { "solver.ordr" = 1 }',
                "line 20: expect[0].where = 'solver.ordr': no such column of the results; did you mean 'solver.order'?",
            ),
            (
                'column = "tangents"\ntable = "t"\nat_most = 1',
                "line 19: expect[0].table = 't': no such table; there are none",
            ),
            ('column = "tangents"\nat_most = "x"', "line 19: expect[0].at_most = 'x': should be a valid number"),
            ('column = "tangents"\nat_mst = 1', "line 19: expect[0].at_mst = 1: no such field; did you mean 'at_most'"),
        ],
    )
    def test_mistakes(self, tmp_path, rule, sentence):
        assert sentence in told(f"{SWEEP}[[expect]]\n{rule}\n", tmp_path)

    def test_a_quick_study_has_its_own(self):
        rules = '[[expect]]\ncolumn = "tangents"\nat_most = 1\n[quick]\nsolver.order = 10\n'
        assert len(study(SWEEP + rules).expectations) == 1
        assert study(SWEEP + rules, quick=True).expectations == ()
        own = f'{rules}expect = [{{ column = "tangents", at_most = 5 }}]\n'
        assert [expected.at_most for expected in study(SWEEP + own, quick=True).expectations] == [5.0]


class TestExclude:
    def test_cases_are_left_out_with_a_reason(self):
        rule = '[[exclude]]\nwhere = { "solver.order" = 20, "solver.tolerance" = [1e-8, 1e-9] }\nreason = "too slow"\n'
        found = study(SWEEP + rule)
        assert [case.label for case in found.cases] == [
            "solver.order = 10, solver.tolerance = 1e-06",
            "solver.order = 10, solver.tolerance = 1e-08",
            "solver.order = 20, solver.tolerance = 1e-06",
        ]
        assert [(left.label, left.reason) for left in found.excluded] == [
            ("solver.order = 20, solver.tolerance = 1e-08", "too slow")
        ]

    def test_what_is_not_valid_may_be_left_out(self, tmp_path):
        sweep = '[[sweep]]\ngrid = { "solver.order" = [10, 1] }\n'
        assert "solver.order = 1: should be greater" in told(sweep, tmp_path)
        rule = '[[exclude]]\nwhere = { "solver.order" = 1 }\nreason = "a series needs two terms"\n'
        assert len(study(sweep + rule).cases) == 1
        each = '[[sweep]]\neach = [{ name = "good" }, { name = "bad", "solver.order" = 1 }]\n'
        found = study(each + '[[exclude]]\nwhere = { variant = "bad" }\nreason = "it is bad"\n')
        assert [(left.label, left.reason) for left in found.excluded] == [("bad", "it is bad")]

    @pytest.mark.parametrize(
        ("rule", "sentence"),
        [
            ('where = { "solver.order" = 20 }', "line 17: exclude[0].reason: required, and missing"),
            ('reason = "r"', "line 17: exclude[0].where: required, and missing"),
            ('reason = "r"\nwhere = { }', "line 19: exclude[0].where = {}: "),
            (
                'reason = "r"\nwhere = { "solver.ordr" = 20 }',
                "line 19: exclude[0].where.solver.ordr: no such column of the results; did you mean 'solver.order'?",
            ),
            (
                'reason = "r"\nwhere = { "solver.order" = 30 }',
                "line 19: exclude[0].where: no case has these values, or an earlier rule leaves it out",
            ),
            ('reason = "r"\nwhere = { "solver.kind" = "anm" }', "line 17: exclude: no case is left"),
        ],
    )
    def test_mistakes(self, tmp_path, rule, sentence):
        assert sentence in told(f"{SWEEP}[[exclude]]\n{rule}\n", tmp_path)

    def test_a_study_that_is_changed_by_hand_may_have_nothing_to_leave_out(self):
        rule = '[[exclude]]\nwhere = { "solver.order" = 20 }\nreason = "r"\n'
        assert len(study(SWEEP + rule, overrides={"solver.order": 10}).cases) == 2
