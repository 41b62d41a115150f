"""Bags: every number of every message, where and when it was; what is no bag is refused in one
line.
"""

import sys

import numpy as np
import pytest

from auv_fault_env.channels import CHANNELS
from auv_fault_env.errors import InputError
from auv_fault_env.fleet import Fleet
from auv_fault_env.parameters import vehicle_of
from training.field.logs.bags import LONGEST_ARRAY, read_bag
from training.field.logs.files import read_table
from training.field.logs.log import read_log
from training.field.vehicle_file import Column, VehicleFile
from training.rollouts import roll_out

pytest.importorskip("rosbags")
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START = 1_700_000_000_000_000_000  # ns
PLUGINS = {"mcap": StoragePlugin.MCAP, "db3": StoragePlugin.SQLITE3}
MOTOR = "\n".join(
    (
        "std_msgs/Header header",
        "auv_msgs/msg/Shaft[2] shafts",
        "bool enabled",
        "string name",
        "float32[] temperatures",
    )
)
SHAFT = "float32 rpm\nint32 ticks"


def store():
    types = get_typestore(Stores.ROS2_HUMBLE)
    types.register(get_types_from_msg(SHAFT, "auv_msgs/msg/Shaft"))
    types.register(get_types_from_msg(MOTOR, "auv_msgs/msg/Motor"))
    return types


def write(path, messages, plugin="mcap"):
    """A bag of messages (time [s], topic, type, fields)."""
    types = store()
    connections = {}
    with Writer(path, version=9, storage_plugin=PLUGINS[plugin]) as writer:
        for time, topic, kind, fields in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=types)
            data = (
                types.serialize_cdr(types.types[kind](**fields), kind)
                if isinstance(fields, dict)
                else fields
            )
            writer.write(connections[topic], START + round(1e9 * time), data)
    return path


def number(time, topic, value):
    return time, topic, "std_msgs/msg/Float64", {"data": value}


def motor(time, rpm, temperatures=(20.0,)):
    types = store().types
    stamp = types["builtin_interfaces/msg/Time"](sec=9, nanosec=7)
    return (
        time,
        "/motor",
        "auv_msgs/msg/Motor",
        {
            "header": types["std_msgs/msg/Header"](stamp=stamp, frame_id="base"),
            "shafts": [types["auv_msgs/msg/Shaft"](rpm=value, ticks=int(value)) for value in rpm],
            "enabled": True,
            "name": "starboard",
            "temperatures": np.array(temperatures, np.float32),
        },
    )


@pytest.fixture(params=["mcap folder", "mcap file", "db3 folder", "db3 file"])
def place(request):
    """Where to write a bag and how, and what to read then."""
    plugin, kind = request.param.split()
    return plugin, lambda folder: folder if kind == "folder" else next(folder.glob(f"*.{plugin}"))


def test_topics_become_columns_on_one_axis(tmp_path, place):
    plugin, what = place
    messages = [number(0.0, "/speed", 0.5), motor(0.05, (300.0, 310.0)), number(0.1, "/speed", 0.6)]
    table = read_table(what(write(tmp_path / "bag", messages, plugin)))
    assert table.remarks == ()
    nan = np.nan
    expected = {
        "time": [0.0, 0.05, 0.1],
        "/speed/data": [0.5, nan, 0.6],
        "/motor/shafts/0/rpm": [nan, 300.0, nan],
        "/motor/shafts/0/ticks": [nan, 300.0, nan],
        "/motor/shafts/1/rpm": [nan, 310.0, nan],
        "/motor/shafts/1/ticks": [nan, 310.0, nan],
        "/motor/enabled": [nan, 1.0, nan],
        "/motor/temperatures/0": [nan, 20.0, nan],
    }
    assert list(table.columns) == list(expected)
    for name, values in expected.items():
        assert table.columns[name].dtype == np.float64
        np.testing.assert_allclose(table.columns[name], values, atol=1e-12)


