"""The search around the convex tuner: never worse than the specification's settings, and as good as a scan."""

from dataclasses import replace

import numpy as np
import pytest

import hydroctl as hc
from hydroctl.coupling import check_coupling

AT = [0.1], [0.25]
STUDY = hc.Specification(notch_damping=(0.3, 0.8))


@pytest.fixture(scope="module")
def found(reference):
    return hc.tune_search(reference, *AT, structure="pi+notch", specification=STUDY)


def test_a_searched_notch_beats_the_fixed_one_within_the_same_limits(reference, found):
    plain = hc.tune(reference, *AT, structure="pi+notch", specification=STUDY)
    assert found.improvement == pytest.approx(found.schedule.ki.item() / plain.ki.item(), rel=1e-9)
    assert found.improvement > 1.5
    assert found.schedule.margins.worst("Ms").value <= 1.6 * 1.0001
    assert found.schedule.margins.worst("Mt").value <= 1.3 * 1.0001
    assert found.schedule.margins.unstable == 0
    assert check_coupling(found.schedule).unstable == 0


def test_the_first_trial_is_the_specification_and_none_is_better_than_the_settings_returned(found):
    settings, score = found.trials[0]
    assert settings == pytest.approx({"notch_ratio": 1.0, "zz": 0.3, "zp": 0.8}, rel=1e-12)
    assert score == pytest.approx(1.0, rel=1e-12)
    assert max(score for _, score in found.trials) == pytest.approx(found.improvement, rel=1e-3)


def test_the_settings_are_those_of_the_schedule_and_survive_its_file(found, tmp_path):
    schedule, settings = found.schedule, found.settings
    assert (schedule.zz, schedule.zp) == (settings["zz"], settings["zp"])
    again = hc.load_schedule(schedule.save(tmp_path / "schedule.json"))
    assert again.specification == schedule.specification
    np.testing.assert_array_equal(again.notch_frequency, schedule.notch_frequency)


def test_one_setting_is_found_as_by_a_scan(reference):
    """Largest ki of a velocity PID over its derivative filter: 15 values of Tf from 0.1 ms to 10 ms."""
    asked = hc.Specification(uncertainty="nominal")
    found = hc.tune_search(reference, *AT, structure="pid", specification=asked)
    filters = [replace(asked, Tf=Tf) for Tf in np.geomspace(1e-4, 1e-2, 15)]
    scanned = [hc.tune(reference, *AT, structure="pid", specification=each).ki.item() for each in filters]
    assert list(found.settings) == ["Tf"]
    assert found.schedule.ki.item() >= 0.99 * max(scanned)


@pytest.mark.parametrize(("loop", "structure"), [("velocity", "pi+lead-lag"), ("position", "p+lead-lag")])
def test_searched_sections_turn_a_lead_lag_from_worse_than_none_to_better(reference, loop, structure):
    nominal = hc.Specification(uncertainty="nominal")
    found = hc.tune_search(reference, *AT, loop=loop, structure=structure, specification=nominal)
    bare = hc.tune(reference, *AT, loop=loop, structure=structure.split("+")[0], specification=nominal)
    assert found.improvement > 1.0
    assert found.schedule.margins.worst("crossover").value > bare.margins.worst("crossover").value
    assert found.schedule.margins.worst("Ms").value <= 1.6 * 1.0001
    assert found.schedule.sections[0] == (found.settings["zero"], found.settings["pole"])


def test_a_structure_with_nothing_to_search_is_refused(reference):
    with pytest.raises(hc.InputError, match="neither notch nor section nor derivative"):
        hc.tune_search(reference, *AT, structure="pi")
