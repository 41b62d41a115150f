"""The picture of the README: a vehicle loses a propeller.

Run ``python -m training.studies.picture docs/propulsion.png``.
"""

from pathlib import Path
from typing import Annotated

import gymnasium as gym
from tyro.conf import Positional, arg

import auv_fault_env  # noqa: F401  (registers the environment)
from auv_fault_env.parameters import SAMPLE_RATE
from training.report.figures.image import write_image
from training.studies.run import command_line

SEED = 3
# s
DURATION = 34.0
FAULT = {"fault": "propeller_loss:port", "onset": 12.0, "severity": 1.0}


def main(path: Annotated[Positional[Path], arg(metavar="PATH")]) -> None:
    """Simulate an episode up to `DURATION` and write its last frame."""
    env = gym.make("auv_fault_env/Propulsion-v0", render_mode="rgb_array")
    observation, _ = env.reset(seed=SEED, options={"schedule": [FAULT], "mission": "thesis"})
    for _ in range(round(DURATION * SAMPLE_RATE)):
        observation, *_ = env.step([observation[0], 0.0, 0.0])
    write_image(path, env.render())
    env.close()


if __name__ == "__main__":
    command_line(main)
