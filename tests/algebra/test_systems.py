"""Systems of equations as scenes: the contract, the Jacobian by groups of columns, endings, and studies of them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import scipy.sparse as sp
from cases import SystemParts
from nlsolve_linear.superlu import SuperLU
from nlsolve_rules.energy import Energy
from nlsolve_rules.refresh import EveryIteration
from nlsolve_solvers import Newton, PseudoTransient, Robust
from nlsolve_systems import Bratu, PLaplacian, Published
from pydantic import Field
from typer.testing import CliRunner

import nlsolve
from nlsolve.algebra.by_equation import ByEquation
from nlsolve.algebra.colouring import Colouring, groups_of
from nlsolve.algebra.root_search import newton_steps, root_error
from nlsolve.cli.app import app
from nlsolve.contracts.status import Status
from nlsolve.plugin import NonlinearProblem, NonlinearSolver, Step, System, hookimpl
from nlsolve.registry.problems import StudyError
from nlsolve.registry.registry import Registry
from nlsolve.results.columns import RUNS, STEPS
from nlsolve.results.verdicts import DOUBTED, RIGHT, outcome, solved
from nlsolve.running.diagnose import diagnose
from nlsolve.running.forecast import forecast
from nlsolve.solving.simulate import Record, run_case
from nlsolve.solving.stopping import Budget, StoppingTest
from nlsolve.solving.work.ledger import Ledger
from nlsolve.study.study import Study
from nlsolve.testing import check_solver, check_system

PLAIN = SuperLU(ordering="colamd")


class Circle(System):
    """A plugin's own system: one formula, one start."""

    kind: Literal["circle"] = "circle"
    radius: float = Field(1.0, gt=0)

    def formula(self, u: Any) -> Any:
        x, y = u
        return np.stack([x**2 + y**2 - self.radius**2, x - y])

    def standard_start(self) -> np.ndarray:
        return np.array([1.0, 0.5])


class HalfKnown(Circle):
    """One of its two roots is known."""

    kind: Literal["half-known"] = "half-known"  # type: ignore[assignment]

    def roots(self) -> np.ndarray:
        return self.radius * np.sqrt(0.5) * np.ones((1, 2))


class FromBehind(HalfKnown):
    """It begins beside the other one."""

    def standard_start(self) -> np.ndarray:
        return np.array([-1.0, -0.5])


class FarOut(System):
    """e⁻ˣ: small far out, zero nowhere."""

    kind: Literal["far-out"] = "far-out"

    def formula(self, u: Any) -> Any:
        return np.exp(-u)

    def standard_start(self) -> np.ndarray:
        return np.zeros(1)


class Elsewhere(FarOut):
    """The same with a known root that is none of it."""

    kind: Literal["elsewhere"] = "elsewhere"  # type: ignore[assignment]

    def roots(self) -> np.ndarray:
        return np.zeros((1, 1))


class Flat(FarOut):
    """x² + 1 from its least point: nothing can be factorised there."""

    kind: Literal["flat"] = "flat"  # type: ignore[assignment]

    def formula(self, u: Any) -> Any:
        return u * u + 1.0


def solve(
    system: System, solver: NonlinearSolver | None = None, budget: Budget | None = None, absolute: bool = False
) -> Record:
    stop = StoppingTest(kind="absolute" if absolute else "residual", tolerance=1e-9)
    return run_case(SystemParts(system, PLAIN, solver or Newton(), stop=stop, budget=budget or Budget()))


# The Jacobian.


@pytest.mark.parametrize(
    ("pattern", "groups"),
    [
        (sp.diags_array([1.0, 1.0, 1.0], offsets=[-1, 0, 1], shape=(50, 50)), 3),
        (sp.eye_array(20), 1),
        (np.ones((6, 6)), 6),
        (Bratu(dimension=2, nodes=12).pattern(), 7),  # five of a cross, and what a greedy rule adds to it
    ],
)
def test_groups_share_no_row(pattern: Any, groups: int) -> None:
    found = groups_of(pattern)
    assert found.max() + 1 <= groups
    entries = sp.csr_array(pattern, dtype=bool)
    for row in range(entries.shape[0]):
        columns = entries.indices[entries.indptr[row] : entries.indptr[row + 1]]
        assert len(set(found[columns].tolist())) == len(columns)


