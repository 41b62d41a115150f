"""Base of the diagnosers that isolate the class by rules over symptoms."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import ClassVar

import numpy as np

from auv_fault_env.channels import COMMANDS, READINGS
from diagnosers.diagnoser import Belief, ModelBased, with_impossible_unknown
from diagnosers.symptoms import rulebook, sensor_symptoms

Severities = tuple[np.ndarray, np.ndarray]  # means and standard deviations
DEFAULT_SEVERITY = 0.6, 0.25  # mean and standard deviation where no symptom shows it


class RuleBased(ModelBased):
    """A diagnoser by symptoms of its own and `sensor_symptoms`; its rules are a `rulebook`.

    A subclass defines the names of all symptoms, and its own rules by class, ``{side}`` in a name
    standing for either side.
    """

    filled_channels = slice(0, len(COMMANDS))  # a gap of a reading is no repeated reading
    symptom_names: ClassVar[Sequence[str]]
    own_rules: ClassVar[Mapping[str, Sequence[str]]]

    @cached_property
    def _rules(self) -> rulebook.Rulebook:
        own = rulebook.rules_of_sides(self.own_rules)
        rules = rulebook.merge_rules(own, sensor_symptoms.RULES)
        return rulebook.parse_rules(rules, self.symptom_names, self.known_classes)

    @cached_property
    def _sensor_columns(self) -> list[int]:
        return [self.classes.index(f"sensor:{channel}") for channel in READINGS]

    def _belief(
        self,
        support: np.ndarray,
        severity: Severities,
        sensors: sensor_symptoms.SensorSymptoms,
    ) -> Belief:
        """The belief by `rulebook.support`, severities, and what the sensors alone show."""
        sensor_symptoms.write_severity(severity[0], self._sensor_columns, sensors)
        log_probability = rulebook.log_probability(self._rules, support)
        return with_impossible_unknown(Belief(log_probability, *severity))
