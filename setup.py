"""The studies ship with the package: `studies/` is `nlsolve/studies` of a wheel. All else is in pyproject.toml."""

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithStudies(build_py):
    """Copies the studies beside the modules; an editable install reads them where they are."""

    def run(self) -> None:
        super().run()
        if not self.editable_mode:
            self.copy_tree("studies", f"{self.build_lib}/nlsolve/studies")


setup(cmdclass={"build_py": BuildWithStudies})
