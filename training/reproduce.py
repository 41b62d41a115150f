"""``auv-fault reproduce``: the thesis' test runs of chapters III to V, our figures beside the thesis'."""

from typing import Any

from tqdm import tqdm

from auv_fault_env.errors import finite_in_range
from training import filter_consistency
from training.arguments import Reproduce
from training.report import write_report
from training.reproduce_page import page
from training.runs import run_folder, write_json
from training.thesis_runs import STEPS, TEST_RUNS, record

CONSISTENCY_SEEDS = 200


def main(arguments: Reproduce) -> None:
    """Simulate, filter, compare, and write report, figures and results."""
    finite_in_range("seeds", arguments.seeds, 2, 10_000)
    finite_in_range("seed", arguments.seed, 0, 2**62)
    with run_folder(arguments.output, "reproduce", arguments) as folder:
        results = reproduce(arguments)
        write_json(folder / "results.json", results)
        write_report(results, folder)
    print_table(results)
    print(f"\nreport: {arguments.output / 'index.html'}")


def reproduce(arguments: Reproduce) -> dict[str, Any]:
    """All results as plain data: what `write_report` needs, and nothing else does it read."""
    with tqdm(total=2 * STEPS, unit="step", desc="test runs") as bar:
        clean = record(0.0, [arguments.seed], bar)
        noisy = record(1.0, list(range(arguments.seed, arguments.seed + arguments.seeds)), bar)
    command = f"auv-fault reproduce --seed {arguments.seed} --seeds {arguments.seeds}"
    results = page(clean, noisy, list(TEST_RUNS), command)
    results["sections"].insert(-2, filter_consistency.section(CONSISTENCY_SEEDS, arguments.seed))
    return results


def print_table(results: dict[str, Any]) -> None:
    """The comparison as plain text."""
    for section in results["sections"]:
        table = section.get("table")
        if table is None:
            continue
        rows = [row[:6] for row in (table["columns"], *table["rows"])]
        widths = [max(len(row[c]) for row in rows) for c in range(len(rows[0]))]
        print(f"\n{section['heading']}")
        for row in rows:
            cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
            print("  " + "  ".join(cells).rstrip())
