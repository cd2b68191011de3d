"""Study files: what they mean, and what they are told when they are wrong."""

from __future__ import annotations

import tomllib
from time import process_time
from typing import Any

import pytest
from fakes import STUDY, Box, Homotopy, Newton, registry_of, write_study

from nlsolve.registry.problems import MOVED, StudyError
from nlsolve.registry.toml_lines import lines_of, nearest_place
from nlsolve.study.case import Composer
from nlsolve.study.study import Frame, Study
from nlsolve.study.sweeps import assign_all, merged, parse_assignments

REGISTRY = registry_of()


def read(folder, *changes, overrides=None, quick=False, text=STUDY) -> Study:
    return Study.from_toml(write_study(folder, *changes, text=text), overrides, quick, REGISTRY)


def complaint(folder, *changes, **options) -> str:
    with pytest.raises(StudyError) as caught:
        read(folder, *changes, **options)
    return str(caught.value).replace(str(folder), "")


def read_parts() -> Any:
    """The components of the first case of the study."""
    return Study.from_dict(tomllib.loads(STUDY), registry=REGISTRY).cases[0].parts


class TestCases:
    def test_a_grid_multiplies_in_the_order_written(self, tmp_path):
        study = read(tmp_path)
        points = [(case.parameters["solver.order"], case.parameters["solver.tolerance"]) for case in study.cases]
        assert points == [(10, 1e-6), (10, 1e-8), (20, 1e-6), (20, 1e-8)]
        assert study.cases[0].swept == ("solver.order", "solver.tolerance")
        assert study.cases[0].label == "solver.order = 10, solver.tolerance = 1e-06"
        assert study.name == "study"

    def test_sweeps_multiply_and_zip_goes_side_by_side(self, tmp_path):
        text = STUDY.replace(
            "[[table]]",
            '[[sweep]]\nzip = { law.index = [0.1, 0.2, 0.3], scene.side = ["left", "right", "left"] }\n[[table]]\n'
            'where = { "law.index" = 0.1 }',
        )
        study = read(tmp_path, text=text)
        assert len(study.cases) == 12
        assert [(c.parts.law.index, c.parts.scene.side) for c in study.cases[:3]] == [
            (0.1, "left"),
            (0.2, "right"),
            (0.3, "left"),
        ]

    def test_a_whole_section_is_replaced_and_its_default_rule_follows(self, tmp_path):
        sweep = 'grid = { solver = [{ kind = "newton" }, { kind = "anm", order = 7 }] }'
        text = STUDY[: STUDY.index("grid = ")] + sweep + "\n"
        newton, homotopy = read(tmp_path, text=text).cases
        assert isinstance(newton.parts.solver, Newton)
        assert newton.parameters["refresh.kind"] == "every-iteration"
        assert "solver.order" not in newton.parameters
        assert homotopy.parts.solver == Homotopy(order=7)
        assert (homotopy.parameters["refresh.kind"], homotopy.parameters["refresh.m"]) == ("every-m", 3)
        assert homotopy.swept == ("solver.kind",)  # order and tolerance are one and the same wherever there are any

    def test_sections_with_a_default_may_be_left_out_or_have_no_kind(self, tmp_path):
        case = read(tmp_path, ("[solver]", "[linear]\nrefinement = 2\n[refresh]\nm = 9\n[solver]")).cases[0]
        assert (case.parts.linear.kind_name(), case.parts.linear.refinement) == ("auto", 2)
        assert (case.parts.refresh.kind_name(), case.parameters["refresh.m"]) == ("every-m", 9)
        assert case.parts.start.solver.kind_name() == "newton"

    def test_parameters_are_flat_and_lists_are_text(self, tmp_path):
        parameters = read(tmp_path, ("question", "record = { times = [0.5] }\nquestion")).cases[0].parameters
        assert parameters["scene.nodes.kind"] == "even"
        assert parameters["scene.nodes.count"] == 4
        assert parameters["record.times"] == "[0.5]"
        assert parameters["start.values"] is None

    def test_identity_follows_from_the_components_only(self, tmp_path):
        first = read(tmp_path)
        written_out = read(tmp_path, ('kind = "box"', 'nodes = { count = 4, kind = "even" }\nkind = "box"'))
        assert [case.id for case in first.cases] == [case.id for case in written_out.cases]
        assert len({case.id for case in first.cases}) == 4
        assert all(len(case.id) == 12 for case in first.cases)
        other = read(tmp_path, overrides={"law.index": 0.4})
        assert not {case.id for case in first.cases} & {case.id for case in other.cases}

    def test_what_is_set_by_hand_wins_over_what_is_swept(self, tmp_path):
        study = read(tmp_path, overrides={"solver.order": 15})
        assert [case.parts.solver.order for case in study.cases] == [15, 15]

    def test_quick_changes_parameters_and_sweeps(self, tmp_path):
        study = read(tmp_path, quick=True)
        assert [(case.parts.scene.side, case.parts.solver.order) for case in study.cases] == [("right", 10)]
        assert read(tmp_path).has_quick

    def test_from_a_dictionary_of_components(self):
        document = {**tomllib.loads(STUDY), "scene": Box(side="right"), "sweep": [{"grid": {"solver": [Newton()]}}]}
        document = {name: value for name, value in document.items() if name not in ("table", "quick")}
        (case,) = Study.from_dict(document, registry=REGISTRY).cases
        assert (case.parts.scene.side, case.parts.solver) == ("right", Newton())


