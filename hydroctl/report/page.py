"""`write_report`: everything that a design is judged by, in one HTML file that needs no network."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

from .. import __version__
from ..digits import apart
from ..errors import InputError
from ..files import write_file
from ..loop.margins import MARGIN_UNITS
from ..machine.actuator import PARAMETERS
from ..proof.prove import standing_proof
from ..regulator.formulas import law_formulas
from ..schedule.schedule import GainSchedule
from ..validation import Standing, ValidationReport, Verdict, validate
from .explorer import explorer_data, laws_script
from .figures import map_data, trace_data

_DIGITS = 4
_SCRIPTS = ("linear_algebra.js", "loop.js", "chart.js", "figures.js", "explorer.js")
_SHOWN = {
    "1": (1.0, ""),
    "Pa": (1e-5, "bar"),
    "rad": (180.0 / math.pi, "degrees"),
    "rad/s": (0.5 / math.pi, "Hz"),
}
"""(factor, unit) for the reader, by SI unit"""
_MARGIN_NAMES = {
    "Ms": "Ms, largest sensitivity",
    "Mt": "Mt, largest complementary sensitivity",
    "gain_margin": "gain margin",
    "gain_reduction_margin": "gain reduction margin (0: no smaller gain brings L to -1)",
    "phase_margin": "phase margin",
    "delay_margin": "delay margin",
    "crossover": "crossover",
}


def write_report(
    path: str | Path,
    schedule: GainSchedule,
    validation: ValidationReport,
    *,
    beside: Mapping[str, GainSchedule] | None = None,
    comparison: Mapping[str, Standing] | None = None,
    remarks: Sequence[str] = (),
) -> Path:
    """Write the page on `schedule` and its `validation` to `path`, atomically, as one HTML file.

    `beside`: other schedules for the same machine, loop and sampling, by name, which explorer and
    motions show too. `comparison`: how schedules stand against a baseline, as
    `validation.standings`. `remarks`: sentences that stand under the verdict. Raises InputError
    where a schedule does not fit the first or the file cannot be written.
    """
    return write_file(
        path,
        page(schedule, validation, beside=beside, comparison=comparison, remarks=remarks).encode(),
    )


def page(
    schedule: GainSchedule,
    validation: ValidationReport,
    *,
    beside: Mapping[str, GainSchedule] | None = None,
    comparison: Mapping[str, Standing] | None = None,
    remarks: Sequence[str] = (),
) -> str:
    """The text of the page of `write_report`."""
    import jinja2
    from markupsafe import Markup

    beside = dict(beside or {})
    _require_alike(schedule, beside)
    scenarios = [
        run.scenario for run in validation.runs if run.variant == validation.runs[0].variant
    ]
    reports = {
        name: validate(other.machine, other, scenarios=scenarios) for name, other in beside.items()
    }
    proof = standing_proof(schedule)
    verdicts = (*proof.linear, *validation.verdicts)
    source = files("hydroctl.report").joinpath("templates")
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters.update(
        short=short, shown=shown, shown_unit=shown_unit, against_limit=against_limit
    )
    template = environment.from_string(source.joinpath("page.html").read_text("utf-8"))
    return template.render(
        schedule=schedule,
        version=__version__,
        passed=all(verdict.passed for verdict in verdicts),
        remarks=remarks,
        verdicts=verdicts,
        worst=[
            (_MARGIN_NAMES[name], proof.worst(name), unit) for name, unit in MARGIN_UNITS.items()
        ],
        comparison=comparison or {},
        specification=_specification(schedule),
        parameters=_parameters(schedule),
        law=law_formulas(schedule.regulator)["sample"]["statements"],
        proof=proof,
        data={
            "explorer": explorer_data({"scheduled": schedule} | beside),
            "map": map_data(schedule),
            "traces": trace_data({"scheduled": validation} | reports),
        },
        styles=Markup(source.joinpath("page.css").read_text("utf-8")),
        scripts=Markup(
            "\n".join((laws_script({"scheduled": schedule} | beside), *map(_script, _SCRIPTS)))
        ),
    )


def _script(name: str) -> str:
    return files("hydroctl.report").joinpath("templates", name).read_text("utf-8")


def shown(value: float, unit: str) -> str:
    """`short` of an SI value in the unit that engineers read, `shown_unit`."""
    return short(value * _SHOWN.get(unit, (1.0, ""))[0])


def shown_unit(unit: str) -> str:
    """What stands beside `shown`; nothing for a pure number."""
    return _SHOWN[unit][1] if unit in _SHOWN else unit


def short(value) -> str:
    """A value as a table shows it: numbers in four digits, infinite ones as a sign, anything else
    as text."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return str(value)
    return _typeset(f"{value:.{_DIGITS}g}")


def against_limit(verdict: Verdict) -> tuple[str, str]:
    """What was reached and what is allowed, as `shown` and in as many digits as tell them apart."""
    factor, _ = _SHOWN.get(verdict.unit, (1.0, ""))
    reached, allowed = apart(verdict.achieved, verdict.limit, digits=_DIGITS, factor=factor)
    return _typeset(reached), _typeset(allowed)


def _typeset(number: str) -> str:
    """A number as text with the signs of print."""
    return number.replace("-", "−").replace("inf", "∞")


def _require_alike(schedule: GainSchedule, beside: Mapping[str, GainSchedule]) -> None:
    def kind(one: GainSchedule):
        return one.loop, one.Ts, one.delay_samples, one.machine.parameters()

    if strange := [name for name, other in beside.items() if kind(other) != kind(schedule)]:
        raise InputError(
            f"schedule {name!r} is for another machine, loop or sampling; compare what is alike."
            for name in strange
        )


def _specification(schedule: GainSchedule) -> dict[str, object]:
    """Name and value of every limit and setting that is given."""
    given = dataclasses.asdict(schedule.specification)
    return {name.replace("_", " "): value for name, value in given.items() if value is not None}


def _parameters(schedule: GainSchedule) -> list[tuple[str, float, str]]:
    """(name, value, unit) of the machine, as far as stated."""
    given = schedule.machine.parameters()
    return [
        (name, value, PARAMETERS[name].metadata["unit"])
        for name, value in given.items()
        if value is not None
    ]
