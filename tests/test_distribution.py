"""What is built is complete: wheel and sdist are installed in a fresh environment and used without the repository."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import pytest
from pages import blocks

from nlsolve.cli.plugins.scaffold import CONTRACTS, files_of, write

ROOT = Path(__file__).parents[1]
LINES = 40
"""Most lines of a first solver."""

ADDED = ('plugins = ["./my_solver.py"]', '{ kind = "my-solver" },')
"""Lines of the first study for a solver of one's own: the first, and one of its sweep."""

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


@dataclass(frozen=True)
class Installed:
    """An environment with what was built, and an empty folder outside of any checkout."""

    environment: Path
    desk: Path

    def nlsolve(self, *words: str) -> str:
        """What a command prints in the folder."""
        command = [str(self.environment / "bin" / "nlsolve"), *words]
        found = subprocess.run(command, cwd=self.desk, capture_output=True, text=True, timeout=300, env={"HOME": "/"})
        assert found.returncode == 0, found.stderr
        return found.stdout


def installed(archive: Path, folder: Path) -> Installed:
    """Install an archive into a fresh environment."""
    environment, desk = folder / "environment", folder / "desk"
    desk.mkdir()
    subprocess.run([sys.executable, "-m", "venv", str(environment)], check=True, timeout=120)
    python = environment / "bin" / "python"
    subprocess.run([str(python), "-m", "pip", "install", "-q", str(archive)], check=True, timeout=600)
    return Installed(environment, desk)


@pytest.fixture(scope="module")
def by_wheel(built: Path, tmp_path_factory) -> Installed:
    (wheel,) = built.glob("*.whl")
    return installed(wheel, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def by_sdist(built: Path, tmp_path_factory) -> Installed:
    (sdist,) = built.glob("*.tar.gz")
    return installed(sdist, tmp_path_factory.mktemp("sdist"))


@pytest.mark.slow
@pytest.mark.parametrize("archive", ["by_wheel", "by_sdist"])
def test_what_is_built_works_in_a_fresh_environment(archive: str, request: pytest.FixtureRequest) -> None:
    """The first study, a plugin of one's own, its check and its study."""
    nlsolve = request.getfixturevalue(archive).nlsolve
    assert nlsolve("--version") == f"nlsolve {version('nlsolve')}\n"
    assert "How many tangents does a homotopy factorise" in nlsolve("examples")
    assert "nlsolve run mine/first.toml --quick" in nlsolve("examples", "first", "mine")
    assert "tangents" in nlsolve("run", "mine/first.toml", "--quick")
    nlsolve("new", "solver", "my-solver", "--to", "new")
    assert "FAILED" not in nlsolve("check", "new/my_solver.py")
    assert "my-solver" in nlsolve("run", "new/my_solver.toml")


@pytest.mark.slow
def test_the_solver_of_the_documentation_is_in_the_table_of_the_first_study(by_wheel: Installed) -> None:
    """Typed as docs/plugins.md shows it, checked, and named in a copy of the study, as that page says."""
    page = (ROOT / "docs" / "plugins.md").read_text(encoding="utf-8")
    (typed,) = (block.text for block in blocks(page) if (block.mark, block.said) == ("file", "my_solver.py"))
    assert len([line for line in typed.splitlines() if line]) <= LINES
    (by_wheel.desk / "my_solver.py").write_text(typed, encoding="utf-8")
    (found,) = json.loads(by_wheel.nlsolve("check", "my_solver.py", "--json"))
    assert (found["kind"], found["holds"]) == ("my-solver", True)
    by_wheel.nlsolve("examples", "first")
    copy = by_wheel.desk / "first.toml"
    lines = copy.read_text(encoding="utf-8").splitlines()
    for line in ADDED:
        assert line in page
    lines.insert(lines.index('    { kind = "modified-newton" },'), f"    {ADDED[1]}")
    copy.write_text("\n".join((ADDED[0], *lines)), encoding="utf-8")
    by_wheel.nlsolve("run", "first.toml", "--quick")
    rows = json.loads(by_wheel.nlsolve("table", "results/first-quick", "strategies", "--json"))["strategies"]
    (row,) = (row for row in rows if row["solver.kind"] == "my-solver")
    (newton,) = (row for row in rows if row["solver.kind"] == "newton")
    assert row["tangents"] < newton["tangents"]
    assert row["residual_norm"] < 1e-8
    assert row["velocity_error"] == pytest.approx(newton["velocity_error"], rel=1e-6)


@pytest.mark.slow
def test_the_plugins_of_new_are_typed(by_wheel: Installed, tmp_path: Path) -> None:
    """`mypy --strict`, as the pyproject.toml of a new package has it, on every kind; and it finds a wrong one."""
    for contract in CONTRACTS:
        write(files_of(contract, f"my-{contract}", package=False), tmp_path)
    (tmp_path / "pyproject.toml").write_text(files_of("law", "x", package=True)["x/pyproject.toml"], encoding="utf-8")
    assert mypy(by_wheel, tmp_path) == (0, f"Success: no issues found in {2 * len(CONTRACTS)} source files\n")
    law = (tmp_path / "my_law.py").read_text(encoding="utf-8")
    (tmp_path / "my_law.py").write_text(law.replace("rate_squared: Any", "rate: int, time: float"), encoding="utf-8")
    code, told = mypy(by_wheel, tmp_path)
    assert code == 1
    assert 'incompatible with supertype "nlsolve.contracts.continuum.law.ConstitutiveLaw"' in told


def mypy(package: Installed, folder: Path) -> tuple[int, str]:
    """Exit code and words of mypy on a folder, against the package that is installed."""
    python = str(package.environment / "bin" / "python")
    command = [sys.executable, "-m", "mypy", "--python-executable", python, "."]
    found = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    return found.returncode, found.stdout
