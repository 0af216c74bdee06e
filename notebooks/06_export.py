# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Does the controller compute what the simulation computed?
#
# A schedule is worth what runs on the machine. This notebook exports one as C, compiles it, feeds
# it the measurements of a motion of the nonlinear machine sample by sample, and compares its
# commands with those of the simulation. It needs a C compiler.

# %%
import ctypes
import subprocess
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import hydroctl as hc

# %matplotlib inline

# %% [markdown]
# ## The schedule
# A position loop with a notch, a filter of the measurement, the derivative on the measurement,
# and a feed-forward of the speed.

# %%
actuator = hc.load_actuator("reference")
settings = {"measurement_filter": 3e-4, "derivative_on": "measurement"}
x, y = np.array([-1.0, -0.1, 0.1, 1.0]), np.array([0.0, 0.25, 0.5])
schedule = hc.tune(
    actuator,
    x,
    y,
    loop="position",
    structure="pid+notch",
    specification=hc.Specification(**settings),
)
written = hc.export_schedule(schedule, "press.c", format="c")
print(*written)

# %% [markdown]
# ## What the programmer of the controller sees
# One state for each cylinder, `press_init` once, `press_step` every sample; no memory is allocated.

# %%
header = Path("press.h").read_text()
print(header[header.index("/* What a step reads") : header.index("/* The gains that act")])

# %% [markdown]
# ## Compiled, without a warning

# %%
strict = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"]
subprocess.run(["cc", *strict, "-shared", "-fPIC", "-o", "press.so", "press.c", "-lm"], check=True)
library = ctypes.CDLL("./press.so")


class Input(ctypes.Structure):
    """`press_input`."""

    _fields_ = [(name, ctypes.c_double) for name in ("reference", "v_ref", "p_a", "p_b", "v", "y")]


state = ctypes.create_string_buffer(1024)
library.press_init(state)
library.press_step.restype = ctypes.c_double

# %% [markdown]
# ## The same motion twice
# A step at full opening, so that limit and anti-windup act too. The simulation runs its own,
# compiled form of the law; the C code gets only what the sensors would tell it.

# %%
t = np.arange(2200) * schedule.Ts
scenario = hc.Scenario(
    name="step of 250 mm",
    loop="position",
    Ts=schedule.Ts,
    reference=np.where(t < 0.05, 0.1, 0.35),
    y=0.1,
)
motion = hc.simulate_closed_loop(actuator, schedule, scenario)
signals = np.stack(
    [scenario.reference, scenario.v_ref, motion.p_a, motion.p_b, motion.v, motion.y], axis=-1
)
commands = np.array([library.press_step(state, ctypes.byref(Input(*row))) for row in signals])

# %%
figure = Figure(figsize=(8, 5), layout="constrained")
above, below = figure.subplots(2, 1, sharex=True)
above.step(t, motion.command, where="post", color="0.6", linewidth=3, label="simulation")
above.step(t, commands, where="post", color="C0", linewidth=1, linestyle="--", label="C")
above.set(ylabel="command x (of full)", title=scenario.name)
above.legend()
below.plot(t, motion.y, color="C0", label="position")
below.plot(t, scenario.reference, "k:", label="reference")
below.set(xlabel="time (s)", ylabel="position y (m)")
below.legend()
figure

# %% [markdown]
# ## The answer
# All 2200 commands agree to rounding: the C code and the simulation are two independent forms of
# one law.

# %%
difference = np.abs(commands - motion.command).max()
print(
    f"{np.count_nonzero(np.abs(commands) == 1.0)} samples at the limit, "
    f"largest difference of a command {difference:.1e}"
)
assert difference <= 1e-12
