import numpy as np

from training.field.calibration.healthy_band import healthy_band
from training.field.calibration.robust_fit import LARGEST_VARIANCE, Problem, fit_parameters

SCATTER = 1e4  # of the residuals, standard deviations


def test_a_unit_without_information_has_a_huge_variance_and_no_warning():
    errors = SCATTER * np.random.default_rng(0).normal(size=400)
    unit = np.repeat([0, 1], 200)
    problem = Problem(
        residuals=lambda values: errors + 1e5 * (values["drag"] - 2.0) * (unit == 0),
        start={"drag": 1.0},
        bounds={"drag": (0.0, 10.0)},
        order=["drag"],
        nuisance=[],
        block=np.arange(400) // 20,
        unit=unit,
    )
    fit = fit_parameters(problem, ["drag"])
    assert abs(fit.estimate[0] - 2.0) < 0.1
    known, unknown = fit.unit_variances[:, 0]
    assert known < 1.0 and unknown == LARGEST_VARIANCE
    for variances in (fit.unit_variances[:, 0], np.full(2, unknown)):
        band = healthy_band(fit.unit_estimates[:, 0], variances, 0.01, 0.1)
        assert 0.0 < band <= 0.9
