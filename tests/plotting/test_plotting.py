"""Figures show the numbers of their results, in the units on their axes, and leave matplotlib as it
was."""

import sys
from dataclasses import replace
from xml.etree import ElementTree

import control
import matplotlib
import numpy as np
import pytest
from machines import REFERENCE
from matplotlib.collections import LineCollection, QuadMesh
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from hydroctl import (
    InputError,
    Scenario,
    Specification,
    State,
    Trajectory,
    find_operating_points,
    linearize,
    plotting,
    reduce_order,
    tune,
)
from hydroctl.loop.margins import Loop, analyse

X, Y = np.array([-0.8, -0.1, 0.1, 0.8]), np.array([0.05, 0.2, 0.35, 0.5])
FAMILY = linearize(REFERENCE, find_operating_points(REFERENCE, X[:, None], Y))
REDUCED = reduce_order(FAMILY)


@pytest.fixture(scope="module")
def schedule():
    ranges = {"mass": (0.7, 1.4)}
    specification = Specification(uncertainty=ranges, Ms=1.7)
    return tune(
        REFERENCE, [-0.5, 0.5], [0.1, 0.4], structure="pi+notch", specification=specification
    )


@pytest.fixture(scope="module")
def run():
    """A scenario and a made-up motion in it, each signal with its own numbers."""
    t = 1e-3 * np.arange(50)
    scenario = Scenario(
        name="Step at 0.2 m",
        kind="step",
        loop="velocity",
        Ts=1e-3,
        reference=np.where(t < 0.01, 0.0, 0.05),
        y=0.2,
    )
    signals = {
        "x": np.sin(90 * t),
        "spool": np.sin(80 * t),
        "y": 0.2 + t**2,
        "v": 0.05 * np.cos(70 * t),
    }
    final = State(1.5e7, 1.5e7, 0.0, 0.2)
    trajectory = Trajectory(
        t=t, **signals, p_a=1e7 + 1e8 * t, p_b=2e7 - 1e8 * t, integrator="made up", final=final
    )
    return scenario, trajectory


@pytest.fixture
def figures(schedule, run):
    return plotting.design_figures(FAMILY, schedule, [run])


def lines_of(ax) -> LineCollection:
    return next(each for each in ax.collections if isinstance(each, LineCollection))


def labels(ax) -> tuple[str, str]:
    return ax.get_xlabel(), ax.get_ylabel()


def legend(ax) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def test_bode_shows_the_response_that_python_control_gives():
    magnitude, phase = plotting.bode(FAMILY)
    for k, (i, j) in enumerate(np.ndindex(FAMILY.shape)):
        hertz, decibels = lines_of(magnitude).get_segments()[k].T
        exact = FAMILY[i, j].transfer_function()(2j * np.pi * hertz)
        np.testing.assert_allclose(decibels, 20 * np.log10(np.abs(exact)), atol=1e-8)
        np.testing.assert_allclose(
            lines_of(phase).get_segments()[k][:, 1],
            np.degrees(np.unwrap(np.angle(exact))),
            atol=1e-7,
        )
    np.testing.assert_array_equal(
        lines_of(magnitude).get_array(), np.broadcast_to(Y, FAMILY.shape).ravel()
    )
    assert (magnitude.get_ylabel(), *labels(phase)) == (
        "|v/x| (dB re 1 m/s)",
        "frequency (Hz)",
        "phase of v/x (degrees)",
    )
    assert magnitude.get_xscale() == phase.get_xscale() == "log"


def test_bode_names_the_least_damped_member():
    magnitude, _ = plotting.bode(FAMILY)
    damping = np.array(
        [
            [
                control.damp(FAMILY[i, j].transfer_function(), doprint=False)[1].min()
                for j in range(4)
            ]
            for i in range(4)
        ]
    )
    i, j = np.unravel_index(np.argmin(damping), damping.shape)
    assert f"x = {X[i]:.3g}, y = {Y[j]:.3g} m" in legend(magnitude)[0]
    assert f"{damping[i, j]:.3f}" in legend(magnitude)[0]
    hertz, decibels = magnitude.lines[0].get_data()
    exact = FAMILY[i, j].transfer_function()(2j * np.pi * hertz)
    np.testing.assert_allclose(decibels, 20 * np.log10(np.abs(exact)), atol=1e-8)


