"""A schedule as a schedule file, and back: which field of `GainSchedule` stands where in the
document."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import get_args

import numpy as np

from .. import __version__
from ..errors import InputError
from ..loop.margins import MARGIN_UNITS
from ..machine.actuator import PARAMETERS, Actuator
from ..regulator.compensation import LEAST_RATIO, MOST_RATIO
from ..regulator.structures import GAINS, STRUCTURES, require_structure, section_count
from ..regulator.units import GAIN_UNITS
from ..regulator.vectors import TOLERANCE, Vector, vectors_of
from ..specification import Specification
from . import document as d
from .versions import VERSION

_LAW = (
    "gains from the tables at (x of the previous sample, y); m_f = m + Tm/(Tm + Ts)*(m_f - m); e = r - m_f; g = c*r - m_f; "
    "d = (Tf*d + g - g_previous)/(Tf + Ts); u = notch(lead_lag(kp*(b*r - m_f) + I + kd*d)) + x_ff, x_ff = 0 where v_ref = 0; "
    "w = ratio*u; x = inverse(clip(w, limits)); I = I + Ts*(ki*e + (clip(w, limits) - w)/(ratio*Tt)), but I stays 0 where ki is 0 "
    "in the whole table; x acts delay_samples after the measurement; m is {measured}"
)
_MEASURED = {"velocity": "the speed v in m/s", "position": "the position y in m"}
_ON = {"error": "backward Euler, on the error", "measurement": "backward Euler, on the measurement"}


def law_text(loop: str) -> str:
    """The regulator law in words and formulas, for the loop "velocity" or "position"."""
    return _LAW.format(measured=_MEASURED[loop])


def document_of(schedule, failed_checks: tuple[str, ...]) -> d.Document:
    """The document that describes a `GainSchedule` in full, and the requirements that it fails."""
    units = GAIN_UNITS[schedule.loop]

    axes = [
        d.Axis(name="x", signal="previous saturated x", unit="1", values=schedule.x.tolist()),
        d.Axis(name="y", signal="measured position", unit="m", values=schedule.y.tolist()),
    ]
    tables = [
        d.Table(name=name, unit=unit, values=getattr(schedule, name).tolist())
        for name, unit in units.items()
    ]
    feed_forward = d.FeedForward(
        enabled=schedule.feed_forward,
        gain_extend=d.Speed(value=schedule.speed_gain_extend, unit="m/s"),
        gain_retract=d.Speed(value=schedule.speed_gain_retract, unit="m/s"),
        offset_extend=float(schedule.speed_offset_extend),
        offset_retract=float(schedule.speed_offset_retract),
    )
    specification = schedule.specification
    uncertainty = specification.uncertainty
    design = d.Design(
        x=schedule.design_x.tolist(),
        y=schedule.design_y.tolist(),
        Ms=float(specification.Ms),
        Mt=float(specification.Mt),
        gain_margin=specification.gain_margin,
        phase_margin=_optional(d.Angle, specification.phase_margin, "rad"),
        min_crossover=_optional(d.Frequency, specification.min_crossover, "rad/s"),
        high_frequency_gain=_optional(d.Gain, specification.high_frequency_gain, units["kp"]),
        notch_ratio=float(specification.notch_ratio or 1.0),
        uncertainty=uncertainty if isinstance(uncertainty, str) else dict(uncertainty),
        added_plants=[_quantities(change) for change in specification.added_plants],
        achieved=d.Margins(
            **{
                name: _achieved(schedule.margins.worst(name), unit)
                for name, unit in MARGIN_UNITS.items()
            }
        ),
    )
    document = d.Document(
        schema=d.SCHEMA,
        version=VERSION,
        generator=f"hydroctl {__version__}",
        loop=schedule.loop,
        structure=schedule.structure,
        controller=_controller(schedule),
        scheduling=d.Scheduling(
            interpolation="bilinear",
            extrapolation="clipped",
            order="row-major",
            sides="x >= 0 uses the nodes x > 0, x < 0 the nodes x < 0",
            axes=axes,
            tables=tables,
        ),
        feed_forward=feed_forward,
        actuator=_machine(schedule.actuator),
        design=design,
        failed_checks=list(failed_checks),
        test_vectors=_test_vectors(vectors_of(schedule.regulator), schedule.loop),
        fingerprint=None,
    )
    return document.model_copy(update={"fingerprint": d.fingerprint(document)})


def _machine(actuator: Actuator) -> d.Machine:
    given = {
        name: value for name, value in actuator.recorded_parameters().items() if value is not None
    }
    return d.Machine(
        name=actuator.name,
        source=actuator.source,
        note=actuator.note,
        fingerprint=actuator.fingerprint(),
        parameters=_quantities(given),
    )


def _quantities(parameters: Mapping[str, float]) -> dict[str, d.Quantity]:
    """Parameters of a machine with their units."""
    quantity = d.Quantity
    return {
        name: quantity(value=value, unit=PARAMETERS[name].metadata["unit"])
        for name, value in parameters.items()
    }


def _test_vectors(vectors: list[Vector], loop: str) -> d.TestVectors:
    reference = "m/s" if loop == "velocity" else "m"
    units = ["1", reference, "m/s", "Pa", "Pa", "m/s", "m", *GAIN_UNITS[loop].values(), "1"]
    rows = [[v.start, *v.inputs, *(v.gains or (None,) * 4), v.x] for v in vectors]
    finite = [
        [None if value is None or math.isnan(value) else value for value in row] for row in rows
    ]
    columns = get_args(d.TestVectors.model_fields["columns"].annotation)[0]
    return d.TestVectors(columns=columns, units=units, tolerance=TOLERANCE, rows=finite)


def require_unchanged(document: d.Document) -> None:
    """InputError where a file that has a fingerprint does not fit to it."""
    if document.fingerprint is not None and document.fingerprint != d.fingerprint(document):
        raise InputError(
            "fingerprint does not belong to the rest of the file, which was changed after it was written."
        )


def vectors_in(document: d.Document) -> list[Vector]:
    """The test vectors of a file; none before version 3."""
    rows = [] if document.test_vectors is None else document.test_vectors.rows
    vectors = []
    for start, *inputs, kp, ki, kd, wn, x in rows:
        gains = None if kp is None else (kp, ki, kd, wn)
        vectors.append(
            Vector(start, tuple(math.nan if value is None else value for value in inputs), gains, x)
        )
    return vectors


_OPTIONAL_LIMITS = ("phase_margin", "high_frequency_gain", "min_crossover")


def _optional(kind, value: float | None, unit: str):
    return None if value is None else kind(value=value, unit=unit)


def _controller(schedule) -> d.Controller:
    return d.Controller(
        form="parallel",
        law=law_text(schedule.loop),
        sample_time=d.Time(value=schedule.Ts, unit="s"),
        delay_samples=float(schedule.delay_samples),
        integral="forward Euler, stored in units of x",
        derivative=_ON[schedule.specification.derivative_on],
        derivative_filter_time=d.Time(value=schedule.Tf, unit="s"),
        measurement_filter_time=d.Duration(value=float(schedule.Tm), unit="s"),
        lead_lag=[
            d.Section(zero=float(zero), pole=float(pole)) for zero, pole in schedule.sections
        ],
        notch="Tustin prewarped at notch_frequency",
        notch_zero_damping=float(schedule.zz),
        notch_pole_damping=float(schedule.zp),
        set_point_weight=float(schedule.b),
        limits=(-1, 1),
        anti_windup="back-calculation from the saturated x, after the notch",
        anti_windup_time=d.Time(value=schedule.Tt, unit="s"),
        pressure_compensation=_compensation(schedule),
        dead_band_inverse=float(schedule.dead_band_inverse),
        start="m_f = m, g_previous = (c - 1)*m, all other states 0",
        fallback=d.FALLBACK,
    )


def _compensation(schedule) -> d.PressureCompensation | None:
    if schedule.pressure_drops is None:
        return None
    (retract_a, retract_b), (extend_a, extend_b) = (
        [d.Pressure(value=float(drop), unit="Pa") for drop in row]
        for row in schedule.pressure_drops
    )
    return d.PressureCompensation(
        ratio="q_ref/q, q = g_a*sqrt(drop_a)/V_a(y) + g_b*sqrt(drop_b)/V_b(y) over the open edges, g = area*flow coefficient",
        limits=(LEAST_RATIO, MOST_RATIO),
        drop_a_retract=retract_a,
        drop_b_retract=retract_b,
        drop_a_extend=extend_a,
        drop_b_extend=extend_b,
    )


def _achieved(worst, unit: str) -> d.Achieved:
    value = worst.value if np.isfinite(worst.value) else None
    return d.Achieved(value=value, unit=unit, variant=worst.variant, x=worst.x, y=worst.y)


def fields_of(document: d.Document) -> dict:
    """The fields of the `GainSchedule` that `document` describes. Raises InputError where its parts
    contradict each other."""
    controller, design, forward = document.controller, document.design, document.feed_forward
    _require_consistent(document)
    x, y = (np.array(axis.values) for axis in document.scheduling.axes)
    return {
        "actuator": _actuator(document.actuator),
        "specification": _specification(document),
        "loop": document.loop,
        "structure": document.structure,
        "x": x,
        "y": y,
        "design_x": np.array(design.x),
        "design_y": np.array(design.y),
        **{table.name: np.array(table.values) for table in document.scheduling.tables},
        "zz": controller.notch_zero_damping,
        "zp": controller.notch_pole_damping,
        "sections": tuple((section.zero, section.pole) for section in controller.lead_lag),
        "Tt": controller.anti_windup_time.value,
        "feed_forward": forward.enabled,
        "speed_gain_extend": forward.gain_extend.value,
        "speed_gain_retract": forward.gain_retract.value,
        "speed_offset_extend": forward.offset_extend,
        "speed_offset_retract": forward.offset_retract,
        "pressure_drops": _pressure_drops(controller.pressure_compensation),
        "failed_checks": tuple(document.failed_checks),
    }


def _require_consistent(document: d.Document) -> None:
    structure = document.structure
    require_structure(structure)
    faults = [
        f"table {table.name} is not zero, but structure {structure!r} has no {table.name}."
        for table in document.scheduling.tables
        if table.name in GAINS and table.name not in STRUCTURES[structure] and np.any(table.values)
    ]
    if (given := len(document.controller.lead_lag)) != (needed := section_count(structure)):
        faults.append(
            f"controller.lead_lag has {given} sections; structure {structure!r} has {needed}."
        )
    if faults:
        raise InputError(faults)


def _actuator(machine: d.Machine) -> Actuator:
    parameters = {name: quantity.value for name, quantity in machine.parameters.items()}
    actuator = Actuator(name=machine.name, source=machine.source, note=machine.note, **parameters)
    if lacking := [
        name
        for name, value in actuator.recorded_parameters().items()
        if value is not None and name not in parameters
    ]:
        raise InputError(f"actuator.parameters lacks {', '.join(lacking)}.")
    if actuator.fingerprint() != machine.fingerprint:
        raise InputError(
            "actuator.fingerprint does not belong to actuator.parameters; the file was changed after it was written."
        )
    return actuator


def _specification(document: d.Document) -> Specification:
    controller, design = document.controller, document.design
    sections = tuple((section.zero, section.pole) for section in controller.lead_lag)
    return Specification(
        sample_time=controller.sample_time.value,
        delay_samples=controller.delay_samples,
        Ms=design.Ms,
        Mt=design.Mt,
        gain_margin=design.gain_margin,
        **{
            name: None if (limit := getattr(design, name)) is None else limit.value
            for name in _OPTIONAL_LIMITS
        },
        uncertainty=design.uncertainty,
        added_plants=tuple(
            {name: given.value for name, given in change.items()} for change in design.added_plants
        ),
        Tf=controller.derivative_filter_time.value,
        **_notch(document),
        lead_lag=sections + Specification.lead_lag[len(sections) :],
        measurement_filter=controller.measurement_filter_time.value,
        derivative_on=next(on for on, text in _ON.items() if text == controller.derivative),
        set_point_weight=controller.set_point_weight,
        pressure_compensation=controller.pressure_compensation is not None,
        dead_band_inverse=controller.dead_band_inverse,
    )


def _notch(document: d.Document) -> dict:
    """The settings of a notch; sections stand at its frequency without it, too, at a ratio of 1
    unless another is stated."""
    controller, ratio = document.controller, document.design.notch_ratio
    if "notch" not in document.structure:
        return {} if ratio == 1.0 else {"notch_ratio": ratio}
    return {
        "notch_damping": (controller.notch_zero_damping, controller.notch_pole_damping),
        "notch_ratio": ratio,
    }


def _pressure_drops(given: d.PressureCompensation | None) -> np.ndarray | None:
    if given is None:
        return None
    names = (("drop_a_retract", "drop_b_retract"), ("drop_a_extend", "drop_b_extend"))
    return np.array([[getattr(given, name).value for name in row] for row in names])
