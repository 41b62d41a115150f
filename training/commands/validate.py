"""``auv-fault validate``: the benchmark on validation seeds, while diagnosers are developed."""

from auv_fault_env.errors import finite_in_range
from diagnosers import NAMES
from training.arguments import Validate
from training.benchmark.plan import MOST_HOURS, BenchmarkPlan
from training.benchmark.trials import COUNTING, THRESHOLD
from training.benchmark.validation_suite import LAST_OFFSET, validation_suite
from training.commands.benchmark import ALL_CORES, Run, named_entrants, run_benchmark
from training.stimuli import Cruise, Thesis


def main(arguments: Validate) -> None:
    """Run what has not been run yet, score it, and write report, figures and results."""
    finite_in_range("lanes", arguments.lanes, 2, 1_000_000)
    finite_in_range("hours", arguments.hours, 0.05, MOST_HOURS)
    finite_in_range("seed", arguments.seed, 0, LAST_OFFSET)
    entrants = named_entrants(arguments.diagnosers or NAMES, {})
    suite = validation_suite(arguments.lanes, arguments.seed)
    hours = {THRESHOLD: arguments.hours, COUNTING: arguments.hours}
    run = Run(
        name="validate",
        arguments=arguments,
        command=command(arguments),
        output=arguments.output,
        suite_identity={"suite": suite.name},
        plan=BenchmarkPlan(suite, suite.conditions, [Cruise(), Thesis()], hours),
        entrants=entrants,
        seed=arguments.seed,
        workers=ALL_CORES,
        backend="loky",
    )
    run_benchmark(run)


def command(arguments: Validate) -> str:
    """The command line that gives these results."""
    words = f"auv-fault validate --seed {arguments.seed} --lanes {arguments.lanes}"
    words += f" --hours {arguments.hours:g}"
    if arguments.diagnosers:
        words += f" --diagnosers {' '.join(arguments.diagnosers)}"
    return words
