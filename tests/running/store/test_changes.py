"""A plugin, a file or a version changes between two runs: what depends on it is run again, and `plan` said so."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fakes import solver_text

PLAIN = solver_text("plain")
EDITED = PLAIN.replace("state - tangent", "state - 0.9 * tangent")

STUDY = """
question = "What is run again?"
scene = { kind = "channel", spacing = 0.5 }
law = { kind = "power-law", index = 1.0 }
discretizer = { kind = "mls" }
solver = { kind = "newton" }

[[sweep]]
name = "by"
each = [
    { name = "newton" },
    { name = "plain", solver = { kind = "plain" } },
    { name = "read", "scene.nodes" = { kind = "file", path = "nodes.csv" } },
]
"""


class Place:
    """A folder with a study, a plugin that is installed there, and a file of nodes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "study.toml").write_text(STUDY, encoding="utf-8")
        self.install(PLAIN, "1.0")
        self.write_nodes(5)

    def install(self, text: str, version: str) -> None:
        site = self.folder / "site"
        for old in site.glob("*.dist-info/*"):
            old.unlink()
        info = site / "plain-1.0.dist-info"
        info.mkdir(parents=True, exist_ok=True)
        (site / "plain.py").write_text(text, encoding="utf-8")
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: plain\nVersion: {version}\n", encoding="utf-8")
        (info / "entry_points.txt").write_text("[nlsolve]\nplain = plain\n", encoding="utf-8")

    def write_nodes(self, across: int) -> None:
        """A channel of 2 by 2 mm; its first corner is given twice when `across` is 0."""
        points = [(0.5 * i, -1.0 + 2.0 * j / (max(across, 5) - 1)) for i in range(5) for j in range(max(across, 5))]
        lines = ["x,y,group"]
        for x, y in points if across else [*points, points[0]]:
            side = "bottom" if y == -1.0 else "top" if y == 1.0 else "inlet" if x == 0 else "outlet" if x == 2 else ""
            lines.append(f"{x},{y},{side}")
        (self.folder / "nodes.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")

    def told(self, command: str, *arguments: str) -> dict[str, Any]:
        environment = {**os.environ, "PYTHONPATH": str(self.folder / "site"), "PYTHONDONTWRITEBYTECODE": "1"}
        main = "from nlsolve.cli.main import main; main()"
        call = [sys.executable, "-c", main, command, "study.toml", "--json", *arguments]
        ran = subprocess.run(call, cwd=self.folder, env=environment, capture_output=True, text=True)
        assert ran.stdout, ran.stderr
        return json.loads(ran.stdout) | {"said": ran.stderr}

    def plan(self) -> dict[str, str]:
        return {row["by"]: row["plan"] for row in self.told("plan")["cases"]}

    def run(self) -> dict[str, str]:
        """The status of every case; asserts that those were run which the plan said, and no others."""
        due = [name for name, word in self.plan().items() if word != "kept"]
        ran = self.told("run")
        computed = [line for line in ran["said"].splitlines() if line.startswith("case ") and "before" not in line]
        assert sum("factorisations" in line for line in computed) == len(due), ran["said"]
        assert set(self.plan().values()) <= {"kept", "retried (crashed)"}
        return {row["by"]: row["status"] for row in ran["runs"]}


@pytest.mark.slow
def test_what_has_changed_is_run_again_and_nothing_else(tmp_path):
    place = Place(tmp_path)
    assert place.plan() == {"newton": "new", "plain": "new", "read": "new"}
    assert place.run() == {"newton": "converged", "plain": "converged", "read": "converged"}
    assert set(place.plan().values()) == {"kept"}

    place.install(EDITED, "1.0")
    assert place.plan() == {"newton": "kept", "plain": "changed plugin plain", "read": "kept"}
    place.run()

    place.install(EDITED, "1.1")
    assert place.plan()["plain"] == "changed plugin plain 1.0 -> 1.1"
    place.run()

    place.write_nodes(0)
    assert place.plan() == {"newton": "kept", "plain": "kept", "read": "changed file nodes.csv"}
    assert place.run()["read"] == "bad cloud"
    assert set(place.plan().values()) == {"kept"}, "a refusal is a result"

    place.write_nodes(9)
    assert place.plan()["read"] == "changed file nodes.csv"
    assert place.run()["read"] == "converged"

    place.write_nodes(5)
    assert set(place.plan().values()) == {"kept"}, "the folder remembers the file as it was"
