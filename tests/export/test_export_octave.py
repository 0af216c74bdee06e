"""Octave as a second opinion: it looks gains up in the exported tables and finds the same poles,
zeros and margins."""

import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from exports import REFERENCE, exported
from scipy.io import loadmat, savemat

import hydroctl as hc

OCTAVE = shutil.which("octave-cli")
BAR = 1e5
pytestmark = pytest.mark.skipif(OCTAVE is None, reason="Octave is not installed")


def run(directory, script):
    """What the script saves in answer.mat."""
    (directory / "script.m").write_text(script + "\nsave('-v7', 'answer.mat', 'answer');\n")
    done = subprocess.run(
        [OCTAVE, "--norc", "script.m"], cwd=directory, capture_output=True, text=True, check=False
    )
    assert (directory / "answer.mat").exists(), done.stderr
    return loadmat(directory / "answer.mat", simplify_cells=True)["answer"]


@pytest.mark.parametrize("nodes", [(4, 3), (4, 1), (1, 1)])
def test_interp2_looks_up_the_gains_of_the_schedule(tmp_path, nodes):
    full = exported()
    rows, columns = slice(4 - nodes[0], None), slice(nodes[1])
    tables = {
        name: getattr(full, name)[rows, columns] for name in ("kp", "ki", "kd", "notch_frequency")
    }
    x, y = full.x[rows], full.y[columns]
    schedule = replace(full, x=x, y=y, design_x=x, design_y=y, **tables)
    hc.export_schedule(schedule, tmp_path / "press.mat", "mat")
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-1.2, 1.2, 200), rng.uniform(-0.1, 0.6, 200)])
    savemat(tmp_path / "points.mat", {"points": points})
    found = run(
        tmp_path,
        """
        load press.mat; load points.mat; s = schedule; answer = zeros(rows(points), 4);
        for n = 1:rows(points)
          x = points(n, 1); y = points(n, 2);
          limits = s.x_limits(1 + (x >= 0), :); x_c = min(max(x, limits(1)), limits(2));
          y_c = min(max(y, s.y_limits(1)), s.y_limits(2));
          names = {'kp', 'ki', 'kd', 'notch_frequency'};
          for k = 1:4
            answer(n, k) = interp2(s.y, s.x, s.(names{k}), y_c, x_c);
          end
        end""",
    )
    gains = schedule.gains(*points.T)
    expected = np.stack([gains.kp, gains.ki, gains.kd, gains.notch_frequency], axis=-1)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_poles_zeros_and_margins_of_the_family_are_those_of_octave(tmp_path):
    """States in bar; the plant by the zero-order hold of Octave, one sample of delay, the regulator
    from its transfer function."""
    schedule = exported()
    margins, designed = schedule.margins.margins, schedule.margins.designed
    points = hc.find_operating_points(REFERENCE, schedule.x[:, None], schedule.y)
    family = hc.linearize(REFERENCE, points)
    scale = np.diag([BAR, BAR, 1.0])
    A, B, C = (
        np.linalg.solve(scale, family.A) @ scale,
        np.linalg.solve(scale, family.B),
        family.C @ scale,
    )
    regulators = [
        schedule.regulators[index].transfer_function() for index in np.ndindex(schedule.kp.shape)
    ]
    count = schedule.kp.size
    given = {
        "A": A.reshape(count, 3, 3),
        "B": np.broadcast_to(B, (*schedule.kp.shape, 3, 1)).reshape(count, 3, 1),
        "C": np.broadcast_to(C, (*schedule.kp.shape, 1, 3)).reshape(count, 1, 3),
        "num": np.stack([np.ravel(regulator.num_array[0, 0]) for regulator in regulators]),
        "den": np.stack([np.ravel(regulator.den_array[0, 0]) for regulator in regulators]),
        "Ts": schedule.Ts,
        "near": margins.crossover[0][designed],
    }
    savemat(tmp_path / "family.mat", given)
    found = run(
        tmp_path,
        """
        pkg load control; load family.mat;
        for n = 1:rows(num)
          plant = ss(squeeze(A(n, :, :)), reshape(B(n, :, :), 3, 1), reshape(C(n, :, :), 1, 3), 0);
          answer.poles(n, :) = pole(plant).'; answer.zeros(n, :) = zero(plant).';
          sampled = c2d(plant, Ts, 'zoh') * tf(1, [1 0], Ts) * tf(num(n, :), den(n, :), Ts);
          response = @(omega) squeeze(freqresp(sampled, omega));
          crossover = fzero(@(omega) abs(response(omega)) - 1, near(n) * [0.9, 1.1]);
          answer.margins(n, :) = [margin(sampled), pi - abs(angle(response(crossover))), crossover];
        end""",
    )

    def ordered(roots):
        return np.sort_complex(np.reshape(roots, (count, -1)).astype(complex))

    np.testing.assert_allclose(ordered(found["poles"]), ordered(family.poles()), rtol=1e-9)
    np.testing.assert_allclose(ordered(found["zeros"]), ordered(family.zeros()), rtol=1e-9)
    np.testing.assert_allclose(found["margins"][:, 0], margins.gain_margin[0][designed], rtol=1e-6)
    np.testing.assert_allclose(found["margins"][:, 1], margins.phase_margin[0][designed], rtol=1e-6)
    np.testing.assert_allclose(found["margins"][:, 2], margins.crossover[0][designed], rtol=1e-6)
