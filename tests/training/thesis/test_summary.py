from training.thesis.comparison import AGREES, COLUMNS, DIFFERS, IN_PART, Comparison
from training.thesis.summary import N_DIFFERENCES, summary


def section(*verdicts):
    rows = []
    for k, verdict in enumerate(verdicts):
        row = Comparison.row(f"Fig. {k}", f"quantity {k}", "1", "2", "3", verdict == AGREES, "why")
        row[COLUMNS.index("verdict (noise-free)")] = verdict
        rows.append(row)
    return {"heading": "x", "table": {"columns": COLUMNS, "rows": rows}}


def test_verdicts_are_counted_over_all_tables_of_the_comparison():
    other = {"heading": "y", "table": {"columns": ["verdict"], "rows": [[DIFFERS]]}}
    sections = [section(AGREES, AGREES, DIFFERS), other, section(IN_PART, "not judged", "-")]
    counts, differences = summary(sections)
    assert "4 results compared" in counts
    assert "2 agree without noise, 1 agree in part, 1 differ." in counts
    assert differences == "Those that differ: Fig. 2: quantity 2."


def test_of_many_differences_the_first_are_named():
    _, differences = summary([section(*[DIFFERS] * (N_DIFFERENCES + 3))])
    assert differences.count("quantity") == N_DIFFERENCES
    assert differences.endswith("; and 3 more.")


def test_where_all_agrees_nothing_is_named():
    assert summary([section(AGREES)])[1:] == ["No result differs."]
