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
# # Can the paper be reproduced, and how good is its model?
#
# *Linearization and simplification of mathematical model of hydraulic system with variable volume*
# turns the equations of a valve-controlled cylinder into a second-order model whose coefficients
# are surfaces over the valve opening x and the position y. This notebook recomputes its tables to
# the printed digits, shows what went wrong in them, and what its recipe costs.

# %%
import numpy as np
from matplotlib.figure import Figure

import hydroctl as hc
from hydroctl import paper

# %matplotlib inline

# %% [markdown]
# ## Table 1: zero and poles
# Secant form (the paper's equation 2), leakage zero. The paper states Kv = 5e-12, but its table
# belongs to Kv = 0.

# %%
matching = 0
print(f"{'x':>4} {'y':>4} {'zero':>10} {'real pole':>10} {'complex pair':>22}   digits as printed")
for (x, y, *computed), (_, _, *printed) in zip(
    paper.zero_pole_table(), paper.PRINTED_ZEROS_AND_POLES, strict=True
):
    rows = [
        [f"{part:.6g}" for part in (zero, pole, pair.real, pair.imag)]
        for zero, pole, pair in (computed, printed)
    ]
    same = [ours == theirs for ours, theirs in zip(*rows, strict=True)]
    matching += sum(same)
    print(
        "{:4.1f} {:4.1f} {:>10} {:>10} {:>10} +- {:>7}i   {} of 4".format(x, y, *rows[0], sum(same))
    )

# %% [markdown]
# ## The coefficients of equation (3)
# All 26 numbers follow from the recipe in `hydroctl.paper`: least squares over 11 x 11 points, and
# one constant for b. Two things are wrong in them. The half for x < 0 was computed at the operating
# point of x > 0, which is no equilibrium there; below it stand the numbers at the true one. And the
# one constant for b leaves the static gain off by up to 15 % (30 % for x < 0).

# %%
table = paper.coefficient_table()
pairs = [
    (table[side][name], paper.PRINTED_COEFFICIENTS[side][name])
    for side in "+-"
    for name in ("a1", "a2", "b")
]
deviations = np.concatenate([np.abs(np.divide(ours, theirs) - 1.0) for ours, theirs in pairs])
print(f"{deviations.size} numbers, at most {deviations.max():.1e} from the printed ones\n")
print(paper.quasi_linear_model(table).table())
print("\nat the true equilibrium:")
print(paper.quasi_linear_model({"-": paper.corrected_coefficient_table()["-"]}).table())

# %% [markdown]
# ## Secant and tangent
# The paper drops a zero and a pole that are 8 to 12 % apart. In the tangent form, which feedback
# design needs, they agree to 3e-4 (8e-4 with the leakage that the paper states): this is why a
# second-order model works for design.

# %%
reference = hc.load_actuator("reference")
for machine in (paper.actuator(), reference):
    points = hc.find_operating_points(machine, np.array([[0.1], [1.0]]), np.array([0.1, 0.4]))
    for form in ("secant", "tangent"):
        gap = np.abs(hc.reduce_order(hc.linearize(machine, points, form=form)).pole_zero_gap)
        print(f"Kv = {machine.leakage:5g}, {form:7} form: gap {gap.min():.1e} ... {gap.max():.1e}")

# %% [markdown]
# ## Figures 2 and 3: a staircase of rising amplitude
# The nonlinear plant against the printed model, the same recipe at the true equilibrium, and
# surfaces in the volume basis {1, x} x {1, 1/V_a(y), 1/V_b(y)} whose static gain is matched at
# every point. The second staircase changes its sign at every step.

# %%
x_grid = np.concatenate([-np.geomspace(1.0, 0.02, 11), np.geomspace(0.02, 1.0, 11)])[:, None]
family = hc.linearize(
    reference, hc.find_operating_points(reference, x_grid, np.linspace(0.0, 0.5, 11))
)
models = {
    "the paper's table": paper.quasi_linear_model(paper.PRINTED_COEFFICIENTS),
    "its recipe at the true equilibrium": paper.quasi_linear_model(
        paper.corrected_coefficient_table()
    ),
    "matched, volume basis": hc.fit_surfaces(hc.reduce_order(family)),
}
limit = hc.find_operating_points(paper.actuator(), paper.LIMIT, 0.0)
steps = 0.1 * np.arange(1, 11)
staircases = {"rising": (steps, 0.0), "alternating": (steps * (-1.0) ** np.arange(10), 0.25)}
t, speeds, errors = np.arange(5001) * 1e-3, {}, {}
for name, (levels, y0) in staircases.items():
    x = np.append(np.repeat(levels, 500), levels[-1])
    start = hc.State(float(limit.p_a), float(limit.p_b), 0.0, y0)
    exact = hc.simulate(reference, t, x, initial=start, rtol=1e-8).v
    speeds[name] = {label: model.simulate(t, x, y0).v for label, model in models.items()} | {
        "x": x,
        "nonlinear plant": exact,
    }
    spread = np.linalg.norm(exact - exact.mean())
    errors[name] = {
        label: 100.0 * np.linalg.norm(speeds[name][label] - exact) / spread for label in models
    }

print(f"{'NRMSE of v in per cent':36} {'rising':>8} {'alternating':>12}")
for label in models:
    print(f"{label:36} {errors['rising'][label]:8.2f} {errors['alternating'][label]:12.2f}")

# %%
figure = Figure(figsize=(8, 6), layout="constrained")
above, below = figure.subplots(2, 1, sharex=True, height_ratios=(1, 2))
above.step(t, speeds["rising"]["x"], where="post", color="black")
above.set_ylabel("valve opening x (of full)")
for label, style in (
    ("nonlinear plant", "k-"),
    ("the paper's table", "C1--"),
    ("matched, volume basis", "C0:"),
):
    below.plot(t, speeds["rising"][label], style, label=label, linewidth=1.5)
below.set(xlabel="time (s)", ylabel="speed v (m/s)")
below.legend()
figure

# %% [markdown]
# ## The answer
# All 16 numbers of Table 1 come out to every printed digit, and the 26 coefficients to 2e-5. The
# model that they make misses the speed of the rising staircase by 16 % of its spread, nearly all of
# it through the one constant for b; with the static gain matched at every point less than 0.1 % is
# left.

# %%
assert matching == 16
