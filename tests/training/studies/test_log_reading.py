"""The study of reading large logs, on small ones."""

import json

import pytest

from auv_fault_env.errors import InputError
from training.studies.log_reading import DIALECTS, LogReadingStudy, main


def test_every_dialect_is_measured(tmp_path, capsys):
    main(LogReadingStudy(tmp_path / "run", rows=200, columns=3, repeats=1))
    results = json.loads((tmp_path / "run" / "results.json").read_text())["results"]
    assert list(results) == list(DIALECTS)
    for dialect in results.values():
        assert dialect["ours"]["time"] > 0 and dialect["ours"]["memory"] > 10
    assert not (tmp_path / "run" / "log.csv").exists()
    assert "200 rows of 3 columns" in capsys.readouterr().out


def test_impossible_sizes_are_refused(tmp_path):
    with pytest.raises(InputError, match="columns: got 1"):
        main(LogReadingStudy(tmp_path / "run", columns=1))