class TestManyCases:
    GRID = '{ "solver.order" = [10, 20], "solver.tolerance" = [1e-6, 1e-8] }'

    def of(self, orders: int, tolerances: int) -> Study:
        """A study of orders × tolerances cases."""
        grid = {"solver.order": list(range(2, 2 + orders)), "law.index": [1.0 + k for k in range(tolerances)]}
        table = {"name": "t", "rows": "solver.order", "columns": "law.index", "value": "tangents"}
        return Study.from_dict({**tomllib.loads(STUDY), "sweep": [{"grid": grid}], "table": [table]}, registry=REGISTRY)

    def test_a_section_is_validated_once_a_distinct_table(self, monkeypatch):
        validated = []
        component = type(REGISTRY).component
        monkeypatch.setattr(type(REGISTRY), "component", lambda *asked: validated.append(asked) or component(*asked))
        cases = self.of(30, 20).cases
        assert len(cases) == len({case.id for case in cases}) == 600
        assert len({id(case.parts.solver) for case in cases}) == 30
        assert len({id(case.parts.law) for case in cases}) == 20
        assert len(validated) < 600

    def test_ten_thousand_cases_take_less_than_five_seconds(self):
        begun = process_time()
        study = self.of(100, 100)
        assert process_time() - begun < 5.0
        assert len(study.cases) == 10_000
        assert study.cases[-1].swept == ("law.index", "solver.order")

    def test_values_that_json_cannot_hold_are_validated_each_time(self, tmp_path):
        grid = '{ "law.index" = [0.5, 1979-05-27] }'
        message = complaint(
            tmp_path, (self.GRID, grid), ('rows = "solver.order"\ncolumns = "solver.tolerance"', 'rows = "law.index"')
        )
        assert "line 16: law.index = datetime.date(1979, 5, 27): should be a valid number" in message

    def test_numbers_of_two_types_are_not_mixed_up(self, tmp_path):
        message = complaint(tmp_path, ("[10, 20]", "[10, 10.5]"))
        assert "line 16: solver.order = 10.5: should be a valid integer" in message


SETTINGS = """each = [
    { name = "as it is" },
    { name = "ε₀ = 10", "law.index" = 0.7, scene.side = "right" },
    { name = "newton", solver = { kind = "newton" } },
]
"""
EACH = STUDY[: STUDY.index("grid = ")] + SETTINGS


