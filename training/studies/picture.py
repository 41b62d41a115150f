"""The picture of the README: ``python -m training.studies.picture docs/propulsion.png``. A propeller is lost."""

from pathlib import Path
from typing import Annotated

import gymnasium as gym
import matplotlib.image
from tyro.conf import Positional, arg

import auv_fault_env  # noqa: F401  (registers the environment)
from training.studies.run import command_line

SEED = 3
SECONDS = 34.0
FAULT = {"fault": "propeller_loss:port", "onset": 12.0, "severity": 1.0}


def main(path: Annotated[Positional[Path], arg(metavar="PATH")]) -> None:
    """Run one episode up to `SECONDS` and write the last frame."""
    env = gym.make("auv_fault_env/Propulsion-v0", render_mode="rgb_array")
    observation, _ = env.reset(seed=SEED, options={"schedule": [FAULT], "mission": "thesis"})
    for _ in range(round(10 * SECONDS)):
        observation, *_ = env.step([observation[0], 0.0, 0.0])
    path.parent.mkdir(parents=True, exist_ok=True)
    matplotlib.image.imsave(path, env.render())
    env.close()


if __name__ == "__main__":
    command_line(main)
