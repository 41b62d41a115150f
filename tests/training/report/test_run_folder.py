import os
from dataclasses import dataclass
from pathlib import Path

import pytest

from auv_fault_env.errors import InputError
from training.report.run_folder import EARLIER, MANIFEST, run_folder, write_json


@dataclass
class Arguments:
    seed: int = 1


def test_run_appears_only_when_complete(tmp_path):
    output = tmp_path / "deep" / "run"
    with run_folder(output, "test", Arguments()) as folder:
        (folder / "data.txt").write_text("x")
        assert not output.exists()
    assert sorted(path.name for path in output.iterdir()) == ["data.txt", MANIFEST]
    assert list((tmp_path / "deep").iterdir()) == [output]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_failed_run_leaves_nothing(tmp_path, error):
    with pytest.raises(error), run_folder(tmp_path / "deep" / "run", "test", Arguments()) as folder:
        (folder / "half.txt").write_text("x")
        raise error
    assert not list(tmp_path.iterdir())


def test_failed_run_keeps_the_earlier_one(tmp_path):
    output = tmp_path / "run"
    with run_folder(output, "test", Arguments()) as folder:
        (folder / "first.txt").write_text("x")
    with pytest.raises(RuntimeError), run_folder(output, "test", Arguments()):
        raise RuntimeError
    assert (output / "first.txt").exists()
    with run_folder(output, "test", Arguments()):
        pass
    assert not (output / "first.txt").exists()


def test_foreign_folder_is_refused_and_untouched(tmp_path):
    (tmp_path / "thesis.doc").write_text("precious")
    with pytest.raises(
        InputError, match=r"output: got .* allowed is a new folder or that of an earlier run"
    ):
        with run_folder(tmp_path, "test", Arguments()):
            raise AssertionError("must not start")
    assert (tmp_path / "thesis.doc").read_text() == "precious"


@pytest.mark.parametrize("name", [300 * "n", 600 * "f/", "loop", "loop/run", "pipe/run"])
def test_a_place_that_cannot_be_is_refused_in_one_line(tmp_path, name):
    (tmp_path / "loop").symlink_to("loop")
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="choose another --output"):
        with run_folder(tmp_path / name, "test", Arguments()):
            raise AssertionError("must not start")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["loop", "pipe"]


def test_unwritable_place_is_refused_and_nothing_is_left(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="a place that can be written"):
        with run_folder(tmp_path / "file" / "deep" / "run", "test", Arguments()):
            raise AssertionError("must not start")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_json_refuses_what_other_readers_cannot_take(tmp_path):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "x.json", {"value": float("inf")})


def test_foreign_manifest_is_not_taken_for_a_run(tmp_path):
    for text in ('{"name": "my app"}', "[]", "{broken"):
        (tmp_path / MANIFEST).write_text(text)
        (tmp_path / "thesis.tex").write_text("precious")
        with pytest.raises(InputError), run_folder(tmp_path, "test", Arguments()):
            raise AssertionError("must not start")
        assert (tmp_path / "thesis.tex").exists()


def test_disk_full_is_one_line_and_leaves_nothing(tmp_path):
    with pytest.raises(InputError, match=r"a place that can be written .No space left"):
        with run_folder(tmp_path / "run", "test", Arguments()):
            raise OSError(28, "No space left on device")
    assert not list(tmp_path.iterdir())


def test_earlier_run_survives_if_the_new_one_cannot_take_its_place(tmp_path, monkeypatch):
    output = tmp_path / "run"
    with run_folder(output, "test", Arguments()) as folder:
        (folder / "first.txt").write_text("x")
    rename = Path.rename

    def taken(self, target):
        return rename(self, target) if self == output or self.name.endswith(EARLIER) else fail()

    monkeypatch.setattr(Path, "rename", taken)
    with pytest.raises(InputError), run_folder(output, "test", Arguments()):
        pass
    assert (output / "first.txt").exists()
    assert list(tmp_path.iterdir()) == [output]


def fail():
    raise OSError(39, "Directory not empty")


def test_link_to_an_earlier_run_is_followed(tmp_path):
    with run_folder(tmp_path / "run", "test", Arguments()) as folder:
        (folder / "first.txt").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "run")
    with run_folder(tmp_path / "link", "test", Arguments()):
        pass
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "run"]
    assert not (tmp_path / "run" / "first.txt").exists()
