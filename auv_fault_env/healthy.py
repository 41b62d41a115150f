"""Healthy vehicles: nominal parameters, and how far those of one vehicle may be from them."""

from collections.abc import Mapping, Sequence

import numpy as np

from auv_fault_env.channels import CHANNELS, READINGS
from auv_fault_env.errors import finite_in_range, known_name
from auv_fault_env.parameters import HULL, PARAMETERS, SHAFT, SIDES, Vehicle, nominal
from auv_fault_env.realism import healthy_spread


class HealthyVehicles:
    """The distribution of the parameters of healthy vehicles of one kind.

    Parameters
    ----------
    vehicle
        The kind.
    sensor_noise, healthy_band, band, noise
        As in `Fleet`.
    realism, effects
        Factor on the imperfections, and the names of those that act.

    Attributes
    ----------
    nominal
        Parameters of the nominal vehicle, (n_parameters,).
    """

    def __init__(
        self,
        vehicle: Vehicle,
        sensor_noise: float,
        healthy_band: float,
        band: Mapping[str, float],
        noise: Mapping[str, float],
        realism: float,
        effects: Sequence[str],
    ):
        parameters = nominal(vehicle, sensor_noise) | _noise_of(noise, sensor_noise)
        self.nominal = np.array(list(parameters.values()))
        self._band = healthy_band * _bands(band)
        self._shift, self._latency = healthy_spread(realism, effects)

    def at(self, place: np.ndarray) -> np.ndarray:
        """Parameters of the vehicles at places from -1 to 1 of the band, (n, n_parameters) both."""
        late = np.floor(0.5 * (1.0 + place) * (self._latency + 1.0))
        return self.nominal * (1.0 + self._band * place) + self._shift * place + late


def _noise_of(noise: Mapping[str, float], factor: float) -> dict[str, float]:
    """Parameters of the noise by name, from standard deviations by reading, times a factor."""
    for reading, std in noise.items():
        channel = CHANNELS[known_name("reading", reading, READINGS)]
        finite_in_range(f"noise of {reading}", std, 0.0, channel.high - channel.low)
    return {f"{reading}_noise": factor * std for reading, std in noise.items()}


def _bands(band: Mapping[str, float]) -> np.ndarray:
    """Relative half-width of the healthy band of every parameter, (n_parameters,)."""
    for name, width in band.items():
        known_name("parameter", name, (*HULL, *SHAFT))
        finite_in_range(f"healthy band of {name}", width, 0.0, 1.0)
    sides = tuple(f"{side}_" for side in SIDES)
    bands = []
    for name, spec in PARAMETERS.items():
        of_vehicle = name.partition("_")[2] if name.startswith(sides) else name
        bands.append(band.get(of_vehicle, spec.band))
    return np.array(bands)
