from training.report.markdown import write_markdown


def test_text_and_tables_are_taken_over_and_figures_left_out(tmp_path):
    table = {"columns": ["form", "error"], "rows": [["u|n|", "1.5"], ["all", ""]]}
    sections = [
        {"heading": "Errors", "text": ["First.", "Second."], "table": table},
        {"heading": "A figure", "text": ["Not here."], "figures": []},
    ]
    results = {
        "title": "Title",
        "summary": ["Good."],
        "intro": ["Intro."],
        "command": "x --seed 0",
        "sections": sections,
    }
    write_markdown(results, tmp_path)
    expected = """## Title

Good.

Intro.

Command: `x --seed 0`

### Errors

First.

Second.

| form | error |
|---|---|
| u\\|n\\| | 1.5 |
| all |  |
"""
    assert (tmp_path / "report.md").read_text(encoding="utf-8") == expected
