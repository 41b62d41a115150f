"""The suite of a submission, drawn from what nobody knew before: its digest and a nonce."""

import json
from dataclasses import asdict, dataclass

from auv_fault_env.errors import finite_in_range, known_name, refusal, whole_number
from training.arguments import FEWEST_HOURS, MOST_HOURS
from training.benchmark.freeze_suites import recipes, sampled
from training.benchmark.plan import BenchmarkPlan
from training.benchmark.suites import STANDARD, Suite, load
from training.benchmark.trials import COUNTING, FAULTY, PARTS, THRESHOLD
from training.seeds import DRAWN_TOGETHER, drawn_seeds
from training.stimuli import Cruise

# seeds of each part: more than lanes of `MOST_HOURS` under any stimulus
SEEDS_OF_A_PART = DRAWN_TOGETHER // 4
LONGEST_NONCE = 200


@dataclass(frozen=True)
class Recipe:
    """What is sampled: the kind of the suite, and how much of it."""

    suite: str  # one of the frozen suites, whose recipe it is
    lanes: int  # faulty episodes
    hours: float  # healthy operation that the thresholds are set on [h]
    counting_hours: float  # other healthy operation that false alarms are counted on [h]

    def __post_init__(self):
        known_name("suite", self.suite, recipes())
        n_cells = len(recipes()[self.suite].cells)
        if whole_number("lanes", self.lanes) > n_cells:
            allowed = f"at most those of the suite {self.suite}, {n_cells}"
            raise refusal("lanes", self.lanes, allowed, "take fewer")
        for name in ("hours", "counting_hours"):
            value = finite_in_range(name, getattr(self, name), FEWEST_HOURS, MOST_HOURS)
            object.__setattr__(self, name, value)

    @property
    def about(self) -> str:
        """The recipe in words."""
        return (
            f"{self.suite}, {self.lanes} faulty episodes, thresholds on {self.hours:g} h, "
            f"false alarms counted on other {self.counting_hours:g} h"
        )


@dataclass(frozen=True)
class Draw:
    """A recipe, and what chooses the seeds."""

    recipe: Recipe
    submission: str  # digest of the submission
    nonce: str

    def __post_init__(self):
        is_text = isinstance(self.nonce, str) and self.nonce.isprintable()
        if not is_text or not 0 < len(self.nonce) <= LONGEST_NONCE:
            allowed = f"1 to {LONGEST_NONCE} printable characters"
            raise refusal("nonce", self.nonce, allowed, "give such a text")

    @property
    def first_seeds(self) -> dict[str, int]:
        """The first seed of each part."""
        seeds = drawn_seeds(json.dumps([asdict(self.recipe), self.submission, self.nonce]))
        return {part: seeds[SEEDS_OF_A_PART * k] for k, part in enumerate(PARTS)}

    @property
    def suite(self) -> Suite:
        """The suite of these seeds."""
        first = self.first_seeds
        recipe = recipes()[self.recipe.suite]
        chosen = range(first[FAULTY], first[FAULTY] + self.recipe.lanes)
        healthy = {part: first[part] for part in (THRESHOLD, COUNTING)}
        return sampled(self.recipe.suite, recipe, chosen, healthy)

    @property
    def plan(self) -> BenchmarkPlan:
        """What is run: without a stimulus."""
        hours = {THRESHOLD: self.recipe.hours, COUNTING: self.recipe.counting_hours}
        plan = BenchmarkPlan(self.suite, load(STANDARD).conditions, [Cruise()], hours)
        plan.check_seeds()
        return plan