def test_a_matrix_comes_back_from_its_groups() -> None:
    random = np.random.default_rng(3)
    pattern = sp.random_array((30, 30), density=0.1, rng=random) + sp.eye_array(30)
    matrix = sp.csr_array(pattern) * 2.5
    compression = Colouring(pattern, 30)
    assert compression.seeds.shape[1] < 30
    np.testing.assert_array_equal(compression.unpack(matrix @ compression.seeds).toarray(), matrix.toarray())
    dense = Colouring(None, 30)
    np.testing.assert_array_equal(dense.unpack(matrix @ dense.seeds).toarray(), matrix.toarray())


# The contract.


def test_a_system_of_ones_own_keeps_the_contract() -> None:
    check_system(Circle(radius=2.0))
    check_system(HalfKnown())


class AlongTheLastAxis(Circle):
    def formula(self, u: Any) -> Any:
        return u * np.arange(1.0, 1.0 + u.shape[-1])


class WrongPattern(Circle):
    def pattern(self) -> Any:
        return sp.eye_array(2)


class WrongRoot(Circle):
    def roots(self) -> np.ndarray:
        return np.array([[0.7071, 0.7071]])


class ThreeOfTwo(Circle):
    def roots(self) -> np.ndarray:
        return np.ones((1, 3))


class NoStart(Circle):
    def standard_start(self) -> np.ndarray:
        return np.array([np.inf, 1.0])


class OneEquation(Circle):
    def formula(self, u: Any) -> Any:
        return u[:1]


@pytest.mark.parametrize(
    ("system", "sentence"),
    [
        (AlongTheLastAxis(), "F of several columns against F of each"),
        (WrongPattern(), "Jacobian is off"),
        (WrongRoot(), "at the root"),
        (ThreeOfTwo(), r"a root of shape \(3,\) of a system of shape \(2,\)"),
        (NoStart(), "should be a finite"),
        (OneEquation(), r"F of shape \(1, 3\) for states of shape \(2, 3\)"),
    ],
)
def test_what_breaks_the_contract(system: System, sentence: str) -> None:
    with pytest.raises(AssertionError, match=sentence), np.errstate(all="ignore"):
        check_system(system)


def test_starts() -> None:
    np.testing.assert_array_equal(Circle().start(), [1.0, 0.5])
    np.testing.assert_array_equal(Circle(factor=10.0).start(), [10.0, 5.0])
    np.testing.assert_array_equal(Bratu(nodes=3, factor=10.0).start(), [10.0, 10.0, 10.0])  # from zero
    noisy = [Circle(perturbation=0.1, seed=seed).start() for seed in (1, 1, 2)]
    np.testing.assert_array_equal(noisy[0], noisy[1])
    assert np.abs(noisy[0] - noisy[2]).max() > 1e-3
    assert 0.0 < np.abs(noisy[0] - [1.0, 0.5]).max() < 0.5


def test_the_distance_to_roots() -> None:
    def error(system: System, u: np.ndarray) -> float:
        return root_error(system.nearest_root(u), u, np.abs(system.start()))

    assert np.isnan(error(Circle(), np.ones(2)))
    assert error(HalfKnown(radius=2.0), np.array([2.0, 2.0])) == pytest.approx(np.sqrt(2.0) - 1.0)
    assert error(Published(problem="sample-19"), np.array([3e-4, 4e-4])) == pytest.approx(4e-4 / 3.0)  # from 3
    assert error(Published(problem="wood"), np.full(4, 1.01)) == pytest.approx(0.01)


# Endings.


def test_a_root_that_is_known_another_one_and_one_of_nobody() -> None:
    known = solve(HalfKnown())
    assert known.summary["status"] == "converged"
    assert known.summary["root_error"] < 1e-9
    assert outcome(known.summary, 0.01, "root_error") == RIGHT
    other = solve(FromBehind())
    assert other.summary["status"] == Status.OTHER_ROOT.word == "other root"
    assert other.summary["message"] == Status.OTHER_ROOT.sentence
    assert other.summary["root_error"] == pytest.approx(2.0)
    assert outcome(other.summary, 0.01, "root_error") == "other root"
    assert other.steps["accepted"].tolist() == [False] * (len(other.steps) - 1) + [True]
    nobody = solve(Circle())
    assert nobody.summary["status"] == "converged"
    assert np.isnan(nobody.summary["root_error"])
    assert all(solved(record.summary, 0.01, "root_error") for record in (known, other, nobody))