def test_bode_of_second_order_models_at_chosen_frequencies():
    omega = np.array([1.0, 100.0, 1000.0])
    magnitude, _ = plotting.bode(REDUCED, omega=omega)
    shown = np.array(lines_of(magnitude).get_segments())
    s = 1j * omega
    exact = REDUCED.b.ravel()[:, None] / (
        s**2 + REDUCED.a1.ravel()[:, None] * s + REDUCED.a2.ravel()[:, None]
    )
    np.testing.assert_allclose(shown[..., 0], np.broadcast_to(omega / (2 * np.pi), exact.shape))
    np.testing.assert_allclose(shown[..., 1], 20 * np.log10(np.abs(exact)), atol=1e-9)


def test_pole_zero_map_shows_the_eigenvalues():
    plane, cancelling = plotting.pole_zero_map(FAMILY)
    shown = np.sort_complex(np.asarray(plane.collections[0].get_offsets()) @ [1, 1j])
    eigenvalues = np.linalg.eigvals(
        FAMILY.A * np.array([1e6, 1e6, 1.0]) / np.array([1e6, 1e6, 1.0])[:, None]
    )
    np.testing.assert_allclose(shown, np.sort_complex(eigenvalues.ravel()), rtol=1e-9)
    zeros = np.asarray(cancelling.collections[1].get_offsets())
    np.testing.assert_allclose(zeros[:, 0], FAMILY.zeros().ravel())
    np.testing.assert_array_equal(zeros[:, 1], np.repeat(X, 4))
    assert labels(plane) == ("real part (rad/s)", "imaginary part (rad/s)")
    assert labels(cancelling) == ("real part (rad/s)", "valve opening x (of full)")


@pytest.mark.parametrize("family", [FAMILY, REDUCED], ids=["third order", "second order"])
def test_resonance_over_the_stroke_follows_the_two_oil_springs(family):
    frequency, damping = plotting.resonance_over_stroke(family)
    springs = REFERENCE.area_a**2 / (REFERENCE.volume_a + REFERENCE.area_a * Y)
    springs += REFERENCE.area_b**2 / (REFERENCE.volume_b - REFERENCE.area_b * Y)
    expected = np.sqrt(REFERENCE.bulk_modulus * springs / REFERENCE.mass) / (2 * np.pi)
    assert len(frequency.collections) == len(X)
    for each, opening in zip(frequency.collections, X, strict=True):
        y, hertz = each.get_segments()[0].T
        np.testing.assert_array_equal(y, Y)
        np.testing.assert_allclose(hertz, expected, rtol=5e-3)
        assert each.get_array() == [opening]
    shown = np.array([each.get_segments()[0][:, 1] for each in damping.collections])
    np.testing.assert_allclose(shown, REDUCED.damping, rtol=1e-9)
    assert (frequency.get_ylabel(), *labels(damping)) == (
        "natural frequency (Hz)",
        "position y (m)",
        "damping ratio (1)",
    )


def test_reduction_error_map_crosses_out_what_is_not_accepted():
    reduced = reduce_order(FAMILY, tolerance=float(np.median(REDUCED.error)))
    ax = plotting.reduction_error_map(reduced)
    mesh = next(each for each in ax.collections if isinstance(each, QuadMesh))
    np.testing.assert_allclose(mesh.get_array().reshape(4, 4), 100 * reduced.error)
    columns, rows = ax.lines[0].get_data()
    crossed = np.zeros((4, 4), bool)
    crossed[np.asarray(rows, int), np.asarray(columns, int)] = True
    np.testing.assert_array_equal(crossed, ~reduced.accepted)
    (j,), (i,) = ax.lines[1].get_data()
    assert reduced.error[int(i), int(j)] == reduced.error.max()
    assert f"x = {X[int(i)]:.3g}, y = {Y[int(j)]:.3g} m" in legend(ax)[0]
    assert "%" in mesh.colorbar.ax.get_ylabel()
    assert labels(ax) == ("position y (m)", "valve opening x (of full)")
    assert [text.get_text() for text in ax.get_yticklabels()] == ["-0.8", "-0.1", "0.1", "0.8"]


def test_points_without_a_model_are_counted_and_explained():
    points = find_operating_points(REFERENCE, np.array([0.0, 0.1, 0.8])[:, None], Y)
    family = linearize(REFERENCE, points)
    for draw in (plotting.bode, plotting.pole_zero_map, plotting.resonance_over_stroke):
        axes = draw(family)
        text = " ".join(note.get_text() for ax in axes for note in ax.texts).replace("\n", " ")
        assert "4 of 12 points are not drawn" in text
        assert "the valve is closed" in text
    ax = plotting.reduction_error_map(reduce_order(family))
    assert "4 without an operating point" in ax.get_title()
    assert ax.collections[0].get_array().mask.reshape(3, 4)[0].all()


