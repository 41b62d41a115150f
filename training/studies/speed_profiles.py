"""Costs of the parts of a step, in the batch and in the single environment."""

import statistics
from collections.abc import Mapping
from functools import partial

import gymnasium as gym
import numpy as np

from auv_fault_env import Fleet, episodes, lanes, layout, sensors
from auv_fault_env.channels import CHANNELS
from auv_fault_env.physics import PlantConstants
from auv_fault_env.truth import SingleLaneTruth
from training.studies.speed_runs import (
    Run,
    batch_run,
    call_run,
    compiled_run,
    rates_in_turn,
    single_run,
)

ENVIRONMENT = "auv_fault_env/Propulsion-v0"
CALLS = 100
STAGE_CALLS = 500
STEPS_BEFORE = 50


def batch_profile(
    seed: int, repeats: int, n_lanes: int, episode: int, seconds: float
) -> dict[str, float]:
    """Cost of the parts of a batch's step on one thread [ns per lane-step]; the sum is the whole.

    `episode` is in steps; `repeats` and `seconds` are those of `rates_in_turn`.
    """
    fleet = Fleet(n_lanes, parallel=False)
    fleet.reset(range(seed, seed + n_lanes))
    stages = _stage_runs(fleet)
    runs = _kernel_runs(fleet) | stages
    lane_steps = n_lanes * episode
    runs["refresh"] = call_run(partial(_update_due_lanes, fleet, episode), lane_steps)
    runs["reset"] = call_run(fleet.reset, lane_steps)
    runs["whole"] = batch_run(ENVIRONMENT, n_lanes, seed, episode + 1, parallel=False)
    cost = _costs(runs, repeats, seconds, "profile of the batch")
    parts = {name: cost[name] for name in stages}
    parts["memory of all blocks, counters"] = cost["kernel"] - sum(parts.values())
    parts["call from Python"] = cost["call"] - cost["kernel"]
    parts["refresh: faults, mission legs"] = cost["refresh"]
    parts["reset"] = cost["reset"]
    rest = cost["whole"] - sum(parts.values())
    return parts | {"Fleet.step, PropulsionVectorEnv.step": rest}


def single_profile(seed: int, repeats: int, episode: int, seconds: float) -> dict[str, float]:
    """Cost of the parts of a single environment's step [ns]; the sum is the whole.

    The parameters are those of `batch_profile`.
    """
    env = gym.make(ENVIRONMENT)
    fleet = Fleet(1)
    fleet.reset([seed])
    action = np.array([0.3, 0.1, 0.0], np.float32)
    fleet_action = action[None].astype(float)
    runs = _kernel_runs(fleet)
    runs["fleet"] = call_run(partial(fleet.step, fleet_action), 1, CALLS)
    runs["truth"] = call_run(SingleLaneTruth(fleet).read, 1, CALLS)
    runs["env"] = call_run(partial(env.unwrapped.step, action), 1, CALLS)
    runs["reset"] = call_run(env.reset, episode)
    runs["whole"] = single_run(env, seed, episode)
    cost = _costs(runs, repeats, seconds, "profile of the single environment")
    parts = {name: cost[name] for name in ("kernel", "truth", "reset")}
    parts["call from Python"] = cost["call"] - cost["kernel"]
    parts["Fleet.step"] = cost["fleet"] - cost["call"]
    parts["PropulsionEnv.step"] = cost["env"] - cost["fleet"] - cost["truth"]
    return parts | {"wrappers of gym.make": cost["whole"] - cost["env"] - cost["reset"]}


def _costs(runs: Mapping[str, Run], repeats: int, seconds: float, about: str) -> dict[str, float]:
    """Median cost of each run [ns per lane-step]."""
    rates = rates_in_turn(runs, repeats, seconds, about)
    return {name: 1e9 / statistics.median(measured) for name, measured in rates.items()}


def _kernel_runs(fleet: Fleet) -> dict[str, Run]:
    """The whole kernel, called from Python (call) and from a compiled loop (kernel)."""
    n_lanes = fleet.n_lanes
    state = fleet.state
    actions = np.full((n_lanes, 3), 0.2)
    observations = np.empty((n_lanes, len(CHANNELS)), np.float32)
    outcomes = np.empty((4, n_lanes))
    inputs = (actions, fleet.limits, fleet.constants)
    arguments = (0, len(state.memory), *state, *inputs, fleet.effects, observations, outcomes)
    calls = 1 + 1000 // n_lanes
    return {
        "call": call_run(partial(lanes.step_blocks, *arguments), n_lanes, calls),
        "kernel": compiled_run(lanes.step_blocks, arguments, n_lanes, calls),
    }


def _stage_runs(fleet: Fleet) -> dict[str, Run]:
    """The stages of the kernel on one block, which stays in the fast caches.

    Each stage has copies of its own: what it is called for again and again leaves the others as
    they are within a mission.
    """
    n_lanes = fleet.n_lanes
    state = fleet.state
    limits = fleet.limits
    constants = PlantConstants(*fleet.constants.tolist())
    actions = np.full((n_lanes, 3), 0.2)
    observations = np.empty((n_lanes, len(CHANNELS)), np.float32)
    outcomes = np.empty((4, n_lanes))
    for _ in range(STEPS_BEFORE):
        fleet.step(actions)
    width = min(n_lanes, layout.LANES)
    block = state.memory[0].copy()
    scratch = np.zeros(layout.N_SCRATCH * layout.LANES)
    lanes.prepare_step(block, scratch, width, constants)
    noise = (width, state.key, state.step)
    stages = {
        lanes.write_commands: (block.copy(), width, actions, limits),
        lanes.run_controllers: (block.copy(), width, constants),
        lanes.sample_normals: (scratch.copy(), *noise),
        lanes.prepare_step: (block.copy(), scratch.copy(), width, constants),
        lanes.advance_motion: (block.copy(), scratch, width),
        lanes.write_true_values: (block.copy(), scratch, width),
        sensors.read_sensors: (block.copy(), scratch, *noise, limits),
        lanes.write_outcomes: (block.copy(), width, constants),
        lanes.copy_results: (block, width, 0, observations, outcomes),
    }
    return {
        stage.__name__: compiled_run(stage, arguments, width, STAGE_CALLS)
        for stage, arguments in stages.items()
    }


def _update_due_lanes(fleet: Fleet, steps: int) -> None:
    """What `Fleet.step` does in an episode for faults and mission legs that begin or end."""
    fleet.state.next_update[:] = 0
    for step in range(steps):
        fleet.state.step[:] = step
        if step >= fleet.state.next_update.min():
            episodes.update_due_lanes(fleet.state, fleet.plan, fleet.catalogue)
