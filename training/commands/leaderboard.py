"""``auv-fault leaderboard``: the page of the rows of ``auv-fault submit``."""

from auv_fault_env.text_files import text_of
from training.arguments import Leaderboard
from training.report.cells import counted
from training.report.whole_file import write_whole
from training.submissions.page import with_tables
from training.submissions.row import read_all


def main(arguments: Leaderboard) -> None:
    """Write the tables into the page."""
    rows = read_all(arguments.rows)
    page = text_of(arguments.page, "page", "a page to write the tables into")
    write_whole(arguments.page, with_tables(page, rows, arguments.page).encode())
    print(f"{arguments.page}: {counted(len(rows), 'row')}")