def test_nothing_to_draw_is_an_error_with_its_reason():
    family = linearize(REFERENCE, find_operating_points(REFERENCE, np.zeros((1, 1)), Y))
    for draw in (plotting.bode, plotting.pole_zero_map, plotting.resonance_over_stroke):
        with pytest.raises(InputError, match=r"4 of 4 points .* valve is closed"):
            draw(family)


def test_a_map_needs_a_grid():
    reduced = reduce_order(linearize(REFERENCE, find_operating_points(REFERENCE, X, Y)))
    with pytest.raises(InputError, match=r"over a grid, not of shape \(4,\)"):
        plotting.reduction_error_map(reduced)


def open_loop(schedule, x, y) -> control.StateSpace:
    """The nominal sampled loop at a node, through python-control."""
    plants = schedule.sampled_plants([x], [y])
    A, B, C = plants.state_space()
    return control.ss(A[0, 0, 0], B[0, 0, 0], C, 0.0, schedule.Ts) * control.ss(
        schedule.gains(x, y).transfer_function()
    )


def test_root_locus_starts_at_the_open_loop_and_marks_the_present_gain(schedule):
    ax = plotting.root_locus(schedule, 0.5, 0.4)
    loop = open_loop(schedule, 0.5, 0.4)
    marks = {
        line.get_label(): np.sort_complex(line.get_xdata() + 1j * line.get_ydata())
        for line in ax.lines
    }
    np.testing.assert_allclose(marks["open-loop poles"], np.sort_complex(loop.poles()), atol=1e-6)
    closed = control.feedback(loop).poles()
    np.testing.assert_allclose(
        marks["poles with the present gain"], np.sort_complex(closed), atol=1e-6
    )
    residual = np.abs(loop(marks["open-loop zeros"]))
    assert residual.max() < 1e-6 * np.abs(loop(0.5))
    assert labels(ax) == ("real part of z (1)", "imaginary part of z (1)")
    assert any(isinstance(patch, Circle) and patch.radius == 1.0 for patch in ax.patches)


def test_every_point_of_the_root_locus_is_a_closed_loop_pole(schedule):
    lines = lines_of(plotting.root_locus(schedule, 0.5, 0.4))
    factor = 10.0 ** np.asarray(lines.get_array())
    z = np.array(lines.get_segments())[:, 1] @ [1, 1j]
    away = np.abs(z - 1.0) > 0.05
    response = open_loop(schedule, 0.5, 0.4)(z[away])
    np.testing.assert_allclose(factor[away] * response, -1.0, rtol=1e-6)


def test_root_locus_leaves_the_unit_circle_at_the_gain_margin(schedule):
    lines = lines_of(plotting.root_locus(schedule, 0.5, 0.4))
    factor, radius = (
        10.0 ** np.asarray(lines.get_array()),
        np.abs(np.array(lines.get_segments())[:, 1] @ [1, 1j]),
    )
    plants = schedule.sampled_plants([0.5], [0.4])
    margin = analyse(Loop(plants, schedule.gains(0.5, 0.4).broadcast_to(plants.shape))).gain_margin[
        0, 0, 0
    ]
    assert (
        radius[factor < margin].max()
        < 1.0
        < radius[(factor >= margin) & (factor < 1.2 * margin)].max()
    )


def test_root_locus_knows_the_plants_of_the_specification(schedule):
    ax = plotting.root_locus(schedule, 0.5, 0.4, variant="mass +40 %")
    assert ax.texts[-1].get_text() == "plant: mass +40 %"
    with pytest.raises(InputError, match="did you mean 'mass \\+40 %'"):
        plotting.root_locus(schedule, 0.5, 0.4, variant="mass +4 %")


