"""The command line: parses, calls, prints. Exit code 0: done and every check passed; 1: a
requirement is not met; 2: bad input."""

from __future__ import annotations

import json
import math
import sys
from contextlib import nullcontext
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import typer

import hydroctl

from .digits import apart
from .machine.units import without_dask
from .progress import interruptible, progress_bar, stage_bar

app = typer.Typer(
    help="From the data sheet of a hydraulic servo cylinder to a proven gain schedule.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


class Loop(StrEnum):
    """What the regulator controls."""

    velocity = "velocity"
    position = "position"


class Target(StrEnum):
    """What a schedule is exported to."""

    json = "json"
    c = "c"
    st = "st"
    mat = "mat"
    fmu = "fmu"
    csv = "csv"


ActuatorArgument = Annotated[
    str, typer.Argument(help="a shipped machine (see `hydroctl actuators`) or a TOML data sheet")
]
JsonOption = Annotated[bool, typer.Option("--json", help="print results as JSON, for programs")]


@app.command()
def design(
    actuator: ActuatorArgument = "reference",
    directory: Annotated[Path, typer.Option("-o", "--output", help="where the results go")] = Path(
        "hydroctl-out"
    ),
    loop: Annotated[Loop, typer.Option(help="what is controlled")] = Loop.velocity,
    structure: Annotated[
        str, typer.Option(help="p, pi or pid; with +lead or +lead-lag; with +notch")
    ] = "pi",
    uncertainty: Annotated[
        str, typer.Option(help="plants the limits hold on: box, corners, one-at-a-time or nominal")
    ] = "box",
    Ms: Annotated[float, typer.Option("--Ms", help="largest sensitivity")] = 1.6,
    Mt: Annotated[float, typer.Option("--Mt", help="largest complementary sensitivity")] = 1.3,
    sample_time: Annotated[float, typer.Option(help="sample time in s")] = 1e-3,
    delay: Annotated[
        float, typer.Option(help="delay from measurement to valve command, in samples")
    ] = 1.0,
    gain_margin: Annotated[float | None, typer.Option(help="least gain margin, a factor")] = None,
    phase_margin: Annotated[
        float | None, typer.Option(help="least phase margin in degrees")
    ] = None,
    min_crossover: Annotated[float | None, typer.Option(help="least crossover in rad/s")] = None,
    measurement_filter: Annotated[
        float, typer.Option(help="time of a filter of the measured quantity in s")
    ] = 0.0,
    pressure_compensation: Annotated[
        bool, typer.Option(help="undo what the load does to the gain; needs p_a and p_b")
    ] = False,
    dead_band_inverse: Annotated[
        float, typer.Option(help="share of the valve's dead band to jump over, 0 to 1")
    ] = 0.0,
    as_json: JsonOption = False,
) -> None:
    """Design a gain schedule, prove its margins, try it on the nonlinear plant, and write schedule,
    figures and summary."""
    from .files import require_writable

    specification = hydroctl.Specification(
        sample_time=sample_time,
        delay_samples=delay,
        Ms=Ms,
        Mt=Mt,
        gain_margin=gain_margin,
        phase_margin=None if phase_margin is None else math.radians(phase_margin),
        min_crossover=min_crossover,
        uncertainty=uncertainty,
        measurement_filter=measurement_filter,
        pressure_compensation=pressure_compensation,
        dead_band_inverse=dead_band_inverse,
    )
    machine = _machine(actuator)
    require_writable(directory)
    from .chain import STAGES

    with stage_bar(len(STAGES) + 1) as begin:
        result = hydroctl.design(
            machine,
            loop=loop.value,
            structure=structure,
            specification=specification,
            on_stage=begin,
        )
        begin("files")
        result.save(directory)
    typer.echo(
        json.dumps(result.to_dict(), indent=1)
        if as_json
        else f"{result.summary()}\n\nwritten to {directory}/"
    )
    raise typer.Exit(0 if result.passed else 1)


@app.command()
def actuators(
    name: Annotated[
        str | None, typer.Argument(help="a shipped machine or a TOML data sheet")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """List the shipped machines, or print one machine's parameters, derived quantities and
    source."""
    if name is None:
        names = hydroctl.list_actuators()
        typer.echo(json.dumps(names) if as_json else "\n".join(names))
        return
    loaded = _machine(name)
    from .report.summary import describe, machine_to_dict

    machine = hydroctl.characterize(loaded)
    typer.echo(json.dumps(machine_to_dict(machine), indent=1) if as_json else describe(machine))


@app.command()
def validate(
    schedule: Annotated[
        list[Path],
        typer.Argument(help="a schedule.json that `hydroctl design` wrote; several to synchronize"),
    ],
    variants: Annotated[
        str, typer.Option(help="machines to try: nominal, design or box")
    ] = "nominal",
    count: Annotated[int, typer.Option(help="run this many random cases instead", min=0)] = 0,
    seed: Annotated[int, typer.Option(help="seed of the random cases", min=0)] = 0,
    directory: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="keep finished cases here; a new run resumes"),
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="run them on a dask cluster, such as tcp://host:8786")
    ] = None,
    replay: Annotated[
        int | None,
        typer.Option(help="run one random case again, by its seed, and print its metrics", min=0),
    ] = None,
    synchronize: Annotated[
        bool,
        typer.Option("--synchronize", help="move one cylinder per schedule along one reference"),
    ] = False,
    coupling: Annotated[
        str, typer.Option(help="of --synchronize: independent, master-slave, mean or ring")
    ] = "mean",
    tolerance: Annotated[
        float, typer.Option(help="of --synchronize: largest rms of max - min, in m", min=0)
    ] = 1e-4,
) -> None:
    """Try a schedule on the nonlinear plant of the machine that it was designed for; or several on
    theirs, together."""
    from . import validation

    if synchronize:
        _synchronize(schedule, coupling, tolerance, count, seed)
    if len(schedule) > 1:
        raise hydroctl.InputError(
            f"{len(schedule)} schedules were given; add --synchronize, or validate one at a time."
        )
    loaded = hydroctl.load_schedule(schedule[0])
    if replay is not None:
        machine, scenario, trajectory = validation.replay(loaded.machine, loaded, replay)
        metrics = validation.measure(machine, scenario, trajectory)
        typer.echo(
            "\n".join(
                [
                    scenario.name,
                    *(f"  {name} {value:.6g}" for name, value in asdict(metrics).items()),
                ]
            )
        )
    elif count:
        with (
            interruptible(directory) as kept,
            validation.connected(scheduler) if scheduler else nullcontext() as executor,
            progress_bar() as advance,
        ):
            settings: dict[str, Any] = {
                "count": count,
                "seed": seed,
                "executor": executor,
                "directory": kept,
                "on_progress": advance,
            }
            settings["chunk_size"] = min(1024, 32 * math.ceil(count / 1024))
            result = validation.campaign(loaded.machine, loaded, **settings)
        scale = validation.scale_of(loaded.machine, loaded.loop)
        verdicts = result.verdicts(
            validation.default_requirements(scale, loaded.loop, Mt=loaded.specification.Mt)
        )
        typer.echo(
            "\n".join(
                [f"{count} random cases, seed {seed}", *(f"  {verdict}" for verdict in verdicts)]
            )
        )
        raise typer.Exit(0 if all(verdict.passed for verdict in verdicts) else 1)
    else:
        report = validation.validate(loaded.machine, loaded, variants=variants)
        typer.echo(report.summary())
        raise typer.Exit(0 if report.passed else 1)


