"""The FMUs: accepted by FMPy, and in its hands the same closed loop as the simulation."""

import ctypes
import shutil

import numpy as np
import pytest
from exports import CASES, HOSTILE, OVERLAPPED, REFERENCE, exported

import hydroctl as hc
from hydroctl.export.contents import contents_of
from hydroctl.export.fmu import plant_fmu, regulator_fmu
from hydroctl.model import chambers, plant, spool, valve

fmpy = pytest.importorskip("fmpy")
COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")

EVERYTHING = OVERLAPPED.replace(
    coulomb_friction=8e3,
    breakaway_friction=1.2e4,
    stribeck_speed=5e-3,
    load_force=2e4,
    inclination=-0.4,
    tank_pressure=2e5,
    end_stop_stiffness=1e9,
    end_stop_damping=0.4,
    valve_natural_frequency=500.0,
    valve_damping=0.7,
    valve_rate_limit=60.0,
)


class Unit:
    """One instance in FMPy, its variables by name."""

    def __init__(self, path, directory, **starts):
        from fmpy.fmi2 import FMU2Slave

        description = fmpy.read_model_description(path)
        self.references = {
            variable.name: variable.valueReference for variable in description.modelVariables
        }
        fmpy.extract(path, directory)
        unit = {"guid": description.guid, "unzipDirectory": str(directory), "instanceName": "one"}
        self.fmu = FMU2Slave(**unit, modelIdentifier=description.coSimulation.modelIdentifier)
        self.fmu.instantiate()
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.set(**starts)
        self.fmu.exitInitializationMode()

    def set(self, **values):
        self.fmu.setReal([self.references[name] for name in values], list(values.values()))

    def get(self, *names):
        return self.fmu.getReal([self.references[name] for name in names])

    def close(self):
        self.fmu.terminate()
        self.fmu.freeInstance()