class TestSettings:
    def test_named_settings_one_after_the_other(self, tmp_path):
        cases = read(tmp_path, text=EACH).cases
        assert [case.parameters["variant"] for case in cases] == ["as it is", "ε₀ = 10", "newton"]
        assert [case.label for case in cases] == ["as it is", "ε₀ = 10", "newton"]
        assert [(c.parts.law.index, c.parts.scene.side, c.parts.solver.kind_name()) for c in cases] == [
            (0.5, "left", "anm"),
            (0.7, "right", "anm"),
            (0.5, "left", "newton"),
        ]
        assert "solver.order" not in cases[2].parameters  # a table with a kind replaces the section
        assert next(iter(cases[0].parameters)) == "variant"

    def test_a_name_is_no_part_of_the_identity(self, tmp_path):
        renamed = read(tmp_path, ("as it is", "baseline"), text=EACH).cases[0]
        plain = read(tmp_path, text=STUDY[: STUDY.index("[[sweep]]")]).cases[0]
        assert renamed.id == plain.id == read(tmp_path, text=EACH).cases[0].id
        assert "variant" not in plain.parameters

    def test_names_are_joined_and_multiply_with_other_sweeps(self, tmp_path):
        random = '[[sweep]]\neach = [{ name = "a", scene.nodes = { kind = "random" } }]\n'
        seeds = '[[sweep]]\ngrid = { "scene.nodes.seed" = [1, 2] }\n'
        cases = read(tmp_path, text=EACH + random + seeds).cases
        assert [case.label for case in cases[:3]] == [
            "as it is, a, scene.nodes.seed = 1",
            "as it is, a, scene.nodes.seed = 2",
            "ε₀ = 10, a, scene.nodes.seed = 1",
        ]

    def test_a_sweep_may_name_its_column(self, tmp_path):
        text = EACH.replace("each = [", 'name = "attack"\neach = [', 1)
        more = '[[sweep]]\nname = "place"\neach = [{ name = "a", scene.nodes = { kind = "random" } }]\n'
        case, *_ = read(tmp_path, text=text + more).cases
        assert list(case.parameters)[:2] == ["attack", "place"]
        assert (case.parameters["attack"], case.parameters["place"], case.label) == ("as it is", "a", "as it is")
        assert "variant" not in case.parameters
        same = '[[sweep]]\nname = "attack"\neach = [{ name = "a", scene.nodes = { kind = "random" } }]\n'
        assert read(tmp_path, text=text + same).cases[2].parameters["attack"] == "newton, a"
        message = complaint(tmp_path, ('name = "newton", solver = { kind = "newton" }', 'name = "same"'), text=text)
        assert "'as it is' and 'same' are one and the same case" in message
        message = complaint(tmp_path, ('"place"', '"condition"'), text=text + more)
        assert "line 22: sweep[1]: name = 'condition' is a column of the results already; choose another" in message
        assert "is a column of the results already" in complaint(tmp_path, ('"place"', '"solved"'), text=text + more)
        assert "sweep[1].name = '1st': " in complaint(tmp_path, ('"place"', '"1st"'), text=text + more)
        message = complaint(tmp_path, ("[[sweep]]\n", '[[sweep]]\nname = "attack"\n'))
        assert "name = 'attack' is for the names of each, and there are none; drop it" in message

    def test_seeds_of_what_is_not_disturbed_are_one_case(self, tmp_path):
        seeds = '[[sweep]]\ngrid = { "start.seed" = [0, 1, 2] }\n'
        disturbed = EACH.replace('{ name = "as it is" }', '{ name = "as it is", "start.perturbation" = 0.1 }')
        cases = read(tmp_path, text=disturbed + seeds).cases
        assert [(case.parameters["variant"], case.parameters["start.seed"]) for case in cases] == [
            ("as it is", 0),
            ("as it is", 1),
            ("as it is", 2),
            ("ε₀ = 10", 0),
            ("newton", 0),
        ]
        assert "start.seed = -1: should be greater than or equal to 0" in complaint(
            tmp_path, ("[0, 1, 2]", "[-1]"), text=disturbed + seeds
        )

    def test_tables_and_figures_may_use_the_variant(self, tmp_path):
        table = '[[table]]\nname = "t"\nrows = "variant"\nvalue = "seconds"\n'
        figure = '[[figure]]\nname = "f"\nkind = "map"\nx = "scene.side"\ny = "variant"\n'
        assert read(tmp_path, text=EACH + table + figure).tables[0].rows == ("variant",)
        message = complaint(tmp_path, ('y = "variant"', 'y = "varient"'), text=EACH + table + figure)
        assert "figure[0].y = 'varient': no such column of the results; did you mean 'variant'?" in message

    def test_every_setting_has_its_own_line(self, tmp_path):
        two = EACH.replace('{ name = "as it is" }', '{ name = "b", "law.index" = -1.0 }').replace("0.7", "-2.0")
        message = complaint(tmp_path, text=two)
        assert "line 17: law.index = -1.0:" in message
        assert "line 18: law.index = -2.0:" in message
        message = complaint(tmp_path, ('kind = "newton" }', 'kind = "newton", ordr = 3 }'), text=EACH)
        assert "line 19: solver.ordr = 3: no such field" in message

    def test_the_hand_wins_and_is_named(self, tmp_path):
        cases = read(tmp_path, text=EACH, overrides={"law.index": 0.9}).cases
        assert {case.parts.law.index for case in cases} == {0.9}
        assert "--set: law.index = -1" in complaint(tmp_path, text=EACH, overrides={"law.index": -1})

    def test_quick_may_have_settings_of_its_own(self, tmp_path):
        quick = '[quick]\nsweep = [{ each = [{ name = "q", "law.index" = 0.2 }] }]\n'
        assert read(tmp_path, text=EACH + quick, quick=True).cases[0].parameters["variant"] == "q"
        message = complaint(tmp_path, ("0.2 }", "-0.2 }"), text=EACH + quick, quick=True)
        assert "line 22: law.index = -0.2:" in message

    def test_two_names_for_one_case(self, tmp_path):
        message = complaint(tmp_path, ('name = "newton", solver = { kind = "newton" }', 'name = "same"'), text=EACH)
        assert message == (
            "/study.toml, line 19: sweep[0].each[2]: 'as it is' and 'same' are one and the same case: "
            "change one of them, or drop it"
        )
        message = complaint(tmp_path, text=EACH, overrides={"law.index": 0.5, "scene.side": "right"})
        assert "'as it is' and 'ε₀ = 10' are one and the same case with what is set by hand" in message

    def test_names_are_required_and_differ(self, tmp_path):
        message = complaint(tmp_path, ('name = "newton", ', ""), text=EACH)
        assert "line 19: sweep[0].each[2].name: required, and missing" in message
        message = complaint(tmp_path, ('"newton", solver', '"as it is", solver'), text=EACH)
        assert "sweep[0]" in message
        assert "2 settings are called 'as it is'; give each its own name" in message
        assert "nothing is swept" in complaint(tmp_path, text=STUDY[: STUDY.index("grid = ")] + "each = []")

    def test_unknown_names_and_names_swept_twice(self, tmp_path):
        message = complaint(tmp_path, ('"law.index" = 0.7', '"lwa.index" = 0.7'), text=EACH)
        assert message == "/study.toml, line 18: lwa.index = []: not a parameter; did you mean 'law'?"
        again = '[[sweep]]\ngrid = { "law.index" = [1.0] }\n'
        assert "line 22: law.index = []: swept twice" in complaint(tmp_path, text=EACH + again)

    def test_components_from_python(self):
        document = {name: value for name, value in tomllib.loads(STUDY).items() if name not in ("table", "quick")}
        sweep = [{"each": [{"name": "newton", "solver": Newton()}, {"name": "p = 7", "solver": Homotopy(order=7)}]}]
        cases = Study.from_dict(document | {"sweep": sweep}, registry=REGISTRY).cases
        assert [case.parts.solver for case in cases] == [Newton(), Homotopy(order=7)]


