"""The report page in a browser: it stays in its file, shows the report's numbers, and computes what
Python computes."""

import base64
import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files

import numpy as np
import pytest
from machines import REFERENCE

import hydroctl as hc
from hydroctl.loop.margins import MARGIN_UNITS, Loop, analyse
from hydroctl.machine.variants import variants
from hydroctl.model.characteristics import resonance
from hydroctl.proof.margin_verdicts import margin_verdicts
from hydroctl.regulator import law
from hydroctl.regulator.prepared import regulator_of
from hydroctl.report.explorer import laws_script, opening_grid
from hydroctl.report.page import page, write_report
from hydroctl.validation import against_rivals

CHROMIUM = shutil.which("chromium")
QUIET = ("gpu", "quic", "background-networking", "component-update", "sync")
ARGUMENTS = [
    "--headless",
    "--no-sandbox",
    "--no-first-run",
    *(f"--disable-{name}" for name in QUIET),
]
HOSTILE = 'Press <b>7</b> </script><script>alert("1")</script> */ <!-- & \u2028'
POSITIONS = 500
SMALL = {"specification": hc.Specification(uncertainty={"mass": (0.7, 1.4)})}
X, Y = [-0.5, -0.05, 0.05, 0.5], [0.1, 0.4]


@pytest.fixture(scope="module")
def plain():
    """A velocity schedule of a machine with a hostile name, its validation, a fixed regulator, and
    the comparison."""
    machine = REFERENCE.replace(name=HOSTILE, note=HOSTILE)
    schedule, fixed = (
        make(machine, X, Y, structure="pi", **SMALL) for make in (hc.tune, hc.tune_fixed)
    )
    return schedule, hc.validate(machine, schedule), fixed, against_rivals(schedule, fixed)


@pytest.fixture(scope="module")
def rich():
    """A position schedule that uses every part of the law, on a machine with valve lag, dead band
    and load, two samples late."""
    machine = REFERENCE.replace(
        valve_natural_frequency=900.0, valve_damping=0.8, dead_band=0.04, load_force=2e4
    )
    limits = {
        "delay_samples": 2.0,
        "measurement_filter": 5e-4,
        "set_point_weight": 0.6,
        "derivative_on": "measurement",
    }
    specification = hc.Specification(uncertainty="nominal", **limits)
    schedule = hc.tune(
        machine,
        X[-1:],
        Y,
        loop="position",
        structure="pid+lead-lag+notch",
        specification=specification,
    )
    scenario = hc.Scenario(name="stay", loop="position", Ts=1e-3, reference=np.full(50, 0.2), y=0.2)
    return schedule, hc.validate(machine, schedule, scenarios=[scenario])


@pytest.fixture(scope="module")
def browser():
    if CHROMIUM is None:
        pytest.skip("no chromium on this machine")
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield opened
        opened.close()


class Visit:
    """An open page, with what it said and asked for."""

    def __init__(self, browser, path, **settings):
        self.page = browser.new_page(**settings)
        self.said, self.asked = [], []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(path.as_uri())

    def values(self, selector):
        """What the <data> elements of a table body hold."""
        return self.page.eval_on_selector_all(
            f"{selector} data", "all => all.map(one => one.value)"
        )

    def numbers(self, selector):
        """The same by the name of the row; a complex value is a pair."""
        rows = self.page.eval_on_selector_all(
            f"{selector} tr",
            "all => all.map(row => [row.querySelector('th').textContent,"
            " row.querySelector('data').value])",
        )
        return {name: [float(part) for part in value.split(",")] for name, value in rows}

    def slide(self, name, value):
        self.page.locator(f"#{name}").fill(str(value))


@pytest.fixture(scope="module")
def visit(browser, plain, tmp_path_factory):
    return Visit(browser, write_plain(tmp_path_factory.mktemp("plain") / "report.html", plain))


def write_plain(path, plain):
    schedule, validation, fixed, comparison = plain
    return write_report(
        path,
        schedule,
        validation,
        beside={"fixed": fixed},
        comparison=comparison,
        remarks=[HOSTILE],
    )


@pytest.fixture(scope="module")
def rich_visit(browser, rich, tmp_path_factory):
    return Visit(browser, write_report(tmp_path_factory.mktemp("rich") / "report.html", *rich))


def loop_at(schedule, x, y, plant=0):
    """The loop of shape (1,) at one operating point on plant number `plant`."""
    plants = schedule.sampled_plants([x], [y])
    chosen = plants.take([plant])
    return Loop(chosen, schedule.gains(x, y).broadcast_to(chosen.shape))


