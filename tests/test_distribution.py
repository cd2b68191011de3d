"""What is built is complete: wheel and sdist are installed in a fresh environment and used without the repository."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LEFT_OUT = {"build", "dist", "results"}
"""What of a checkout is no source, beside hidden folders."""


def no_source(folder: str, names: list[str]) -> set[str]:
    """The names in a folder that are not copied."""
    out = {name for name in names if name == "__pycache__" or name.endswith(".egg-info")}
    return out | {name for name in names if Path(folder) == ROOT and (name in LEFT_OUT or name.startswith("."))}


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """A folder with the sdist of a copy of this checkout, and the wheel that is built from the sdist."""
    folder = tmp_path_factory.mktemp("built")
    copy = shutil.copytree(ROOT, folder / "checkout", ignore=no_source)
    command = [sys.executable, "-m", "build", "--outdir", str(folder / "dist"), str(copy)]
    subprocess.run(command, check=True, capture_output=True, timeout=600)
    return folder / "dist"


@pytest.mark.slow
def test_the_wheel_has_the_studies_and_all_modules(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    studies = {f"nlsolve/studies/{path.relative_to(ROOT / 'studies')}" for path in (ROOT / "studies").rglob("*.toml")}
    modules = {str(path.relative_to(ROOT)) for path in (ROOT / "nlsolve").rglob("*.py")}
    plugins = {str(path.relative_to(ROOT / "plugins")) for path in (ROOT / "plugins").rglob("*.py")}
    data = {
        str(path.relative_to(ROOT))
        for path in (ROOT / "nlsolve").rglob("*")
        if path.suffix in (".txt", ".html", ".typed")
    }
    assert studies
    assert data
    assert (studies | modules | plugins | data) - names == set()
    assert not {name for name in names if name.startswith(("tests/", "studies/", "setup.py"))}


@pytest.mark.slow
@pytest.mark.parametrize("pattern", ["*.whl", "*.tar.gz"])
def test_what_is_built_works_in_a_fresh_environment(built: Path, tmp_path: Path, pattern: str) -> None:
    """The first study, a plugin of one's own, its check and its study, in a folder outside of any checkout."""
    (archive,) = built.glob(pattern)
    environment = tmp_path / "environment"
    subprocess.run([sys.executable, "-m", "venv", str(environment)], check=True, timeout=120)
    python = environment / "bin" / "python"
    subprocess.run([str(python), "-m", "pip", "install", "-q", str(archive)], check=True, timeout=600)

    def nlsolve(*words: str) -> str:
        command = [str(environment / "bin" / "nlsolve"), *words]
        found = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, env={"HOME": "/"})
        assert found.returncode == 0, found.stderr
        return found.stdout

    assert nlsolve("--version") == f"nlsolve {version('nlsolve')}\n"
    assert "How many tangents does a homotopy factorise" in nlsolve("examples")
    assert "nlsolve run mine/first.toml --quick" in nlsolve("examples", "first", "mine")
    assert "tangents" in nlsolve("run", "mine/first.toml", "--quick")
    nlsolve("new", "solver", "my-solver")
    assert "FAILED" not in nlsolve("check", "my_solver.py")
    assert "my-solver" in nlsolve("run", "my_solver.toml")
