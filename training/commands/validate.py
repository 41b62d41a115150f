"""``auv-fault validate``: the benchmark on validation seeds, while diagnosers are developed."""

from diagnosers import NAMES
from training.arguments import Validate
from training.benchmark.plan import BenchmarkPlan
from training.benchmark.trials import COUNTING, THRESHOLD
from training.benchmark.validation_suite import validation_suite
from training.commands.benchmark import ALL_CORES, Run, named_entrants, run_benchmark
from training.stimuli import Cruise, Thesis


def main(arguments: Validate) -> None:
    """Run what has not been run yet, score it, and write report, figures and results."""
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
        failures={},
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