class TestComplaints:
    def test_misspelt_field(self, tmp_path):
        message = complaint(tmp_path, ('kind = "honey"', 'kind = "honey"\nindx = 0.2'))
        assert message == "/study.toml, line 8: law.indx = 0.2: no such field; did you mean 'index'?"

    def test_misspelt_nested_field(self, tmp_path):
        message = complaint(tmp_path, ('kind = "box"', 'kind = "box"\nnodes = { kind = "random", sead = 1 }'))
        assert message == "/study.toml, line 5: scene.nodes.sead = 1: no such field; did you mean 'seed'?"

    def test_misspelt_kind(self, tmp_path):
        message = complaint(tmp_path, ('kind = "anm"', 'kind = "amn"'))
        assert (
            message
            == "/study.toml, line 13: solver.kind = 'amn': no such solver; did you mean 'anm'? installed: anm, newton"
        )

    def test_misspelt_nested_kind_and_choice(self, tmp_path):
        message = complaint(tmp_path, ('kind = "box"', 'kind = "box"\nside = "lefd"\nnodes = { kind = "evn" }'))
        assert "line 5: scene.side = 'lefd': should be 'left' or 'right'; did you mean 'left'?" in message
        assert "line 6: scene.nodes.kind = 'evn': should be 'even', 'random'; did you mean 'even'?" in message

    def test_misspelt_swept_parameter_is_found_in_the_sweep(self, tmp_path):
        grid = '[sweep.grid]\n"solver.tolerance" = [1e-6]\n"solver.oder" = [10]\n[quick]'
        message = complaint(tmp_path, text=STUDY[: STUDY.index("grid = ")] + grid)
        assert message == "/study.toml, line 18: solver.oder = 10: no such field; did you mean 'order'?"

    def test_swept_section_and_twice_swept(self, tmp_path):
        assert "'solvr.order'" not in complaint(tmp_path, ('"solver.order" =', '"solvr.order" ='))
        assert "solvr.order = []: not a parameter; did you mean 'solver'?" in complaint(
            tmp_path, ('"solver.order" =', '"solvr.order" =')
        )
        again = '[[sweep]]\ngrid = { "solver.order" = [1] }\n[[table]]'
        assert "line 19: solver.order = []: swept twice" in complaint(tmp_path, ("[[table]]", again))

    @pytest.mark.parametrize(
        ("values", "expected"),
        [
            ('order = "x"', "line 14: solver.order = 'x': should be a valid integer"),
            ("order = 1", "line 14: solver.order = 1: should be greater than or equal to 2"),
            ("tolerance = 0.0", "line 14: solver.tolerance = 0.0: should be greater than 0"),
            ("tolerance = nan", "line 14: solver.tolerance = nan: should be a finite number"),
        ],
    )
    def test_wrong_values(self, tmp_path, values, expected):
        text = STUDY[: STUDY.index("[[sweep]]")].rstrip() + "\n" + values
        assert expected in complaint(tmp_path, text=text)

    def test_members_of_a_union_complain_together(self, tmp_path):
        message = complaint(tmp_path, ('kind = "grid"', 'kind = "grid"\nwidth = "x"'))
        assert message.count("discretizer.width = 'x'") == 1
        assert "valid number" in message
        assert "should be 'auto'" in message

    def test_missing_sections_kinds_and_question(self, tmp_path):
        without_law = ('[law]\nkind = "honey"\n', "")
        assert complaint(tmp_path, without_law) == "/study.toml: law: required, and missing"
        message = complaint(tmp_path, without_law, ('kind = "box"', ""))  # nobody knows what the scene needs
        assert message == "/study.toml, line 3: scene.kind: required, and missing; installed: box"
        assert "question: required, and missing" in complaint(tmp_path, ('question = "How many branches?"', ""))

    def test_unknown_section(self, tmp_path):
        message = complaint(tmp_path, ("[solver]", "[sovler]"))
        assert message == "/study.toml, line 12: sovler = {'kind': 'anm'}: no such section; did you mean 'solver'?"

    def test_section_that_is_no_table(self, tmp_path):
        assert "law = 'honey': should be a table with a kind" in complaint(
            tmp_path, ('[law]\nkind = "honey"\n', ""), ("question", 'law = "honey"\nquestion')
        )

    def test_zip_of_different_lengths(self, tmp_path):
        message = complaint(tmp_path, ("grid = {", "zip = {"), ("[1e-6, 1e-8]", "[1e-6, 1e-7, 1e-8]"))
        assert message.startswith("/study.toml, line 15: sweep[0]")
        assert message.endswith("zip needs lists of one length; 'solver.order' has 2, 'solver.tolerance' has 3")

    def test_sweep_without_values_or_with_two_modes(self, tmp_path):
        assert "'solver.order' has no values" in complaint(tmp_path, ("[10, 20]", "[]"))
        assert "a sweep has one of grid, zip, each and repeat" in complaint(
            tmp_path, ("[[table]]", "[[sweep]]\n[[table]]")
        )

    def test_claim_needs_a_solver_that_claims(self, tmp_path):
        assert read(tmp_path, ("[solver]", '[stop]\nkind = "claim"\n[solver]')).cases[0].parts.stop.kind == "claim"
        text = STUDY[: STUDY.index("[[sweep]]")].replace('"anm"', '"newton"') + '[stop]\nkind = "claim"'
        message = complaint(tmp_path, text=text)
        assert "line 16: stop.kind = 'claim': the solver 'newton' never claims a solution" in message

    def test_start_by_a_field_the_law_is_not_continued_by(self, tmp_path):
        message = complaint(tmp_path, ("[solver]", '[start]\nby = "idx"\n[solver]'))
        assert "line 13: start.by = 'idx': the law 'honey' is continued by index only" in message

    def test_sections_that_do_not_fit_together(self, tmp_path):
        wrong = ("[solver]", '[physics]\nconvection = true\n[motion]\nnodes = "lagrangian"\n[solver]')
        message = complaint(tmp_path, wrong)
        assert message == (
            "/study.toml, line 13: physics.convection = True: nodes that move with the material carry it already; "
            'use motion.nodes = "fixed"'
        )
        right = wrong[0], wrong[1].replace("lagrangian", "fixed")
        assert read(tmp_path, right).cases[0].parts.physics.convection
        moving = {"motion.nodes": "lagrangian"}
        assert "/study.toml, line 13: physics.convection = True" in complaint(tmp_path, right, overrides=moving)

    def test_tables_name_columns_that_exist(self, tmp_path):
        message = complaint(tmp_path, ('value = "tangents"', 'value = "tangnts"'))
        assert "line 22: table[0].value = 'tangnts': no such column of the results; did you mean 'tangents'?" in message
        message = complaint(tmp_path, ('rows = "solver.order"', 'rows = "solver.ordr"'))
        assert "line 20: table[0].rows = 'solver.ordr'" in message

    def test_an_old_column_is_answered_with_its_new_name(self, tmp_path):
        message = complaint(tmp_path, ('value = "tangents"', 'value = "branches"'))
        assert message.endswith("line 22: table[0].value = 'branches': this column is called tangents now")
        figure = '[[figure]]\nkind = "line"\nname = "f"\nsource = "runs"\nx = "solver.order"\ny = "branches"\n[quick]'
        message = complaint(tmp_path, ("[quick]", figure))
        assert message.endswith("figure[0].y = 'branches': this column is called tangents now")

    def test_a_cell_with_several_runs_is_seen_before_anything_is_run(self, tmp_path):
        message = complaint(tmp_path, ('columns = "solver.tolerance"\n', ""))
        assert "several runs land in the cell solver.order = 10; they differ in 'solver.tolerance'" in message

    def test_figures_name_columns_that_exist(self, tmp_path):
        figure = '[[figure]]\nkind = "line"\nname = "range"\ny = "range"\ngroup = "solver.odrer"\n[quick]'
        message = complaint(tmp_path, ("[quick]", figure))
        assert "line 28: figure[0].group = 'solver.odrer': no such column of the results" in message

    def test_paper_values_of_another_shape(self, tmp_path):
        paper = '[table.paper]\nsource = "here"\nvalues = [[1, 2, 3]]\n[quick]'
        message = complaint(tmp_path, ("[quick]", paper))
        assert "table[0].paper.values" in message
        assert "should be 2 lists of 2 numbers, as the table has; there are lists of [3]" in message
        assert read(tmp_path, ("[quick]", paper), quick=True).tables[0].paper is None

    def test_not_toml(self, tmp_path):
        assert complaint(tmp_path, ('kind = "anm"', "kind anm")).startswith(
            "/study.toml, line 13, column 6: not valid TOML: Expected '='"
        )

    def test_unreadable(self, tmp_path):
        with pytest.raises(StudyError, match=r"nowhere\.toml: the study cannot be read: No such file"):
            Study.from_toml(tmp_path / "nowhere.toml", registry=REGISTRY)
        (tmp_path / "latin.toml").write_bytes("question = 'ε'".encode("utf-16"))
        with pytest.raises(StudyError, match="not UTF-8"):
            Study.from_toml(tmp_path / "latin.toml", registry=REGISTRY)

    def test_overrides(self, tmp_path):
        message = complaint(tmp_path, overrides={"solver.ordr": 5, "question.x": 1})
        assert "question.x = 1: 'question' is not a table" in message
        message = complaint(tmp_path, overrides={"solver.ordr": 5})
        assert message == "/study.toml, --set: solver.ordr = 5: no such field; did you mean 'order'?"
        assert "--set: sover = {'order': 5}: no such section" in complaint(tmp_path, overrides={"sover.order": 5})

    def test_quick_without_a_section(self, tmp_path):
        text = STUDY[: STUDY.index("[quick]")]
        assert complaint(tmp_path, text=text, quick=True).endswith(
            "no [quick] section, so it cannot be run with --quick"
        )

    def test_problems_of_the_quick_form_are_found_there(self, tmp_path):
        wrong = ('{ "solver.order" = [10] }', '{ "solver.order" = [0] }')
        assert len(read(tmp_path, wrong).cases) == 4
        message = complaint(tmp_path, wrong, quick=True)
        assert message == "/study.toml, line 26: solver.order = 0: should be greater than or equal to 2"

    def test_every_problem_has_its_line(self, tmp_path):
        message = complaint(tmp_path, ('kind = "honey"', 'kind = "honey"\nindex = -1.0'), ('"box"', '"bx"'))
        assert [line.split(": ")[1].split(" =")[0] for line in message.splitlines()] == ["scene.kind", "law.index"]


