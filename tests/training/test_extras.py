"""A missing extra is one plain sentence: who needs which package, and how to install it."""

import sys
import tomllib
from pathlib import Path

import pytest

from auv_fault_env.errors import InputError
from training.benchmark.workers import check_backend
from training.datasets.forests import boosting, forest
from training.extras import import_from_extra
from training.field.logs import bags, dataflash_table, mavlink_table, mcap_table, ulog_table
from training.formats import minari, onnx_export

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
NEEDED = {
    "`--backend ray`": ("ray", "distributed", lambda: check_backend("ray")),
    "`haizhe`": ("sklearn", "data", lambda: forest(0)),
    "`haizhe` ": ("sklearn", "data", lambda: boosting(0)),
    "reading bags": ("rosbags", "logs", lambda: bags.read_bag("bag")),
    "reading DataFlash logs": ("pymavlink", "logs", dataflash_table._reader),
    "reading MAVLink": ("pymavlink", "logs", mavlink_table._dialect.__wrapped__),
    "reading MCAP": ("mcap", "logs", lambda: mcap_table._profile(Path("log"))),
    "reading ULog": ("pyulog", "logs", lambda: ulog_table._read(b"", "log")),
    "`--formats minari`": (
        "minari",
        "formats",
        lambda: minari.new_storage(Path("run"), None, None),
    ),
    "`export`": ("onnx", "formats", lambda: onnx_export.to_onnx(None)),
}


@pytest.mark.parametrize("user", NEEDED)
def test_who_needs_what_and_how_to_install_it(monkeypatch, user):
    package, extra, use = NEEDED[user]
    for module in list(sys.modules):
        if module.partition(".")[0] == package:
            monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(InputError) as error:
        use()
    expected = f"{user.strip()} needs {package}: pip install 'auv-fault[{extra}]'"
    assert str(error.value) == expected
    names = [one.partition(">")[0] for one in PROJECT["optional-dependencies"][extra]]
    assert {"sklearn": "scikit-learn"}.get(package, package) in names


def test_an_import_that_fails_for_another_reason_says_so(tmp_path, monkeypatch):
    (tmp_path / "broken_one.py").write_text("import a_package_that_nobody_has\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"`x` needs broken_one, whose import fails .*nobody_has"):
        import_from_extra("broken_one", "live", "`x`")