@pytest.mark.parametrize("system", [FarOut(), Elsewhere()])
def test_a_small_residual_without_a_root_is_not_solved_and_by_an_absolute_test_in_doubt(system: System) -> None:
    assert solve(system).summary["status"] in ("stagnated", "budget spent")
    run = solve(system, absolute=True).summary
    assert run["status"] == "converged"
    assert run["doubt"].startswith("no root is near: 10 Newton steps lead")
    assert outcome(run, 0.01, "root_error") == DOUBTED
    assert not solved(run, 0.01, "root_error")


def test_newton_steps_tell_roots_from_what_only_looks_like_them() -> None:

    def displacement(problem: NonlinearProblem, u: np.ndarray) -> float:
        start = np.ones(len(u))
        return newton_steps(problem, u, ByEquation(problem, start, problem.residual(start), PLAIN)).displacement

    circle, far = Circle().equations(), FarOut().equations()
    root = np.sqrt(0.5) * np.ones(2)
    assert displacement(circle, root + 1e-6) < 1e-5
    assert displacement(circle, 3.0 * root) > 0.5
    assert displacement(far, np.array([25.0])) == pytest.approx(10.0 / 25.0)
    assert displacement(far, np.array([np.nan])) == np.inf
    large = Bratu(nodes=400).equations()
    assert displacement(large, Bratu(nodes=400).roots()[0]) < 1e-11
    flat = Bratu(nodes=400, strength=0.0).equations()
    flat.jacobian = lambda u: sp.csr_array((400, 400))  # type: ignore[method-assign]
    assert displacement(flat, np.ones(400)) == np.inf


def test_the_row_of_a_system() -> None:
    record = solve(Published(problem="powell-singular"), absolute=True)
    row = record.summary
    assert set(row) <= set(RUNS)
    assert set(record.steps.columns) <= set(STEPS)
    np.testing.assert_array_equal(record.fields["value"], record.outcome.state)
    np.testing.assert_array_equal(record.fields["unknown"], np.arange(len(record.outcome.state)))
    assert (row["unknowns"], row["increments"], row["root_singular"]) == (4, 1, True)
    assert row["iterations"] == row["tangents"] == row["jacobians"] == row["factorizations"] == 17
    assert row["residual_absolute"] <= 1e-9
    assert row["newton_correction"] > 1e-9  # the root is singular, and F flat around it
    assert row["ordering"] == "colamd"
    assert row["seconds"] > 0.0
    failed = solve(Published(problem="freudenstein-roth"), budget=Budget(iterations=5)).summary
    assert failed["status"] == "budget spent"
    assert failed["increments"] == 0
    assert not solved(failed, 0.01, "root_error")


def test_a_gradient_may_be_searched_on_its_energy_and_nothing_else() -> None:
    energy = Newton(globalization=Energy())
    run = solve(PLaplacian(power=1.2, regularization=1e-3), energy).summary
    assert run["status"] == "converged"
    assert run["root_error"] < 1e-9
    refused = solve(Circle(), energy).summary
    assert refused["status"] == "not applicable"


# Every strategy, unchanged.


STRATEGIES: list[dict[str, Any]] = [
    {"kind": "newton"},
    {"kind": "modified-newton"},
    {"kind": "pseudo-transient"},
    {"kind": "robust"},
    {"kind": "anderson"},
    {"kind": "broyden"},
    {"kind": "newton-krylov"},
    {"kind": "newton-krylov", "products": "jacobian"},
    {"kind": "trust-region"},
    {"kind": "anm"},
    {"kind": "anm", "form": "newton", "extrapolation": "pade"},
    {"kind": "scipy-root", "method": "hybr", "precondition": False},
]


@pytest.mark.parametrize(
    "scene", [{"kind": "bratu", "nodes": 20}, {"kind": "p-laplacian", "nodes": 20, "regularization": 0.01}]
)
def test_every_strategy_meets_the_same_root(scene: dict[str, Any]) -> None:
    study = {
        "question": "?",
        "scene": scene,
        "solver": {"kind": "newton"},
        "stop": {"tolerance": 1e-9},
        "sweep": [{"grid": {"solver": STRATEGIES}}],
    }
    runs = nlsolve.run(study).runs
    assert runs["status"].tolist() == ["converged"] * len(STRATEGIES), runs["message"].tolist()
    assert (runs["root_error"] < 1e-8).all()
    (refused,) = nlsolve.run(study | {"solver": {"kind": "picard"}, "sweep": []}).runs.itertuples()
    assert refused.status == "not applicable"


