"""``auv-fault reproduce``: the thesis' test runs and networks, chapters III to VI, our figures beside the thesis'."""

from typing import Any

from tqdm import tqdm

from auv_fault_env.errors import finite_in_range
from training import (
    filter_consistency,
    kalman_network_page,
    kalman_network_study,
    raw_network_page,
    raw_network_study,
    recommendation_page,
)
from training.arguments import Reproduce
from training.comparison import Comparison
from training.report import print_tables, write_report
from training.reproduce_page import COLUMNS, page
from training.runs import run_folder, write_json
from training.thesis_runs import STEPS, TEST_RUNS, record

CONSISTENCY_SEEDS = 200


def main(arguments: Reproduce) -> None:
    """Simulate, filter, compare, and write report, figures and results."""
    finite_in_range("seeds", arguments.seeds, 2, 10_000)
    finite_in_range("networks", arguments.networks, 2, 100)
    finite_in_range("seed", arguments.seed, 0, 2**62)
    with run_folder(arguments.output, "reproduce", arguments) as folder:
        results = reproduce(arguments)
        write_json(folder / "results.json", results)
        write_report(results, folder)
    print_tables(results["sections"])
    print(f"\nreport: {arguments.output / 'index.html'}")


def reproduce(arguments: Reproduce) -> dict[str, Any]:
    """All results as plain data: what `write_report` needs, and nothing else does it read."""
    with tqdm(total=2 * STEPS, unit="step", desc="test runs") as bar:
        clean = record(0.0, [arguments.seed], bar)
        noisy = record(1.0, list(range(arguments.seed, arguments.seed + arguments.seeds)), bar)
    command = f"auv-fault reproduce --seed {arguments.seed} --seeds {arguments.seeds} --networks {arguments.networks}"
    view = Comparison(clean, noisy, list(TEST_RUNS), command)
    seeds = range(arguments.seed, arguments.seed + arguments.networks)
    results = page(view)
    extra = [filter_consistency.section(CONSISTENCY_SEEDS, arguments.seed), *network_sections(view, seeds)]
    results["sections"][-2:-2] = extra
    return results


def network_sections(view: Comparison, seeds: range) -> list[dict[str, Any]]:
    """Train the thesis' networks on and beside the recorded runs; all of the report that concerns them."""
    total = raw_network_study.CHECKPOINTS[-1] + kalman_network_study.CHECKPOINTS[-1]
    with tqdm(total=total, unit="presentation", unit_scale=True, desc="networks") as bar:
        raw = raw_network_study.study(view, seeds, bar)
        fed = kalman_network_study.study(seeds, bar)
    return [
        *raw_network_page.sections(view, raw, COLUMNS),
        *kalman_network_page.sections(view, fed, COLUMNS),
        recommendation_page.section(view, COLUMNS),
    ]
