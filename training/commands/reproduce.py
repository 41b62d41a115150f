"""``auv-fault reproduce``: the thesis' test runs and networks, chapters III to VI."""

from typing import Any

from tqdm import tqdm

from training.arguments import Reproduce
from training.report.page import print_tables, write_report
from training.report.run_folder import run_folder, write_json
from training.thesis import (
    filter_consistency,
    kalman_networks,
    kalman_page,
    raw_networks,
    raw_page,
    recommendation_page,
)
from training.thesis.comparison import Comparison
from training.thesis.page import report_on_test_runs
from training.thesis.runs import STEPS, TEST_RUNS, record
from training.thesis.summary import summary

CONSISTENCY_SEEDS = 200


def main(arguments: Reproduce) -> None:
    """Simulate, filter, compare, and write report, figures and results."""
    with run_folder(arguments.output, "reproduce", arguments) as folder:
        results = reproduce(arguments)
        write_json(folder / "results.json", results)
        write_report(results, folder)
    print_tables(results["sections"])
    print(f"\nreport: {arguments.output / 'index.html'}")


def reproduce(arguments: Reproduce) -> dict[str, Any]:
    """All results as plain data, from which alone `write_report` makes the report."""
    seed = arguments.seed
    with tqdm(total=2 * STEPS, unit="step", desc="test runs") as bar:
        clean = record(0.0, [seed], bar)
        noisy = record(1.0, list(range(seed, seed + arguments.seeds)), bar)
    command = (
        f"auv-fault reproduce --seed {seed} --seeds {arguments.seeds} "
        f"--networks {arguments.networks}"
    )
    comparison = Comparison(clean, noisy, list(TEST_RUNS), command)
    results = report_on_test_runs(comparison)
    *sections, appendix, constants = results["sections"]
    results["sections"] = [
        *sections,
        filter_consistency.section(CONSISTENCY_SEEDS, seed),
        *network_sections(comparison, range(seed, seed + arguments.networks)),
        appendix,
        constants,
    ]
    results["summary"] = summary(results["sections"])
    return results


def network_sections(comparison: Comparison, seeds: range) -> list[dict[str, Any]]:
    """Train the thesis' networks and report on them."""
    total = raw_networks.CHECKPOINTS[-1] + kalman_networks.CHECKPOINTS[-1]
    with tqdm(total=total, unit="presentation", unit_scale=True, desc="networks") as bar:
        raw_study = raw_networks.run_study(comparison, seeds, bar)
        kalman_study = kalman_networks.run_study(seeds, bar)
    return [
        *raw_page.sections(comparison, raw_study),
        *kalman_page.sections(comparison, kalman_study),
        recommendation_page.section(),
    ]
