"""The surge filters of the reference, those of the Gaussian bank, and what all filters share."""

from auv_fault_env.compiling import kernel
from diagnosers.bank import algebra, surge
from diagnosers.bank.sensors import fill_sample, keep_readings


@kernel
def begin_sample(observation, readings, sensors, sample):
    """Fill the sample from an observation (1, n_channels) and the last readings, and keep these."""
    fill_sample(observation, readings, sensors, sample)
    keep_readings(sample, readings)


@kernel
def replace_severities(first, last, work):
    """Replace the severities of the columns by ``work.severity``; the other states follow."""
    algebra.replace_severity((first, last), work)


@kernel
def step_surge(first, last, sample, constants, work):
    """Take the surge filters, columns `first` to before `last`, through one sample."""
    surge.update((first, last), sample, constants, work)
