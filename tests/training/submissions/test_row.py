"""Rows hold what they are recomputed from, and say when something is wrong with them."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from auv_fault_env.errors import InputError
from training.submissions import page, row
from training.submissions.draw import Draw, Recipe
from training.submissions.row import Row
from training.submissions.scoring import FIGURES, Figure
from training.submissions.submission import digest_of

ROOT = Path(__file__).parents[3]
FILES = {"mine.py": "1" * 64, "data/weights.bin": "2" * 64}


def made(name="mine", isolation=8.0, nonce="n", files=FILES, nonce_from=None, suite="thesis"):
    recipe = Recipe(suite, 4, 0.1, 0.05)
    first = Draw(recipe, digest_of("mine.py:Mine", files), nonce).first_seeds
    return Row(
        name=name,
        target="mine.py:Mine",
        files=files,
        recipe=recipe,
        nonce=nonce,
        nonce_from=nonce_from,
        seeds={part: {"first": seed, "count": 4} for part, seed in first.items()},
        episodes="3" * 64,
        figures={key: Figure(isolation, (0.0, 2 * isolation)) for key in FIGURES},
        update={"p50_us": 10.0, "p99_us": 20.0, "many_lanes_us": 1.0},
        scored_by={"version": "0.1.0", "revision": None, "code": "abc"},
    )


def written(folder, one, name="row.json"):
    path = folder / name
    path.write_text(one.text(), encoding="utf-8")
    return path


def test_what_is_written_is_read(tmp_path):
    assert row.read(written(tmp_path, made())) == made()


def spoilt(path, change):
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.update(extra=1), "field of row: got 'extra'"),
        (lambda c: c["figures"].update(extra=1), "field of figures: got 'extra'"),
        (lambda c: c["figures"]["detected"].update(extra=1), "field of figures, detected"),
        (lambda c: c.pop("nonce"), "field nonce of row"),
        (lambda c: c["figures"].pop("detected"), "field detected of figures"),
        (lambda c: c.update(nonce="m"), "first seeds"),
        (lambda c: c["recipe"].update(lanes=5), "first seeds"),
        (lambda c: c["recipe"].update(suite="none"), "suite: got 'none'"),
        (lambda c: c["files"].update({"mine.py": "4" * 64}), "first seeds"),
        (lambda c: c.update(target="mine.py:Other"), "first seeds"),
        (lambda c: c.update(submission="4" * 64), "submission"),
        (lambda c: c["seeds"]["counting"].update(first=1), "first seeds"),
        (lambda c: c["seeds"]["faulty"].update(count=5), "faulty seeds"),
        (lambda c: c["seeds"]["faulty"].update(count=5.5), "a whole number"),
        (lambda c: c["figures"]["detected"].update(value="high"), "figures, detected"),
        (lambda c: c["figures"]["detected"].update(value=float("nan")), "figures, detected"),
        (lambda c: c["figures"]["detected"].update(interval=[2, 1]), "figures, detected"),
        (lambda c: c["files"].update({"mine.py": "short"}), "SHA-256"),
        (lambda c: c.update(name="<b>"), "name"),
        (lambda c: c.update(name="a\nb"), "printable"),
        (lambda c: c.update(files=[]), "a JSON object"),
        (lambda c: c["update"].update(p50_us=-1), "update, p50_us"),
    ],
)
def test_a_spoilt_row_is_refused_in_one_line(tmp_path, change, words):
    path = spoilt(written(tmp_path, made()), change)
    with pytest.raises(InputError, match=words) as refused:
        row.read(path)
    assert "\n" not in str(refused.value) and str(path) in str(refused.value)


@pytest.mark.parametrize("text", ["", "[]", "{", "[" * 100_000, "\x00"])
def test_a_file_that_is_no_row_is_refused_in_one_line(tmp_path, text):
    path = tmp_path / "row.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"row\.json") as refused:
        row.read(path)
    assert "\n" not in str(refused.value)


@pytest.fixture
def small(monkeypatch):
    """Rows of few episodes are taken."""
    monkeypatch.setattr(row, "LEAST_LANES", 1)
    monkeypatch.setattr(row, "LEAST_HOURS", 0.01)


def test_a_row_of_few_episodes_is_refused(tmp_path):
    path = written(tmp_path, made())
    with pytest.raises(InputError, match=r"4 faulty episodes, 0.1 h and 0.05 h.*at least 100"):
        row.read_all(tmp_path)
    assert row.read(path) == made()


def test_the_best_of_many_nonces_is_no_row(tmp_path, small):
    written(tmp_path, made(), "a.json")
    written(tmp_path, made(name="other", nonce="better"), "b.json")
    with pytest.raises(InputError, match="one row of a submission"):
        row.read_all(tmp_path)
    written(tmp_path, made(nonce="better", files=FILES | {"mine.py": "5" * 64}), "b.json")
    with pytest.raises(InputError, match="one row of a submission"):
        row.read_all(tmp_path)
    written(tmp_path, made(suite="ideal"), "b.json")
    assert len(row.read_all(tmp_path)) == 2


def test_the_table_has_the_best_first_and_says_which_nonces_are_unverified(tmp_path, small):
    (tmp_path / "rows").mkdir()
    written(tmp_path / "rows", made("slow", 9.0, nonce_from="a `page` | elsewhere"), "a.json")
    quick = made("quick", 2.0, files=FILES | {"mine.py": "5" * 64})
    written(tmp_path / "rows", quick, "b.json")
    rows = row.read_all(tmp_path / "rows")
    text = f"before\n{page.BEGIN}former{page.END}after\n"
    shown = page.with_tables(text, rows, tmp_path / "page.md")
    assert shown.startswith("before\n") and shown.endswith("after\n") and "former" not in shown
    lines = shown.splitlines()
    quick_at, slow_at = (
        next(k for k, line in enumerate(lines) if line.startswith(f"| {name} |"))
        for name in ("quick", "slow")
    )
    assert slow_at == quick_at + 1
    assert "2.00 (0.00–4.00)" in lines[quick_at] and "200 % (0–400)" in lines[quick_at]
    origins = [line for line in lines if "rows/" in line]
    assert page.UNVERIFIED in origins[0] and page.UNVERIFIED not in origins[1]
    assert "`a 'page' \\| elsewhere`" in origins[1]
    # in two lines, which the width of a page holds
    assert "--files data/weights.bin \\\n        --suite thesis --lanes 4 --hours 0.1" in shown
    assert page.with_tables(shown, rows, tmp_path / "page.md") == shown


def test_a_page_without_marks_is_refused(tmp_path):
    with pytest.raises(InputError, match="put them in"):
        page.with_tables("text", {}, tmp_path / "page.md")


def test_the_row_of_another_recipe_has_its_own_table():
    other = replace(made(), recipe=Recipe("thesis", 4, 0.1, 0.05))
    text = page.tables({Path("a.json"): other, Path("b.json"): made(suite="ideal")}, Path())
    assert text.index("### Recipe ideal, 4 faulty") < text.index("### Recipe thesis, 4 faulty")


def test_the_page_in_docs_is_that_of_its_rows():
    path = ROOT / "docs" / "leaderboard.md"
    text = path.read_text(encoding="utf-8")
    rows = row.read_all(ROOT / "docs" / "leaderboard")
    assert len(rows) >= 3
    assert page.with_tables(text, rows, path) == text