def assert_same_poles(shown, computed, rtol=1e-6):
    """Every pole has its partner within 1e-6 of its modulus; poles at 0 within 1e-6 of the unit
    circle's hundredth."""
    shown, left = (
        [complex(*value) if len(value) == 2 else value[0] for value in shown],
        list(computed),
    )
    assert len(shown) == len(left)
    for pole in shown:
        nearest = min(left, key=lambda other, pole=pole: abs(other - pole))
        assert abs(nearest - pole) <= rtol * max(abs(nearest), 1e-2)
        left.remove(nearest)


@pytest.mark.parametrize("kind", ["plain", "rich"])
def test_both_sliders_move_poles_margins_and_gains_to_the_values_of_python(kind, request):
    schedule = request.getfixturevalue(kind)[0]
    visit = request.getfixturevalue("visit" if kind == "plain" else "rich_visit")
    openings, generator = opening_grid(schedule.actuator), np.random.default_rng(8)
    plants = list(
        variants(
            schedule.actuator,
            schedule.specification.uncertainty,
            schedule.specification.added_plants,
        ).values()
    )
    for k in range(20):
        i, j, plant = (
            int(generator.integers(n)) for n in (openings.size, POSITIONS + 1, len(plants))
        )
        x, y = openings[i], schedule.actuator.stroke * j / POSITIONS
        visit.slide(*(("opening", i), ("position", j))[k % 2])
        visit.slide(*(("position", j), ("opening", i))[k % 2])
        visit.page.locator("#plant").select_option(str(plant))
        loop = loop_at(schedule, x, y, plant)
        gains = {
            name.replace(" ", "_"): value for name, (value,) in visit.numbers("#gains").items()
        }
        assert gains == pytest.approx(
            {name: getattr(loop.regulators, name).item() for name in gains}, rel=1e-6
        )
        assert set(gains) >= {"kp", "ki"}
        margins, shown = analyse(loop), visit.numbers("#margins")
        for name in ("Ms", "Mt", "gain_margin", "phase_margin", "delay_margin", "crossover"):
            assert shown[name.replace("_", " ")] == pytest.approx(
                [getattr(margins, name).item()], rel=1e-6
            ), (name, x, y)
        assert_same_poles(visit.numbers("#poles").values(), loop.poles()[0])
        points = hc.find_operating_points(plants[plant], x, y)
        family = hc.linearize(plants[plant], points)
        natural, damping = resonance(family)
        machine = visit.numbers("#machine")
        assert_same_poles([machine[f"pole {n}"] for n in (1, 2, 3)], family.poles())
        expected = {
            "zero": family.zeros().item(),
            "natural frequency": natural.item(),
            "damping ratio": damping.item(),
        }
        expected |= {
            "speed v": points.v.item(),
            "pressure a": points.p_a.item(),
            "pressure b": points.p_b.item(),
        }
        assert {name: machine[name][0] for name in expected} == pytest.approx(expected, rel=1e-6)
    assert visit.said == []


@pytest.mark.parametrize("kind", ["plain", "rich"])
def test_response_and_step_of_the_page_are_those_of_the_linear_loop_under_the_law(kind, request):
    schedule = request.getfixturevalue(kind)[0]
    visit = request.getfixturevalue("visit" if kind == "plain" else "rich_visit")
    openings, i, j = opening_grid(schedule.actuator), 120, 180
    source = laws_script({"scheduled": schedule}) + "".join(
        files("hydroctl.report").joinpath("templates", name).read_text("utf-8")
        for name in ("linear_algebra.js", "loop.js")
    )
    ask = "const read = withRows(JSON.parse(document.getElementById('data').textContent).explorer);"
    ask += (
        f"return evaluate(read, read.plants[0], read.regulators[0], {i}, read.stroke * {j} /"
        f" {POSITIONS});"
    )
    found = visit.page.evaluate(f"() => {{ {source} {ask} }}")
    loop = loop_at(schedule, openings[i], schedule.actuator.stroke * j / POSITIONS)
    L = loop.frequency_response(np.array([found["omega"]]))[0]
    np.testing.assert_allclose(np.array(found["L"]) @ [1, 1j], L, rtol=1e-6)
    np.testing.assert_allclose(
        found["step"], law_step(schedule, loop, len(found["step"])), rtol=1e-6, atol=1e-9
    )
    assert max(found["step"]) > 0.9


def law_step(schedule, loop, count):
    """(count,) the measured quantity over a small step of the reference: the law itself on the
    sampled linear plant."""
    (A,), (B,), C = loop.plant.state_space()
    regulator, size = regulator_of(replace(schedule, feed_forward=False).regulator), 1e-6
    gains = tuple(
        float(getattr(loop.regulators, name)[0]) for name in ("kp", "ki", "kd", "notch_frequency")
    )
    state, memory, found = np.zeros(len(A)), law.AT_REST, np.empty(count)
    for k in range(count):
        m = float(C[0] @ state)
        found[k] = m / size
        memory = law.regulate(size, 0.0, (1e7, 1e7, m, m), gains, memory, regulator)
        state = A @ state + B[:, 0] * float(memory.x)
    return found


