"""The files of a submission and their digest."""

import pytest

from auv_fault_env.errors import InputError
from training.submissions.submission import submission_of


@pytest.fixture
def place(tmp_path):
    (tmp_path / "mine.py").write_text("class Mine: ...")
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "weights.bin").write_bytes(b"\x00\x01\x02")
    (tmp_path / "mine.onnx").write_bytes(b"network")
    return tmp_path


def submitted(place, tmp_path_factory, target="mine.py:Mine", further=("data/weights.bin",)):
    folder = tmp_path_factory.mktemp("copy")
    files = [place / name for name in further]
    return submission_of(str(place / target), files, folder), folder


def test_all_named_files_are_copied_and_no_others(place, tmp_path_factory):
    submission, folder = submitted(place, tmp_path_factory)
    copied = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    assert copied == {"mine.py", "data/weights.bin"} == set(submission.files)
    assert submission.target == "mine.py:Mine"


@pytest.mark.parametrize("changed", ["mine.py", "data/weights.bin"])
def test_one_byte_of_any_file_changes_the_digest(place, tmp_path_factory, changed):
    before, _ = submitted(place, tmp_path_factory)
    again, _ = submitted(place, tmp_path_factory)
    content = bytearray((place / changed).read_bytes())
    content[-1] ^= 1
    (place / changed).write_bytes(content)
    after, _ = submitted(place, tmp_path_factory)
    assert before.digest == again.digest != after.digest


def test_class_and_names_of_files_belong_to_the_digest(place, tmp_path_factory):
    (place / "data" / "copy.bin").write_bytes(b"\x00\x01\x02")
    digests = {
        submitted(place, tmp_path_factory, target, further)[0].digest
        for target in ("mine.py:Mine", "mine.py:Other")
        for further in ((), ("data/weights.bin",), ("data/copy.bin",))
    }
    assert len(digests) == 6


def test_one_byte_of_a_network_changes_the_digest(place, tmp_path_factory):
    before, _ = submitted(place, tmp_path_factory, "mine.onnx", ())
    (place / "mine.onnx").write_bytes(b"networks")
    after, _ = submitted(place, tmp_path_factory, "mine.onnx", ())
    assert before.digest != after.digest
    assert before.target == "mine.onnx"


def test_all_files_of_the_package_of_a_module_belong_to_it(place, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(place)
    package = place / "submitted_package"
    (package / "deep").mkdir(parents=True)
    (package / "__pycache__").mkdir()
    for name in ("__init__.py", "deep/weights.txt", "__pycache__/x.pyc"):
        (package / name).write_text("1")
    before = submission_of("submitted_package.one:Mine", (), tmp_path)
    assert set(before.files) == {
        "submitted_package/__init__.py",
        "submitted_package/deep/weights.txt",
    }
    (package / "deep" / "weights.txt").write_text("2")
    assert submission_of("submitted_package.one:Mine", (), tmp_path).digest != before.digest


@pytest.mark.parametrize(
    ("target", "further", "words"),
    [
        ("nowhere_at_all.module:Mine", (), "check the name of the module"),
        ("", (), "what can be imported"),
        (":Mine", (), "what can be imported"),
        ("{place}/mine.py", (), "name its class: .*/mine.py:Class"),
        ("{place}/absent.py:Mine", (), "a file: module:Class or"),
        ("{place}/absent.onnx", (), "a file: module:Class or"),
        ("{place}/mine.py:Mine", ("absent.txt",), "absent.txt"),
        ("{place}/mine.py:Mine", ("../mine.py",), "or below"),
        ("{place}/mine.py:Mine", ("data",), "a file"),
        ("{place}/mi\x00ne.py:Mine", (), "a file"),
        ("json:Mine", ("mine.py",), "files beside a FILE.py"),
    ],
)
def test_what_is_no_submission_is_refused_in_one_line(
    place, tmp_path_factory, target, further, words
):
    files = [place / name for name in further]
    with pytest.raises(InputError, match=words) as refused:
        submission_of(target.format(place=place), files, tmp_path_factory.mktemp("copy"))
    assert "\n" not in str(refused.value)
