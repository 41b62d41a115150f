"""The thesis' kind of network (V.A): feedforward, one hidden layer of sigmoids, in PyTorch."""

from collections.abc import Mapping

import numpy as np
import torch
from torch.nn.functional import linear

from diagnosers.storage import Shapes


def tensor_shapes(n_inputs: int, n_hidden: int, n_outputs: int) -> Shapes:
    """The tensors of a network, by name."""
    return {
        "hidden_weight": (n_hidden, n_inputs),
        "hidden_bias": (n_hidden,),
        "output_weight": (n_outputs, n_hidden),
        "output_bias": (n_outputs,),
    }


def random_tensors(architecture: Shapes, seed: int) -> dict[str, np.ndarray]:
    """Tensors to start from: uniform within one over the root of the number of a node's inputs."""
    random = np.random.default_rng(seed)
    tensors = {}
    for name, shape in architecture.items():
        layer = name.split("_")[0]
        bound = architecture[f"{layer}_weight"][1] ** -0.5
        tensors[name] = (bound * random.uniform(-1.0, 1.0, shape)).astype(np.float32)
    return tensors


class FeedForward(torch.nn.Module):
    """One hidden layer of sigmoids, float32; the outputs are the sums before their sigmoids."""

    def __init__(self, tensors: Mapping[str, np.ndarray]):
        super().__init__()
        for name, tensor in tensors.items():
            values = torch.tensor(tensor, dtype=torch.float32)
            self.register_parameter(name, torch.nn.Parameter(values))

    def forward(self, inputs: torch.Tensor) -> torch.Tensor:
        """The output nodes' sums (n, n_outputs) of inputs (n, n_inputs)."""
        hidden = torch.sigmoid(linear(inputs, self.hidden_weight, self.hidden_bias))
        return linear(hidden, self.output_weight, self.output_bias)

    def evaluate(self, inputs: np.ndarray) -> np.ndarray:
        """As `forward`, without gradients, from and to numpy: (n, n_outputs) float64."""
        inputs = torch.from_numpy(inputs.astype(np.float32))
        with torch.inference_mode():
            outputs = self(inputs).numpy()
        return outputs.astype(np.float64)

    def tensors(self) -> dict[str, np.ndarray]:
        """A copy of the tensors, by name."""
        parameters = self.named_parameters()
        return {name: parameter.detach().numpy().copy() for name, parameter in parameters}