def test_nothing_leaves_the_file_and_nothing_is_complained_about(visit):
    visit.page.wait_for_load_state("networkidle")
    assert visit.said == []
    assert [url.split("/")[-1] for url in visit.asked] == ["report.html"]


def test_a_name_with_markup_is_shown_as_text(visit):
    assert visit.page.text_content("h1") == HOSTILE
    assert visit.page.title().startswith("Press <b>7</b>")
    assert visit.page.locator("script").count() == 2
    assert visit.page.locator("h1 b").count() == 0


def test_tables_hold_the_numbers_of_the_report(visit, plain):
    schedule, validation, *_ = plain
    verdicts = (*margin_verdicts(schedule), *validation.verdicts)
    shown = [float(value) for value in visit.values("#verdicts")]
    assert shown == [number for verdict in verdicts for number in (verdict.achieved, verdict.limit)]
    words = visit.page.eval_on_selector_all(
        "#verdicts .badge", "all => all.map(one => one.textContent)"
    )
    assert words == [
        "note" if verdict.is_remark else "pass" if verdict.passed else "fail"
        for verdict in verdicts
    ]
    outcome = visit.page.text_content("#outcome")
    assert outcome == (
        "Every requirement is met"
        if all(verdict.passed for verdict in verdicts)
        else "A requirement is not met"
    )
    worst = [schedule.margins.worst(name) for name in MARGIN_UNITS]
    assert [float(value) for value in visit.values("#worst")] == [
        number for point in worst for number in (point.value, point.x, point.y)
    ]
    standing = [
        number
        for found in plain[3].values()
        for number in (
            found.nominal.mean,
            found.nominal.best,
            found.nominal.worst,
            found.nominal.failed,
            found.worst.mean,
        )
    ]
    assert [float(value) for value in visit.values("#comparison")] == standing
    assert visit.page.locator("#comparison tbody th").all_text_contents() == [
        "scheduled",
        "P",
        "P + feed-forward",
    ]
    parameters = [value for value in schedule.actuator.parameters().values() if value is not None]
    assert [float(value) for value in visit.values("#provenance")] == parameters


def test_the_map_holds_the_worst_of_all_plants_and_a_click_moves_the_sliders(visit, plain):
    schedule = plain[0]
    drawn = json.loads(visit.page.text_content("#data"))["map"]
    layer = next(layer for layer in drawn["layers"] if layer["label"].startswith("gain margin"))
    np.testing.assert_allclose(
        layer["values"], schedule.margins.margins.gain_margin.min(axis=0), rtol=1e-5
    )
    gains = next(layer for layer in drawn["layers"] if layer["label"] == "ki")
    np.testing.assert_allclose(
        gains["values"],
        schedule.gains(schedule.margins.x[:, None], schedule.margins.y).ki,
        rtol=1e-5,
    )
    assert visit.page.locator("#map-figure .cell").count() == np.size(layer["values"])
    visit.page.locator("#map-figure .cell").last.click()
    assert visit.page.text_content("#opening-value") == "0.5"
    assert visit.page.text_content("#position-value") == "0.4 m"
    visit.page.select_option("#map-layer", label="speed v (m/s)")
    assert "speed v" in visit.page.get_attribute("#map-figure", "aria-label")


def test_a_worst_point_is_shown_by_its_button_on_its_plant(visit, plain):
    worst = plain[0].margins.worst("Ms")
    visit.page.locator("#worst button").first.click()
    openings = opening_grid(plain[0].actuator)
    assert float(visit.page.input_value("#opening")) == np.argmin(np.abs(openings - worst.x))
    assert visit.page.locator("#plant option:checked").text_content() == worst.variant


def test_motions_are_those_of_the_validation_and_of_the_other_regulators(visit, plain):
    schedule, validation, *_ = plain
    traces = json.loads(visit.page.text_content("#data"))["traces"]
    assert [trace["name"] for trace in traces] == [run.scenario.name for run in validation.runs]
    assert [motion["label"] for motion in traces[0]["motions"]] == ["scheduled", "fixed"]
    for trace, run in zip(traces, validation.runs, strict=True):
        stride = round(trace["step"] / schedule.Ts)
        shown = np.frombuffer(base64.b64decode(trace["motions"][0]["v"]), dtype="<f4")
        np.testing.assert_allclose(shown, run.trajectory.v[::stride], rtol=1e-6, atol=1e-12)
        assert shown.size <= 400
    visit.page.select_option("#scenario", index=3)
    labels = visit.page.eval_on_selector_all(
        "#motion-figures svg", "all => all.map(one => one.textContent)"
    )
    for label, unit in zip(
        labels, ("y (m)", "v (m/s)", "x (of full)", "a (bar)", "b (bar)"), strict=True
    ):
        assert unit in label
        assert "time (s)" in label
    assert validation.runs[3].scenario.name in visit.page.get_attribute("#motion-v", "aria-label")