class TestMoved:
    """What was called otherwise once is answered with its name now, wherever it is written."""

    def test_a_section_in_the_file(self, tmp_path):
        message = complaint(tmp_path, ("[solver]", '[counterpart]\nkind = "grid"\n[solver]'))
        assert message == "/study.toml, line 12: counterpart: this is called error_estimator now"
        assert read(tmp_path, ("[solver]", '[error_estimator]\nkind = "grid"\n[solver]')).cases

    def test_a_section_in_a_sweep(self, tmp_path):
        sweep = '[[sweep]]\ngrid = { "counterpart.width" = [1.0] }\n[[table]]'
        message = complaint(tmp_path, ("[[table]]", sweep))
        assert message == "/study.toml, line 19: counterpart.width: this is called error_estimator.width now"
        each = EACH + '[[sweep]]\neach = [{ name = "a", counterpart = { kind = "grid" } }]\n'
        message = complaint(tmp_path, text=each)
        assert message == "/study.toml, line 22: counterpart: this is called error_estimator now"

    def test_a_section_by_hand_in_quick_and_in_a_reference(self, tmp_path):
        message = complaint(tmp_path, overrides={"counterpart.kind": "grid"})
        assert message == "/study.toml, --set: counterpart: this is called error_estimator now"
        quick = '"scene.side" = "right"', '"counterpart.kind" = "grid"'
        message = complaint(tmp_path, quick, quick=True)
        assert message == "/study.toml, line 25: counterpart: this is called error_estimator now"
        reference = "[quick]", "[reference]\ncounterpart.width = 2.0\n[quick]"
        assert "counterpart: this is called error_estimator now" in complaint(tmp_path, reference)
        misspelt = "[quick]", "[reference]\nsolvr.order = 2\n[quick]"
        assert "solvr: no such section; did you mean 'solver'?" in complaint(tmp_path, misspelt)

    @pytest.mark.parametrize(
        ("change", "options", "where"),
        [
            (('kind = "box"', 'kind = "box"\nflank = "left"'), {}, "line 5"),
            (('"solver.order" =', '"scene.flank" ='), {}, "line 16"),
            (('"scene.side" =', '"scene.flank" ='), {"quick": True}, "line 25"),
            (('kind = "box"', 'kind = "box"'), {"overrides": {"scene.flank": "left"}}, "--set"),
        ],
    )
    def test_a_field_wherever_it_is_written(self, tmp_path, monkeypatch, change, options, where):
        monkeypatch.setitem(MOVED, "scene.flank", "place.side")
        plain = STUDY.replace('rows = "solver.order"', 'rows = "solver.kind"')
        message = complaint(tmp_path, change, text=plain, **options)
        assert message == f"/study.toml, {where}: scene.flank: this is called place.side now"

    @pytest.mark.parametrize(
        ("old", "new"),
        [
            ("scene.horizon", "time.horizon"),
            ("scene.divergence", "physics.divergence_tolerance"),
            ("scene.motion_of_nodes", "motion.nodes"),
            ("scene.probe", "record.probe"),
            ("budget.pressures", "physics.pressure_iterations"),
        ],
    )
    def test_a_field_that_has_a_section_of_its_own_now(self, tmp_path, old, new):
        section, field = old.split(".")
        budget = "[budget]\niterations = 9\n[quick]"
        heading = 'kind = "box"' if section == "scene" else "iterations = 9"
        written = STUDY.replace("[quick]", budget).replace(heading, f"{heading}\n{field} = 1")
        line = 1 + written.splitlines().index(f"{field} = 1")
        told = f"{old}: this is called {new} now"
        assert complaint(tmp_path, text=written) == f"/study.toml, line {line}: {told}"
        assert complaint(tmp_path, ('"solver.order" =', f'"{old}" =')) == f"/study.toml, line 16: {told}"
        assert complaint(tmp_path, overrides={old: 1}) == f"/study.toml, --set: {told}"
        quick = complaint(tmp_path, ('"scene.side" = "right"', f'"{old}" = 1'), quick=True)
        assert quick == f"/study.toml, line 25: {told}"

    def test_a_column_of_a_table_that_has_moved(self, tmp_path):
        message = complaint(tmp_path, ('rows = "solver.order"', 'rows = "scene.penalty"'))
        assert (
            message
            == "/study.toml, line 20: table[0].rows = 'scene.penalty': this column is called physics.penalty now"
        )

    def test_a_kind_that_has_another_name_now(self, tmp_path):
        message = complaint(tmp_path, ('kind = "box"', 'kind = "system"'))
        assert message == "/study.toml, line 4: scene.kind = 'system': this kind is called 'published' now"

    def test_record_is_no_list_any_more(self, tmp_path):
        told = "record = [0.1, 0.2]: should be a table now: record = { times = [0.1, 0.2] }"
        written = ("question", "record = [0.1, 0.2]\nquestion")
        assert complaint(tmp_path, written) == f"/study.toml, line 1: {told}"
        assert complaint(tmp_path, overrides={"record": [0.1, 0.2]}) == f"/study.toml, --set: {told}"

    def test_every_new_place_exists(self):
        known = {*Composer(REGISTRY).sections, *Frame.model_fields}
        assert all(new.split(".")[0] in known for new in MOVED.values())
        assert not any(old in known for old in MOVED)
        parts = read_parts()
        for new in MOVED.values():
            section, *field = new.split(".")
            assert not field or field[0] in type(getattr(parts, section)).model_fields, new