def test_simultaneous_messages_share_a_row_each_topic_once(tmp_path):
    messages = [
        number(0.0, "/a", 1.0),
        number(0.019, "/b", 2.0),
        number(0.021, "/c", 3.0),
        number(0.022, "/c", 4.0),
    ]
    columns = read_bag(write(tmp_path / "bag", messages)).columns
    np.testing.assert_allclose(columns["time"], [0.0, 0.021, 0.022])
    np.testing.assert_array_equal(columns["/a/data"], [1.0, np.nan, np.nan])
    np.testing.assert_array_equal(columns["/b/data"], [2.0, np.nan, np.nan])
    np.testing.assert_array_equal(columns["/c/data"], [np.nan, 3.0, 4.0])


@pytest.mark.parametrize("apart", [0.0002, 0.004], ids=["together", "one after the other"])
@pytest.mark.parametrize("rate", [10.0, 1.0])
def test_a_bag_is_read_as_a_log(tmp_path, apart, rate):
    rollout = roll_out(Fleet(1), [1], 150)
    samples = rollout.observations[:, 0].astype(float)
    messages = [
        number(k / rate + apart * place, f"/{channel}", values[place])
        for k, values in enumerate(samples)
        for place, channel in enumerate(CHANNELS)
    ]
    columns = {channel: Column(f"/{channel}/data") for channel in CHANNELS}
    vehicle = VehicleFile(vehicle_of("thesis1992"), columns, Column("time"), rate)
    log = read_log(write(tmp_path / "bag", messages), vehicle)
    assert log.segments == (slice(0, 150 * round(10 / rate) - round(10 / rate) + 1),)
    np.testing.assert_array_equal(log.observation[:: round(10 / rate)], samples)


def test_an_array_of_variable_length_fills_its_columns(tmp_path):
    messages = [motor(0.0, (1.0, 2.0), ()), motor(1.0, (1.0, 2.0), (5.0, 6.0))]
    columns = read_bag(write(tmp_path / "bag", messages)).columns
    np.testing.assert_array_equal(columns["/motor/temperatures/1"], [np.nan, 6.0])


def test_a_long_array_is_no_reading(tmp_path):
    columns = read_bag(
        write(tmp_path / "bag", [motor(0.0, (1.0, 2.0), np.zeros(LONGEST_ARRAY + 1))])
    ).columns
    assert not [name for name in columns if "temperatures" in name]


def test_messages_that_cannot_be_decoded_are_left_out_and_counted(tmp_path):
    broken = (0.5, "/speed", "std_msgs/msg/Float64", b"\x00\x01")
    table = read_bag(
        write(tmp_path / "bag", [number(0.0, "/speed", 1.0), broken, number(1.0, "/speed", 2.0)])
    )
    np.testing.assert_array_equal(table.columns["/speed/data"], [1.0, 2.0])
    assert table.remarks == ("/speed: 1 messages that cannot be decoded left out",)


def cut(folder):
    path = next(folder.glob("*.mcap"))
    path.write_bytes(path.read_bytes()[:-60])
    return path


def garbage(folder):
    path = folder.parent / "garbage.mcap"
    path.write_bytes(np.random.default_rng(0).bytes(500))
    return path


def empty(folder):
    (folder.parent / "empty.mcap").touch()
    return folder.parent / "empty.mcap"


def no_metadata(folder):
    (folder / "metadata.yaml").unlink()
    return folder


def broken_metadata(folder):
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    return folder


def text(folder):
    (folder / "log.csv").write_text("time,speed\n0,1\n")
    return folder / "log.csv"


def nowhere(folder):
    return folder / "nowhere.mcap"


@pytest.mark.parametrize(
    "spoil", [cut, garbage, empty, no_metadata, broken_metadata, text, nowhere]
)
def test_a_damaged_bag_is_refused_in_one_line(tmp_path, spoil):
    path = spoil(write(tmp_path / "bag", [number(0.0, "/speed", 1.0)]))
    with pytest.raises(
        InputError, match=r"^bag: got .*allowed is a whole MCAP file or rosbag2 folder"
    ) as caught:
        read_bag(path)
    assert "\n" not in str(caught.value) and path.name in str(caught.value)


def test_a_bag_without_numbers_is_refused(tmp_path):
    path = write(tmp_path / "bag", [(0.0, "/note", "std_msgs/msg/String", {"data": "off we go"})])
    with pytest.raises(InputError, match="one with numbers in its messages"):
        read_bag(path)


def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(InputError, match=r"auv-fault\[logs\]"):
        read_bag(tmp_path)