def test_the_sliders_work_from_the_keyboard_and_everything_has_a_name(visit):
    visit.slide("opening", 30)
    visit.page.focus("#opening")
    visit.page.keyboard.press("ArrowRight")
    assert visit.page.input_value("#opening") == "31"
    assert visit.page.get_attribute(
        "#opening", "aria-valuetext"
    ) == "x = " + visit.page.text_content("#opening-value")
    unnamed = (
        "all => all.filter(one => !(one.getAttribute('aria-label') || one.labels?.length)).map(one"
        " => one.id)"
    )
    assert visit.page.eval_on_selector_all("svg[role=img], input, select", unnamed) == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_at_390_pixels_nothing_is_wider_than_the_screen(browser, visit, scheme, tmp_path):
    path = visit.asked[0].removeprefix("file://")
    narrow = Visit(
        browser, type(tmp_path)(path), viewport={"width": 390, "height": 800}, color_scheme=scheme
    )
    assert narrow.page.evaluate("document.documentElement.scrollWidth") == 390
    background = narrow.page.evaluate("getComputedStyle(document.body).backgroundColor")
    light = sum(map(int, re.findall(r"\d+", background)[:3])) > 382
    assert light == (scheme == "light")
    narrow.page.close()


def test_a_point_without_equilibrium_says_why(browser, tmp_path):
    sticky = REFERENCE.replace(
        coulomb_friction=1e3, breakaway_friction=1e3, stribeck_speed=1e-2, creep_speed=4e-3
    )
    schedule = hc.tune(
        sticky, [-0.5, 0.5], Y, specification=hc.Specification(uncertainty="nominal")
    )
    rest = hc.Scenario(name="rest", loop="velocity", Ts=1e-3, reference=np.zeros(20), y=0.2)
    path = write_report(
        tmp_path / "report.html", schedule, hc.validate(sticky, schedule, scenarios=[rest])
    )
    visit = Visit(browser, path)
    blocked = opening_grid(sticky).size // 2
    visit.slide("opening", blocked)
    assert "twice creep_speed" in visit.page.text_content("#explorer-state")
    assert visit.values("#poles") == visit.values("#margins") == []
    assert visit.page.locator("#bode-gain *").count() == 0
    visit.slide("opening", opening_grid(sticky).size - 1)
    assert visit.values("#poles")
    assert visit.said == []
    visit.page.close()


class Collector(HTMLParser):
    """The references and the scripts of a page."""

    def __init__(self):
        super().__init__()
        self.references, self.tags = [], []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.references += [
            value for name, value in attributes if name in ("src", "href", "action", "srcset")
        ]


def test_the_page_is_one_small_file_without_references(plain, tmp_path):
    path = write_plain(tmp_path / "report.html", plain)
    assert path.stat().st_size <= 2_000_000
    collector = Collector()
    collector.feed(path.read_text("utf-8"))
    assert all(reference.startswith(("#", "data:,")) for reference in collector.references)
    assert collector.tags.count("script") == 2
    sources = [
        part.read_text("utf-8") for part in files("hydroctl.report").joinpath("templates").iterdir()
    ]
    assert not any(
        re.search(r"url\((?!#)|@import|fetch\(|XMLHttpRequest|\bimport\b", source)
        for source in sources
    )
    assert write_plain(tmp_path / "again.html", plain).read_bytes() == path.read_bytes()


def test_a_schedule_for_another_machine_cannot_stand_beside(plain):
    schedule, validation, fixed, _ = plain
    other = replace(fixed, actuator=fixed.actuator.replace(mass=400.0))
    with pytest.raises(hc.InputError, match="'light' is for another machine"):
        page(schedule, validation, beside={"light": other})


def test_a_place_that_cannot_be_written_is_named(plain, tmp_path):
    schedule, validation, *_ = plain
    with pytest.raises(hc.InputError, match=r"none.report.html cannot be written"):
        write_report(tmp_path / "none" / "report.html", schedule, validation)


def test_a_failed_run_stands_with_its_reason(plain):
    schedule, validation, *_ = plain
    broken = replace(validation.runs[0], trajectory=None, metrics=None, reason="overflow <here>")
    text = page(schedule, replace(validation, runs=(broken, *validation.runs[1:])))
    assert "overflow <here>" not in text
    assert "overflow \\u003chere\\u003e" in text


def test_a_saved_schedule_gets_its_page(command, plain, tmp_path):
    saved = plain[0].save(tmp_path / "schedule.json")
    code, stdout, _ = command("report", saved, "-o", tmp_path / "page.html")
    assert code == 0
    assert "written to" in stdout
    assert "P + feed-forward" in (tmp_path / "page.html").read_text("utf-8")
