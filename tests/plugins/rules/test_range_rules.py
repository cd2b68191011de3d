"""Range rules and homotopy forms as plugins: their contracts, a stranger's of each, and bad answers."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from cases import run
from fakes import Plugin
from nlsolve_rules.refresh import EveryIteration, RangeUnderOne
from nlsolve_solvers.homotopy import FORMS, RANGE_RULES, AsymptoticNumericalMethod
from nlsolve_solvers.homotopy.branch import Branch, BranchView
from nlsolve_solvers.homotopy.forms import FixedPoint, FixedPointRecurrence
from nlsolve_solvers.homotopy.ranges import LastTerm, NearestPole, PadePair, Ratio, ResidualCoefficient, TrueResidual
from pydantic import ValidationError

import nlsolve
from nlsolve import Status, Study
from nlsolve.plugin import HomotopyForm, NonlinearProblem, Range, RangeRule, Recurrence, SeriesBranch
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import Registry
from nlsolve.solving.stopping import StoppingTest
from nlsolve.testing import check_homotopy_form, check_range_rule
from nlsolve.testing.rules import KnownBranch
from nlsolve.testing.toy_problem import DenseLU, ToyProblem

Method = AsymptoticNumericalMethod
START = ToyProblem.solution + 0.5 * np.cos(np.arange(12.0))
CASE: dict[str, Any] = {"question": "How far?", "scene": {"kind": "bratu"}}


@pytest.mark.parametrize("rule", RANGE_RULES, ids=lambda cls: cls.kind_name())
def test_range_rules_conform(rule: type[RangeRule]) -> None:
    check_range_rule(rule())


@pytest.mark.parametrize("form", FORMS, ids=lambda cls: cls.kind_name())
def test_homotopy_forms_conform(form: type[HomotopyForm]) -> None:
    check_homotopy_form(form())


# What the rules that ship say.


def toy_branch(order: int, shift: float = 0.3) -> Branch:
    """W_1 … W_p of the toy problem with the K* of another state."""
    problem = ToyProblem()
    inverse = np.linalg.inv(problem.jacobian(START + shift).toarray())
    made = Branch(problem, START, FixedPoint(), "series")
    for _ in range(order):
        rhs = made.recurrence.right_hand_side()
        made.append(rhs, inverse @ rhs)
    return made


@pytest.mark.parametrize("order", [2, 5, 10])
def test_the_last_term_alone_is_equation_24(order: int) -> None:
    made = toy_branch(order)
    found = LastTerm().limit(made, 1e-6, True)
    first, last = (float(np.linalg.norm(made.terms[j])) for j in (0, -1))
    assert found.a_max == pytest.approx((1e-6 * first / last) ** (1.0 / (order - 1)), rel=1e-14)
    assert found == Range(found.a_max, last / first, 1e-6)
    assert Ratio().limit(made, 1e-6, True).a_max <= found.a_max


def test_a_last_term_that_vanishes_limits_nothing_and_the_one_before_it_does() -> None:
    made = toy_branch(5)
    made.sizes[-1] = 0.0
    assert LastTerm().limit(made, 1e-6, True).a_max == np.inf
    assert Ratio().limit(made, 1e-6, True).a_max < np.inf


def test_a_series_of_two_terms_with_the_tangent_itself_is_told_to_be_longer() -> None:
    outcome, _ = run(ToyProblem(), Method(order=2, range="last-term"), EveryIteration(), START, DenseLU())
    assert outcome.status is Status.RANGE_EXHAUSTED
    assert "use order 3 or more" in outcome.detail


@pytest.mark.parametrize(
    ("rule", "power"), [(LastTerm(), 4), (ResidualCoefficient(), 6), (TrueResidual(), 6)], ids=lambda x: str(x)
)
def test_quantity_and_threshold_are_those_that_decided(rule: RangeRule, power: int) -> None:
    """a_max = (threshold/quantity)^(1/power) where nothing but the power of a is known between 0 and 1."""
    branch = KnownBranch(np.linspace(0.05, 0.2, 8), 5)
    found = rule.limit(branch, 1e-3, True)
    assert found.a_max > 1.0
    assert found.a_max == pytest.approx((found.threshold / found.quantity) ** (1.0 / power), rel=1e-12)


@pytest.mark.parametrize("rule", [cls() for cls in RANGE_RULES], ids=lambda rule: rule.kind)
@pytest.mark.parametrize("tolerance", [1e-10, 1e-5, 1e-1])
def test_the_end_of_the_path_is_reached_where_the_quantity_is_at_most_the_threshold(
    rule: RangeRule, tolerance: float
) -> None:
    for size in (0.05, 0.5, 1.2):
        found = rule.limit(KnownBranch(np.linspace(-size, size, 9), 6), tolerance, True)
        assert (found.quantity <= found.threshold) == (found.a_max >= 1.0)
        assert found.threshold == tolerance


def test_steps_say_by_what_a_range_was_decided() -> None:
    outcome, _ = run(ToyProblem(), Method(order=5, tolerance=1e-5), RangeUnderOne(), START - 1.5, DenseLU())
    rows = outcome.rows[1:]
    assert {row["range_threshold"] for row in rows} == {1e-5}
    assert {row["range_quantity"] <= 1e-5 for row in rows} == {False, True}
    assert all((row["range_quantity"] <= 1e-5) == (row["range"] >= 1.0) for row in rows)


# What a rule may look at.


def test_a_branch_is_read_and_not_changed() -> None:
    made = toy_branch(4)
    view: SeriesBranch = BranchView(made)
    assert (view.order, view.residual, view.contraction) == (4, made.residual, made.contraction)
    assert view.singularity == made.singularity
    assert view.defect(1.0) == made.defect(1.0)
    for a in (0.5, 1.0):
        assert np.linalg.norm(view.approximant()(a)) == pytest.approx(np.linalg.norm(made.increment(a)), rel=1e-12)
    np.testing.assert_array_equal(view.next_coefficient(), made.recurrence.right_hand_side())
    for values in (*view.terms, view.columns, view.next_coefficient()):
        with pytest.raises(ValueError, match="read-only"):
            values[...] = 0.0
    assert isinstance(view.sizes, tuple)
    with pytest.raises(AttributeError):
        view.order = 3  # type: ignore[misc]


# A stranger's.


class HalfTheWay(RangeRule):
    """A part of what the contraction θ of an order allows: η^(1/p)/θ."""

    kind: Literal["half-the-way"] = "half-the-way"
    part: float = 0.5

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        allowed = tolerance ** (1.0 / branch.order)
        return Range(self.part * allowed / branch.contraction, branch.contraction, self.part * allowed)


class Halfway(HomotopyForm):
    """(1 − a) K* W + a G(W) = 0 by its recurrence: a stranger's that is built on nothing of its own."""

    kind: Literal["halfway"] = "halfway"

    def recurrence(self, problem: NonlinearProblem, state: np.ndarray) -> Recurrence:
        return FixedPointRecurrence(problem, state)


