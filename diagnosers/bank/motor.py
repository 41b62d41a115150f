"""The motors' filters in the bank: healthy deviations of four parameters and the severity, from current and rpm.

Given the voltage reading, the shaft equation's closed form (`physics.spin`) predicts the rpm
reading, and Ohm's law the current. The voltage's noise enters both predictions, so both
measurements are made independent first.
"""

import numpy as np

from auv_fault_env.compiling import fused, inlined, scalar
from auv_fault_env.parameters import SAMPLE_TIME
from auv_fault_env.physics import RPM, Shaft, armature_current, motor, shaft_speed_after
from diagnosers.bank.algebra import N_STATES, SEVERITY, condition
from diagnosers.bank.pack import spread
from diagnosers.bank.sensors import BIAS, GAIN, LEAST_GAIN, NOISE, deliver, meant, shown

# Rows of a motor's parameters, `hypotheses.OWN`
(C1, C2, RESISTANCE, TORQUE_CONSTANT, COULOMB_FRICTION, VISCOUS_FRICTION, INERTIA) = range(7)
# first row of each sensor
VOLTAGE = 7
CURRENT = 12
SPEED = 17
N_MOTOR_ROWS = 22
# `expected` reads them
FORESEEING = (*range(7), *(row + k for row in (VOLTAGE, CURRENT, SPEED) for k in (BIAS, GAIN)))
BELIEVING = (VOLTAGE + NOISE, SPEED + BIAS, SPEED + GAIN, SPEED + NOISE)  # `believe` does
# parameters whose healthy deviation is a state
DEVIATIONS = (TORQUE_CONSTANT, RESISTANCE, COULOMB_FRICTION, C1)
STEP = 1e-4  # of the forward differences
# rpm; below, the shaft may stand, and where it begins to turn no linear model tells
STANDING = 10.0
STANDING_BLUR = 15.0  # rpm, standard deviation of the prediction there
BLIND_BLUR = 1e4  # rpm, of a motor whose voltage nobody has ever heard: it is not judged


@inlined
def impair(r, healthy, x, part, work):
    """Write parameter r at the filters' severities from its healthy value (n_columns,), and its derivative by them."""
    for f in range(part[0], part[1]):
        work.by_severity[r, f] = healthy[f] * work.slope[r, f] + work.offset[r, f]
        work.values[r, f] = healthy[f] + x[SEVERITY, f] * work.by_severity[r, f]


@inlined
def form(x, part, work):
    """Write the parameters (22, n_columns) at the filters' means, and their derivatives by severity."""
    for i in range(SEVERITY):
        for f in range(part[0], part[1]):
            work.values[DEVIATIONS[i], f] = work.base[DEVIATIONS[i], f] * (1.0 + x[i, f])
    for r in range(N_MOTOR_ROWS):
        impair(r, work.values[r] if r in DEVIATIONS else work.base[r], x, part, work)


@scalar
def expected(values, f, readings, heard_voltage, heard_rpm, start, speed, shift, water):
    """The shaft speed [rad/s], and what rpm counter and current sensor should show, at a shift of the true voltage.

    A lost voltage is replaced by what current and shaft speed say of it, a lost shaft speed by its
    prediction.
    """
    resistance = values[RESISTANCE, f]
    flux = values[TORQUE_CONSTANT, f]
    friction = values[COULOMB_FRICTION, f], values[VISCOUS_FRICTION, f]
    shaft = Shaft(
        0.0,
        values[C1, f],
        values[C2, f],
        resistance,
        flux,
        friction[0],
        friction[1],
        values[INERTIA, f],
    )
    turning = max(meant(values, SPEED, f, readings[2, f]), 0.0) / RPM
    read = meant(values, VOLTAGE, f, readings[0, f])
    balanced = fused(resistance, meant(values, CURRENT, f, readings[1, f]), flux * turning)
    voltage = shift + (read if heard_voltage > 0.0 else balanced)
    predicted = shaft_speed_after(start, motor(shaft, water, voltage), speed, 0.0, SAMPLE_TIME)
    current = armature_current(shaft, turning if heard_rpm > 0.0 else predicted, voltage)
    return predicted, shown(values, SPEED, f, RPM * predicted), shown(values, CURRENT, f, current)


@inlined
def expect(values, part, shift, water, work, out):
    """`expected` of every filter into out (3, n_columns)."""
    delivered = work.delivered
    for f in range(part[0], part[1]):
        heard = delivered[0, f], delivered[2, f]
        one = expected(
            values, f, work.readings, heard[0], heard[1], work.start[f], work.speed[f], shift, water
        )
        out[0, f], out[1, f], out[2, f] = one


@inlined
def slopes(part, trial, out, step, on_rpm, on_current):
    """Forward differences (n_columns,) of the expected readings."""
    for f in range(part[0], part[1]):
        on_rpm[f] = (trial[1, f] - out[1, f]) / step
        on_current[f] = (trial[2, f] - out[2, f]) / step


@inlined
def nudge(part, work):
    """Fill the parameters that `expected` reads at `STEP` more of the severity."""
    for r in FORESEEING:
        for f in range(part[0], part[1]):
            work.nudged[r, f] = work.values[r, f] + STEP * work.by_severity[r, f]


