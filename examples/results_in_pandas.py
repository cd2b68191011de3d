"""Results are frames: `runs` has a row for each case, `steps` one for each iteration; both are kept as Parquet."""

import tempfile
from pathlib import Path

import pandas as pd

import nlsolve

study = {
    "question": "How does the residual of Bratu's problem fall, as λ nears the fold at 3.5138?",
    "scene": {"kind": "bratu", "nodes": 32},
    "solver": {"kind": "newton"},
    "sweep": [{"grid": {"scene.strength": [1.0, 2.0, 3.0, 3.5]}}],
}
with tempfile.TemporaryDirectory() as folder:
    nlsolve.run(study, out=folder)  # called again with the same folder, it computes only what is missing there
    runs = pd.read_parquet(Path(folder) / "runs.parquet")
    steps = pd.read_parquet(Path(folder) / "steps.parquet")

residuals = steps.merge(runs[["case", "scene.strength"]], on="case")
print(residuals.pivot(index="step", columns="scene.strength", values="residual_norm"))
