import json
from dataclasses import replace

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.faults import classes
from auv_fault_env.fleet import Fleet
from diagnosers.networks.features import feature_names
from training.learning.episode_sets import features_of
from training.metrics import sample_at
from training.rollouts import roll_out
from training.studies import ablation, ablation_runs, ablation_trials
from training.studies.ablation_inputs import (
    INPUTS,
    SAMPLES,
    FeatureSet,
    by_half_seconds,
    columns,
    group_of,
)
from training.studies.ablation_network import AblationTraining, Architecture, DecidedLanes
from training.studies.ablation_trials import TrialFeatures, record_of

N_LANES = 4
SMALL = Architecture(True, 8)


@pytest.fixture(scope="module")
def observations():
    return roll_out(Fleet(N_LANES), range(N_LANES), 63).observations


def test_raw_inputs_are_readings_alone_and_filters_have_none():
    names = feature_names(classes())
    raw = {names[k].partition(":")[0] for k in columns("raw")}
    assert raw == set(CHANNELS)
    of_filters = [names[k] for k in columns("both filters")]
    assert not any(name in CHANNELS or "residual" in name for name in of_filters)
    # a signal named after a reading is a physical residual, part of no group
    assert {f"{name}:now" for name in READINGS}.isdisjoint(of_filters)
    assert group_of("port_voltage:now") is None
    assert group_of("port_voltage:step") == "raw"
    assert group_of("port_voltage_innovation:now") == "motor"


def test_inputs_join_without_overlap():
    chosen = {name: set(columns(name).tolist()) for name in INPUTS}
    assert chosen["hull filter"] | chosen["motor filter"] == chosen["both filters"]
    assert not chosen["hull filter"] & chosen["motor filter"]
    assert chosen["raw"] | chosen["both filters"] == chosen["raw and filters"]
    assert chosen["raw and filters"] | chosen["bank"] == chosen["bank, raw and filters"]


