"""Components of classes that nobody has installed, in studies from Python: kept, told apart, swept, and refused."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from nlsolve_laws import PowerLaw
from nlsolve_rules import FullSteps
from nlsolve_solvers import Newton
from nlsolve_systems import Bratu
from pydantic import ConfigDict, Field

import nlsolve
from nlsolve.plugin import Globalization, NonlinearSolver, RefreshRule, Step, System

QUESTION = "Does a class of this file take part?"
SYSTEM = {"kind": "bratu", "nodes": 4}


class Half(NonlinearSolver):
    """Newton's direction at a fixed length."""

    kind: Literal["half"] = "half"
    length: float = Field(0.5, gt=0)

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        state = start
        while True:
            yield Step(state)
            tangent.refresh_if_due(lambda: problem.jacobian(state))
            state = state - self.length * tangent.solve(problem.residual(state))


class Twin(Half):
    """The same kind and parameters, another class."""


class Newtons(Newton):
    """Of the kind of an installed class."""


class Always(RefreshRule):
    """Each time."""

    kind: Literal["always"] = "always"

    def due(self, evidence: Any) -> bool:
        return True


class Halved:
    """t = 1/2."""

    def length(self, problem: Any, state: Any, residual: Any, direction: Any, promised: float = 1.0) -> Any:
        return 0.5, problem.residual(state + 0.5 * direction)


class Halving(Globalization):
    """Half of each step."""

    kind: Literal["halving"] = "halving"

    def search(self, problem: Any) -> Any:
        return Halved()


class Square(System):
    """u² = c."""

    kind: Literal["square"] = "square"
    constant: float = 2.0

    def formula(self, u: Any) -> Any:
        return u**2 - self.constant

    def standard_start(self) -> Any:
        return np.ones(1)


class WithMatrix(Square):
    """Of a field that JSON cannot hold."""

    model_config = ConfigDict(arbitrary_types_allowed=True)
    kind: Literal["with-matrix"] = "with-matrix"  # type: ignore[assignment]
    matrix: Any = Field(default_factory=lambda: np.eye(1))


class Nameless(NonlinearSolver):
    """It has no kind."""

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        yield Step(start)


def study(**sections: Any) -> nlsolve.Study:
    return nlsolve.Study.from_dict({"question": QUESTION, "scene": SYSTEM} | sections)


def ids(**sections: Any) -> list[str]:
    return [case.id for case in study(**sections).cases]


def test_a_study_runs_with_instances():
    document = {"question": QUESTION, "scene": Square(constant=9.0), "solver": Half(length=0.9), "refresh": Always()}
    results = nlsolve.run(document)
    (case,) = results.study.cases
    assert (type(case.parts.scene), type(case.parts.solver), type(case.parts.refresh)) == (Square, Half, Always)
    run = results.runs.iloc[0]
    assert (run["status"], run["solver.kind"], run["solver.length"]) == ("converged", "half", 0.9)
    assert run["solver.class"] == f"{__name__}.Half"
    assert run["scene.constant"] == 9.0


def test_two_classes_of_one_kind_are_two_cases():
    grid = [{"grid": {"solver": [Half(), Twin(), Newton(), Newtons()]}}]
    cases = study(sweep=grid).cases
    assert [type(case.parts.solver) for case in cases] == [Half, Twin, Newton, Newtons]
    assert len({case.id for case in cases}) == 4
    names = [case.parameters.get("solver.class") for case in cases]
    assert names == [f"{__name__}.Half", f"{__name__}.Twin", None, f"{__name__}.Newtons"]


def test_an_installed_class_has_the_id_of_its_kind():
    assert ids(solver=Newton(), scene=Bratu(nodes=4)) == ids(solver={"kind": "newton"})
    assert ids(solver=Newton(globalization=FullSteps())) == ids(
        solver={"kind": "newton", "globalization": {"kind": "none"}}
    )
    assert ids(solver=Newtons()) != ids(solver={"kind": "newton"})
    assert ids(solver=Half()) == ids(solver=Half())


