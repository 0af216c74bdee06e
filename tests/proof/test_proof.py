"""The proof of a schedule: made once, kept with it, read by file, export and report."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hydroctl as hc
from hydroctl.loop import machine_plants
from hydroctl.loop.margins import MARGIN_UNITS
from hydroctl.proof.margin_verdicts import margin_verdicts
from hydroctl.schedule.verdict import failures

ASKED = hc.Specification(uncertainty="corners")


@pytest.fixture(scope="module")
def designed():
    return hc.design(hc.load_actuator("reference"), specification=ASKED)


def test_it_holds_the_verdicts_on_linear_loops_and_on_motions(designed):
    proof, schedule = designed.proof, designed.schedule
    assert schedule.proof is proof
    assert proof.linear == margin_verdicts(schedule)
    assert proof.verdicts == (*proof.linear, *designed.validation.verdicts)
    assert {verdict.subject for verdict in proof.verdicts} == {
        "margins",
        "hidden coupling",
        "motion",
    }
    assert proof.plants == schedule.margins.variants
    assert proof.machine == designed.actuator.fingerprint()
    assert [point.margin for point in proof.margins] == list(MARGIN_UNITS)
    assert proof.worst("Ms") == schedule.margins.worst("Ms")


def test_it_says_what_was_not_looked_at(designed):
    text = " ".join(designed.proof.not_shown)
    assert "between the design points" in text
    assert "other machines than these: nominal" in text
    assert "motions of other kinds than these: reversal, saturated, step" in text


def test_without_a_machine_no_motion_was_looked_at():
    actuator = hc.load_actuator("reference")
    x, y = np.array([-0.5, 0.5]), np.array([0.1, 0.4])
    family = hc.linearize(actuator, hc.find_operating_points(actuator, x[:, None], y))
    proof = hc.prove(hc.tune(family))
    assert proof.machine is None
    assert {verdict.subject for verdict in proof.verdicts} <= {"margins", "hidden coupling"}
    assert "the motion of a nonlinear machine" in proof.not_shown


def test_a_box_is_searched_and_only_said_to_be(designed):
    schedule = replace(
        designed.schedule, specification=replace(ASKED, uncertainty={"mass": (0.9, 1.1)})
    )
    proof = hc.prove(schedule, validation=designed.validation)
    searched = [verdict for verdict in proof.verdicts if verdict.method == "searched"]
    assert searched
    assert all("searched" in verdict.name for verdict in searched)
    assert any("searched, not proven" in text for text in proof.not_shown)
    assert proof.state in ("failed", "sampled")


def test_the_file_gives_it_back_and_a_change_of_the_schedule_makes_it_another_ones(
    designed, tmp_path
):
    again = hc.load_schedule(designed.schedule.save(tmp_path / "schedule.json"))
    assert again.proof == designed.proof
    assert again.own_proof == designed.proof
    changed = replace(again, kp=1.01 * again.kp)
    assert changed.proof is again.proof
    assert changed.own_proof is None
    assert hc.load_schedule(changed.save(tmp_path / "changed.json")).proof is None


def test_numbers_that_json_does_not_know_come_back(designed, tmp_path):
    odd = tuple(
        replace(verdict, achieved=value, limit=np.inf)
        for verdict, value in zip(designed.proof.verdicts, (np.inf, -np.inf, 0.5), strict=False)
    )
    schedule = replace(designed.schedule, proof=replace(designed.proof, verdicts=odd))
    assert hc.load_schedule(schedule.save(tmp_path / "odd.json")).proof.verdicts == odd
    nan = (replace(odd[0], achieved=np.nan, passed=False),)
    schedule = replace(designed.schedule, proof=replace(designed.proof, verdicts=nan))
    (found,) = hc.load_schedule(schedule.save(tmp_path / "nan.json")).proof.verdicts
    assert np.isnan(found.achieved)


def test_a_motion_that_failed_blocks_an_export_also_after_reading(designed, tmp_path):
    bad = replace(designed.proof.verdicts[-1], passed=False, achieved=1.0)
    proof = replace(designed.proof, verdicts=(*designed.proof.verdicts[:-1], bad))
    assert proof.state == "failed"
    assert failures([bad]) == proof.failed_checks
    schedule = replace(designed.schedule, proof=proof)
    read = hc.load_schedule(schedule.save(tmp_path / "schedule.json"))
    for one in (schedule, read):
        with pytest.raises(hc.FailedChecksError) as refused:
            hc.export_schedule(one, tmp_path / "press.c", "c")
        assert refused.value.checks == proof.failed_checks


def test_an_export_states_it(designed, tmp_path):
    source, *_ = hc.export_schedule(designed.schedule, tmp_path / "press.c", "c")
    text = " ".join(Path(source).read_text().split())
    assert "State of the proof: sampled" in text


@pytest.mark.parametrize("uncertainty", ["corners", "box"])
def test_design_save_load_and_export_sample_each_set_of_plants_once(
    monkeypatch, tmp_path, uncertainty
):
    """Each set: plants, points, what the loop controls, sampling. Only the climbs of the search of
    a box come to the same few points of a plant again, while it designs; nothing does after
    that."""
    counted = Counter()
    sample = machine_plants.sample

    def counting(family, *, loop, sample_time, delay_samples):
        points = family.points
        key = (points.x.tobytes(), points.y.tobytes(), family.A.tobytes(), loop, sample_time)
        counted[key] += 1
        return sample(family, loop=loop, sample_time=sample_time, delay_samples=delay_samples)

    monkeypatch.setattr(machine_plants, "sample", counting)
    machine = hc.load_actuator("differential_100_56").replace(mass=431.0)
    asked = hc.Specification(uncertainty=uncertainty)
    made = hc.design(machine, specification=asked)
    by_design = Counter(counted)
    read = hc.load_schedule(made.schedule.save(tmp_path / "schedule.json"))
    hc.export_schedule(read, tmp_path / "press.c", "c")
    hc.export_schedule(read, tmp_path / "press.st", "st")
    assert counted == by_design
    if uncertainty == "corners":
        assert set(by_design.values()) == {1}