def _synchronize(
    paths: list[Path], coupling: str, tolerance: float, count: int, seed: int
) -> NoReturn:
    """The standard motion of the schedules' machines, or random cases of it."""
    from . import synchronization

    schedules = [hydroctl.load_schedule(path) for path in paths]
    machines = [schedule.machine for schedule in schedules]
    with stage_bar(3) as begin:
        begin("coupling")
        designed = synchronization.design_coupling(machines, schedules, coupling)
        assert designed.evidence is not None  # a coupling that was designed has it
        profile, loads = synchronization.standard_motion(machines, Ts=schedules[0].Ts)
        given: dict[str, Any] = {"coupling": designed, "load_forces": loads}
        begin("motion")
        result = hydroctl.synchronize(machines, schedules, profile, **given)
        if count:
            begin("random cases")
            cases = synchronization.campaign(
                machines, schedules, profile, count=count, seed=seed, **given
            )
    typer.echo(result.summary())
    rms, completed = result.metrics.rms, result.completed
    if count:
        worst = cases.worst()
        rms, completed = (
            max(rms, float(cases.metrics["rms"][worst])),
            completed and bool(cases.completed.all()),
        )
        failed = int((~cases.completed).sum())
        typer.echo(
            f"{count} random cases, seed {seed}: {failed} failed, worst rms {1e3 * rms:.4f} mm"
            f" (case {worst})"
        )
    reached, allowed = apart(rms, tolerance, digits=4, factor=1e3)
    judged = {
        f"rms {reached} mm, at most {allowed} mm allowed": rms <= tolerance,
        "every motion reaches its end": completed,
        "the coupling keeps its limit": designed.evidence.kept,
    }
    typer.echo(
        "\n".join(
            f"{'pass' if passed else 'FAIL'}  {requirement}"
            for requirement, passed in judged.items()
        )
    )
    raise typer.Exit(0 if all(judged.values()) else 1)


