"""Repeated, zero and noisy readings are counted by channel, and forgotten."""

import numpy as np

from auv_fault_env.channels import CHANNELS, COMMANDS, READINGS
from diagnosers.symptoms import sensor_symptoms

NOISE = np.array([channel.noise for channel in CHANNELS.values()])


def follow(observations):
    state = sensor_symptoms.initial(observations.shape[1])
    for observation in observations:
        state = sensor_symptoms.update(state, observation)
    return dict(
        zip(sensor_symptoms.SYMPTOMS, sensor_symptoms.symptoms(state)[0], strict=True)
    ), state


def noisy(n_samples=200, factor=1.0):
    return 0.3 + factor * NOISE * np.random.default_rng(0).standard_normal(
        (n_samples, 1, len(CHANNELS))
    )


def test_healthy_noise_is_no_symptom():
    symptoms, _ = follow(noisy())
    assert max(abs(value) for value in symptoms.values()) < 0.7


def test_one_repeated_and_two_zero_readings_count_once_and_twice():
    observations = noisy()
    observations[-1, 0, len(COMMANDS)] = observations[-2, 0, len(COMMANDS)]
    observations[[-3, -1], 0, -1] = 0.0
    symptoms, state = follow(observations)
    assert symptoms["speed_repeated"] == sensor_symptoms.COUNT_SYMPTOM
    np.testing.assert_allclose(
        symptoms["starboard_rpm_zero"],
        sensor_symptoms.COUNT_SYMPTOM * (1.0 + sensor_symptoms.FORGETTING**2),
    )
    severity = np.full((1, 9), 0.5)
    sensor_symptoms.write_severity(severity, list(range(1, 9)), state)
    assert 0.0 < severity[0, 1] < severity[0, -1] < 0.05 and (severity[0, [0, 2, 3]] == 0.5).all()


def test_threefold_noise_is_a_symptom_on_every_reading():
    symptoms, _ = follow(noisy(factor=3.0))
    assert all(symptoms[f"{channel}_noisy"] > 0.5 for channel in READINGS)
