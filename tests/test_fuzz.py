"""Whatever a run is given, it ends in a status with a sentence; the long form of this is benchmarks/fuzz.py."""

from __future__ import annotations

from pathlib import Path

import pytest
from fuzz import crashes, drawn, endings, files, flows, report, run, systems

from nlsolve import Status

SECONDS = 10


@pytest.mark.parametrize(("documents", "count"), [(systems, 60), (flows, 12)], ids=["systems", "flows"])
def test_no_run_crashes(documents, count):
    every = documents()
    found = list(endings(drawn(every, count / len(every), seed=3), SECONDS))
    assert len(found) == count
    assert not crashes(found), report("runs", found)
    assert all(ending.sentence for ending in found)


def test_no_file_of_nodes_crashes(tmp_path: Path):
    every = files(tmp_path)
    found = list(endings(drawn(every, 60 / len(every), seed=3), SECONDS))
    assert not crashes(found), report("files", found)
    assert {ending.word for ending in found} >= {Status.BAD_CLOUD.word, Status.CONVERGED.word}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::scipy.linalg.LinAlgWarning")  # a method of SciPy tells of it and goes on
@pytest.mark.parametrize(("documents", "part"), [(systems, 0.03), (flows, 0.005)], ids=["systems", "flows"])
def test_no_run_of_many_crashes(documents, part):
    found = list(endings(drawn(documents(), part, seed=4), SECONDS))
    assert not crashes(found), report("runs", found)


@pytest.mark.slow
def test_no_file_of_all_crashes(tmp_path: Path):
    found = list(endings(files(tmp_path), SECONDS))
    assert not crashes(found), report("files", found)


def test_a_crash_is_reported_with_its_document():
    """A method of a stranger that raises is what the fuzz looks for."""
    document = {"scene": {"kind": "bratu", "nodes": 4}, "solver": {"kind": "newton"}}
    ending = run(document, SECONDS)
    assert ending.word == Status.CONVERGED.word
    broken = type(ending)(document, Status.CRASHED.word, "KeyError: 1 (/a/b.py:3)")
    assert "1 runs, 1 crashed" in report("runs", [broken])
    assert str(document) in report("runs", [broken])


@pytest.mark.parametrize(
    "document",
    [
        {
            "scene": {"kind": "published", "problem": "powell-singular", "factor": 1e-150},
            "solver": {"kind": "anm", "range": {"kind": "pade-pair"}},
        },
        {
            "scene": {"kind": "p-laplacian", "nodes": 5, "dimension": 2, "power": 5.0, "factor": 1e-3},
            "solver": {"kind": "anm", "form": "newton", "extrapolation": "pade", "range": {"kind": "pade-pair"}},
        },
        {
            "scene": {"kind": "published", "problem": "watson-mgh", "factor": 1e6},
            "solver": {
                "kind": "anm",
                "adaptive": True,
                "residual": 1e-8,
                "order": 30,
                "range": {"kind": "last-term"},
                "extrapolation": "pade",
            },
            "operator": {"kind": "mass"},
        },
        {
            "scene": {"kind": "published", "problem": "gulf", "factor": 1e-150},
            "solver": {"kind": "newton"},
            "linear": {"kind": "rslab"},
        },
    ],
    ids=["pade-pair", "pade-pair, newton form", "adaptive order", "J = 0 by rslab"],
)
def test_dense_algebra_that_fails_on_its_numbers_is_a_status(document):
    ending = run(document, SECONDS)
    assert ending.word != Status.CRASHED.word, ending.sentence
    assert ending.sentence