def scenario(loop, samples=400):
    rng = np.random.default_rng(3)
    steps = np.repeat(rng.uniform(-1.0, 1.0, samples // 50), 50)
    reference = 0.05 * steps if loop == "velocity" else 0.25 + 0.005 * steps
    load = 1e5 * np.repeat(rng.uniform(-1.0, 1.0, samples // 100), 100)
    return hc.Scenario(
        name="random",
        loop=loop,
        Ts=1e-3,
        reference=reference,
        y=0.25,
        v_ref=0.01 * steps,
        load_force=load,
    )


@pytest.mark.parametrize(
    ("case", "delay", "actuator"),
    [
        ("velocity pi+notch", 1, REFERENCE),
        ("velocity p", 0, REFERENCE),
        ("position pid+lead-lag+notch", 2, EVERYTHING),
    ],
)
def test_the_closed_loop_of_both_units_is_that_of_the_simulation(tmp_path, case, delay, actuator):
    schedule = exported(**CASES[case] | {"delay_samples": delay, "actuator": actuator})
    written = hc.export_schedule(schedule, tmp_path / "press.fmu", "fmu", force=True)
    from fmpy.validation import validate_fmu

    assert [validate_fmu(str(path)) for path in written] == [[], []]
    given = scenario(schedule.loop)
    expected = hc.simulate_closed_loop(actuator, schedule, given)
    states = ("p_a", "p_b", "v", "y")
    starts = {f"{name}_start": getattr(expected, name)[0] for name in states}
    regulator, motion = (
        Unit(written[0], tmp_path / "regulator"),
        Unit(written[1], tmp_path / "plant", **starts),
    )
    rows = []
    for k, time in enumerate(given.t):
        rows.append(motion.get(*states))
        regulator.set(
            reference=given.reference[k],
            v_ref=given.v_ref[k],
            **dict(zip(states, rows[-1], strict=True)),
        )
        motion.set(x=regulator.get("x")[0], load_force=given.load_force[k])
        rows[-1].extend(motion.get("x", "spool"))
        regulator.fmu.doStep(time, given.Ts)
        motion.fmu.doStep(time, given.Ts)
    for unit in (regulator, motion):
        unit.close()
    for name, values in zip((*states, "x", "spool"), np.array(rows).T, strict=True):
        wanted = getattr(expected, name)
        assert np.abs(values - wanted).max() <= 1e-6 * np.ptp(wanted), name
    assert np.ptp(expected.x) > 0.2


@pytest.mark.parametrize(
    "machine",
    [REFERENCE, EVERYTHING, hc.load_actuator("fast_50_28")],
    ids=lambda machine: machine.name,
)
def test_the_plant_in_c_has_the_rates_of_the_plant(tmp_path, machine):
    path = tmp_path / "plant_x.fmu"
    path.write_bytes(plant_fmu(machine, "plant_x"))
    fmpy.extract(path, tmp_path / "unit")
    (library,) = (tmp_path / "unit" / "binaries").glob("*/plant_x.*")
    slope = ctypes.CDLL(str(library)).plant_slope
    slope.argtypes = [
        ctypes.POINTER(ctypes.c_double),
        ctypes.c_double,
        ctypes.c_double,
        ctypes.POINTER(ctypes.c_double),
    ]
    slope.restype = None
    ideal, p, rng = (
        machine.valve_natural_frequency is None,
        plant.parameters(machine),
        np.random.default_rng(0),
    )
    for _ in range(300):
        p_a, p_b = machine.supply_pressure * rng.uniform(-0.2, 1.2, 2)
        v, y = rng.uniform(-0.3, 0.3), machine.stroke * rng.uniform(-0.01, 1.01)
        x, position, rate, load = (
            *rng.uniform(-1.2, 1.2, 2),
            rng.uniform(-80.0, 80.0),
            rng.uniform(-1e5, 1e5),
        )
        x = np.clip(x, -1.0, 1.0) if ideal else x
        opening = valve.effective_opening(x if ideal else position, p.valve)
        expected = [*plant.rates(p_a, p_b, v, y, opening, load, p), v]
        state = [p_a, p_b, v, y]
        if not ideal:
            expected += spool.rates(position, rate, x, p.spool)
            state += [position, rate]
        found = (ctypes.c_double * len(state))()
        slope((ctypes.c_double * len(state))(*state), x, load, found)
        stiff = max(chambers.stiffnesses(y, p.chambers))
        scale = [stiff * machine.area_a * 0.3] * 2 + [
            machine.area_a * machine.supply_pressure / machine.mass,
            1.0,
            80.0,
            1e5,
        ]
        assert (np.abs(np.subtract(found, expected)) <= 1e-13 * np.array(scale[: len(state)])).all()


def test_a_unit_stands_still_at_a_fault_and_says_why(tmp_path):
    schedule = exported()
    path = tmp_path / "press.fmu"
    path.write_bytes(regulator_fmu(contents_of(schedule, force=True), "press"))
    unit = Unit(path, tmp_path / "unit")
    from fmpy.fmi1 import FMICallException

    with pytest.raises(FMICallException):
        unit.fmu.doStep(0.0, 0.4e-3)
    unit.close()


def test_names_from_files_change_nothing_but_descriptions(tmp_path):
    path = tmp_path / "press.fmu"
    path.write_bytes(plant_fmu(REFERENCE.replace(name=HOSTILE), "press"))
    assert fmpy.read_model_description(path).modelName == "press"


NO_COMPILER = {"no-such-cc": "cannot be run", "false": "failed", "": "there is no C compiler"}


@pytest.mark.parametrize(("compiler", "message"), NO_COMPILER.items())
def test_without_a_working_compiler_one_sentence_says_so(tmp_path, monkeypatch, compiler, message):
    monkeypatch.setenv("CC", compiler)
    if not compiler:
        monkeypatch.setenv("PATH", "")
    with pytest.raises(hc.InputError, match=message):
        hc.export_plant(REFERENCE, tmp_path / "press.fmu")
    assert list(tmp_path.iterdir()) == []


def test_a_delay_of_a_fraction_of_a_sample_is_refused():
    with pytest.raises(hc.InputError, match="whole samples"):
        regulator_fmu(contents_of(exported(delay_samples=0.5), force=True), "press")
