"""The signals of a small mission, from which the tests of proposals make their logs."""

import numpy as np

N_ROWS = 600  # 10 Hz
TIME = 0.1 * np.arange(N_ROWS)  # s
LEGS = np.repeat([0.0, 0.5, 0.8, 0.3, 0.6, 0.0], 100)  # of full speed; at rest before and after
RANDOM = np.random.default_rng(1)


def noise(size):
    """Of a sensor, (N_ROWS,)."""
    return size * RANDOM.standard_normal(N_ROWS)


SPEED = 1.5 * LEGS + noise(0.005)  # m/s
RPM = 1200 * LEGS + (LEGS > 0) * noise(3.0)
SECOND_RPM = 1210 * LEGS + (LEGS > 0) * noise(3.0)
CURRENT = 8 * LEGS**2 + noise(0.02)  # A
SECOND_CURRENT = 7.9 * LEGS**2 + noise(0.02)
SUPPLY = 24.0 - CURRENT / 50 + noise(0.01)  # V
VOLTAGE = LEGS * SUPPLY + noise(0.02)
SECOND_VOLTAGE = 0.99 * LEGS * SUPPLY + noise(0.02)
RUDDER = 0.2 * np.sin(TIME / 3)  # rad
SIGNALS = {
    "time": TIME,
    "ms": 1e3 * TIME,
    "us": 1e6 * TIME,
    "epoch": 1.7e9 + TIME,
    "speed": SPEED,
    "knots": SPEED * 3600 / 1852,
    "cm/s": 100 * SPEED,
    "set": 1.5 * LEGS,
    "set in knots": 1.5 * LEGS * 3600 / 1852,
    "rpm": RPM,
    "rpm 2": SECOND_RPM,
    "set rpm": 1200 * LEGS,
    "rev/s": RPM / 60,
    "rad/s": RPM * np.pi / 30,
    "A": CURRENT,
    "A 2": SECOND_CURRENT,
    "mA": 1e3 * CURRENT,
    "mA 2": 1e3 * SECOND_CURRENT,
    "V": VOLTAGE,
    "V 2": SECOND_VOLTAGE,
    "mV": 1e3 * VOLTAGE,
    "supply": SUPPLY,
    "drawn": 0.5 + CURRENT,
    "pulses": 1500 + 400 * LEGS,
    "pulses 2": 1500 + 396 * LEGS,
    "percent": 100 * LEGS,
    "percent 2": 99 * LEGS,
    "fraction": LEGS,
    "counts": 128 + np.round(127 * LEGS),
    "rad": RUDDER,
    "deg": np.rad2deg(RUDDER),
    "accel": np.gradient(SPEED, TIME) + noise(0.01),
    "g": (np.gradient(SPEED, TIME) + noise(0.01)) / 9.80665,
    "sway": noise(0.05),
    "turn": noise(0.02),
    "heading": 180 + 40 * RUDDER,
    "depth": 5 + np.sin(TIME / 10),
    "temperature": 15 + TIME / 100,
    "sound": 1500 + noise(0.3),
    "sea": 0.2 + noise(0.01),
    "step": np.floor(TIME / 10),
    "index": np.arange(N_ROWS),
    "charge": np.cumsum(CURRENT) / 36_000,
    "limit": np.full(N_ROWS, 20.0),
    "level": 20.0 + (TIME > 30),
    "cell": SUPPLY / 6,
    "zero": np.zeros(N_ROWS),
    "nothing": np.full(N_ROWS, np.nan),
    "torque": LEGS**2,
    "power": VOLTAGE * CURRENT,
    "pressure": 1013 + TIME / 10,
    "degrees north": 54.3 + TIME / 1e5,
    "flag": (LEGS > 0).astype(float),
}
