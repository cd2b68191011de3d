"""What is slow to load is loaded by who needs it: a study with figures is read without matplotlib."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from nlsolve.show import plotting

STUDY = Path(__file__).parents[2] / "studies" / "first.toml"

READ = """
import sys
from nlsolve.cli.options import checked_study
study = checked_study(sys.argv[1], None, True, None, None)
assert study.figures
slow = ("matplotlib", "scipy.optimize", "scipy.spatial", "scipy.stats")
print([name for name in slow if name in sys.modules])
"""


def test_a_study_with_figures_is_read_without_what_draws_and_solves():
    read = subprocess.run([sys.executable, "-c", READ, str(STUDY)], capture_output=True, text=True, check=True)
    assert read.stdout == "[]\n"


@pytest.mark.parametrize("name", sorted({*plotting.__all__} - {"Picture"}))
def test_every_name_of_matplotlib_is_there_when_it_is_asked_for(name):
    assert getattr(plotting, name).__module__.startswith("matplotlib")


def test_a_picture_is_a_figure_of_matplotlib_that_makes_a_png_of_itself():
    picture = plotting.Picture(lambda figure: str(figure.get_figwidth()).encode(), figsize=(2, 1))
    assert isinstance(picture, plotting.Figure)
    assert picture._repr_png_() == b"2.0"


def test_a_name_that_it_does_not_have():
    with pytest.raises(AttributeError, match="has no attribute 'pyplot'"):
        _ = plotting.pyplot
