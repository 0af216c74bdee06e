"""The layers of the package, and what importing it may load."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import hydroctl

PACKAGE = Path(hydroctl.__file__).parent
LAYERS = (
    ("errors", "scalar", "digits"),
    ("compiling",),
    ("units", "polynomials", "transfer_function", "files", "schedule_versions", "forms", "recursion", "region"),
    ("actuator", "second_order"),
    ("datasheet", "plant", "bases", "records"),
    ("equilibrium",),
    ("operating_point",),
    ("linearization",),
    ("reduction", "quasi_linear", "characteristics"),
    ("surfaces", "estimation"),
    ("paper", "frequency"),
    ("identification",),
    ("regulators", "specification"),
    ("margins",),
    ("simulation",),
    ("test_vectors", "schedule_document"),
    ("schedule_file",),
    ("schedule",),
    ("tuning", "coupling"),
    ("validation", "synchronization"),
    ("testing", "verdicts"),
    ("export", "searched_tuning"),
    ("plotting",),
    ("report",),
    ("summary", "remarks"),
    ("design",),
    ("cli",),
)
RANK = {name: rank for rank, layer in enumerate(LAYERS) for name in layer}
HEAVY = ("control", "matplotlib", "numba", "pint", "jinja2", "dask", "pydantic", "typer", "pandas", "scipy")
FILES = sorted(PACKAGE.rglob("*.py"))


def _part(path: Path) -> str:
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


def _is_for_type_checkers(node) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def _imported_parts(path: Path):
    """Top-level parts of hydroctl that a file imports when it runs, wherever in the file."""
    package = ("hydroctl", *path.relative_to(PACKAGE).with_suffix("").parts[:-1])
    tree = ast.parse(path.read_text())
    only_types = {id(node) for block in ast.walk(tree) if _is_for_type_checkers(block) for node in ast.walk(block)}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and id(node) not in only_types:
            base = package[: len(package) - node.level + 1] if node.level else ()
            target = (*base, *(node.module.split(".") if node.module else ()))
            if target[:1] == ("hydroctl",):
                yield from [target[1]] if len(target) > 1 else [alias.name for alias in node.names]


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_only_to_lower_layers(path):
    part = _part(path)
    if part == "__init__":
        return
    assert part in RANK, f"{part} has no layer"
    for other in _imported_parts(path):
        assert other == "__version__" or other == part or RANK[other] < RANK[part], f"{part} imports {other}, which is not below it"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_star_imports(path):
    for node in ast.walk(ast.parse(path.read_text())):
        assert not (isinstance(node, ast.ImportFrom) and any(alias.name == "*" for alias in node.names))


def test_importing_hydroctl_loads_nothing_heavy():
    code = f"import sys, hydroctl; print([name for name in {HEAVY!r} if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=PACKAGE.parent)
    assert loaded.stdout.strip() == "[]"


@pytest.mark.parametrize("name", hydroctl.__all__)
def test_every_public_name_exists_and_is_documented(name):
    assert getattr(hydroctl, name).__doc__