class TestLines:
    def test_lines_of_every_way_to_write_a_key(self):
        text = '''# a comment with [brackets] = x
title = """two
lines"""
a.b = 1   # dotted
[t."quoted key"]
x = { y = [1,
  2], z = 'a # no comment' }
[[list]]
k = 1.5
[list.sub]
m = 2020-01-01T00:00:00
[[list]]
k = 2
'''
        lines = lines_of(text)
        tomllib.loads(text)
        assert lines[("title",)] == 2
        assert lines[("a", "b")] == 4
        assert lines[("t", "quoted key", "x", "y", 1)] == 7
        assert lines[("t", "quoted key", "x", "z")] == 7
        assert lines[("list", 0, "k")] == 9
        assert lines[("list", 0, "sub", "m")] == 11
        assert lines[("list", 1, "k")] == 13
        assert nearest_place(lines, ("list", 1, "absent", "deep")) == ("list", 1)
        assert lines["list", 1] == 12
        assert nearest_place(lines, ("absent",)) is None


class TestAssignments:
    @pytest.mark.parametrize("sweep", [[], [{"grid": {"solver.range": ["ratio", "last-term"]}}]])
    def test_a_word_is_short_for_a_table_with_that_kind(self, sweep):
        solver = {"kind": "anm", "range": "ratio"}
        document = {"question": "q", "scene": {"kind": "bratu", "nodes": 4}, "solver": solver, "sweep": sweep}
        (case,) = Study.from_dict(document, {"solver.range.kind": "pade-pair"}).cases
        assert case.parameters["solver.range.kind"] == "pade-pair"
        with pytest.raises(StudyError, match=r"study, --set: solver.range.part = 2: no such field"):
            Study.from_dict(document, {"solver.range.part": 2})
        quick = {"solver": {"range": {"kind": "nearest-pole"}, "order": 5}}
        (case,) = Study.from_dict(document | {"sweep": [], "quick": quick}, quick=True).cases
        assert case.parameters["solver.range.kind"] == "nearest-pole"
        filled = {"solver": {"range": "half"}}
        assert assign_all(filled, {"solver.range.part": 0.1}) == []
        assert filled == {"solver": {"range": {"kind": "half", "part": 0.1}}}
        assert merged("half", {"part": 0.1}) == {"kind": "half", "part": 0.1}

    def test_values_are_toml_or_else_text(self):
        parsed = parse_assignments(["a.b=1e-3", "c = true", "d=spin", 'e={ kind = "x" }', "f=a=b"])
        assert parsed == {"a.b": 1e-3, "c": True, "d": "spin", "e": {"kind": "x"}, "f": "a=b"}

    @pytest.mark.parametrize("text", ["solver.order", "=3"])
    def test_without_a_key_or_a_value(self, text):
        with pytest.raises(StudyError, match="expected key=value, such as solver"):
            parse_assignments([text])
