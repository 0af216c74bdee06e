"""The layers of the package (the contract stands in pyproject.toml), and what importing it may
load."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import hydroctl

PACKAGE = Path(hydroctl.__file__).parent
PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"
HEAVY = (
    "control",
    "matplotlib",
    "numba",
    "pint",
    "jinja2",
    "dask",
    "pydantic",
    "typer",
    "pandas",
    "scipy",
)
FILES = sorted(PACKAGE.rglob("*.py"))


def _contract(root: Path) -> subprocess.CompletedProcess:
    """What import-linter says of a copy of the package."""
    command = [Path(sys.executable).with_name("lint-imports"), "--no-cache", "--config", PYPROJECT]
    environment = os.environ | {"PYTHONPATH": str(root)}
    return subprocess.run(command, capture_output=True, text=True, cwd=root, env=environment)


def test_every_import_points_down_and_nothing_runs_in_a_circle():
    told = _contract(PACKAGE.parent)
    assert told.returncode == 0, told.stdout


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("regulator/law.py", "from ..model import plant"),
        ("loop/margins.py", "import hydroctl.schedule"),
        ("machine/units.py", "from .datasheet import load_actuator"),
        ("model/plant.py", "if TYPE_CHECKING:\n    from ..schedule import GainSchedule"),
        ("errors.py", "def late():\n    from .files import write_file"),
    ],
    ids=["side", "up", "circle", "types", "inside a function"],
)
def test_an_import_against_the_contract_is_found(tmp_path, file, line):
    shutil.copytree(PACKAGE, tmp_path / "hydroctl", ignore=shutil.ignore_patterns("__pycache__"))
    with (tmp_path / "hydroctl" / file).open("a") as source:
        source.write(f"\n{line}\n")
    told = _contract(tmp_path)
    assert told.returncode == 1, told.stdout
    assert "BROKEN" in told.stdout


def test_the_top_level_shows_the_method():
    assert len(list(PACKAGE.glob("*.py"))) <= 10


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_star_imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        assert not (
            isinstance(node, ast.ImportFrom) and any(alias.name == "*" for alias in node.names)
        )


def test_importing_hydroctl_loads_nothing_heavy():
    code = f"import sys, hydroctl; print([name for name in {HEAVY!r} if name in sys.modules])"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=PACKAGE.parent
    )
    assert loaded.stdout.strip() == "[]"


@pytest.mark.parametrize("name", hydroctl.__all__)
def test_every_public_name_exists_and_is_documented(name):
    assert getattr(hydroctl, name).__doc__
