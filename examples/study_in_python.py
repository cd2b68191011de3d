"""A study as a dictionary, with the keys of a study file: three strategies, two systems of equations, one table."""

import nlsolve

results = nlsolve.run(
    {
        "question": "How many Jacobians does each strategy assemble on its way to a root?",
        "scene": {"kind": "published", "problem": "powell-singular"},
        "solver": {"kind": "newton"},
        "stop": {"kind": "residual", "tolerance": 1e-9},
        "sweep": [
            {"grid": {"solver.kind": ["newton", "modified-newton", "robust"]}},
            {"grid": {"scene.problem": ["powell-singular", "helical-valley"]}},
        ],
        "table": [{"name": "work", "rows": "solver.kind", "columns": "scene.problem", "value": "jacobians"}],
    }
)
print(results.table("work"))
print(results.runs[["solver.kind", "scene.problem", "status", "message"]])
