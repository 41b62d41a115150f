import pyarrow.csv
import pytest

from training.field.logs.text_table import text_table


@pytest.mark.parametrize(("n_rows", "is_threaded"), [(200, False), (200_000, True)])
def test_a_short_log_leaves_no_thread_of_the_reader_behind(monkeypatch, n_rows, is_threaded):
    """One that lets go of a Python object when the interpreter ends would abort it."""
    used = []
    read_csv = pyarrow.csv.read_csv

    def watched(source, read_options, *others):
        used.append(read_options.use_threads)
        return read_csv(source, read_options, *others)

    monkeypatch.setattr(pyarrow.csv, "read_csv", watched)
    rows = b"".join(b"%d.5,%d\n" % (k, k % 7) for k in range(n_rows))
    table = text_table(b"time,speed\n" + rows, "log.csv")
    assert used == [is_threaded]
    assert len(table.columns["speed"]) == n_rows