def test_a_half_second_is_the_mean_of_its_samples(observations):
    features = features_of(observations)
    averaged = by_half_seconds(observations)
    assert averaged.shape == (63 // SAMPLES, N_LANES, features.shape[-1])
    expected = features[SAMPLES : 2 * SAMPLES].mean(axis=0)
    is_step = np.array([name.endswith(":step") for name in feature_names(classes())])
    assert averaged[1][:, ~is_step] == pytest.approx(expected[:, ~is_step], abs=0.01)
    sizes = np.abs(features[SAMPLES : 2 * SAMPLES]).mean(axis=0)
    assert averaged[1][:, is_step] == pytest.approx(sizes[:, is_step], abs=0.01)


def trial_of(n_samples):
    lengths = np.full(N_LANES, n_samples)
    instants = np.full((1, N_LANES), n_samples - 1)
    return TrialFeatures("faulty", None, lengths, instants, None)


def test_no_belief_uses_a_later_sample(observations):
    training = AblationTraining("raw and filters", SMALL, 0)
    changed = observations.copy()
    changed[42:] += 1.0
    records = []
    for readings in (observations, changed):
        features = by_half_seconds(readings)[:, :, training.columns]
        records.append(record_of(training.log_probability(features), trial_of(63)))
    before, after = (record.log_normal for record in records)
    assert np.array_equal(before[:42], after[:42])
    assert not np.allclose(before[45:], after[45:])


def test_a_belief_is_held_from_the_end_of_its_half_second():
    log_probability = np.log(np.full((2, N_LANES, len(classes())), 1.0 / len(classes())))
    log_probability[1, :, 0] = -5.0
    record = record_of(log_probability.astype(np.float32), trial_of(12))
    assert record.log_normal[: SAMPLES - 1] == pytest.approx(np.log1p(-ablation_trials.BEFORE))
    assert record.log_normal[SAMPLES - 1 : 2 * SAMPLES - 1] == pytest.approx(
        -np.log(len(classes()))
    )
    assert record.log_normal[2 * SAMPLES - 1 :] == pytest.approx(-5.0)


def learnable(n_lanes, n_inputs):
    """Episodes whose class from the third half second on shows in the first input."""
    random = np.random.default_rng(0)
    label = np.zeros((8, n_lanes), np.uint8)
    label[3:] = random.integers(0, 2, n_lanes)
    features = random.normal(0.0, 0.1, (8, n_lanes, n_inputs)).astype(np.float16)
    features[..., 0] += label
    return FeatureSet(features, label)


def test_a_network_learns_and_its_seed_decides(monkeypatch):
    monkeypatch.setattr("training.studies.ablation_network.BATCH", 32)

    def run(seed):
        training = AblationTraining("hull filter", SMALL, seed)
        episodes = learnable(1024, len(training.columns))
        fault = episodes.label[-1].astype(np.int64)
        faulty = DecidedLanes.at(episodes.features, fault, np.full(1024, 3.9))
        return list(training.run(episodes, episodes, faulty, passes=12, reports=2))

    progress = run(0)
    assert len(progress) == 24 and progress[-1].episodes == 12 * 1024
    assert progress[-1].validation_loss < 0.6 < 1.5 < progress[0].validation_loss
    assert progress[-1].macro_f1 > 0.95
    assert run(0) == progress != run(1)


def test_a_decision_at_ten_seconds_sees_the_half_seconds_before_it():
    lanes = DecidedLanes.at(np.zeros((40, 2, 1)), np.zeros(2), np.array([10.0, 10.3]))
    assert (SAMPLES * (lanes.decided + 1) - 1 <= sample_at(np.array([10.0, 10.3]))).all()
    assert lanes.decided.tolist() == [19, 19]


def result(inputs, seed, isolation):
    history = [
        {"episodes": 512 * k, "training_loss": 1.0, "validation_loss": 1.0, "macro_f1": score}
        for k, score in enumerate((0.2, 0.5, 0.6), start=1)
    ]
    fault = [1, 2, 3, 5, 13]
    return {
        "inputs": inputs,
        "seed": seed,
        "history": history,
        "isolation": isolation,
        "isolated": [True] * 5,
        "detection": isolation,
        "decision": [1, 2, 4, 5, 13, 0],
        "label": [*fault, 0],
        "restricted_mean": float(np.mean(isolation)),
        "ece": 0.1,
        "threshold": -2.0,
        "false_alarms": 1,
        "hours": 2.0,
    }


def test_scores_by_hand():
    networks = [
        result("raw", 0, [2.0, 4.0, 6.0, 8.0, 10.0]),
        result("raw", 1, [4.0, 4.0, 6.0, 8.0, 10.0]),
    ]
    score = ablation.score(networks, seed=0)
    assert score["isolation"] == pytest.approx((3 + 4 + 6 + 8 + 10) / 5)
    assert score["isolation_of_networks"] == [6.0, 6.4]
    assert score["isolation_of_groups"]["hull"] == pytest.approx(3.5)
    assert score["f1_of_groups"]["hull"] == 1.0
    assert score["macro_f1"] == pytest.approx(5 / 6)
    assert score["false_alarms"] == 2 and score["hours"] == 4.0


def test_a_difference_is_of_the_same_lanes():
    first = [result("raw", 0, [2.0, 4.0, 6.0, 8.0, 10.0])]
    second = [result("hull filter", 0, [1.0, 3.0, 9.0, 11.0, 11.0])]
    assert ablation.difference(first, second, "hull", 0)["mean"] == pytest.approx(-1.0)
    assert ablation.difference(first, second, "all", 0)["mean"] == pytest.approx(1.0)


def test_enough_episodes_are_those_of_nine_tenths_of_the_final_score():
    curve = ablation.curves([result("raw", 0, [1.0] * 5)])
    assert curve["episodes_enough"] == 1536.0


@pytest.mark.slow
def test_the_study_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(ablation, "INPUTS", {name: INPUTS[name] for name in ("raw", "bank")})
    monkeypatch.setattr(ablation, "COMPARED", (("raw", "bank"),))
    monkeypatch.setattr(ablation, "NETWORKS", 1)
    monkeypatch.setattr(ablation_runs, "VALIDATION_SETS", 1)
    monkeypatch.setattr(ablation_runs, "VALIDATION_LANES", 36)
    arguments = ablation.AblationStudy(
        output=tmp_path / "out",
        cache=tmp_path / "cache",
        sets=1,
        passes=1,
        hours=0.2,
        every=60,
        workers=1,
    )
    ablation.main(arguments)
    first = json.loads((tmp_path / "out" / "results.json").read_text())

    def not_again(*arguments):
        raise AssertionError("computed again")

    monkeypatch.setattr(ablation_trials, "by_half_seconds", not_again)
    monkeypatch.setattr(AblationTraining, "run", not_again)
    ablation.main(replace(arguments, output=tmp_path / "again"))
    again = json.loads((tmp_path / "again" / "results.json").read_text())
    assert again["scores"] == first["scores"] and set(first["scores"]) == {
        "raw",
        "bank",
        "filter_bank",
    }
