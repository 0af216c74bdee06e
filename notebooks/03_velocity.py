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
# # Which structure buys back the speed that robustness costs?
#
# A regulator can trust the data sheet, or hold on every machine that the data sheet may stand for.
# This notebook tunes four structures of the velocity loop both ways, counts how many of 324 varied
# loops each of them loses, and looks at the worst one.

# %%
import itertools
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure

import hydroctl as hc
from hydroctl import plotting
from hydroctl.schedule import check_margins

# %matplotlib inline

actuator = hc.load_actuator("reference")
x, y = np.array([-1.0, -0.1, 0.1, 1.0]), np.array([0.0, 0.25, 0.5])
structures = ("pi", "pi+notch", "pid", "pid+notch")

# %% [markdown]
# ## Two specifications
# Both ask for Ms <= 1.6 and Mt <= 1.3 at a sample time of 1 ms and one sample of delay, with as
# much integral gain as these limits allow. "nominal" asks it of one machine, "corners" of five: the
# nominal one, and bulk modulus +-30 % with mass +-50 % at a supply pressure 20 % too high. The
# notch is that of the study whose figure stands at the end.

# %%
dampings = {"nominal": (0.2, 0.8), "corners": (0.3, 0.8)}
specifications = {
    kind: hc.Specification(uncertainty=kind, notch_damping=damping)
    for kind, damping in dampings.items()
}
schedules = {
    (structure, kind): hc.tune(actuator, x, y, structure=structure, specification=specification)
    for structure in structures
    for kind, specification in specifications.items()
}

# %% [markdown]
# ## 27 machines at 12 points
# Every combination of low, nominal and high bulk modulus, mass and supply pressure. A loop is lost
# where a pole of the sampled closed loop is not inside the unit circle.

# %%
factors = {
    "bulk_modulus": (0.7, 1.0, 1.3),
    "mass": (0.5, 1.0, 1.5),
    "supply_pressure": (0.8, 1.0, 1.2),
}
machines = [
    actuator.replace(
        **{
            name: getattr(actuator, name) * factor
            for name, factor in zip(factors, chosen, strict=True)
        }
    )
    for chosen in itertools.product(*factors.values())
]


def over_the_box(schedule):
    """(largest Ms of a stable loop, number of unstable loops) over all machines and points."""
    alone = replace(schedule, specification=specifications["nominal"])
    found = [check_margins(replace(alone, actuator=machine), x, y).margins for machine in machines]
    Ms, stable = (
        np.stack([getattr(margins, name) for margins in found]) for name in ("Ms", "stable")
    )
    return Ms[stable].max(), np.count_nonzero(~stable)


results = {
    key: (np.median(schedule.ki), *over_the_box(schedule)) for key, schedule in schedules.items()
}
print(
    f"{'structure':10} {'tuned for':9} {'ki (1/m)':>9} {'largest Ms':>11} {'unstable of 324':>16}"
)
for (structure, kind), (ki, Ms, unstable) in results.items():
    print(f"{structure:10} {kind:9} {ki:9.0f} {Ms:11.2f} {unstable:16d}")

# %%
figure = Figure(figsize=(7, 3.6), layout="constrained")
ax = figure.subplots()
for shift, kind in ((-0.2, "nominal"), (0.2, "corners")):
    heights = [results[structure, kind][0] for structure in structures]
    ax.bar(
        np.arange(4) + shift,
        heights,
        0.38,
        label=f"tuned for {kind}",
        color="C0" if kind == "corners" else "0.7",
    )
ax.set(
    xlabel="structure",
    ylabel="integral gain ki (1/m), median",
    xticks=np.arange(4),
    xticklabels=structures,
)
ax.legend()
figure

# %% [markdown]
# ## The price and its return
# A regulator that trusts the data sheet loses whole loops as soon as it has a notch or a
# derivative. Held on all machines, both together give back what robustness took: the loop stays
# clear of the forbidden circles on every variant.

# %%
plotting.nyquist(schedules["pid+notch", "corners"], 0.1, 0.25).figure

# %%
plotting.nyquist(schedules["pid", "nominal"], 0.1, 0.25).figure

# %% [markdown]
# ## The answer
# PI with a notch and a derivative, held on the corners: ki = 776 1/m by an independent study, two
# and a half times the robust PI, and no loop lost.

# %%
ki, Ms, unstable = results["pid+notch", "corners"]
print(f"pid+notch on the corners: ki {ki:.0f} 1/m, largest Ms {Ms:.3f}, {unstable} unstable loops")
assert abs(ki / 776.0 - 1.0) <= 0.03