def test_pseudo_transient_damps_equations_of_either_sign() -> None:
    """1 − x has the slope −1: with σ |J_ii| on it the first matrix would be singular."""
    run = solve(Published(problem="generalized-rosenbrock"), PseudoTransient()).summary
    assert run["status"] == "converged"
    assert run["root_error"] < 1e-9


# Several methods in one.


def test_the_robust_method_keeps_the_contract() -> None:
    check_solver(Robust(), EveryIteration())


def test_a_leap_leaves_the_least_point_of_the_residual() -> None:
    problem = Published(problem="freudenstein-roth")
    assert solve(problem, Newton()).summary["status"] in ("stagnated", "budget spent")  # by the rounding of the BLAS
    record = solve(problem, Robust())
    assert record.summary["root_error"] < 1e-9
    sizes = record.steps["residual_absolute"].to_numpy()
    assert (sizes[1:] > 10.0 * sizes[:-1]).sum() >= 1  # there it went
    assert solve(problem, Robust(leaps=0), budget=Budget(iterations=27)).summary["status"] != "converged"


def test_the_last_method_tells_how_it_ended() -> None:
    run = solve(Flat(), Robust()).summary
    assert run["status"] == "singular tangent"


def test_anderson_mixes_no_more_changes_than_there_are_unknowns() -> None:
    study = {"question": "?", "scene": {"kind": "published", "problem": "scalar"}, "solver": {"kind": "anderson"}}
    (run,) = nlsolve.run(study | {"stop": {"tolerance": 1e-9}}).runs.itertuples()
    assert run.status == "converged"


# Studies.


class Plugin:
    """A stranger's module."""

    @hookimpl
    def nlsolve_components(self) -> list[type[System]]:
        return [HalfKnown]


STUDY: dict[str, Any] = {
    "question": "?",
    "scene": {"kind": "half-known"},
    "solver": {"kind": "newton"},
    "stop": {"tolerance": 1e-9},
    "sweep": [{"grid": {"scene.radius": [1.0, 2.0]}}],
}


@pytest.fixture
def registry() -> Registry:
    found = Registry.installed()
    found.add(Plugin(), "stranger 1.0")
    return found


def test_a_study_of_ones_own_system(registry: Registry, tmp_path: Path) -> None:
    study = Study.from_dict(STUDY, registry=registry)
    assert [case.label for case in study.cases] == ["scene.radius = 1.0", "scene.radius = 2.0"]
    parameters = study.cases[0].parameters
    assert not any(name.startswith(("law.", "discretizer.")) for name in parameters)
    assert [name for name in parameters if name.startswith("start.")] == ["start.stored"]
    assert study.cases[0].parameters["refresh.kind"] == "every-iteration"
    results = nlsolve.run(study, tmp_path / "out")
    assert results.runs["status"].tolist() == ["converged"] * 2
    assert results.notes == ()
    again = nlsolve.run(study, tmp_path / "out")
    assert again.runs["seconds"].tolist() == results.runs["seconds"].tolist()
    assert (tmp_path / "out" / "report.html").exists()


@pytest.mark.parametrize(
    ("extra", "sentence"),
    [
        (
            {"law": {"kind": "power-law", "index": 0.5}},
            "law: the scene 'half-known' has no such section: leave it out",
        ),
        ({"discretizer": {"kind": "mls"}}, "discretizer: the scene 'half-known' has no such section"),
        ({"motion": {"markers": True}}, "motion: the scene 'half-known' has no such section"),
        ({"start": {"adaptive": True}}, "start.adaptive = True: no such field; there are 'stored'"),
        ({"start": {"tolerance": 1e-3}}, "start.tolerance = 0.001: no such field; there are 'stored'"),
        ({"record": {"times": [0.1]}}, r"record.times = \[0.1\]: no such field; there are 'iterates'"),
        ({"scene": {"kind": "half-known", "radus": 1.0}}, "no such field; did you mean 'radius'"),
        ({"stop": {"kind": "claim"}}, "the solver 'newton' never claims a solution"),
        ({"scene": {"kind": "half-know"}}, "no such scene; did you mean 'half-known'"),
        ({"scene": {"kind": "couette"}, "sweep": []}, "law: required, and missing"),
        ({"scene": {"kind": "published", "problem": "woods"}, "sweep": []}, "did you mean 'wood'"),
    ],
)
def test_what_a_study_of_systems_may_not_say(registry: Registry, extra: dict[str, Any], sentence: str) -> None:
    with pytest.raises(StudyError, match=sentence):
        Study.from_dict(STUDY | extra, registry=registry)


