"""Where a row was computed."""

from __future__ import annotations

import subprocess
from pathlib import Path

from nlsolve.running.store.environment import _commit, environment_here, name_of
from nlsolve.running.store.sources import numerics


def test_what_is_told():
    here = environment_here()
    assert set(here) >= {"nlsolve", "numpy", "scipy", "Python", "processor", "BLAS", "threads", "commit"}
    assert all(isinstance(value, str) and value for value in here.values())
    assert here["numerics"] == numerics()
    assert len(name_of(here)) == 8
    assert name_of(here) == name_of(dict(here)) != name_of({**here, "numpy": "0"})
    assert name_of({}) == ""


def test_the_commit_is_that_of_git(tmp_path):
    """A branch in a file, a branch among the packed ones, a commit without a branch, a worktree, and no git at all."""

    def git(*words: str, within: Path = tmp_path / "a") -> str:
        identity = ("-c", "user.name=a", "-c", "user.email=a@b.c")
        return subprocess.run(["git", *identity, *words], cwd=within, capture_output=True, text=True, check=True).stdout

    (tmp_path / "a").mkdir()
    assert _commit(tmp_path / "a") == "none"
    git("init", "-q")
    git("commit", "-q", "--allow-empty", "-m", "first")
    commit = git("rev-parse", "HEAD")[:12]
    assert _commit(tmp_path / "a") == commit
    git("pack-refs", "--all")
    assert _commit(tmp_path / "a") == commit
    git("worktree", "add", "-q", "-b", "other", str(tmp_path / "b"))
    assert _commit(tmp_path / "b") == commit
    git("checkout", "-q", "--detach", within=tmp_path / "b")
    assert _commit(tmp_path / "b") == commit
    (tmp_path / "b" / ".git").write_text("gitdir: nowhere")
    assert _commit(tmp_path / "b") == "unknown"
