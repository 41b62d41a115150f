"""The table of the learning libraries says what the tests say."""

import ast
import importlib.util
import re
from pathlib import Path
from string import Formatter

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "tests" / "ecosystem"
SPEC = importlib.util.spec_from_file_location("write_table", FOLDER / "write_table.py")
write_table = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(write_table)
CASE = """<testcase classname="tests.ecosystem.test_{file}" name="test_it">{outcome}<properties>
<property name="library" value="lib" /><property name="version" value="1.0" />
<property name="environment" value="{environment}" /><property name="what" value="it learns" />
</properties></testcase>"""
FAILED = '<failure message="ValueError: no&#10;more">trace</failure>'


def report(tmp_path, *cases):
    path = tmp_path / "report.xml"
    path.write_text(f"<testsuites><testsuite>{''.join(cases)}</testsuite></testsuites>")
    return str(path)


def case(outcome="", environment="Propulsion-v0", file="lib"):
    return CASE.format(outcome=outcome, environment=environment, file=file)


@pytest.fixture(autouse=True)
def page(tmp_path, monkeypatch):
    path = tmp_path / "page.md"
    path.write_text(f"before\n{write_table.BEGIN}old\n{write_table.END}after\n")
    monkeypatch.setattr(write_table, "PAGE", path)
    monkeypatch.setattr(write_table, "__file__", str(tmp_path / "write_table.py"))
    (tmp_path / "test_lib.py").touch()
    return path


def test_all_passed(tmp_path, page):
    cases = case(), case(environment="ActiveDiagnosis-v0")
    assert write_table.main([report(tmp_path, *cases)]) == 0
    text = page.read_text()
    assert "| lib | 1.0 | it learns | passed | passed |\n" in text
    assert text.startswith("before\n") and text.endswith("after\n") and "old" not in text


@pytest.mark.parametrize(
    ("outcome", "words"),
    [
        (FAILED, "failure: ValueError: no"),
        ('<error message="gone" />', "error: gone"),
        ('<skipped message="not here" />', "skipped: not here"),
    ],
)
def test_nothing_else_becomes_passed(tmp_path, page, outcome, words):
    for cases in ((case(outcome), case()), (case(), case(outcome))):
        assert write_table.main([report(tmp_path, *cases)]) == 1
        assert f"| it learns | {words} |  |\n" in page.read_text()


def test_a_file_without_a_result_is_named(tmp_path, capsys):
    (tmp_path / "test_other.py").touch()
    assert write_table.main([report(tmp_path, case())]) == 1
    assert "test_other.py: no test ran" in capsys.readouterr().err


def patterns():
    """What the rows of the tests in the folder say, with anything for a parameter."""
    for path in FOLDER.glob("test_*.py"):
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                parts = [re.escape(part) for part, *_ in Formatter().parse(ast.get_docstring(node))]
                yield ".+".join(parts)


def test_the_page_says_what_tests_say_and_all_of_them_passed():
    _, _, rest = (ROOT / "docs" / "ecosystem.md").read_text("utf-8").partition(write_table.BEGIN)
    written, _, _ = rest.partition(write_table.END)
    known = list(patterns())
    rows = written.splitlines()[2:]
    assert rows and known
    for row in rows:
        _, _, what, *results = (cell.strip() for cell in row.strip("|").split("|"))
        assert results == [write_table.PASSED] * 2, row
        assert any(re.match(pattern, what) for pattern in known), row
