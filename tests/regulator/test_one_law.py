"""The law stands once: whatever sign of its source is changed, the law in Python, what is printed
from it and what follows from it change with it."""

import json
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[2] / "hydroctl"
PROBE = Path(__file__).with_name("one_law_probe.py")
SIGNS = {
    "the measurement enters the error": (
        "law.py",
        "error = reference - filtered",
        "error = reference + filtered",
    ),
    "the feed-forward is added": ("law.py", "notched + forward", "notched - forward"),
    "the limit is on both sides": ("law.py", "(wanted, -1.0, 1.0)", "(wanted, 1.0, 1.0)"),
    "the integral adds up": ("pid.py", "memory.integral + gained", "memory.integral - gained"),
    "the derivative is a difference": ("pid.py", "+ g - before", "+ g + before"),
    "the notch has poles": ("notch.py", "b1 * u - b1 * notched", "b1 * u + b1 * notched"),
    "a section has a zero": ("lead_lag.py", "(w - zero)", "(w + zero)"),
    "the filter is behind": (
        "measurement_filter.py",
        "measured + keep",
        "measured - keep",
    ),
    "the volumes are on two sides": (
        "compensation.py",
        "k.volume_b - k.area_b",
        "k.volume_b + k.area_b",
    ),
    "the inverse opens": ("inverse.py", "return w + regulator", "return w - regulator"),
    "the tables are interpolated": ("gains.py", "return low + along_x", "return low - along_x"),
}
LINEAR = {"pid.py", "notch.py", "lead_lag.py", "measurement_filter.py"}
"""modules that the linear regulator follows from"""


def probed(package_parent):
    """What every target makes of the package in that place, by target."""
    environment = os.environ | {"PYTHONPATH": f"{package_parent}{os.pathsep}{PROBE.parents[1]}"}
    done = subprocess.run(
        [sys.executable, PROBE], env=environment, check=True, capture_output=True, text=True
    )
    return json.loads(done.stdout)


@cache
def original():
    return probed(PACKAGE.parent)


def test_the_targets_do_not_depend_on_where_the_package_lies(tmp_path):
    shutil.copytree(PACKAGE, tmp_path / "hydroctl", ignore=shutil.ignore_patterns("__pycache__"))
    assert probed(tmp_path) == original()


@pytest.mark.parametrize("sign", SIGNS)
def test_one_sign_of_the_source_changes_every_target(sign, tmp_path):
    file, before, after = SIGNS[sign]
    shutil.copytree(PACKAGE, tmp_path / "hydroctl", ignore=shutil.ignore_patterns("__pycache__"))
    source = tmp_path / "hydroctl" / "regulator" / file
    text = source.read_text("utf-8")
    assert text.count(before) == 1
    source.write_text(text.replace(before, after), "utf-8")
    found = probed(tmp_path)
    same = {target for target, value in original().items() if found[target] == value}
    assert same == (set() if file in LINEAR else {"linear"})
