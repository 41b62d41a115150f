"""Small ONNX networks for tests."""

import json

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from auv_fault_env.channels import CHANNELS
from auv_fault_env.faults import classes

NAMES = classes()
N_CLASSES = len(NAMES)


def counting_network(names=NAMES, without=(), bias=3.0):
    """A network whose score of `normal` is a bias and its count of the samples."""
    lanes = ["n_lanes"]
    value = helper.make_tensor_value_info
    bias_row = np.zeros((1, N_CLASSES), np.float32)
    bias_row[0, 0] = bias
    by_count = np.zeros((1, N_CLASSES), np.float32)
    by_count[0, 0] = 0.01
    weights = {
        "zeros": np.zeros((len(CHANNELS), N_CLASSES), np.float32),
        "bias": bias_row,
        "by_count": by_count,
        "one": np.ones((1, 1), np.float32),
    }
    nodes = [
        helper.make_node("Add", ["state", "one"], ["next_state"]),
        helper.make_node("MatMul", ["next_state", "by_count"], ["counted"]),
        helper.make_node("MatMul", ["observation", "zeros"], ["severity_mean"]),
        helper.make_node("Identity", ["severity_mean"], ["severity_std"]),
        helper.make_node("Add", ["severity_mean", "bias"], ["biased"]),
        helper.make_node("Add", ["biased", "counted"], ["log_probability"]),
    ]
    outputs = [
        value(name, TensorProto.FLOAT, [*lanes, N_CLASSES])
        for name in ("log_probability", "severity_mean", "severity_std")
    ]
    outputs.append(value("next_state", TensorProto.FLOAT, [*lanes, 1]))
    inputs = [
        value("observation", TensorProto.FLOAT, [*lanes, len(CHANNELS)]),
        value("state", TensorProto.FLOAT, [*lanes, 1]),
    ]
    graph = helper.make_graph(
        nodes,
        "counting",
        inputs,
        [output for output in outputs if output.name not in without],
        [numpy_helper.from_array(array, name) for name, array in weights.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    helper.set_model_props(model, {"classes": json.dumps(names)})
    onnx.checker.check_model(model)
    return model.SerializeToString()