def test_nyquist_curves_stay_out_of_the_circles_that_the_limits_forbid(schedule):
    ax = plotting.nyquist(schedule, 0.5, 0.4)
    Ms_circle, Mt_circle = ax.patches
    for circle, sensitive in (
        (Ms_circle, lambda L: 1 / (1 + L)),
        (Mt_circle, lambda L: L / (1 + L)),
    ):
        border = circle.center[0] + circle.radius * np.exp(1j * np.linspace(0.1, 6.0, 7))
        limit = schedule.specification.Ms if circle is Ms_circle else schedule.specification.Mt
        np.testing.assert_allclose(np.abs(sensitive(border)), limit)
        for line in ax.lines[:3]:
            distance = np.abs(line.get_xdata() + 1j * line.get_ydata() - circle.center[0])
            assert distance.min() > circle.radius * (1 - 1e-3)
    assert legend(ax) == ["Ms > 1.7", "Mt > 1.3", "its variants", "nominal plant"]
    assert labels(ax) == ("real part of L (1)", "imaginary part of L (1)")


def test_nyquist_and_nichols_show_the_same_response(schedule):
    gain_plane, chart = plotting.nyquist(schedule, 0.5, 0.4), plotting.nichols(schedule, 0.5, 0.4)
    for flat, curved in zip(chart.lines[:3], gain_plane.lines[:3], strict=True):
        degrees, decibels = flat.get_data()
        L = 10 ** (decibels / 20) * np.exp(1j * np.radians(degrees))
        np.testing.assert_allclose(L, curved.get_xdata() + 1j * curved.get_ydata(), rtol=1e-9)
        assert -180.0 < degrees[0] < 0.0
    assert labels(chart) == ("phase of L (degrees)", "|L| (dB)")


def test_gain_surfaces_show_the_tables(schedule):
    axes = plotting.gain_surfaces(schedule)
    tables = (schedule.kp, schedule.ki, schedule.notch_frequency / (2 * np.pi))
    for ax, table in zip(axes, tables, strict=True):
        segments = np.array(lines_of(ax).get_segments())
        np.testing.assert_array_equal(segments[..., 1], table)
        np.testing.assert_array_equal(segments[..., 0], np.broadcast_to(schedule.y, table.shape))
        assert ax.get_ylim()[0] <= table.min()
        assert table.max() <= ax.get_ylim()[1]
    assert [ax.get_ylabel() for ax in axes] == ["kp (s/m)", "ki (1/m)", "notch frequency (Hz)"]
    assert axes[-1].get_xlabel() == "position y (m)"


@pytest.mark.parametrize(
    ("name", "unit", "convert", "worst"),
    [
        ("Ms", "Ms = max |S|", lambda value: value, np.max),
        ("gain_margin", "dB", lambda value: 20 * np.log10(value), np.min),
        ("phase_margin", "degrees", np.degrees, np.min),
        ("delay_margin", "ms", lambda value: 1e3 * value, np.min),
        ("crossover", "Hz", lambda value: value / (2 * np.pi), np.min),
    ],
)
def test_margin_map_shows_the_worst_plant_and_names_the_worst_point(
    schedule, name, unit, convert, worst
):
    margins = schedule.margins
    ax = plotting.margin_map(margins, name)
    mesh = next(each for each in ax.collections if isinstance(each, QuadMesh))
    values = convert(worst(getattr(margins.margins, name), axis=0))
    np.testing.assert_allclose(mesh.get_array(), values)
    assert unit in mesh.colorbar.ax.get_ylabel()
    (j,), (i,) = ax.lines[0].get_data()
    assert values[i, j] == worst(values)
    assert (
        f"x = {margins.x[i]:.3g}, y = {margins.y[j]:.3g} m\n{margins.worst(name).variant}"
        in legend(ax)[0]
    )


def test_margin_map_names_a_misspelt_margin(schedule):
    with pytest.raises(InputError, match="did you mean 'gain_margin'"):
        plotting.margin_map(schedule.margins, "gain_margins")


def test_traces_show_the_motion_with_the_reference_of_the_controlled_quantity(run):
    scenario, trajectory = run
    axes = plotting.traces(trajectory, scenario)
    shown = [trajectory.y, trajectory.v, trajectory.x, trajectory.p_a / 1e5]
    for ax, values in zip(axes, shown, strict=True):
        np.testing.assert_array_equal(ax.lines[0].get_data(), (trajectory.t, values))
    np.testing.assert_array_equal(axes[3].lines[1].get_ydata(), trajectory.p_b / 1e5)
    np.testing.assert_array_equal(axes[1].lines[1].get_ydata(), scenario.reference)
    np.testing.assert_array_equal(axes[2].lines[1].get_ydata(), trajectory.spool)
    assert [len(ax.lines) for ax in axes] == [1, 2, 2, 2]
    units = [ax.get_ylabel() for ax in axes]
    assert units == [
        "position y (m)",
        "speed v (m/s)",
        "valve opening x\n(of full)",
        "pressure (bar)",
    ]
    assert axes[-1].get_xlabel() == "time (s)"
    assert axes[0].get_title() == scenario.name
    ideal = replace(trajectory, spool=trajectory.x)
    assert [len(ax.lines) for ax in plotting.traces(ideal)] == [1, 1, 1, 2]


