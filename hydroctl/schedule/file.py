"""A schedule as a schedule file, and back: which field of `GainSchedule` stands where in the
document."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal, get_args

import numpy as np
from pydantic import BaseModel

from .. import __version__
from ..errors import InputError
from ..loop.quantity import ControlledQuantity
from ..machine.actuator import PARAMETERS, Actuator
from ..regulator.compensation import LEAST_RATIO, MOST_RATIO
from ..regulator.formulas import law_formulas
from ..regulator.structures import GAINS, STRUCTURES, require_structure, section_count
from ..regulator.vectors import TOLERANCE, Vector, vectors_of
from ..specification import Specification
from . import document as d
from . import parts as p
from .models import PlantModels, models_of, models_part
from .proof_file import proof_of, proof_part, remarks_of
from .shown import Columns, Law, TestVectors
from .versions import VERSION


def document_of(schedule) -> d.Document:
    """The document that describes a `GainSchedule` in full."""
    scheduled, proof = schedule.regulator, schedule.own_proof
    document = d.Document(
        schema=d.SCHEMA,
        version=VERSION,
        generator=f"hydroctl {__version__}",
        **_parts(schedule),
        law=_law(law_formulas(scheduled), schedule.quantity),
        proof=None if proof is None else proof_part(proof),
        failed_checks=remarks_of(schedule.failed_checks),
        test_vectors=_test_vectors(vectors_of(scheduled), schedule.quantity),
        fingerprint=None,
    )
    return document.model_copy(update={"fingerprint": d.fingerprint(d.content_of(document))})


def schedule_fingerprint(schedule) -> str:
    """SHA-256 of what makes up a `GainSchedule`: regulator, plants and specification."""
    parts = {
        name: d.content_of(part) if isinstance(part, BaseModel) else part
        for name, part in _parts(schedule).items()
    }
    return d.fingerprint(parts)


def _parts(schedule) -> dict[str, Any]:
    """The parts of the document that make up the schedule."""
    return {
        "loop": schedule.loop,
        "structure": schedule.structure,
        "controller": _controller(schedule),
        "scheduling": _scheduling(schedule),
        "feed_forward": p.FeedForward(
            enabled=schedule.feed_forward,
            gain_extend=p.Speed(value=schedule.speed_gain_extend, unit="m/s"),
            gain_retract=p.Speed(value=schedule.speed_gain_retract, unit="m/s"),
            offset_extend=float(schedule.speed_offset_extend),
            offset_retract=float(schedule.speed_offset_retract),
        ),
        "actuator": None if schedule.actuator is None else _machine(schedule.actuator),
        "models": None if schedule.models is None else _models(schedule),
        "design": _design(schedule),
    }


def _scheduling(schedule) -> p.Scheduling:
    return p.Scheduling(
        interpolation="bilinear",
        extrapolation="clipped",
        sides="separate",
        x=_axis("previous_x", "1", schedule.x),
        y=_axis("y", "m", schedule.y),
        tables=p.Tables(
            **{
                name: p.Table(unit=unit, values=getattr(schedule, name).tolist())
                for name, unit in schedule.quantity.gain_units.items()
            }
        ),
    )


def _axis(signal: Literal["previous_x", "y"], unit: Literal["1", "m"], nodes: np.ndarray) -> p.Axis:
    values = nodes.tolist()
    return p.Axis(signal=signal, unit=unit, nodes=values, slopes=p.slopes(values))


def _design(schedule) -> p.Design:
    specification, unit = schedule.specification, schedule.quantity.gain_units["kp"]
    uncertainty = specification.uncertainty
    return p.Design(
        x=schedule.design_x.tolist(),
        y=schedule.design_y.tolist(),
        Ms=float(specification.Ms),
        Mt=float(specification.Mt),
        gain_margin=specification.gain_margin,
        phase_margin=_optional(p.Angle, specification.phase_margin, "rad"),
        min_crossover=_optional(p.Frequency, specification.min_crossover, "rad/s"),
        high_frequency_gain=_optional(p.Gain, specification.high_frequency_gain, unit),
        notch_ratio=float(specification.notch_ratio or 1.0),
        uncertainty=uncertainty if isinstance(uncertainty, str) else dict(uncertainty),
        added_plants=[_quantities(change) for change in specification.added_plants],
    )


_STANDS_AT = {
    "x_nodes": "scheduling.x.nodes",
    "x_slope": "scheduling.x.slopes",
    "y_nodes": "scheduling.y.nodes",
    "y_slope": "scheduling.y.slopes",
}
"""where in the file arrays of the law stand already"""


def _law(formulas: dict[str, Any], quantity: ControlledQuantity) -> Law:
    """The formulas; arrays that stand elsewhere in the file are named by their place."""
    places = _STANDS_AT | {name: f"scheduling.tables.{name}.values" for name in quantity.gain_units}
    arrays = []
    for array in formulas["arrays"]:
        kept = {key: value for key, value in array.items() if key != "values"}
        place = places.get(array["name"])
        where = {"values": array["values"]} if place is None else {"source": place}
        arrays.append(kept | where)
    fallback = {"x": 0, "memory": "rest", "description": formulas["fallback"]}
    return Law.model_validate(formulas | {"arrays": arrays, "fallback": fallback})


def _models(schedule) -> PlantModels:
    """The models at the points at which the margins are looked at."""
    points = schedule.models.between(schedule.design_x, schedule.design_y)
    return models_part(schedule.models, *points)


def _machine(actuator: Actuator) -> p.Machine:
    given = {
        name: value for name, value in actuator.recorded_parameters().items() if value is not None
    }
    return p.Machine(
        name=actuator.name,
        source=actuator.source,
        note=actuator.note,
        fingerprint=actuator.fingerprint(),
        parameters=_quantities(given),
    )


def _quantities(parameters: Mapping[str, float]) -> dict[str, p.Quantity]:
    """Parameters of a machine with their units."""
    quantity = p.Quantity
    return {
        name: quantity(value=value, unit=PARAMETERS[name].metadata["unit"])
        for name, value in parameters.items()
    }


def _test_vectors(vectors: list[Vector], quantity: ControlledQuantity) -> TestVectors:
    inputs = ["1", quantity.unit, "m/s", "Pa", "Pa", "m/s", "m"]
    units = [*inputs, *quantity.gain_units.values(), "1"]
    rows = [[v.start, *v.inputs, *(v.gains or (None,) * 4), v.x] for v in vectors]
    finite = [
        [None if value is None or math.isnan(value) else value for value in row] for row in rows
    ]
    columns = tuple(get_args(name)[0] for name in get_args(Columns))
    return TestVectors(columns=columns, units=units, tolerance=TOLERANCE, rows=finite)


def vectors_in(document: d.Document) -> list[Vector]:
    """The test vectors of a file; none before version 3."""
    rows: list[list[Any]] = [] if document.test_vectors is None else document.test_vectors.rows
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


def _controller(schedule) -> p.Controller:
    return p.Controller(
        form="parallel",
        sample_time=p.Time(value=schedule.Ts, unit="s"),
        delay_samples=float(schedule.delay_samples),
        derivative_on=schedule.specification.derivative_on,
        derivative_filter_time=p.Time(value=schedule.Tf, unit="s"),
        measurement_filter_time=p.Duration(value=float(schedule.Tm), unit="s"),
        lead_lag=[
            p.Section(zero=float(zero), pole=float(pole)) for zero, pole in schedule.sections
        ],
        notch_zero_damping=float(schedule.zz),
        notch_pole_damping=float(schedule.zp),
        set_point_weight=float(schedule.b),
        limits=(-1, 1),
        anti_windup_time=p.Time(value=schedule.Tt, unit="s"),
        pressure_compensation=_compensation(schedule),
        dead_band_inverse=float(schedule.dead_band_inverse),
    )


def _compensation(schedule) -> p.PressureCompensation | None:
    if schedule.pressure_drops is None:
        return None
    (retract_a, retract_b), (extend_a, extend_b) = (
        [p.Pressure(value=float(drop), unit="Pa") for drop in row]
        for row in schedule.pressure_drops
    )
    return p.PressureCompensation(
        limits=(LEAST_RATIO, MOST_RATIO),
        drop_a_retract=retract_a,
        drop_b_retract=retract_b,
        drop_a_extend=extend_a,
        drop_b_extend=extend_b,
    )


def fields_of(document: d.Document) -> dict:
    """The fields of the `GainSchedule` that `document` describes. Raises InputError where its parts
    contradict each other."""
    controller, design, forward = document.controller, document.design, document.feed_forward
    _require_consistent(document)
    scheduling = document.scheduling
    return {
        "actuator": None if document.actuator is None else _actuator(document.actuator),
        "models": None if document.models is None else models_of(document.models),
        "specification": _specification(document),
        "loop": document.loop,
        "structure": document.structure,
        "x": np.array(scheduling.x.nodes),
        "y": np.array(scheduling.y.nodes),
        "design_x": np.array(design.x),
        "design_y": np.array(design.y),
        **{name: np.array(table.values) for name, table in scheduling.tables.items()},
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
        "failed_checks": tuple(remark.description for remark in document.failed_checks),
        "proof": None if document.proof is None else proof_of(document.proof),
    }


def _require_consistent(document: d.Document) -> None:
    structure = document.structure
    require_structure(structure)
    faults = [
        f"table {name} is not zero, but structure {structure!r} has no {name}."
        for name, table in document.scheduling.tables.items()
        if name in GAINS and name not in STRUCTURES[structure] and np.any(table.values)
    ]
    if (given := len(document.controller.lead_lag)) != (needed := section_count(structure)):
        faults.append(
            f"controller.lead_lag has {given} sections; structure {structure!r} has {needed}."
        )
    if faults:
        raise InputError(faults)


def _actuator(machine: p.Machine) -> Actuator:
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
            "actuator.fingerprint does not belong to actuator.parameters; the file was changed"
            " after it was written."
        )
    return actuator


def _specification(document: d.Document) -> Specification:
    controller, design = document.controller, document.design
    sections = tuple((section.zero, section.pole) for section in controller.lead_lag)
    first, second = sections + Specification.lead_lag[len(sections) :]
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
        lead_lag=(first, second),
        measurement_filter=controller.measurement_filter_time.value,
        derivative_on=controller.derivative_on,
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


def _pressure_drops(given: p.PressureCompensation | None) -> np.ndarray | None:
    if given is None:
        return None
    names = (("drop_a_retract", "drop_b_retract"), ("drop_a_extend", "drop_b_extend"))
    return np.array([[getattr(given, name).value for name in row] for row in names])