def test_a_component_inside_another_keeps_its_class():
    (case,) = study(solver=Newton(globalization=Halving())).cases
    assert type(case.parts.solver) is Newton
    assert type(case.parts.solver.globalization) is Halving
    assert case.parameters["solver.globalization.class"] == f"{__name__}.Halving"
    (swept,) = study(solver={"kind": "newton"}, sweep=[{"grid": {"solver.globalization": [Halving()]}}]).cases
    assert type(swept.parts.solver.globalization) is Halving
    assert swept.id == case.id
    changed = Newton(globalization=Halving()).with_(kind="newton")
    assert type(changed.globalization) is Halving


@pytest.mark.parametrize(
    "sweep",
    [
        {"grid": {"solver": [Half(), Half(length=1.0)]}},
        {"zip": {"solver": [Half(), Half(length=1.0)], "budget.iterations": [50, 60]}},
        {"each": [{"name": "half", "solver": Half()}, {"name": "full", "solver": Half(length=1.0)}]},
    ],
)
def test_instances_are_swept(sweep):
    cases = study(sweep=[sweep]).cases
    assert [case.parts.solver for case in cases] == [Half(), Half(length=1.0)]


def test_the_fields_of_an_instance_are_swept_and_set():
    cases = study(solver=Half(), sweep=[{"grid": {"solver.length": [0.5, 1.0]}}]).cases
    assert [case.parts.solver for case in cases] == [Half(), Half(length=1.0)]
    assert [case.label for case in cases] == ["solver.length = 0.5", "solver.length = 1.0"]
    by_hand = {"question": QUESTION, "scene": SYSTEM, "solver": Half()}
    (case,) = nlsolve.Study.from_dict(by_hand, overrides={"solver.length": 0.7}).cases
    assert case.parts.solver == Half(length=0.7)
    (case,) = nlsolve.Study.from_dict(by_hand, overrides={"solver": Twin()}).cases
    assert type(case.parts.solver) is Twin
    quick = by_hand | {"quick": {"solver": Twin(length=0.6)}}
    (case,) = nlsolve.Study.from_dict(quick, quick=True).cases
    assert (type(case.parts.solver), case.parts.solver.length) == (Twin, 0.6)


def test_a_reference_may_be_an_instance():
    cases = study(solver={"kind": "newton"}, reference={"solver": Half()}).cases
    assert [type(case.parts.solver) for case in cases] == [Half, Newton]
    assert cases[1].reference == cases[0].id


def test_the_results_folder_knows_the_classes_apart(tmp_path: Path):
    first = nlsolve.run({"question": QUESTION, "scene": SYSTEM, "solver": Half(length=1.0)}, tmp_path / "out")
    again = nlsolve.run(first.study, tmp_path / "out")
    assert again.runs["case"].tolist() == first.runs["case"].tolist()
    other = nlsolve.run({"question": QUESTION, "scene": SYSTEM, "solver": Twin(length=1.0)}, tmp_path / "out")
    assert set(other.runs["case"]).isdisjoint(first.runs["case"])
    assert len(list((tmp_path / "out" / "cases").glob("*.json"))) == 2


@pytest.mark.parametrize(
    ("sections", "sentence"),
    [
        (
            {"solver": PowerLaw(index=0.5)},
            r"^study: solver.*: PowerLaw is a law, where a solver belongs; installed: anderson, anm",
        ),
        ({"linear": Half()}, r"^study: linear.*: Half is a solver, where a linear belongs; installed: "),
        ({"solver": Half}, r"^study: solver.*: Half is a class: give an instance of it, such as Half\(\)$"),
        ({"solver": Nameless()}, r"^study: solver.*: Nameless must declare its name: kind: Literal"),
        (
            {"solver": Newton(), "sweep": [{"grid": {"solver": [Half(), Always()]}}]},
            r"^study: solver.*: Always is a ref",
        ),
        (
            {"solver": Half(), "sweep": [{"grid": {"solver.lenght": [1.0]}}]},
            r"solver.lenght = 1.0: no such field; did you",
        ),
        (
            {"solver": Half(), "sweep": [{"grid": {"solver.length": [-1.0]}}]},
            r"solver.length = -1.0: should be greater",
        ),
        ({"scene": WithMatrix()}, r"^study: scene: a field cannot be written as JSON, by which cases are told apart: "),
    ],
)
def test_what_is_refused(sections, sentence):
    with pytest.raises(nlsolve.StudyError, match=sentence) as refused:
        study(**sections)
    assert "\n" not in str(refused.value)
