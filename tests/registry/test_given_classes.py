"""Classes given from Python: their kinds can be written wherever a kind is, and they are part of what tells cases."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from nlsolve_laws import PowerLaw

import nlsolve
from nlsolve.plugin import ConstitutiveLaw, FlowScene, NonlinearSolver, Step
from nlsolve.registry.plugin_files import with_plugins
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import Registry
from nlsolve.running.store.identity import identity_of
from nlsolve.study.study import Study

QUESTION = "Does a class that is given take part?"
STUDY = {"question": QUESTION, "scene": {"kind": "bratu", "nodes": 4}, "solver": {"kind": "shortened"}}


class Shortened(NonlinearSolver):
    """Newton's direction at a fixed length."""

    kind: Literal["shortened"] = "shortened"
    length: float = 0.75

    def steps(self, problem: Any, tangent: Any, start: Any) -> Iterator[Step]:
        state = start
        while True:
            yield Step(state)
            tangent.refresh_if_due(lambda: problem.jacobian(state))
            state = state - self.length * tangent.solve(problem.residual(state))


class Longer(Shortened):
    """Another class of the same kind."""

    length: float = 0.9


def square(u: Any) -> Any:
    return u**2 - 2.0


def test_a_solve_may_name_the_kind_of_a_class() -> None:
    for solver in ("shortened", {"kind": "shortened", "length": 0.9}, Shortened()):
        outcome = nlsolve.solve(square, [1.0], solver, plugins=[Shortened])
        assert outcome.state == pytest.approx(np.sqrt([2.0]))
    with pytest.raises(nlsolve.InputError, match="'shortened'"):
        nlsolve.solve(square, [1.0], "shortened")


def test_a_comparison_takes_classes_and_files(tmp_path: Any) -> None:
    file = tmp_path / "half.py"
    file.write_text(
        "from typing import Literal\n\nfrom nlsolve_solvers import Newton\n\n\n"
        'class Half(Newton):\n    kind: Literal["half"] = "half"\n',
        encoding="utf-8",
    )
    frame = nlsolve.compare(square, [1.0], ["newton", "shortened", "half"], plugins=(p for p in (Shortened, file)))
    assert list(frame["status"]) == ["converged"] * 3
    assert frame.iterations[1] > frame.iterations[0] == frame.iterations[2]


def test_a_study_may_name_the_kind_of_a_class() -> None:
    for study, plugins in (({**STUDY, "plugins": [Shortened]}, ()), (STUDY, [Shortened])):
        results = nlsolve.run(study, plugins=plugins, isolation="none")
        assert list(results.runs["status"]) == ["converged"]
        assert results.runs["solver.kind"][0] == "shortened"
    with pytest.raises(StudyError, match="'shortened'"):
        nlsolve.run(STUDY)


def test_a_march_may_name_the_kind_of_a_class() -> None:
    class Water(ConstitutiveLaw):
        kind: Literal["water"] = "water"

        def viscosity(self, rate_squared: Any) -> Any:
            return 1.0 + 0.0 * rate_squared

    study = {
        "scene": {"kind": "couette"},
        "law": {"kind": "water"},
        "discretizer": {"kind": "delaunay"},
        "solver": {"kind": "newton"},
        "start": {"values": []},
    }
    march = nlsolve.march(study, plugins=[Water])
    assert march.outcome.status is nlsolve.Status.CONVERGED


def test_the_class_tells_cases_apart() -> None:
    def key(cls: type[Shortened]) -> str:
        study = Study.from_dict({**STUDY, "solver": {"kind": "shortened", "length": 0.5}, "plugins": [cls]})
        return identity_of(study.cases[0]).key

    assert key(Shortened) == key(Shortened)
    first = identity_of(Study.from_dict({**STUDY, "plugins": [Shortened]}).cases[0])
    assert "tests" in first.code


def test_a_class_may_be_given_twice() -> None:
    registry = with_plugins(Registry(), [Shortened, Shortened])
    assert list(registry.classes("solver")) == ["shortened"]
    both = with_plugins(registry, [Longer])
    assert list(both.classes("solver")) == []  # nobody can say which is meant


@pytest.mark.parametrize(
    ("plugin", "sentence"),
    [(int, "<class 'int'> is not a subclass of one of Scene"), (NonlinearSolver, "leaves methods of its contract out")],
)
def test_a_class_that_cannot_be_used(plugin: type, sentence: str) -> None:
    with pytest.raises(StudyError, match=sentence) as caught:
        Study.from_dict({**STUDY, "plugins": [plugin]})
    assert str(caught.value).startswith("study: plugins[0]: the plugin ")
    with pytest.raises(StudyError, match=sentence):
        nlsolve.run(STUDY, plugins=[plugin])


def test_a_study_that_has_been_read_takes_no_more_plugins() -> None:
    study = Study.from_dict({**STUDY, "plugins": [Shortened]})
    with pytest.raises(StudyError, match="plugins are applied when a study is read"):
        nlsolve.run(study, plugins=[Shortened])


class _Scene(FlowScene):
    """A scene that computes nothing."""

    def cloud(self, law: Any) -> Any: ...
    def boundary_position(self, cloud: Any, time: float) -> Any: ...
    def boundary_velocity(self, cloud: Any, law: Any, time: float) -> Any: ...


class Called(_Scene):
    kind: Literal["called"] = "called"

    def reference_rate(self) -> float:  # type: ignore[override]
        return 1.0


class Read(PowerLaw):
    kind: Literal["read"] = "read"  # type: ignore[assignment]
    continued_by: ClassVar[Any] = {}

    @property
    def viscosity(self) -> Any:  # type: ignore[override]
        return 1.0


@pytest.mark.parametrize(
    ("cls", "sentence"),
    [
        (Called, "Called.reference_rate is a method, and should be a property: write @property above it"),
        (Read, "Read.viscosity is a property, and should be a method: leave @property out"),
    ],
)
def test_a_method_is_no_property(cls: type, sentence: str) -> None:
    with pytest.raises(StudyError, match=sentence):
        with_plugins(Registry(), [cls])
