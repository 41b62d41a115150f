"""Readings of a motor of one time: the shaft speed may be read some samples late.

A late shaft speed is compared with the voltage and current of its own time. How late it is follows
from the voltages of several samples: that of its time predicts it best. One that is later than any
healthy counter's is the class `unknown`: its motor's readings are no evidence for anything else.
"""

import numpy as np

from auv_fault_env.channels import CHANNELS
from auv_fault_env.compiling import part, scalar
from auv_fault_env.physics import RPM
from diagnosers.bank.hypotheses import PORT, STARBOARD
from diagnosers.bank.kernel import MOTOR_CHANNEL
from diagnosers.bank.motor import OF_RPM, OF_VOLTAGE, predict_shaft_speed, shaft_of
from diagnosers.bank.pack import columns_of_lane
from diagnosers.bank.sensors import FIRST_READING

N_CHANNELS = len(CHANNELS)
LARGEST_LATENCY = 2  # samples, twice that of healthy counters
N_LATENCIES = 6  # that are compared, from none
N_EARLIER = 2  # voltage and current
MEMORY = 0.995  # share of a misfit that is left after a sample: 20 s
LARGEST_MISFIT = 30.0  # rpm, of one sample
CLEARLY_LESS = 0.6  # share of a misfit
# share of the least misfit of healthy latencies; what a failed voltage sensor leaves at its onset
# is 0.5 of it at least
LATE = 0.45
LATE_EVIDENCE = 2.0  # of a sample, for a change of the motor that no fault makes
# rpm^2, of latencies other than 0 before the first reading: 20 samples of 5 rpm
START_MISFIT = 500.0


@part
def align(observation, old, new, aligned):
    """Fill ``aligned``, the observation with voltages and currents as late as the shaft speeds.

    ``new.earlier`` (n_lanes, 2, N_EARLIER, N_LATENCIES) gets the readings of voltage and current by
    their age, the last first. NaN means no reading.
    """
    for lane in range(len(observation)):
        for channel in range(N_CHANNELS):
            aligned[lane, channel] = observation[lane, channel]
        for subsystem in (PORT, STARBOARD):
            side = subsystem - PORT
            latency = np.uint64(min(old.latency[lane, side], LARGEST_LATENCY))
            for k in range(N_EARLIER):
                channel = FIRST_READING + MOTOR_CHANNEL[subsystem] + k
                readings = new.earlier[lane, side, k]
                for age in range(1, N_LATENCIES):
                    readings[age] = old.earlier[lane, side, k, age - 1]
                readings[0] = observation[lane, channel]
                aligned[lane, channel] = readings[latency]


@scalar
def better_latency(latency, misfit):
    """The latency whose misfit (N_LATENCIES,) is clearly less than that of `latency`, or this."""
    best = misfit.argmin()
    return best if misfit[best] < CLEARLY_LESS * misfit[np.uint64(latency)] else latency


@part
def compare_latencies(subsystem, old, new, sample, column, water, work):
    """Fill ``new.latency`` by how well the voltages of several samples predict the shaft speed.

    column (n_lanes,) is the filter of each lane that predicts, with its parameters.
    """
    side = subsystem - PORT
    rpm_channel = MOTOR_CHANNEL[subsystem] + OF_RPM
    for lane in range(len(column)):
        c = column[lane]
        misfit = new.misfit[lane, side]
        for latency in range(N_LATENCIES):
            misfit[latency] = old.misfit[lane, side, latency]
        is_read = not (sample.silent[rpm_channel, lane] or sample.resting[rpm_channel, lane])
        voltages = new.earlier[lane, side, OF_VOLTAGE]
        if is_read and not np.isnan(voltages).any():
            shaft = shaft_of(work.parameters, c)
            measured = sample.reading[rpm_channel, lane]
            for latency in range(N_LATENCIES):
                predicted = RPM * predict_shaft_speed(shaft, c, voltages[latency], water, work)
                error = min(abs(measured - predicted), LARGEST_MISFIT)
                misfit[latency] = MEMORY * misfit[latency] + error * error
        new.latency[lane, side] = better_latency(old.latency[lane, side], misfit)


@part
def judge_latencies(columns, subsystem, new, work):
    """Replace the evidence of a motor whose shaft speed is later than that of healthy counters.

    It is as long as the misfits show it, not as long as its latency is taken for that.
    """
    n_lanes = new.age.size
    for lane in range(n_lanes):
        side = subsystem - PORT
        misfit = new.misfit[lane, side]
        of_healthy = misfit[: LARGEST_LATENCY + 1].min()
        if misfit[np.uint64(new.latency[lane, side])] < LATE * of_healthy:
            first, last = columns_of_lane(lane, columns, n_lanes)
            for c in range(first, last):
                is_unknown = work.spread[c] > 0.0
                work.evidence[c] = LATE_EVIDENCE if is_unknown else 0.0
