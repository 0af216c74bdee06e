"""Long campaigns on the command line: progress, and an interrupt that loses nothing."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import hydroctl as hc
from hydroctl import progress

COUNT, CHUNKS = 20_480, 32


@pytest.fixture
def schedule(tmp_path, reference):
    x, y = np.array([-1.0, -0.1, 0.1, 1.0]), np.array([0.0, 0.25, 0.5])
    return hc.tune_fixed(
        reference, x, y, specification=hc.Specification(uncertainty="nominal")
    ).save(tmp_path / "schedule.json")


def start(*arguments):
    # a shell's background jobs, and all that they start, ignore SIGINT
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); from hydroctl.cli"
        " import main; main()"
    )
    return subprocess.Popen(
        [sys.executable, "-c", code, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def interrupted(process, directory):
    """(return code, stderr) of the process after Ctrl-C, sent when its first chunk is in
    `directory`."""
    patience = time.monotonic() + 300.0
    while (
        not list(directory.glob("cases-*.npy"))
        and process.poll() is None
        and time.monotonic() < patience
    ):
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=120)
    return process.returncode, err


def test_ctrl_c_leaves_a_state_from_which_the_same_command_goes_on(schedule, tmp_path, command):
    kept = tmp_path / "kept"
    arguments = "validate", schedule, "--count", COUNT, "--seed", 5, "-o", kept
    code, err = interrupted(start(*arguments), kept)
    assert code == 130
    assert (
        err.strip()
        == f"hydroctl: interrupted; the same command with -o {kept} goes on from the finished cases"
    )
    finished = {path: path.stat().st_mtime_ns for path in kept.glob("cases-*.npy")}
    assert 1 <= len(finished) < CHUNKS
    code, resumed, _ = command(*arguments)
    assert code in (0, 1)
    assert {path: path.stat().st_mtime_ns for path in finished} == finished
    assert len(list(kept.glob("cases-*.npy"))) == CHUNKS
    assert resumed.startswith(f"{COUNT} random cases, seed 5")


def test_progress_is_drawn_on_a_terminal_after_two_seconds_and_nowhere_else(monkeypatch, capsys):
    now = iter([0.0, 1.0, 3.0, 4.0, *([5.0] * 100)])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(now))
    for terminal in (True, False):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal, raising=False)
        with progress.progress_bar() as advance:
            advance(100, 1000)
            assert capsys.readouterr().err == ""
            advance(500, 1000)
            advance(1000, 1000)
        assert ("100%" in capsys.readouterr().err) is terminal
        now = iter([0.0, 5.0, 6.0, 7.0])
