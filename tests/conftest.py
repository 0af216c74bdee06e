"""Machines and families that many tests use."""

import sys

import numpy as np
import pytest

import hydroctl as hc


@pytest.fixture(scope="session")
def reference():
    return hc.load_actuator("reference")


@pytest.fixture(scope="session")
def family(reference):
    """Tangent models of the reference actuator at x = -1, -0.1, 0.1, 1 and y = 0.1, 0.25, 0.4 m."""
    points = hc.find_operating_points(
        reference, np.array([-1.0, -0.1, 0.1, 1.0])[:, None], np.array([0.1, 0.25, 0.4])
    )
    return hc.linearize(reference, points)


@pytest.fixture
def command(monkeypatch, capsys):
    """Runs `hydroctl` with the given arguments in this process; returns (exit code, stdout,
    stderr)."""
    from hydroctl.cli import main

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["hydroctl", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        return ended.value.code or 0, out, err

    return run
