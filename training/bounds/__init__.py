"""Theoretical limits: delays of detection and isolation, parameter estimation, active diagnosis."""

from training.bounds.delays import (
    LARGEST_EXPONENT,
    RESAMPLES,
    asymptotic_delay,
    bootstrap,
    delay_bound,
    detection_power,
    information_rate,
    late_rate,
    mean_inverse_ratio,
    neyman_pearson_power,
)

__all__ = [
    "LARGEST_EXPONENT",
    "RESAMPLES",
    "asymptotic_delay",
    "bootstrap",
    "delay_bound",
    "detection_power",
    "information_rate",
    "late_rate",
    "mean_inverse_ratio",
    "neyman_pearson_power",
]
