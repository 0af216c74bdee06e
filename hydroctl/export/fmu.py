"""FMI 2.0: the regulator, and the plant, as units of co-simulation with their C sources and a
binary for this platform."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from zipfile import ZIP_STORED, ZipFile, ZipInfo

from .. import __version__
from ..errors import InputError
from ..files import write_file
from ..machine.actuator import Actuator
from ..model.plant import parameters
from ..regulator import law
from ..simulation import rest_state
from ..simulation.kernels import runge_kutta
from ..simulation.modes import longest_step
from .c import filters, sources
from .contents import Contents
from .text import harmless, identifier, render

_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off")
_PLATFORMS = {
    "linux": ("linux64", "so"),
    "darwin": ("darwin64", "dylib"),
    "win32": ("win64", "dll"),
}
_FILTERS = filters("double")
_STEPS_OVER_BENDS = 24
"""in place of one, for a machine whose equations bend, because the unit has no control of its
errors"""
_INITIAL = {
    "parameter": {"variability": "fixed", "initial": "exact"},
    "output": {"initial": "calculated"},
}


class Variable(NamedTuple):
    """One variable of a unit; its value reference is its place in the list."""

    name: str
    unit: str
    description: str
    causality: str
    start: float | None = None
    feedthrough: tuple[str, ...] = ()
    """of an output: the inputs that act on it at once"""
    initially: tuple[str, ...] = ()
    """of an output: what its first value is made of"""


_INPUTS = (
    Variable("reference", "{reference}", "wanted {loop}", "input", 0.0),
    Variable("v_ref", "m/s", "speed of the reference, for the feed-forward", "input", 0.0),
    Variable("p_a", "Pa", "pressure in the cap side", "input", 0.0),
    Variable("p_b", "Pa", "pressure in the rod side", "input", 0.0),
    Variable("v", "m/s", "measured speed", "input", 0.0),
    Variable("y", "m", "measured position", "input", 0.0),
)
_PLANT = (
    Variable("x", "1", "valve command, -1 to 1", "input", 0.0),
    Variable(
        "load_force", "N", "load beside the machine's own, positive against extension", "input", 0.0
    ),
    Variable("p_a", "Pa", "pressure in the cap side", "output", initially=("p_a_start",)),
    Variable("p_b", "Pa", "pressure in the rod side", "output", initially=("p_b_start",)),
    Variable("v", "m/s", "speed", "output", initially=("v_start",)),
    Variable("y", "m", "position", "output", initially=("y_start",)),
)
_LIMITS: dict[str, dict[str, Any]] = {
    end: {
        "description": f"{end} value that is not a fault",
        "causality": "parameter",
        "start": start,
    }
    for end, start in (("lowest", -sys.float_info.max), ("highest", sys.float_info.max))
}
_STATES = (("p_a", "Pa"), ("p_b", "Pa"), ("v", "m/s"), ("y", "m"))


def write_fmu(contents: Contents, path: Path) -> tuple[Path, ...]:
    """Write the regulator to `path`, and the plant beside it with _plant added to its name."""
    machine = contents.schedule.machine
    regulator = regulator_fmu(contents, identifier(path.stem))
    plant_path = path.with_name(f"{path.stem}_plant.fmu")
    return write_file(path, regulator), *export_plant(machine, plant_path)


def export_plant(actuator: Actuator, path: str | Path) -> tuple[Path, ...]:
    """Write the nonlinear plant of `actuator` as an FMU (FMI 2.0, co-simulation) to `path`.

    Inputs x and load_force, held over a communication step; outputs p_a, p_b, v, y, spool;
    parameters p_a_start, ... (default: at rest in the middle of the stroke). Runge-Kutta 6, with
    the steps of `simulate_closed_loop`. Raises InputError without a C compiler.
    """
    path = Path(path)
    return (write_file(path, plant_fmu(actuator, identifier(path.stem))),)


def regulator_fmu(contents: Contents, name: str) -> bytes:
    """The regulator: sampled at the beginning of each sample time, its output delayed by the
    samples of the schedule.

    Parameters y_lowest, y_highest, ... limit the inputs that it reads; its output faults counts the
    samples with a fault.
    """
    delay = contents.schedule.delay_samples
    if delay != int(delay):
        raise InputError(
            f"delay_samples = {delay:g}: an FMU delays by whole samples; round it up and design"
            " anew."
        )
    header, source = sources(contents, name, "double")
    reads = law.inputs_read(contents.regulator)
    values = {
        "filters": _FILTERS,
        "name": name,
        "NAME": name.upper(),
        "delay": int(delay),
        "reads": reads,
    }
    files = {f"{name}.h": header, f"{name}.c": source} | {
        f"model.{kind}": render(f"regulator_model.{kind}.jinja", **values) for kind in ("h", "c")
    }
    schedule = contents.schedule
    words = {"loop": schedule.loop, "reference": schedule.quantity.unit}
    inputs = [
        v._replace(unit=v.unit.format(**words), description=v.description.format(**words))
        for v in _INPUTS
    ]
    direct = tuple(v.name for v in inputs) if delay == 0 else ()
    variables = [
        *inputs,
        Variable(
            "x", "1", "valve command, -1 to 1", "output", feedthrough=direct, initially=direct
        ),
    ]
    variables.append(Variable("faults", "1", "samples at which a fault was found", "output"))
    for v in inputs:
        if v.name in reads:
            variables += [
                v._replace(name=f"{v.name}_{end}", **limit) for end, limit in _LIMITS.items()
            ]
    return _packed(name, " ".join(contents.provenance), variables, files, contents.schedule.Ts)


def plant_fmu(actuator: Actuator, name: str) -> bytes:
    """The plant of `actuator`."""
    p = parameters(actuator)
    ideal = actuator.valve_natural_frequency is None
    starts = list(rest_state(actuator))[:4]
    bends = (
        p.friction.breakaway_friction,
        p.end_stops.end_stop_stiffness,
        p.valve.dead_band,
        not ideal,
    )
    description = (
        f"Valve-controlled hydraulic cylinder: {actuator.name}. Written by hydroctl {__version__}."
    )
    values: dict[str, Any] = {
        "filters": _FILTERS,
        "provenance": [
            harmless(description),
            f"SHA-256 of its parameters: {actuator.fingerprint()}",
        ],
        "p": p,
        "ideal": ideal,
        "dry": p.friction.breakaway_friction != 0.0,
        "stops": p.end_stops.end_stop_stiffness != 0.0,
        "rate_limited": actuator.valve_rate_limit is not None,
        "longest_step": longest_step(actuator) / (_STEPS_OVER_BENDS if any(bends) else 1),
        "own_load": actuator.constant_load,
        "starts": starts,
        "A": runge_kutta.A,
        "B": runge_kutta.B,
    }
    templates = {
        "plant.h": "plant.h",
        "plant.c": "plant.c",
        "model.h": "plant_model.h",
        "model.c": "plant_model.c",
    }
    files = {file: render(f"{template}.jinja", **values) for file, template in templates.items()}
    at_once = ("x",) if ideal else ()
    variables = [
        *_PLANT,
        Variable(
            "spool", "1", "where the spool is", "output", feedthrough=at_once, initially=at_once
        ),
    ]
    for (state, unit), start in zip(_STATES, starts, strict=True):
        variables.append(
            Variable(f"{state}_start", unit, f"{state} at the start", "parameter", start)
        )
    return _packed(name, harmless(description), variables, files, 1e-3)


def _packed(
    name: str, description: str, variables: list[Variable], files: dict[str, bytes], step: float
) -> bytes:
    """The archive, with the same bytes for the same unit and compiler."""
    digest = hashlib.sha256(b"\0".join(files[file] for file in sorted(files))).hexdigest()
    guid = f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"
    files = files | {"fmi2.c": render("fmi2.c.jinja", filters=_FILTERS, guid=guid, absent=_ABSENT)}
    directory, suffix = _PLATFORMS.get(sys.platform, _PLATFORMS["linux"])
    members = {f"sources/{file}": data for file, data in files.items()}
    members["modelDescription.xml"] = _description(
        name, guid, description, variables, sorted(f for f in files if f[-1] == "c"), step
    )
    members[f"binaries/{directory}/{name}.{suffix}"] = _compiled(files, f"{name}.{suffix}")
    buffer = BytesIO()
    with ZipFile(buffer, "w", ZIP_STORED) as archive:
        for member in sorted(members):
            archive.writestr(ZipInfo(member, (1980, 1, 1, 0, 0, 0)), members[member])
    return buffer.getvalue()


def _sources(files: dict[str, bytes]) -> list[str]:
    return sorted(file for file in files if file.endswith(".c"))


def _compiled(files: dict[str, bytes], library: str) -> bytes:
    compiler = os.environ.get("CC") or next(
        filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None
    )
    if compiler is None:
        raise InputError(
            "an FMU holds a compiled library, and there is no C compiler; install gcc or clang, or"
            " name one in CC."
        )
    with tempfile.TemporaryDirectory() as directory:
        for file, data in files.items():
            (Path(directory) / file).write_bytes(data)
        command = [*compiler.split(), *_FLAGS, *_sources(files), "-lm", "-o", library]
        try:
            subprocess.run(command, cwd=directory, check=True, capture_output=True, text=True)
        except OSError as error:
            raise InputError(
                f"the C compiler {compiler} cannot be run ({error.strerror}); name another in CC."
            ) from None
        except subprocess.CalledProcessError as error:
            raise InputError(f"the C compiler {compiler} failed: {error.stderr.strip()}") from None
        return (Path(directory) / library).read_bytes()


def _description(
    name: str, guid: str, text: str, variables: list[Variable], source_files: list[str], step: float
) -> bytes:
    """modelDescription.xml"""
    attributes = {"fmiVersion": "2.0", "modelName": name, "guid": guid, "description": text}
    root = ElementTree.Element(
        "fmiModelDescription", attributes | {"generationTool": f"hydroctl {__version__}"}
    )
    unit = ElementTree.SubElement(
        root, "CoSimulation", modelIdentifier=name, canHandleVariableCommunicationStepSize="true"
    )
    listed = ElementTree.SubElement(unit, "SourceFiles")
    for file in source_files:
        ElementTree.SubElement(listed, "File", name=file)
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for symbol in sorted({v.unit for v in variables}):
        ElementTree.SubElement(units, "Unit", name=symbol)
    ElementTree.SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(step))
    places = {v.name: str(k + 1) for k, v in enumerate(variables)}
    listed = ElementTree.SubElement(root, "ModelVariables")
    for k, v in enumerate(variables):
        initial = _INITIAL.get(v.causality, {})
        described = {
            "name": v.name,
            "valueReference": str(k),
            "description": v.description,
            "causality": v.causality,
        }
        variable = ElementTree.SubElement(listed, "ScalarVariable", described | initial)
        start = {} if v.start is None else {"start": repr(float(v.start))}
        ElementTree.SubElement(variable, "Real", {"unit": v.unit} | start)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for group in ("Outputs", "InitialUnknowns"):
        listed = ElementTree.SubElement(structure, group)
        for v in variables:
            if v.causality == "output":
                depends = v.feedthrough if group == "Outputs" else v.initially
                ElementTree.SubElement(
                    listed,
                    "Unknown",
                    index=places[v.name],
                    dependencies=" ".join(places[n] for n in depends),
                )
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def _of_type(kind: str) -> list:
    both = [("const fmi2ValueReference ", "vr[]"), ("size_t ", "n")]
    return [
        (f"fmi2Get{kind}", [*both, (f"fmi2{kind} ", "value[]")], "n == 0 ? fmi2OK : fmi2Error"),
        (
            f"fmi2Set{kind}",
            [*both, (f"const fmi2{kind} ", "value[]")],
            "n == 0 ? fmi2OK : fmi2Error",
        ),
    ]


_STATE, _SIZE = ("fmi2FMUstate ", "state"), ("size_t ", "n")
_ORDERS = [("const fmi2ValueReference ", "vr[]"), _SIZE, ("const fmi2Integer ", "order[]")]
_KIND = ("const fmi2StatusKind ", "kind")
_ABSENT = [
    *_of_type("Integer"),
    *_of_type("Boolean"),
    *_of_type("String"),
    ("fmi2GetFMUstate", [("fmi2FMUstate *", "state")], "fmi2Error"),
    ("fmi2SetFMUstate", [_STATE], "fmi2Error"),
    ("fmi2FreeFMUstate", [("fmi2FMUstate *", "state")], "fmi2Error"),
    ("fmi2SerializedFMUstateSize", [_STATE, ("size_t *", "n")], "fmi2Error"),
    ("fmi2SerializeFMUstate", [_STATE, ("fmi2Byte ", "bytes[]"), _SIZE], "fmi2Error"),
    (
        "fmi2DeSerializeFMUstate",
        [("const fmi2Byte ", "bytes[]"), _SIZE, ("fmi2FMUstate *", "state")],
        "fmi2Error",
    ),
    (
        "fmi2GetDirectionalDerivative",
        [
            ("const fmi2ValueReference ", "unknown[]"),
            ("size_t ", "unknowns"),
            ("const fmi2ValueReference ", "known[]"),
            ("size_t ", "knowns"),
            ("const fmi2Real ", "seed[]"),
            ("fmi2Real ", "derivative[]"),
        ],
        "fmi2Error",
    ),
    ("fmi2SetRealInputDerivatives", [*_ORDERS, ("const fmi2Real ", "value[]")], "fmi2Error"),
    ("fmi2GetRealOutputDerivatives", [*_ORDERS, ("fmi2Real ", "value[]")], "fmi2Error"),
    ("fmi2CancelStep", [], "fmi2Error"),
    ("fmi2GetStatus", [_KIND, ("fmi2Status *", "value")], "fmi2Discard"),
    ("fmi2GetIntegerStatus", [_KIND, ("fmi2Integer *", "value")], "fmi2Discard"),
    ("fmi2GetBooleanStatus", [_KIND, ("fmi2Boolean *", "value")], "fmi2Discard"),
    ("fmi2GetStringStatus", [_KIND, ("fmi2String *", "value")], "fmi2Discard"),
]
"""functions that the standard asks for and these units have no use for: name, arguments, what they
return"""