@inlined
def differentiate(x, part, water, work):
    """Fill the expected readings, and their gradients by the states and by the voltage (index -1)."""
    values = work.values
    out = work.expected
    trial = work.trial
    kept = work.shift
    expect(values, part, 0.0, water, work, out)
    expect(values, part, STEP, water, work, trial)
    slopes(part, trial, out, STEP, work.by_voltage[0], work.by_voltage[1])
    for k in range(SEVERITY):
        row = DEVIATIONS[k]
        for f in range(part[0], part[1]):
            kept[f] = values[row, f]
            values[row, f] *= 1.0 + STEP / (1.0 + x[k, f])
        expect(values, part, 0.0, water, work, trial)
        slopes(part, trial, out, STEP, work.gradient[k], work.second[k])
        for f in range(part[0], part[1]):
            values[row, f] = kept[f]
    nudge(part, work)
    expect(work.nudged, part, 0.0, water, work, trial)
    slopes(part, trial, out, STEP, work.gradient[SEVERITY], work.second[SEVERITY])


@inlined
def decorrelate(part, work):
    """Fill innovations and variances of both measurements; take out of the current what the rpm reading explains."""
    values = work.values
    by_voltage = work.by_voltage
    readings = work.readings
    for f in range(part[0], part[1]):
        ohms = values[RESISTANCE, f]
        deaf = ohms * values[CURRENT + NOISE, f] / max(values[CURRENT + GAIN, f], LEAST_GAIN)
        heard = values[VOLTAGE + NOISE, f] / max(values[VOLTAGE + GAIN, f], LEAST_GAIN)
        blur = heard if work.delivered[0, f] > 0.0 else deaf
        counter = values[SPEED + NOISE, f]
        turning = values[CURRENT + GAIN, f] * values[TORQUE_CONSTANT, f] / (ohms * RPM)
        turning *= counter * work.delivered[2, f] / max(values[SPEED + GAIN, f], LEAST_GAIN)
        on_rpm = by_voltage[0, f] * blur
        on_current = by_voltage[1, f] * blur
        work.variance[0, f] = counter * counter + on_rpm * on_rpm + work.blur[f]
        shared = fused(on_rpm, on_current, turning * counter)
        ratio = work.delivered[2, f] * shared / work.variance[0, f]
        own = fused(values[CURRENT + NOISE, f], values[CURRENT + NOISE, f], on_current**2)
        work.variance[1, f] = own + turning**2 - ratio * shared
        work.innovation[0, f] = readings[2, f] - work.expected[1, f]
        work.innovation[1, f] = readings[1, f] - work.expected[2, f] - ratio * work.innovation[0, f]
        work.shift[f] = ratio
        work.delivered[1, f] *= work.delivered[0, f]
    for i in range(N_STATES):
        for f in range(part[0], part[1]):
            work.second[i, f] -= work.shift[f] * work.gradient[i, f]


@inlined
def relocate(x, part, gradient, innovation, sign):
    """Move an innovation by what its gradient says of the mean: before a condition with +1, after it with -1."""
    for i in range(N_STATES):
        for f in range(part[0], part[1]):
            innovation[f] += sign * gradient[i, f] * x[i, f]


@inlined
def believe(x, part, work):
    """Write the shaft speeds [rad/s] that the filters believe in, with slope by severity and noise, for surge."""
    values = work.values
    for r in BELIEVING:
        impair(r, work.base[r], x, part, work)
    for f in range(part[0], part[1]):
        heard = work.delivered[2, f]
        gain = max(values[SPEED + GAIN, f], LEAST_GAIN)
        read = meant(values, SPEED, f, work.readings[2, f]) / RPM
        work.turning[f] = read if heard > 0.0 else work.expected[0, f]
        tilt = work.by_severity[SPEED, f] / RPM + work.by_severity[SPEED + GAIN, f] * read
        work.turning_slope[f] = -heard * tilt / gain
        blur = abs(work.by_voltage[0, f]) * values[VOLTAGE + NOISE, f]
        work.turning_noise[f] = (values[SPEED + NOISE, f] if heard > 0.0 else blur) / gain


@inlined
def hear(part, seen, channel, work):
    """Bring the readings to their columns, which filters take them, and how far the predicted rpm is from certain."""
    n_lanes = np.uint64(seen.deflection.size)
    for k in range(3):
        spread(seen.reading[channel + k], part, work.readings[k])
        deliver(
            work.values, part, VOLTAGE + 5 * k, seen, channel + k, work.delivered[k], work.evidence
        )
    for p in range(n_lanes):
        held = seen.held[channel, p]
        blind = seen.silent[channel, p] and not held
        standing = seen.reading[channel + 2, p] < STANDING
        for f in range(part[0] + p, part[1], n_lanes):
            work.blur[f] = BLIND_BLUR**2 if blind else STANDING_BLUR**2 if standing else 0.0
            # the controller holds it between two readings
            work.delivered[0, f] = 1.0 if held else work.delivered[0, f]


@inlined
def update(x, part, seen, channel, water, work):
    """One sample of a motor's filters, its first reading being `channel`: adds to the evidence, writes `turning`."""
    form(x, part, work)
    hear(part, seen, channel, work)
    differentiate(x, part, water, work)
    decorrelate(part, work)
    innovation = work.innovation
    variance = work.variance
    delivered = work.delivered
    evidence = work.evidence
    relocate(x, part, work.second, innovation[1], 1.0)
    condition(
        x,
        part,
        work.gradient,
        innovation[0],
        variance[0],
        delivered[2],
        work.crossed,
        work.shift,
        evidence,
    )
    relocate(x, part, work.second, innovation[1], -1.0)
    condition(
        x,
        part,
        work.second,
        innovation[1],
        variance[1],
        delivered[1],
        work.crossed,
        work.shift,
        evidence,
    )
    believe(x, part, work)