def test_overlay_shows_motions_of_both_loops_with_their_references(run):
    scenario, trajectory = run
    position = Scenario(name="stay", loop="position", Ts=1e-3, reference=np.full(50, 0.2), y=0.2)
    axes = plotting.overlay([run, (position, replace(trajectory, y=trajectory.y + 0.1))])
    shown = [
        trajectory.y + 0.1,
        trajectory.v,
        trajectory.x,
        trajectory.p_a / 1e5,
        trajectory.p_b / 1e5,
    ]
    for ax, values in zip(axes, shown, strict=True):
        np.testing.assert_array_equal(ax.lines[-1].get_ydata(), values)
    dotted = [
        [line.get_ydata() for line in ax.lines if line.get_label() == "reference"] for ax in axes
    ]
    np.testing.assert_array_equal(dotted[0], [position.reference])
    np.testing.assert_array_equal(dotted[1], [scenario.reference])
    assert legend(axes[-1]) == [scenario.name, "stay"]
    units = [ax.get_ylabel() for ax in axes]
    assert units == [
        "position y (m)",
        "speed v (m/s)",
        "valve opening x\n(of full)",
        "pressure a (bar)",
        "pressure b (bar)",
    ]


def test_comparison_shows_every_motion_and_its_error(run):
    scenario, trajectory = run
    axes = plotting.comparison({"scheduled": trajectory, "fixed": trajectory}, scenario)
    assert legend(axes[0]) == ["reference", "scheduled", "fixed"]
    for line in axes[1].lines:
        np.testing.assert_array_equal(line.get_ydata(), scenario.reference - trajectory.v)
    assert [ax.get_ylabel() for ax in axes] == [
        "speed v (m/s)",
        "control error (m/s)",
        "valve opening x\n(of full)",
    ]
    styles = {line.get_linestyle() for line in axes[1].lines}
    assert len(styles) == 2


def test_distributions_count_cases_without_a_value_among_all():
    generator = np.random.default_rng(7)
    settled = generator.uniform(0.1, 0.3, 100)
    settled[:20] = np.nan
    metrics = {"settling_time": settled, "peak_pressure": generator.uniform(1e7, 2e7, 100)}
    time, pressure = plotting.distributions(
        {"scheduled": metrics, "fixed": metrics}, ("settling_time", "peak_pressure")
    )
    value, share = time.lines[0].get_data()
    for x, y in zip(value, share, strict=True):
        assert y == np.mean(settled <= x)
    assert share[-1] == 0.8
    np.testing.assert_allclose(
        pressure.lines[1].get_xdata(), np.sort(metrics["peak_pressure"]) / 1e5
    )
    assert legend(time) == ["scheduled: 80 of 100 cases", "fixed: 80 of 100 cases"]
    assert labels(time) == ("settling time (s)", "share of all cases (1)")
    assert pressure.get_xlabel() == "peak pressure (bar)"


def test_distributions_name_a_misspelt_metric_and_leave_no_empty_axes():
    with pytest.raises(InputError, match="did you mean 'overshoot'"):
        plotting.distributions({}, ("overshot",))
    metrics = {name: np.linspace(0.0, 1.0, 5) for name in ("rise_time", "overshoot", "oscillation")}
    axes = plotting.distributions({"one": metrics}, tuple(metrics))
    assert axes[0].figure.axes == list(axes)


def test_every_figure_has_a_title_and_a_unit_on_every_axis(figures, schedule):
    assert set(figures) == {
        "bode",
        "pole-zero-map",
        "gains",
        "margin-Ms",
        "root-locus",
        "validation-step",
    }
    others = {
        "nyquist": lambda: plotting.nyquist(schedule, 0.5, 0.1).figure,
        "nichols": lambda: plotting.nichols(schedule, 0.5, 0.1).figure,
        "resonance": lambda: plotting.resonance_over_stroke(REDUCED)[0].figure,
        "reduction-error": lambda: plotting.reduction_error_map(REDUCED).figure,
    }
    for name, draw in (figures | others).items():
        figure = draw()
        panels = [ax for ax in figure.axes if ax.get_label() != "<colorbar>"]
        assert panels[0].get_title(), name
        for ax in panels:
            shown = [ax.yaxis] + ([ax.xaxis] if ax.get_subplotspec().is_last_row() else [])
            for axis in shown:
                assert axis.label.get_text().split("\n")[-1].rstrip().endswith((")", "|S|")), (
                    name,
                    axis.label.get_text(),
                )