@pytest.fixture
def registry() -> Registry:
    """One in which the strangers are installed."""
    found = Registry.installed()
    found.add(Plugin(HalfTheWay, Halfway), "stranger 1.0")
    return found


def test_a_strangers_rule_and_form_work_in_a_study(registry: Registry, tmp_path: Path) -> None:
    check_range_rule(HalfTheWay())
    check_homotopy_form(Halfway())
    path = tmp_path / "study.toml"
    path.write_text(
        """\
question = "How far does a stranger go?"
[scene]
kind = "bratu"
[solver]
kind = "anm"
form = "halfway"
[[sweep]]
grid = { "solver.range" = ["half-the-way", { kind = "half-the-way", part = 0.1 }, "last-term"] }
[[table]]
name = "tangents"
rows = ["solver.range.kind", "solver.range.part"]
value = "tangents"
"""
    )
    study = Study.from_toml(path, registry=registry)
    results = nlsolve.run(study, tmp_path / "out")
    assert results.runs["status"].tolist() == ["converged"] * 3, results.runs["message"].tolist()
    assert results.runs["solver.range.kind"].tolist() == ["half-the-way", "half-the-way", "last-term"]
    assert results.runs["solver.form.kind"].tolist() == ["halfway"] * 3
    assert len({case.id for case in study.cases}) == 3
    assert results.table("tangents").shape[0] == 3
    assert (results.steps["range_quantity"].notna() == results.steps["limited_by"].notna()).all()
    rows = {(row.noun, row.kind): row.failure for row in registry.plugins()}
    assert rows["range", "half-the-way"] is rows["form", "halfway"] is None


def test_a_rule_that_is_not_installed_is_given_as_an_instance() -> None:
    study = Study.from_dict(CASE | {"solver": {"kind": "anm", "range": HalfTheWay(part=0.2), "form": Halfway()}})
    (case,) = study.cases
    assert case.parameters["solver.range.class"].endswith(".HalfTheWay")
    assert nlsolve.run(study).runs["status"].tolist() == ["converged"]


def test_a_name_is_short_for_a_table_of_a_kind() -> None:
    for name, rule in (("ratio", Ratio()), ("pade-pair", PadePair()), ("nearest-pole", NearestPole())):
        assert Method(range=name).range == Method(range={"kind": name}).range == rule
    assert Method(form="newton") == Method(form={"kind": "newton"})
    assert Method() == Method(range="ratio", form="fixed-point")
    assert Method.model_validate_json(Method(range="last-term").model_dump_json()).range == LastTerm()


@pytest.mark.parametrize(
    ("fields", "sentence"),
    [
        ({"range": "lst-term"}, "solver.range = 'lst-term': no such range; did you mean 'last-term'?"),
        ({"range": {"kind": "lst-term"}}, "solver.range.kind = 'lst-term': no such range; did you mean 'last-term'?"),
        ({"range": {"kind": "ratio", "terms": 2}}, "solver.range.terms = 2: no such field"),
        ({"range": {}}, "solver.range.kind: required, and missing; installed: last-term"),
        ({"range": 0.5}, "solver.range = 0.5: should be a table with a kind"),
        ({"form": "riks"}, "solver.form = 'riks': no such form; installed: fixed-point, newton"),
    ],
)
def test_what_is_wrong_is_told_in_its_own_place(fields: dict[str, Any], sentence: str) -> None:
    with pytest.raises(StudyError) as caught:
        Study.from_dict(CASE | {"solver": {"kind": "anm"} | fields})
    assert sentence in str(caught.value)


