"""Thresholds of log p(normal) by diagnoser.

Of `filter_bank`, `residuals` (with the relations of the package) and `integrated` as ``python -m
training.studies.robustness`` sets them, on 30 h, 125 h and 10 h of whole missions of the suite
`standard`, with imperfections. Of the others as ``auv-fault benchmark`` set them on 200 h of
healthy episodes of 65 s under the conditions of the suite `ideal`, from before it took whole
missions: with imperfections, or over hours, their alarms are more frequent than the names say. A
diagnoser without an entry works; the live page does not offer it.
The belief of `null` is constant and never below its threshold.
"""

ONE_PER_HOUR: dict[str, float] = {
    "limits": -0.957,
    "cusum": -1.169,
    "rules": -1.414,
    "residuals": -1.066,
    "filter_bank": -2.593,
    "gaussian_bank": -4.409,
    "raw_network": -1.458,
    "kalman_network": -2.328,
    "parallel": -2.792,
    "integrated": -1.593,
    "oracle": -1.999,
    "null": -1.610,
    "random": -29.094,
}
ONE_PER_10_HOURS: dict[str, float] = {
    "limits": -2.838,
    "cusum": -2.806,
    "rules": -2.838,
    "residuals": -3.190,
    "filter_bank": -4.654,
    "gaussian_bank": -10.701,
    "raw_network": -2.039,
    "kalman_network": -4.206,
    "parallel": -5.189,
    "integrated": -3.158,
    "oracle": -5.851,
    "null": -1.610,
    "random": -29.559,
}
