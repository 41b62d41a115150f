from training.report.page import write_report


def test_code_stands_between_backticks_and_all_else_is_escaped(tmp_path):
    table = {"columns": ["name"], "rows": [["`a < b`"], ["<b>"]]}
    section = {"heading": "x", "text": ["the class `unknown` of <i>"], "table": table}
    write_report({"title": "x", "intro": [], "command": "x", "sections": [section]}, tmp_path)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "the class <code>unknown</code> of &lt;i&gt;" in page
    assert "<code>a &lt; b</code>" in page and "&lt;b&gt;" in page
