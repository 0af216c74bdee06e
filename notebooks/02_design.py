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
# # Which gains move this cylinder fast, without ringing anywhere on its stroke?
#
# A servo cylinder rings like a mass between two oil springs, and the springs change with the
# position of the piston. This notebook goes from the cylinder's data to a gain schedule for the
# speed, checks the loop at every point and on varied machines, and drives the nonlinear machine
# with it. `hc.design(actuator)` does the same in one call.

# %%
import numpy as np

import hydroctl as hc
from hydroctl import plotting
from hydroctl.tuning import default_points

# %matplotlib inline

# %% [markdown]
# ## The machine
# `load_actuator` takes the name of a shipped machine or the path of your own data sheet, a TOML
# file in which every number carries its unit.

# %%
actuator = hc.load_actuator("reference")
actuator

# %% [markdown]
# ## Where it works, and how it behaves there
# At each valve opening x and position y: the equilibrium, then the linear model around it. Fields
# come as arrays over the grid; one member becomes an object of python-control.

# %%
x = np.array([-1.0, -0.5, -0.1, -0.02, 0.02, 0.1, 0.5, 1.0])
y = np.linspace(0.0, actuator.stroke, 11)
points = hc.find_operating_points(actuator, x[:, None], y)
family = hc.linearize(actuator, points)
print(
    f"{points.feasible.sum()} of {points.feasible.size} operating points, "
    f"largest residual {points.residual.max():.1e}"
)
family[5, 5].transfer_function()

# %%
plotting.bode(family)[0].figure

# %%
plotting.pole_zero_map(family)[0].figure

# %% [markdown]
# The real pole and the zero nearly cancel, so that second order is enough. Every point carries the
# error of that step.

# %%
reduced = hc.reduce_order(family)
model = hc.fit_surfaces(reduced)
print(model.table())
plotting.reduction_error_map(reduced).figure

# %% [markdown]
# ## Gains that hold on the machine as it is, and on one that differs
# The specification asks for Ms <= 1.6 and Mt <= 1.3 on five machines: the nominal one and the
# corners of bulk modulus +-30 % and mass +-50 % at a supply pressure 20 % too high. At each node
# the tuner finds the largest integral gain that holds on all of them.

# %%
specification = hc.Specification(
    sample_time=1e-3, delay_samples=1, Ms=1.6, Mt=1.3, uncertainty="corners"
)
schedule = hc.tune(
    actuator,
    *default_points(actuator),
    loop="velocity",
    structure="pi",
    specification=specification,
)
plotting.gain_surfaces(schedule)[0].figure

# %%
plotting.margin_map(schedule.margins, "Ms", limit=specification.Ms).figure

# %% [markdown]
# The worst point is found between the nodes as well as at them. There, the loop as a control
# engineer looks at it:

# %%
worst = schedule.margins.worst("Ms")
print(worst)
plotting.nyquist(schedule, worst.x, worst.y).figure

# %%
plotting.root_locus(schedule, worst.x, worst.y, variant=worst.variant).figure

# %% [markdown]
# ## On the nonlinear machine
# Steps at three positions both ways, steps far beyond the valve's range, and a reversal, under the
# sampled regulator with its delay, saturation and anti-windup.

# %%
report = hc.validate(actuator, schedule)
print(report.summary())
run = report.runs[0]
plotting.traces(run.trajectory, run.scenario)[0].figure

# %% [markdown]
# ## The answer
# The schedule goes to the controller as a file. Its integral gain, the median over twelve operating
# points, is the price of robustness: an independent study found 306 1/m for these limits and
# machines, and 477 1/m at x = 0.1, y = 0.25 m for a regulator that trusts the nominal machine
# alone.

# %%
schedule.save("schedule.json")
nominal = hc.tune(actuator, [0.1], [0.25], specification=hc.Specification(uncertainty="nominal"))
median = np.median(
    schedule.gains(np.array([-1.0, -0.1, 0.1, 1.0])[:, None], np.array([0.0, 0.25, 0.5])).ki
)
print(
    f"ki: {median:.0f} 1/m robust, {nominal.ki[0, 0]:.0f} 1/m nominal; "
    f"every requirement met: {report.passed}"
)
assert abs(median / 306.0 - 1.0) <= 0.03
