"""Coarse and fine substeps: which lanes take which, and how far either is from the limit."""

import numpy as np
import pytest

from auv_fault_env import integration, layout, physics
from auv_fault_env.parameters import PRESETS, nominal

from . import reference
from .test_physics import shafts_of

N_LANES = layout.LANES
LIMIT = integration.graded_substeps(64, 1.75)
# relative errors count from 0.05 m/s and from 1 rad/s on
LEAST = np.array([0.05, 1.0, 1.0])[:, None]


def scratch_of_random_samples(preset, seed):
    """Motions, voltages and faults at random, those of a vehicle that steers hard among them."""
    rng = np.random.default_rng(seed)
    vehicle = PRESETS[preset]
    constants = physics.plant_constants(vehicle)
    scratch = np.zeros((layout.N_SCRATCH, N_LANES))
    fastest = vehicle.maximum_voltage / vehicle.torque_constant
    for lane in range(N_LANES):
        names = rng.choice(reference.PLANT_FAULTS, rng.integers(0, 4), replace=False)
        parameters = reference.within_band(nominal(vehicle), rng)
        severities = {str(name): rng.uniform() for name in names}
        parameters = reference.faulted(parameters, severities)
        voltages = vehicle.maximum_voltage * rng.choice([0.0, 0.3, 0.5, 1.0], 2)
        shafts = shafts_of(parameters)
        pairs = zip(shafts, voltages, strict=True)
        motors = [physics.motor(shaft, constants, voltage) for shaft, voltage in pairs]
        shaft_speeds = 0.8 * fastest * rng.choice([0.0, 0.05, 0.4, 1.0], 2) * rng.uniform(0.9, 1)
        speed = rng.uniform(0.0, vehicle.maximum_speed)
        drag = parameters["alpha"] + 0.1 * rng.uniform() * parameters["gamma"]
        motion = (speed, *shaft_speeds, 0.0, 0.0)
        values = (*motion, *motors[0], *motors[1], drag, 0.002 * rng.standard_normal())
        scratch[: layout.MOTION, lane] = values
    return scratch


def motions(scratch, substeps):
    """Motions after the substeps, (5, n_lanes), and misfits."""
    scratch = scratch.copy()
    integration.take_substeps(scratch.ravel(), N_LANES, substeps)
    return scratch[layout.MOTION : layout.MISFIT], scratch[layout.MISFIT]


def error(got, exact):
    """Relative error of surge speed and shaft speeds, (3, n_lanes)."""
    return np.abs(got - exact)[:3] / np.maximum(np.abs(exact[:3]), LEAST)


@pytest.mark.parametrize("preset", PRESETS)
def test_lanes_with_a_misfit_take_the_fine_substeps_and_the_others_do_not_need_them(preset):
    scratch = scratch_of_random_samples(preset, seed=1)
    coarse, misfit = motions(scratch, integration.COARSE)
    fine, _ = motions(scratch, integration.FINE)
    exact, _ = motions(scratch, LIMIT)
    needs_fine = misfit > integration.ALLOWED_MISFIT
    assert 0.05 < needs_fine.mean() < 0.95
    integration.advance_motions(scratch.ravel(), N_LANES)
    got = scratch[layout.MOTION : layout.MISFIT]
    np.testing.assert_array_equal(got, np.where(needs_fine, fine, coarse))
    assert error(got, exact).max() < 1e-6
    assert error(coarse, exact)[:, ~needs_fine].max() < 3e-7
    assert error(coarse, exact).max() > 1e-6


def test_a_lane_does_not_depend_on_its_neighbours():
    scratch = scratch_of_random_samples("thesis1992", seed=2)
    together = scratch.copy()
    integration.advance_motions(together.ravel(), N_LANES)
    for lane in range(0, N_LANES, 7):
        alone = np.zeros_like(scratch)
        alone[:, 0] = scratch[:, lane]
        integration.advance_motions(alone.ravel(), 1)
        np.testing.assert_array_equal(alone[:, 0], together[:, lane])


def test_a_motion_that_is_not_a_number_spoils_its_lane_alone():
    scratch = scratch_of_random_samples("thesis1992", seed=3)
    expected = scratch.copy()
    integration.advance_motions(expected.ravel(), N_LANES)
    scratch[layout.START, 5] = np.nan
    integration.advance_motions(scratch.ravel(), N_LANES)
    others = np.arange(N_LANES) != 5
    rows = slice(layout.MOTION, layout.MISFIT)
    np.testing.assert_array_equal(scratch[rows, others], expected[rows, others])
    assert np.isnan(scratch[layout.MOTION, 5])
