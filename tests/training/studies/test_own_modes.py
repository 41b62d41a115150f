import json

import numpy as np

from training.studies import own_modes
from training.studies.own_modes import OwnModesStudy


def test_every_diagnoser_has_a_row_and_a_confusion_of_its_modes(tmp_path, monkeypatch):
    entrants = {"5.1": ("raw_network",), "5.2": ("null", "random")}
    monkeypatch.setattr(own_modes, "ENTRANTS", entrants)
    own_modes.main(OwnModesStudy(output=tmp_path / "out", lanes=12, hours=0.1))
    results = json.loads((tmp_path / "out" / "results.json").read_text())
    scores, *others = results["sections"]
    reasons = others[: len(entrants)]
    confusions = others[len(entrants) :]
    rows = [row[:3] for row in scores["table"]["rows"]]
    assert rows == [
        ["Table 5.1", "ideal", "raw_network"],
        ["Table 5.1", "realism 1", "raw_network"],
        *(["Table 5.2", kind, name] for kind in own_modes.REALISMS for name in entrants["5.2"]),
    ]
    assert len(confusions) == len(rows)
    matrix = np.array(results["scores"]["5.1"]["ideal"]["raw_network"]["confusion"])
    assert matrix.shape == (4, 4) and matrix[1:].sum() == 12
    assert [row[0] for row in confusions[0]["table"]["rows"]] == confusions[0]["table"]["columns"][
        1:
    ]
    severity = {row[0]: row[6] for row in scores["table"]["rows"]}
    assert severity["Table 5.1"] == "-" and float(severity["Table 5.2"]) > 0.0
    counts = [row[2:] for row in reasons[1]["table"]["rows"] if row[1] == "null"]
    assert len(counts) == 2  # of either realism
    for row in counts:
        # `null` never raises an alarm
        assert all(cell.split(";")[1].startswith(" 0 of ") for cell in row)
