"""A requirement that a design does not meet on the nonlinear plant stays with its schedule, into
every file."""

import json
import re
import shutil
from dataclasses import replace
from zipfile import ZipFile

import pytest
from scipy.io import loadmat

import hydroctl as hc
from hydroctl.export import FORMATS as ALL_FORMATS
from hydroctl.proof.margin_verdicts import margin_verdicts

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
FORMATS = [f for f in ALL_FORMATS if f != "fmu" or COMPILER]


@pytest.fixture(scope="module")
def missed():
    """PI without a notch is too slow for the fast machine, whose margins are sound."""
    return hc.design(
        hc.load_actuator("fast_50_28"), specification=hc.Specification(uncertainty="corners")
    )


@pytest.fixture(scope="module")
def saved(missed, tmp_path_factory):
    directory = tmp_path_factory.mktemp("missed")
    missed.save(directory)
    return directory / "schedule.json"


def plain(text: str) -> str:
    """Text without what a target sets around it: comments, line ends, blanks."""
    return re.sub(r"[\s*#()]", "", text)


def recorded(path) -> str:
    """What a written file says, whatever its format."""
    if path.suffix == ".mat":
        return str(loadmat(path, simplify_cells=True)["schedule"]["failed_checks"])
    if path.suffix == ".json":
        failed = json.loads(path.read_text())["failed_checks"]
        return " ".join(check["description"] for check in failed)
    if path.suffix == ".fmu":
        with ZipFile(path) as archive:
            return archive.read("sources/press.c").decode()
    return path.read_text()


def test_a_design_hands_the_requirements_that_it_misses_to_its_schedule(missed):
    failed = [verdict for verdict in missed.validation.verdicts if not verdict.passed]
    assert failed
    assert all(verdict.passed for verdict in margin_verdicts(missed.schedule))
    assert missed.schedule.failed_checks == tuple(map(str, failed))
    assert any("settling time" in check for check in missed.schedule.failed_checks)


def test_a_failed_fixed_regulator_beside_it_is_no_failure_of_the_schedule(missed):
    assert not missed.fixed_validation.passed
    own = {str(verdict) for verdict in missed.validation.verdicts}
    assert set(missed.schedule.failed_checks) <= own


def test_a_schedule_without_failures_knows_none(reference):
    nominal = hc.Specification(uncertainty="nominal")
    assert hc.tune(reference, [-1.0, 1.0], [0.1, 0.4], specification=nominal).failed_checks == ()


def test_the_file_keeps_them_and_nobody_removes_them_unnoticed(missed, saved, tmp_path):
    assert hc.load_schedule(saved).failed_checks == missed.schedule.failed_checks
    again = hc.load_schedule(saved).save(tmp_path / "again.json")
    assert again.read_bytes() == saved.read_bytes()
    changed = tmp_path / "changed.json"
    for change in ({"failed_checks": []}, {"failed_checks": [], "fingerprint": None}):
        changed.write_text(json.dumps(json.loads(saved.read_text()) | change))
        with pytest.raises(hc.InputError, match="changed after it was written"):
            hc.load_schedule(changed)


@pytest.mark.parametrize("format", FORMATS)
def test_every_export_refuses_them_and_records_them_where_it_is_forced(
    missed, saved, tmp_path, format
):
    path = tmp_path / f"press.{format}"
    for schedule in (missed.schedule, hc.load_schedule(saved)):
        with pytest.raises(hc.FailedChecksError, match="FAIL  settling time") as refused:
            hc.export_schedule(schedule, path, format)
        assert refused.value.checks == missed.schedule.failed_checks
        assert list(tmp_path.iterdir()) == []
    for written in hc.export_schedule(hc.load_schedule(saved), path, format, force=True):
        if not written.stem.endswith("_plant"):
            assert all(
                plain(check) in plain(recorded(written)) for check in missed.schedule.failed_checks
            )


@pytest.mark.skipif(not COMPILER, reason="no C compiler")
def test_a_forced_fmu_says_so_in_its_description(missed, tmp_path):
    path, _ = hc.export_schedule(missed.schedule, tmp_path / "press.fmu", "fmu", force=True)
    with ZipFile(path) as archive:
        assert b"WRITTEN BY FORCE" in archive.read("modelDescription.xml")


def test_a_forced_schedule_file_is_no_more_exported_than_the_first(missed, tmp_path):
    """A failed margin joins what the design found, each once, however often the file is written and
    read."""
    strict = replace(missed.schedule, specification=replace(missed.schedule.specification, Ms=1.01))
    (path,) = hc.export_schedule(strict, tmp_path / "forced.json", force=True)
    read = hc.load_schedule(path)
    assert set(missed.schedule.failed_checks) < set(read.failed_checks)
    with pytest.raises(hc.FailedChecksError) as refused:
        hc.export_schedule(read, tmp_path / "press.c", "c")
    assert refused.value.checks == read.failed_checks
    assert len(set(read.failed_checks)) == len(read.failed_checks)


def test_the_command_line_ends_with_1_and_with_0_where_it_is_forced(
    command, missed, saved, tmp_path
):
    code, stdout, stderr = command("export", saved, "--to", "c", "-o", tmp_path)
    assert (code, stdout) == (1, "")
    assert "or force the export" in stderr
    assert all(check in stderr for check in missed.schedule.failed_checks)
    assert not list(tmp_path.iterdir())
    code, _, _ = command("export", saved, "--to", "c", "-o", tmp_path, "--force")
    assert code == 0
    assert "WRITTEN BY FORCE" in (tmp_path / "schedule.c").read_text()