def test_a_table_by_the_old_column_is_told_the_new_one() -> None:
    table = [{"name": "t", "rows": "solver.range", "value": "tangents"}]
    with pytest.raises(StudyError, match=r"whose name is in the column solver\.range\.kind"):
        Study.from_dict(CASE | {"solver": {"kind": "anm"}, "table": table})


# Bad answers.


class Constant(RangeRule):
    """The same range whatever the branch."""

    kind: Literal["constant"] = "constant"
    value: Any = 1.0

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        return Range(self.value)


@pytest.mark.parametrize("adaptive", [False, True])
@pytest.mark.parametrize("choice", ["renew", "advance", "accept"])
@pytest.mark.parametrize("value", ["nan", "-0.5"])
def test_a_rule_that_gives_no_range_ends_with_its_name_and_the_way_out(value: str, choice: Any, adaptive: bool) -> None:
    class Bad(Constant):
        kind: Literal["bad"] = "bad"  # type: ignore[assignment]

        def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
            return Range(float(value))

    solver = Method(order=5, range=Bad(), short_range=choice, adaptive=adaptive)
    outcome, _ = run(ToyProblem(), solver, RangeUnderOne(), START, DenseLU())
    assert outcome.status is Status.RANGE_EXHAUSTED
    assert f"the range rule 'bad' gave a_max = {float(value):.1e} for a series of order 5" in outcome.detail
    assert "choose another" in outcome.detail
    assert "\n" not in outcome.detail


@pytest.mark.parametrize("adaptive", [False, True])
def test_a_rule_that_gives_nothing_ends_as_a_series_without_range(adaptive: bool) -> None:
    solver = Method(order=8, range=Constant(value=0.0), adaptive=adaptive)
    outcome, _ = run(ToyProblem(), solver, RangeUnderOne(), START, DenseLU())
    assert outcome.status is Status.RANGE_EXHAUSTED
    assert outcome.detail.startswith("a_max = 0.0e+00 for a series of order 8")


class Shrinking(Constant):
    kind: Literal["shrinking"] = "shrinking"  # type: ignore[assignment]

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        return Range(1e-3 / tolerance)


class Moody(Constant):
    kind: Literal["moody"] = "moody"  # type: ignore[assignment]

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        MOODS.append(1.0)
        return Range(tolerance * len(MOODS))


MOODS: list[float] = []


class Unused(Constant):
    kind: Literal["unused"] = "unused"  # type: ignore[assignment]

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        return Range(tolerance if used else 2.0)


class Meddling(Constant):
    kind: Literal["meddling"] = "meddling"  # type: ignore[assignment]

    def limit(self, branch: SeriesBranch, tolerance: float, used: bool) -> Range:
        branch.terms[0][0] = 7.0
        return Range(tolerance)


@pytest.mark.parametrize(
    ("rule", "sentence"),
    [
        (Constant(value=float("inf")), None),
        (Constant(value=0.5), "does not grow with η"),
        (Constant(value=0.0), "a range is positive or infinite"),
        (Constant(value=float("nan")), "a range is positive or infinite"),
        (Shrinking(), "falls where η grows"),
        (Moody(), "when it was asked again"),
        (Unused(), "where it will not be used"),
        (Meddling(), "the rule changed a branch"),
    ],
    ids=lambda given: given.kind if isinstance(given, RangeRule) else "",
)
def test_the_check_finds_broken_promises(rule: RangeRule, sentence: str | None) -> None:
    if sentence is None:
        check_range_rule(rule)
    else:
        with pytest.raises(AssertionError, match=sentence):
            check_range_rule(rule)


class Twice(HomotopyForm):
    """r_1 = −2 G(0), and later the fixed-point form's."""

    kind: Literal["twice"] = "twice"
    late: bool = False

    def recurrence(self, problem: NonlinearProblem, state: np.ndarray) -> Recurrence:
        late = self.late

        class Wrong(FixedPointRecurrence):
            def right_hand_side(self) -> np.ndarray:
                return (2.0 if not late or len(self._terms) == 2 else 1.0) * super().right_hand_side()

        return Wrong(problem, state)


def test_the_check_of_forms_finds_wrong_right_hand_sides() -> None:
    with pytest.raises(AssertionError, match="r_1, which is −G"):
        check_homotopy_form(Twice())
    with pytest.raises(AssertionError, match=r"in the homotopy, not O\(a\^5\)"):
        check_homotopy_form(Twice(late=True))


def test_a_rule_is_no_form() -> None:
    with pytest.raises(ValidationError, match="Ratio is a range, where a form belongs"):
        Method(form=Ratio())
    assert run(ToyProblem(), Method(), RangeUnderOne(), START, DenseLU(), stop=StoppingTest())[0].converged