@app.command()
def identify(
    record: Annotated[Path, typer.Argument(help="a CSV file with columns t, x, v and y")],
    machine: Annotated[
        str | None,
        typer.Option(help="a shipped machine or a data sheet, for its areas and volumes"),
    ] = None,
    basis: Annotated[
        str, typer.Option(help="volume, volume-leakage, quadratic, paper or constant")
    ] = "volume",
    method: Annotated[str, typer.Option(help="srivc or least-squares")] = "srivc",
    settling: Annotated[
        float, typer.Option(help="s at full opening to leave out after each reversal")
    ] = 0.0,
    column: Annotated[
        list[str] | None, typer.Option(help="name of a column in the file, such as x=valve")
    ] = None,
    unit: Annotated[list[str] | None, typer.Option(help="unit of a column, such as v=mm/s")] = None,
) -> None:
    """Identify the quasi-linear model from a measured record."""
    data = hydroctl.read_record(
        record, columns=_pairs("--column", column), units=_pairs("--unit", unit)
    )
    actuator = None if machine is None else _machine(machine)
    settings: dict[str, Any] = {
        "basis": basis,
        "actuator": actuator,
        "method": method,
        "settling": settling,
    }
    found = hydroctl.identify(
        data.t, data.x, data.v, data.y, **settings, progress=_tell if sys.stderr.isatty() else None
    )
    fit = (
        f"fit {found.fit.estimation:.2f} %, held out {found.fit.hold_out:.2f} %, one step"
        f" {found.fit.one_step:.2f} %"
    )
    typer.echo("\n".join([fit, found.model.table(), *found.restrictions]))


@app.command()
def report(
    schedule: Annotated[Path, typer.Argument(help="a schedule.json that `hydroctl design` wrote")],
    path: Annotated[Path, typer.Option("-o", "--output", help="the HTML file to write")] = Path(
        "report.html"
    ),
) -> None:
    """Write the report page of a schedule: verdicts, maps, motions, and an explorer of its loop, in
    one HTML file."""
    from .files import make_directory
    from .report import write_report
    from .validation import against_rivals, fixed_rival

    loaded = hydroctl.load_schedule(schedule)
    make_directory(path.parent)
    with stage_bar(4) as begin:
        begin("validation")
        validation = hydroctl.validate(loaded.machine, loaded)
        begin("fixed regulator")
        fixed = fixed_rival(loaded, loaded.structure)
        begin("comparison")
        comparison = against_rivals(loaded, fixed)
        begin("page")
        write_report(path, loaded, validation, beside={"fixed": fixed}, comparison=comparison)
    typer.echo(f"written to {path}")


@app.command()
def export(
    schedule: Annotated[Path, typer.Argument(help="a schedule.json that `hydroctl design` wrote")],
    to: Annotated[
        Target,
        typer.Option(
            help="C99, structured text, MATLAB tables, FMUs, CSV, or the schedule file itself"
        ),
    ],
    directory: Annotated[Path, typer.Option("-o", "--output", help="where the files go")] = Path(
        "hydroctl-out"
    ),
    single: Annotated[
        bool, typer.Option("--float", help="single precision: float in C, REAL in structured text")
    ] = False,
    force: Annotated[
        bool, typer.Option(help="export even if the schedule fails its checks; the files say so")
    ] = False,
) -> None:
    """Export a schedule to the machine; files are named after the schedule's."""
    from .files import make_directory

    path = directory / f"{schedule.stem}.{to.value}"
    loaded = hydroctl.load_schedule(schedule)
    make_directory(directory)
    real: Literal["double", "float"] = "float" if single else "double"
    for written in hydroctl.export_schedule(loaded, path, to.value, real=real, force=force):
        typer.echo(written)


@app.command()
def schema() -> None:
    """Print the JSON Schema (draft 2020-12) of schedule files."""
    from .schedule.document import SCHEMA_FILE

    typer.echo(SCHEMA_FILE.read_text(), nl=False)


def _pairs(option: str, given: list[str] | None) -> dict[str, str]:
    pairs = [text.partition("=") for text in given or ()]
    if wrong := [name for name, sign, value in pairs if not (sign and value)]:
        raise hydroctl.InputError(f"{option} {wrong[0]} must have the form name=value.")
    return {name: value for name, _, value in pairs}


def _tell(iteration: int, fit: float) -> None:
    typer.echo(f"iteration {iteration}: fit {fit:.2f} %", err=True)


def _machine(name: str) -> hydroctl.Actuator:
    with without_dask():
        return hydroctl.load_actuator(name)


def main() -> None:
    """Entry point: turns the project's errors into one message and an exit code."""
    try:
        app()
    except hydroctl.InputError as error:
        sys.exit(_complain(error, 2))
    except hydroctl.HydroctlError as error:
        sys.exit(_complain(error, 1))


def _complain(error: Exception, code: int) -> int:
    typer.echo(f"hydroctl: {error}", err=True)
    return code


if __name__ == "__main__":
    main()
