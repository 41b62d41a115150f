"""The constants: units and sources given, presets as the sources have them, limits that hold."""

import dataclasses
import math

import pytest

from auv_fault_env import CHANNELS, PARAMETERS, PRESETS, Vehicle
from auv_fault_env.parameters import (
    HULL,
    SENSOR,
    SHAFT,
    SIDES,
    SIGNAL,
    blade_pair_inertia,
    describe,
    nominal,
    vehicle_of,
)

FOOT = 0.3048
OUNCE_INCH = 28.349523125e-3 * 9.80665 * 0.0254
NUMBERS = [spec.name for spec in dataclasses.fields(Vehicle) if spec.metadata]
every_constant = pytest.mark.parametrize("name", NUMBERS)


@every_constant
def test_every_constant_has_unit_meaning_source_and_limits(name):
    meta = Vehicle.__dataclass_fields__[name].metadata
    assert meta["unit"] and meta["about"] and meta["source"][:1] in "TNHE"
    assert meta["low"] <= getattr(PRESETS["thesis1992"], name) <= meta["high"]
    assert 0.0 <= meta["band"] < 1.0


@every_constant
@pytest.mark.parametrize("bad", ["below", "above", "nan", "text", "none", "list"])
def test_values_outside_the_limits_are_refused(name, bad):
    meta = Vehicle.__dataclass_fields__[name].metadata
    low = meta["low"]
    high = meta["high"]
    values = dict(
        below=low - 1e-6,
        above=high + 0.01 * abs(high) + 1e-6,
        nan=math.nan,
        text="a lot",
        none=None,
        list=[low],
    )
    with pytest.raises(ValueError, match=rf"^{name}: got .+; allowed is a number from .+ to .+; "):
        dataclasses.replace(PRESETS["thesis1992"], **{name: values[bad]})


@pytest.mark.parametrize(
    ("name", "value"),
    {
        "alpha": -0.0333 / 1.35 / FOOT,
        "beta": 2.1906e-7 / 0.65 * FOOT,
        "gamma": -0.0722 / FOOT,
        "c1": 0.0465,
        "c2": 0.0285,
        "resistance": 1.01,
        "torque_constant": 8.67 * OUNCE_INCH,
        "coulomb_friction": 1.79 * OUNCE_INCH,
        "diameter": 0.1016,
        "wake_fraction": 0.1,
        "maximum_voltage": 24.0,
    }.items(),
)
def test_thesis_preset_has_the_printed_values(name, value):
    assert getattr(PRESETS["thesis1992"], name) == pytest.approx(value, rel=1e-9)


def test_npsnet_preset_differs_in_the_hull_alone():
    one, two = (dataclasses.asdict(PRESETS[name]) for name in ("thesis1992", "npsnet1995"))
    assert {key for key in one if one[key] != two[key]} == {"name", "alpha", "beta"}
    assert two["alpha"] == pytest.approx(-0.0276 / FOOT) and two["beta"] == pytest.approx(
        2.252e-7 * FOOT
    )


def test_motor_agrees_with_the_stall_and_no_load_currents_of_appendix_a():
    motor = PRESETS["thesis1992"]
    assert motor.maximum_voltage / motor.resistance == pytest.approx(23.8, abs=0.05)
    assert motor.coulomb_friction / motor.torque_constant == pytest.approx(0.21, abs=0.005)


def test_inertia_of_the_blades_converges_to_the_integral():
    many = blade_pair_inertia(
        hub=0.0, tip=0.05, chord=0.02, thickness=0.002, density=1000.0, elements=10_000
    )
    assert many == pytest.approx(2 * 1000.0 * 0.02 * 0.002 * 0.05**3 / 3, rel=1e-6)
    assert blade_pair_inertia(
        hub=0.0, tip=0.05, chord=0.02, thickness=0.002, density=1000.0
    ) == pytest.approx(many)


def test_parameters_of_a_lane_are_hull_shafts_and_sensors():
    shafts = [f"{side}_{name}" for side in SIDES for name in SHAFT]
    sensors = [f"{channel}_{name}" for channel in list(CHANNELS)[4:] for name in SENSOR]
    signals = [f"{channel}_{name}" for channel in list(CHANNELS)[4:] for name in SIGNAL]
    names = [*HULL, *shafts, *sensors, *signals]
    assert list(PARAMETERS) == names == list(nominal(PRESETS["thesis1992"]))


def test_healthy_bands_are_those_of_the_design():
    bands = {name: spec.band for name, spec in PARAMETERS.items() if spec.band}
    side = dict(beta=0.03, c1=0.03, c2=0.03, resistance=0.02, torque_constant=0.01)
    side |= dict(coulomb_friction=0.1, viscous_friction=0.1)
    assert bands == {"alpha": 0.05} | {
        f"{place}_{name}": band for place in SIDES for name, band in side.items()
    }


def test_nominal_vehicle_shares_the_thrust_and_scales_the_noise():
    vehicle = PRESETS["thesis1992"]
    values = nominal(vehicle)
    silent = nominal(vehicle, sensor_noise=0.0)
    assert values["port_beta"] + values["starboard_beta"] == vehicle.beta
    assert nominal(vehicle, 2.0)["port_rpm_noise"] == 2.0 * CHANNELS["port_rpm"].noise > 0.0
    assert {key for key in values if values[key] != silent[key]} == {
        f"{name}_noise" for name in list(CHANNELS)[4:]
    }


def test_description_lists_every_constant_with_its_source():
    rows = describe(PRESETS["npsnet1995"])
    assert [row["name"] for row in rows] == NUMBERS
    assert all(set(row) == {"name", "value", "unit", "about", "source"} for row in rows)
    assert rows[0]["value"] == PRESETS["npsnet1995"].alpha


def test_vehicles_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        PRESETS["thesis1992"].alpha = -0.2


def test_vehicle_of_a_preset():
    assert vehicle_of("npsnet1995") is PRESETS["npsnet1995"]
    mine = dataclasses.replace(PRESETS["thesis1992"], name="mine")
    assert vehicle_of(mine) is mine