def test_drawing_changes_no_setting_and_registers_no_figure(figures):
    before = dict(matplotlib.rcParams)
    drawn = [draw() for draw in figures.values()]
    assert dict(matplotlib.rcParams) == before
    assert all(type(figure) is Figure for figure in drawn)
    if "matplotlib.pyplot" in sys.modules:
        assert sys.modules["matplotlib.pyplot"].get_fignums() == []


@pytest.mark.parametrize(
    ("count", "draw"),
    [
        (2, lambda schedule, run, ax: plotting.bode(FAMILY, ax)),
        (2, lambda schedule, run, ax: plotting.pole_zero_map(FAMILY, ax)),
        (2, lambda schedule, run, ax: plotting.resonance_over_stroke(FAMILY, ax)),
        (1, lambda schedule, run, ax: plotting.reduction_error_map(REDUCED, ax)),
        (1, lambda schedule, run, ax: plotting.root_locus(schedule, 0.5, 0.1, ax)),
        (1, lambda schedule, run, ax: plotting.nyquist(schedule, 0.5, 0.1, ax)),
        (1, lambda schedule, run, ax: plotting.nichols(schedule, 0.5, 0.1, ax)),
        (3, lambda schedule, run, ax: plotting.gain_surfaces(schedule, ax)),
        (1, lambda schedule, run, ax: plotting.margin_map(schedule.margins, "Mt", ax)),
        (4, lambda schedule, run, ax: plotting.traces(run[1], run[0], ax)),
        (5, lambda schedule, run, ax: plotting.overlay([run], ax)),
        (3, lambda schedule, run, ax: plotting.comparison({"one": run[1]}, run[0], ax)),
    ],
)
def test_every_plot_draws_into_the_axes_given_and_returns_them(schedule, run, count, draw):
    axes = Figure().subplots(count, squeeze=False)[:, 0]
    if count == 1:
        assert draw(schedule, run, axes[0]) is axes[0]
    else:
        assert list(draw(schedule, run, axes)) == list(axes)
        with pytest.raises(InputError, match=f"needs {count} axes, 1 were given"):
            draw(schedule, run, axes[0])
    assert all(ax.has_data() for ax in axes)


def test_files_hold_the_figure_and_are_the_same_bytes_every_time(figures, tmp_path):
    name = "root-locus"
    first = plotting.save_figure(figures[name](), tmp_path, name)
    content = [path.read_bytes() for path in first]
    assert [path.name for path in first] == ["root-locus.png", "root-locus.svg"]
    assert content[0].startswith(b"\x89PNG")
    root = ElementTree.fromstring(content[1])
    text = " ".join(part for element in root.iter() for part in [element.text or ""])
    assert root.tag.endswith("svg")
    assert "real part of z (1)" in text
    assert b"dc:date" not in content[1]
    assert [
        path.read_bytes() for path in plotting.save_figure(figures[name](), tmp_path, name)
    ] == content


def test_saving_a_set_draws_and_writes_each_under_its_name(figures, tmp_path):
    written = plotting.save_figures(
        {name: figures[name] for name in ("gains", "root-locus")}, tmp_path
    )
    assert written == [
        tmp_path / name for name in ("gains.png", "gains.svg", "root-locus.png", "root-locus.svg")
    ]
    assert sorted(tmp_path.iterdir()) == sorted(written)


def test_one_format_can_be_asked_for_and_a_misspelt_one_is_named(figures, tmp_path):
    assert plotting.save_figure(figures["gains"](), tmp_path, "gains", formats=("svg",)) == [
        tmp_path / "gains.svg"
    ]
    with pytest.raises(InputError, match="format 'swg' is unknown; did you mean 'svg'"):
        plotting.save_figure(figures["gains"](), tmp_path, "gains", formats=("swg",))


def test_a_place_that_cannot_be_written_is_named(figures, tmp_path):
    with pytest.raises(InputError, match="missing"):
        plotting.save_figure(figures["gains"](), tmp_path / "missing", "gains")
    assert list(tmp_path.iterdir()) == []
