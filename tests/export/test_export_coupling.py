"""The coupling of a group in C: the references that each regulator is given, sample by sample."""

import shutil
import subprocess

import numpy as np
import pytest
from groups import machines_of, pair
from loops import schedule

import hydroctl as hc
from hydroctl.errors import FailedChecksError, InputError
from hydroctl.export import export_coupling
from hydroctl.synchronization import Coupling, design_coupling, s_curve
from hydroctl.synchronization.coupling import COUPLINGS, coupling_matrix

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
STRICT = (
    "-std=c99",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Werror",
)
SANITIZERS = ("-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
DRIVER = """
#include <stdio.h>
#include "press.h"
enum { N = PRESS_CYLINDERS };
int main(void)
{
    press_state state;
    double row[1 + 2 * N], out[N + 1];
    press_real y[N], x[N], target[N];
    press_init(&state);
    while (fread(row, sizeof row[0], 1 + 2 * N, stdin) == 1 + 2 * N) {
        int i;
        for (i = 0; i < N; i++) {
            y[i] = (press_real)row[1 + i];
            x[i] = (press_real)row[1 + N + i];
        }
        out[N] = press_targets(&state, (press_real)row[0], y, target);
        press_integrate(&state, x);
        for (i = 0; i < N; i++) {
            out[i] = (double)target[i];
        }
        if (fwrite(out, sizeof out[0], N + 1, stdout) != N + 1) {
            return 1;
        }
    }
    return 0;
}
"""

needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


def answers(directory, rows):
    """(targets (n, N), sound (n,)) of the compiled coupling in `directory` for rows (n, 1 + 2 N):
    reference, y, x."""
    (directory / "driver.c").write_text(DRIVER)
    command = [COMPILER, *STRICT, *SANITIZERS, "-I.", "driver.c", "press.c", "-lm", "-o", "program"]
    subprocess.run(command, cwd=directory, check=True)
    done = subprocess.run(
        [directory / "program"], input=rows.tobytes(), capture_output=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, b"")
    out = np.frombuffer(done.stdout).reshape(len(rows), -1)
    return out[:, :-1], out[:, -1]


def motion(name):
    """Three cylinders, one of which saturates for a while."""
    machine = hc.load_actuator("reference")
    coupling = Coupling(
        name=name,
        matrix=coupling_matrix(name, 3),
        kc=1.0 if name == "master-slave" else 0.4,
        ki=15.0,
    )
    given = schedule("position", feed_forward=True)
    profile = s_curve(0.1, 0.15, 0.4, after=0.3)
    loads = [0.0, 3e5, 7e5 * (profile.t < 0.35)]
    return hc.synchronize(
        [machine, machine.replace(mass=800.0), machine],
        [given] * 3,
        profile,
        coupling=coupling,
        load_forces=loads,
    )


@needs_compiler
@pytest.mark.parametrize(("real", "bound"), [("double", 1e-15), ("float", 1e-6)])
@pytest.mark.parametrize("name", COUPLINGS)
def test_targets_in_c_are_those_of_the_simulated_group(tmp_path, name, real, bound):
    """The bounds: ten roundings of a position below 1 m, in double; in float the integral adds one
    per sample, each of the integral's own size, which is under 1 % of a metre."""
    result = motion(name)
    assert 0.0 < result.metrics.saturation_time < 0.5
    export_coupling(result.coupling, tmp_path / "press.c", sample_time=1e-3, real=real)
    commands, expected = (
        np.array([getattr(t, signal) for t in result.trajectories])
        for signal in ("command", "reference")
    )
    targets, sound = answers(
        tmp_path, np.ascontiguousarray(np.vstack([result.reference, result.y, commands]).T)
    )
    assert sound.all()
    assert np.abs(targets - expected.T).max() <= bound


@needs_compiler
def test_an_unknown_position_keeps_the_targets_at_their_distance(tmp_path):
    result = motion("mean")
    export_coupling(result.coupling, tmp_path / "press.c", sample_time=1e-3)
    commands = np.array([t.command for t in result.trajectories])
    rows = np.vstack([result.reference, result.y, commands]).T.copy()
    rows[400:, 2] = np.nan
    targets, sound = answers(tmp_path, rows)
    assert (sound == (np.arange(len(rows)) < 400)).all()
    distance = targets - rows[:, :1]
    assert np.abs(distance[399]).max() > 1e-5
    assert np.abs(distance[400:] - distance[399]).max() <= 1e-15


def test_the_header_states_the_evidence(tmp_path):
    schedules = pair()
    coupling = design_coupling(machines_of(schedules), schedules, "mean")
    header, source = export_coupling(coupling, tmp_path / "gate.c", sample_time=1e-3)
    assert (header.name, source.name) == ("gate.h", "gate.c")
    assert "kept: limit 2" in header.read_text()
    assert "#define GATE_CYLINDERS 2" in header.read_text()


def test_what_cannot_be_exported_is_refused(tmp_path):
    schedules = pair()
    coupling = design_coupling(machines_of(schedules), schedules, "mean", Ms=1.5)
    with pytest.raises(InputError) as caught:
        export_coupling(coupling, tmp_path / "gate.c", sample_time=0.0, real="half")
    assert len(caught.value.faults) == 2
    with pytest.raises(FailedChecksError, match=r"does not keep its limit.*\n.*NOT KEPT"):
        export_coupling(coupling, tmp_path / "gate.c", sample_time=1e-3)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="cannot name"):
        export_coupling(
            Coupling(name="mean", matrix=coupling_matrix("mean", 2), kc=0.1, ki=1.0),
            tmp_path / "2.c",
            sample_time=1e-3,
        )
