"""The command line: parses, calls, prints. Exit code 0: done and every check passed; 1: a requirement is not met; 2: bad input."""

from __future__ import annotations

import json
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

import hydroctl

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


ActuatorArgument = Annotated[str, typer.Argument(help="a shipped machine (see `hydroctl actuators`) or a TOML data sheet")]
JsonOption = Annotated[bool, typer.Option("--json", help="print results as JSON, for programs")]


@app.command()
def design(
    actuator: ActuatorArgument = "reference",
    directory: Annotated[Path, typer.Option("-o", "--output", help="where the results go")] = Path("hydroctl-out"),
    loop: Annotated[Loop, typer.Option(help="what is controlled")] = Loop.velocity,
    structure: Annotated[str, typer.Option(help="p, pi or pid, each with or without +notch")] = "pi",
    uncertainty: Annotated[str, typer.Option(help="plants the margins must hold on: corners or nominal")] = "corners",
    Ms: Annotated[float, typer.Option("--Ms", help="largest sensitivity")] = 1.6,
    Mt: Annotated[float, typer.Option("--Mt", help="largest complementary sensitivity")] = 1.3,
    sample_time: Annotated[float, typer.Option(help="sample time in s")] = 1e-3,
    delay: Annotated[float, typer.Option(help="delay from measurement to valve command, in samples")] = 1.0,
    as_json: JsonOption = False,
) -> None:
    """Design a gain schedule, prove its margins, try it on the nonlinear plant, and write schedule, figures and summary."""
    from .files import require_writable

    specification = hydroctl.Specification(sample_time=sample_time, delay_samples=delay, Ms=Ms, Mt=Mt, uncertainty=uncertainty)
    machine = hydroctl.load_actuator(actuator)
    require_writable(directory)
    result = hydroctl.design(machine, loop=loop.value, structure=structure, specification=specification)
    result.save(directory)
    typer.echo(json.dumps(result.to_dict(), indent=1) if as_json else f"{result.summary()}\n\nwritten to {directory}/")
    raise typer.Exit(0 if result.passed else 1)


@app.command()
def actuators(
    name: Annotated[str | None, typer.Argument(help="a shipped machine or a TOML data sheet")] = None, as_json: JsonOption = False
) -> None:
    """List the shipped machines, or print one machine's parameters, derived quantities and source."""
    if name is None:
        names = hydroctl.list_actuators()
        typer.echo(json.dumps(names) if as_json else "\n".join(names))
        return
    from .summary import describe, machine_to_dict

    machine = hydroctl.characterize(hydroctl.load_actuator(name))
    typer.echo(json.dumps(machine_to_dict(machine), indent=1) if as_json else describe(machine))


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
