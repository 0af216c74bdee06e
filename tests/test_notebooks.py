"""Every notebook asks a question, answers it with one asserted number, and runs from top to bottom:
figures shown, stderr empty."""

import ast
import os
import shutil
from pathlib import Path

import jupytext
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.py"))
MOST_LINES = 80
each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def cells(path, kind):
    return [cell.source for cell in jupytext.read(path).cells if cell.cell_type == kind]


def test_they_are_numbered_from_one_on():
    assert [path.stem[:2] for path in NOTEBOOKS] == [
        f"{k:02d}" for k in range(1, len(NOTEBOOKS) + 1)
    ]


@each_notebook
def test_it_starts_with_a_question(path):
    title = cells(path, "markdown")[0].splitlines()[0]
    assert title.startswith("# ")
    assert title.endswith("?")


@each_notebook
def test_it_ends_with_its_one_assertion_in_at_most_80_lines_of_code(path):
    code = "\n".join(
        line
        for cell in cells(path, "code")
        for line in cell.splitlines()
        if not line.startswith("%")
    )
    assert (
        sum(bool(line.strip()) and not line.lstrip().startswith("#") for line in code.splitlines())
        <= MOST_LINES
    )
    statements = ast.parse(code).body
    assert isinstance(statements[-1], ast.Assert)
    assert sum(isinstance(node, ast.Assert) for node in ast.walk(ast.parse(code))) == 1


# The settings of pytest do not reach the kernel: what warns there arrives on its stderr. Here only
# the kernel's client would.
@pytest.mark.filterwarnings("default")
@each_notebook
def test_it_runs(path, tmp_path):
    if path.stem == "06_export" and shutil.which("cc") is None:
        pytest.skip("no C compiler on this machine")
    client = NotebookClient(
        jupytext.read(path),
        timeout=300,
        kernel_name="python3",
        resources={"metadata": {"path": str(tmp_path)}},
    )
    client.execute(env=os.environ | {"PYTHONPATH": str(ROOT)})
    outputs = [output for cell in client.nb.cells for output in cell.get("outputs", [])]
    assert [
        output.text
        for output in outputs
        if output.output_type == "stream" and output.name == "stderr"
    ] == []
    shown = [output.data for output in outputs if "data" in output]
    assert all("image/png" in data for data in shown if "<Figure" in data.get("text/plain", ""))
    assert any("image/png" in data for data in shown)
