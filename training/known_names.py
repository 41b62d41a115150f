"""Names of the registries for the help, which does not wait for their imports.

The registries decide: commands look names up there, and a test compares.
"""

PRESETS = ("thesis1992", "npsnet1995", "remus100", "torpedo_1hz")
SPLITS = ("train", "calibration", "validation", "test")
COMPETITORS = (
    "limits",
    "cusum",
    "rules",
    "residuals",
    "filter_bank",
    "gaussian_bank",
    "raw_network",
    "kalman_network",
    "parallel",
    "integrated",
)
DIAGNOSERS = (*COMPETITORS, "oracle", "null", "random")
DIAGNOSERS_OF_LOGS = (
    "filter_bank",
    "integrated",
    "cusum",
    "rules",
    "limits",
    "kalman_network",
    "raw_network",
    "residuals",
)
TRAINABLE = ("raw_network", "kalman_network", "integrated", "residuals")
EXPORTABLE = ("raw_network", "kalman_network", "parallel", "integrated")
STIMULI = (
    "cruise",
    "thesis",
    "prbs",
    "multisine",
    "d_optimal",
    "triggered_thesis",
    "triggered_prbs",
    "triggered_d_optimal",
    "greedy",
    "triggered_surge",
    "learned",
    "learned_1",
    "learned_2",
    "learned_3",
    "learned_4",
    "learned_held",
    "constant",
    "standing_surge",
    "two_experiments",
    "triggered_shift",
    "planner",
)
SUITES = (
    "thesis",
    "ideal",
    "standard",
    "ood_sensors",
    "ood_noise",
    "ood_disturbance",
    "ood_vehicle",
    "ood_severity",
    "ood_compound",
    "ood_mission",
    "unknown_faults",
    "long",
)
MISSIONS = ("thesis", "acceleration", "cruise")
