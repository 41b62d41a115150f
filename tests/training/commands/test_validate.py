"""`auv-fault validate` is the benchmark on validation seeds."""

import json

import pytest

from training import cli
from training.benchmark import timing
from training.commands import benchmark
from training.seeds import purpose_of

# of these the first whole missions are of a minute or two
SEED = 1129
OTHER_SEED = 11_758


@pytest.fixture(autouse=True)
def short_timing(monkeypatch):
    values = {"WARM_UP": 2, "ONE_BY_ONE": 10, "MANY_LANES": 4, "MANY_SAMPLES": 3, "DIFFERENT": 2}
    for name, value in values.items():
        monkeypatch.setattr(timing, name, value)


def run(output, *arguments):
    tiny = ["--lanes", "6", "--hours", "0.05", "--diagnosers", "null", "random"]
    assert cli.main(["validate", "--output", str(output), *tiny, *arguments]) == 0
    return json.loads((output / "results.json").read_text())


def test_it_leaves_a_report_of_validation_episodes(tmp_path, monkeypatch):
    output = tmp_path / "out"
    results = run(output, "--seed", str(SEED))
    assert results["command"].startswith(f"auv-fault validate --seed {SEED} --lanes 6 --hours 0.05")
    assert results["suite"]["name"] == "validation" and results["suite"]["listed"] == 6
    assert list(results["scores"]) == ["cruise", "thesis"]
    assert list(results["scores"]["thesis"]) == ["null", "random"]
    ends = [seed for part in ("faulty", "threshold", "counting") for seed in results["seeds"][part]]
    assert {purpose_of(seed) for seed in ends} == {"validation"}
    assert "Leaderboard under thesis" in (output / "index.html").read_text()
    # another seed has other episodes, and replaces the report
    monkeypatch.setattr(benchmark, "write_report", lambda report, folder: None)
    again = run(output, "--seed", str(OTHER_SEED))
    assert again["episodes"]["seed"] != results["episodes"]["seed"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--diagnosers", "nul"], ["diagnoser", "'nul'", "did you mean 'null'"]),
        (["--lanes", "1"], ["lanes", "1", "from 2"]),
        (["--hours", "nan"], ["hours", "nan"]),
        (["--hours", "0"], ["hours", "0"]),
        (["--seed", "-1"], ["seed", "-1"]),
    ],
    ids=lambda value: " ".join(value) if value[0].startswith("--") else "",
)
def test_bad_input_ends_with_two_and_one_line(tmp_path, capfd, arguments, words):
    assert cli.main(["validate", "--output", str(tmp_path / "out"), *arguments]) == 2
    message = capfd.readouterr().err
    assert message.count("\n") == 1
    for word in words:
        assert word in message
    assert not list(tmp_path.iterdir())
