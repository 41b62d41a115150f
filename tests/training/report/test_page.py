"""Every page: a summary first, the command once, lists of figures, and nothing too wide."""

import ast
import re
from pathlib import Path

import pytest

import training
from training.report.page import FIRST_SENTENCE, write_report

from ..live.browser import CHROMIUM, tab

COMMAND = "auv-fault x --seed 0"
CURVE = {"train": [3.0, 2.0], "validation": [3.0, 2.5], "best": 2}
LONG = "motor_overheating:starboard"


def a_figure(name, caption):
    return {"plot": "learning_curve", "name": name, "caption": caption, "data": CURVE}


def results(*sections):
    return {
        "title": "A title",
        "summary": ["Two of three.", "That is good."],
        "intro": ["How it is meant."],
        "command": COMMAND,
        "sections": list(sections),
    }


def written(folder, *sections):
    write_report(results(*sections), folder)
    return (folder / "index.html").read_text(encoding="utf-8")


def test_code_stands_between_backticks_and_all_else_is_escaped(tmp_path):
    table = {"columns": ["name"], "rows": [["`a < b`"], ["<b>"]]}
    section = {"heading": "x", "text": ["the class `unknown` of <i>"], "table": table}
    page = written(tmp_path, section)
    assert "the class <code>unknown</code> of &lt;i&gt;" in page
    assert "<code>a &lt; b</code>" in page and "&lt;b&gt;" in page


def test_the_summary_comes_first_and_the_command_once(tmp_path):
    page = written(tmp_path, {"heading": "Of x", "text": []})
    order = ["A title</h1>", "Two of three.", "That is good.", COMMAND, "Contents"]
    order += ['href="#s1"', "How it is meant.", 'id="s1"']
    places = [page.index(text) for text in order]
    assert places == sorted(places)
    assert page.count(COMMAND) == 1


def test_every_figure_has_a_number_and_is_in_the_list(tmp_path):
    captions = ["Figs 5.3 to 5.6: a run at 0.5 m/s. More of it.", "Of `normal`, e.g. all."]
    figures = [a_figure(f"f{k}", caption) for k, caption in enumerate(captions)]
    sections = [{"heading": f"s{k}", "text": [], "figures": [figures[k]]} for k in range(2)]
    page = written(tmp_path, *sections)
    contents, body = page.split("</nav>")
    assert '<a href="#f1">Figure 1: Figs 5.3 to 5.6: a run at 0.5 m/s</a>' in contents
    assert '<a href="#f2">Figure 2: Of <code>normal</code>, e.g</a>' in contents
    for number in (1, 2):
        assert re.search(rf'<figure id="f{number}">\s*<figcaption>Figure {number}\. ', body)
    assert page.count("<img ") == 2


def test_a_page_without_figures_has_no_list_of_them(tmp_path):
    assert "<strong>Figures</strong>" not in written(tmp_path, {"heading": "x", "text": []})


@pytest.mark.parametrize(
    ("caption", "title"),
    [("One. Two.", "One"), ("All of it.", "All of it"), ("At 1.5 s", "At 1.5 s")],
)
def test_the_first_sentence_is_the_title(caption, title):
    assert FIRST_SENTENCE.match(caption)[0] == title


@pytest.mark.parametrize(("n_columns", "breaks"), [(3, False), (8, True)])
def test_long_names_of_wide_tables_may_break_and_intervals_may_not(tmp_path, n_columns, breaks):
    cells = [LONG, "1.0 (0.5–1.5)", "propeller_loss:port"] + [""] * (n_columns - 3)
    table = {"columns": ["x"] * n_columns, "rows": [cells]}
    page = written(tmp_path, {"heading": "x", "text": [], "table": table})
    assert ("motor_<wbr>overheating:<wbr>starboard" in page) == breaks
    assert (LONG in page) != breaks
    assert "0.5\u2060–\u20601.5" in page and "propeller_loss:port" in page


def pages_in(file):
    """The dict literals of a module that are pages."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Dict):
            keys = {key.value for key in node.keys if isinstance(key, ast.Constant)}
            if {"title", "sections"} <= keys:
                yield keys


def test_every_page_of_the_package_has_a_summary():
    files = Path(training.__file__).parent.rglob("*.py")
    found = {str(file): list(pages_in(file)) for file in files}
    assert sum(map(len, found.values())) > 20
    for name, pages in found.items():
        assert all("summary" in keys for keys in pages), name


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
@pytest.mark.parametrize("n_columns", [3, 7, 11, 12])
def test_text_and_tables_are_as_wide_as_the_page(tmp_path, n_columns):
    cells = [LONG] + ["12.34 (10.00–15.00)"] * (n_columns - 1)
    table = {"columns": ["isolation, restricted mean [s]"] * n_columns, "rows": [cells] * 3}
    section = {"heading": "x", "text": ["word " * 100], "table": table}
    (tmp_path / "page").mkdir()
    written(tmp_path / "page", section)
    with tab(tmp_path, width=1300) as page:
        page.call("Page.navigate", url=(tmp_path / "page" / "index.html").as_uri())
        page.until("document.querySelector('table') !== null")
        width = page.evaluate("document.querySelector('.summary').offsetWidth")
        for element in ("table", ".scroll", "h2 + p"):
            script = f"document.querySelector('{element}').scrollWidth"
            assert abs(page.evaluate(script) - width) <= 2, element
