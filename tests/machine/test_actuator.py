"""Checks of the parameters, copies, fingerprints, the data sheet written out."""

import dataclasses
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machines import DIFFERENTIAL, REFERENCE, dry_machines, machines

import hydroctl as hc
from hydroctl.machine.actuator import PARAMETERS


def _with(**changes):
    fields = {f.name: getattr(DIFFERENTIAL, f.name) for f in dataclasses.fields(DIFFERENTIAL)}
    return hc.Actuator(**fields | changes)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"mass": 0.0}, "mass = 0 kg must be above 0"),
        ({"mass": -1}, "mass = -1 kg must be above 0"),
        ({"leakage": -1e-13}, "leakage = -1e-13 .* must be at least 0"),
        ({"stroke": math.nan}, "stroke = nan is not finite"),
        ({"bulk_modulus": math.inf}, "bulk_modulus = inf is not finite"),
        ({"mass": 10**400}, "mass = inf is not finite"),
        ({"area_a": True}, "area_a = True is not a number"),
        ({"area_a": "large"}, "area_a = 'large' is not a number"),
        ({"supply_pressure": None}, "supply_pressure = None is not a number"),
        ({"dead_band": 1.0}, "dead_band = 1 must be below 1"),
        ({"creep_speed": 0.0}, "creep_speed = 0 m/s must be above 0"),
        ({"volume_b": 1e-3}, "volume_b = 0.001 m.3 is used up before the end of the stroke"),
        ({"tank_pressure": 210e5}, "tank_pressure = 2.1e.07 Pa is not below supply_pressure"),
        (
            {"coulomb_friction": 200.0, "breakaway_friction": 100.0},
            "breakaway_friction = 100 N is below coulomb_friction",
        ),
        ({"breakaway_friction": 100.0}, "stribeck_speed is missing"),
        ({"valve_natural_frequency": 300.0}, "valve_damping is missing"),
        ({"valve_damping": 0.7}, "valve_damping = 0.7 needs valve_natural_frequency"),
        ({"valve_rate_limit": 10.0}, "valve_rate_limit = 10 needs valve_natural_frequency"),
        ({"name": 7}, "name = 7 is not a text"),
        ({"inclination": 90.0}, "inclination = 90 rad must be at most 1.5708"),
        ({"inclination": -2.0}, "inclination = -2 rad must be at least -1.5708"),
        ({"pressure_rating": 0.0}, "pressure_rating = 0 Pa must be above 0"),
    ],
)
def test_a_fault_names_field_value_and_way_out(changes, words):
    with pytest.raises(hc.InputError, match=words) as caught:
        _with(**changes)
    assert len(caught.value.faults) == 1


def test_numbers_of_numpy_become_floats():
    actuator = _with(mass=np.int64(200), stroke=np.float32(1.0))
    assert (type(actuator.mass), type(actuator.stroke)) == (float, float)


def test_all_faults_come_at_once():
    with pytest.raises(hc.InputError) as caught:
        _with(mass=-1.0, stroke=0.0, leakage=math.nan)
    assert len(caught.value.faults) == 3


def test_replace_refuses_an_unknown_name_and_names_the_nearest():
    with pytest.raises(
        hc.InputError, match="parameter 'bulk_module' is unknown; did you mean 'bulk_modulus'"
    ):
        REFERENCE.replace(bulk_module=1e9)


def test_a_parameter_that_follows_another_keeps_following_it_in_a_copy():
    assert REFERENCE.replace(flow_coefficient=2e-6).flow_coefficient_b == 2e-6
    assert REFERENCE.replace(coulomb_friction=50.0).breakaway_friction == 50.0
    unequal = REFERENCE.replace(flow_coefficient_b=5e-7)
    assert unequal.replace(flow_coefficient=2e-6).flow_coefficient_b == 5e-7


def test_the_fingerprint_sees_the_physics_and_not_the_texts():
    assert REFERENCE.replace(name="other", note="other").fingerprint() == REFERENCE.fingerprint()
    for name, value in REFERENCE.parameters().items():
        if value and name != "flow_coefficient":
            assert (
                REFERENCE.replace(**{name: value * (1 + 1e-15)}).fingerprint()
                != REFERENCE.fingerprint()
            )


def test_what_a_machine_does_not_state_changes_no_fingerprint_of_before():
    """The shipped machines as files of the first version knew them; the number is that of such a
    file."""
    crane = hc.load_actuator("crane_80_45")
    assert crane.fingerprint() == "66e48a2df5998dd9bbcc0bbef075ea6b65ff966e910407d390483f30bf692ecd"
    assert (
        crane.replace(inclination=-0.0, pressure_rating=None).fingerprint() == crane.fingerprint()
    )
    stated = [crane, crane.replace(inclination=0.5), crane.replace(pressure_rating=250e5)]
    assert len({machine.fingerprint() for machine in stated}) == 3


def test_the_constant_load_is_the_load_and_the_weight_along_the_axis():
    lift = DIFFERENTIAL.replace(mass=3000.0, load_force=-500.0, inclination=math.pi / 6)
    assert lift.constant_load == pytest.approx(-500.0 + 3000.0 * 9.80665 * 0.5, rel=1e-15)
    assert lift.replace(inclination=-math.pi / 2).constant_load == pytest.approx(
        -500.0 - 29419.95, rel=1e-15
    )
    assert DIFFERENTIAL.replace(load_force=70.0).constant_load == 70.0


def test_an_actuator_cannot_change():
    with pytest.raises(dataclasses.FrozenInstanceError):
        REFERENCE.mass = 1.0


def test_every_parameter_says_its_unit_and_what_it_is():
    assert all(
        spec.metadata["text"] and isinstance(spec.metadata["unit"], str)
        for spec in PARAMETERS.values()
    )


def test_faults_between_numbers_of_any_kind_are_told():
    for changes in (
        {"area_b": 10**300, "stroke": 10**300},
        {"tank_pressure": Fraction(10**9, 3), "supply_pressure": Fraction(1, 3)},
        {"tank_pressure": np.float32(1e9)},
    ):
        with pytest.raises(hc.InputError, match=r"is used up|is not below supply_pressure"):
            REFERENCE.replace(**changes)


@settings(max_examples=60, deadline=None)
@given(
    machine=st.one_of(machines(), dry_machines()),
    name=st.text(max_size=20),
    note=st.text(max_size=40),
)
def test_an_actuator_written_as_a_data_sheet_reads_back_bit_for_bit(
    machine, name, note, tmp_path_factory
):
    named = machine.replace(
        name=name or "unnamed", note=note, inclination=-0.3, pressure_rating=251e5
    )
    path = hc.save_actuator(named, tmp_path_factory.getbasetemp() / "machine.toml")
    assert hc.load_actuator(path) == named


@pytest.mark.parametrize("name", hc.list_actuators())
def test_a_shipped_machine_reads_back_bit_for_bit(name, tmp_path):
    actuator = hc.load_actuator(name)
    assert hc.load_actuator(hc.save_actuator(actuator, tmp_path / "machine.toml")) == actuator