def test_a_section_set_by_a_sweep_is_refused_at_its_place(registry: Registry) -> None:
    with pytest.raises(StudyError, match="law: the scene 'half-known' has no such section: leave it out"):
        Study.from_dict(STUDY | {"sweep": [{"grid": {"law.index": [0.5]}}]}, registry=registry)


def test_plans_and_diagnoses_of_systems(registry: Registry) -> None:
    study = Study.from_dict(STUDY, registry=registry)
    plan = forecast(study)
    assert plan["unknowns"].tolist() == [2, 2]
    assert plan["increments"].tolist() == [1, 1]
    assert (plan["seconds"] > 0.0).all()
    twice = STUDY | {"sweep": [*STUDY["sweep"], {"grid": {"stop.tolerance": [1e-6, 1e-9]}}]}
    rows = diagnose(Study.from_dict(twice, registry=registry))
    assert rows["operator"].tolist() == ["this scene has no cloud, and no operators on it"] * 2
    flat = {"kind": "bratu", "nodes": 2, "strength": 9.0}  # the least eigenvalue of −Δ, so that J is singular at rest
    singular = {"question": "?", "scene": flat, "solver": {"kind": "newton"}}
    (costs,) = forecast(Study.from_dict(singular)).to_dict("records")
    assert costs["unknowns"] == 2
    assert np.isnan(costs["seconds_factorization"])


def test_solved_of_all_beside_a_papers_counts(registry: Registry) -> None:
    variants = [
        {"name": "newton", "solver.kind": "newton"},
        {"name": "idle", "solver": {"kind": "newton", "globalization": {"kind": "none"}}, "budget": {"iterations": 1}},
    ]
    table = {"name": "solved", "rows": "variant", "count": True, "value": ["solved", "runs"], "error": "root_error"}
    paper = {"source": "p", "values": [[2, 2], [1, float("nan")]]}
    document = STUDY | {"sweep": [*STUDY["sweep"], {"each": variants}], "table": [table | {"paper": paper}]}
    results = nlsolve.run(Study.from_dict(document, registry=registry))
    assert results.table("solved").to_numpy().tolist() == [[2, 2], [0, 2]]
    (built,) = results.tables()
    assert built.comparison is not None
    assert built.comparison["solved"].tolist() == ["2 (2) within 25 %", "0 (1) same trend"]
    with pytest.raises(StudyError, match="2 lists of 2 numbers"):
        Study.from_dict(document | {"table": [table | {"paper": paper | {"values": [[2, 2]]}}]}, registry=registry)
    with pytest.raises(StudyError, match="drop value, or show runs or solved"):
        Study.from_dict(document | {"table": [table | {"value": "seconds"}]}, registry=registry)


def test_the_command_line_knows_systems(tmp_path: Path) -> None:
    path = Path(__file__).parents[2] / "studies" / "algebraic.toml"
    assert len(tomllib.loads(path.read_text())["sweep"][1]["grid"]["scene.problem"]) == 23
    shell = CliRunner()
    for command in ("validate", "plan", "diagnose"):
        quick = [] if command == "validate" else ["--quick"]
        result = shell.invoke(app, [command, str(path), *quick])
        assert result.exit_code == 0, result.output
    result = shell.invoke(app, ["run", str(path), "--quick", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert "Solved of 23" in result.stdout
    assert "15 converged" in result.stderr


def test_the_default_solves_all_23() -> None:
    """The aim of the set: from the published starts, each to a verified root, with nothing chosen by hand."""
    path = Path(__file__).parents[2] / "studies" / "algebraic.toml"
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    document = {name: document[name] for name in ("question", "scene", "linear", "stop")} | {
        "sweep": [document["sweep"][1]]
    }
    runs = nlsolve.run(document).runs
    assert runs["solver.kind"].tolist() == ["robust"] * 23
    judged = [solved(run, 0.01, "root_error") for run in runs.to_dict("records")]
    assert all(judged), runs.loc[~np.array(judged), ["scene.problem", "status"]]


class Silent(NonlinearSolver):
    """Yields its start and stops."""

    def steps(self, problem: Any, tangent: Any, start: np.ndarray) -> Iterator[Step]:
        yield Step(start)


def test_a_method_that_stops_by_itself_leaves_a_row() -> None:
    assert solve(Circle(), Silent()).summary["status"] == "stagnated"
    assert Ledger().work()["factorizations"] == 0
