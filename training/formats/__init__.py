"""Export to formats of other projects: ONNX networks and Minari data sets."""
