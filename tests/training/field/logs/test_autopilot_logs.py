"""Logs of autopilots: ULog, DataFlash, .tlog and MAVLink in MCAP become columns of numbers."""

import gzip
import struct
import sys

import numpy as np
import pytest

from auv_fault_env.errors import InputError
from training.field.logs import limits, mavlink_table
from training.field.logs.files import read_table
from training.field.proposal.proposal import propose

from .foreign_logs import dataflash, frame, mcap, tlog, ulog

NAN = np.nan
VFR = (0.0, 1.5, 90, 40, 0.0, 0.0)  # airspeed, groundspeed, heading, throttle, altitude, climb


def write(tmp_path, content, name):
    path = tmp_path / name
    path.write_bytes(content)
    return path


ESC_FORMATS = [
    "esc_report:uint64_t timestamp;int32_t esc_rpm;float esc_voltage;float esc_current;",
    "esc_status:uint64_t timestamp;uint8_t count;esc_report[2] esc;",
    "battery_status:uint64_t timestamp;float voltage_v;",
]


def esc_status(time, *reports):
    content = struct.pack("<QB", time, 2)
    return 0, content + b"".join(struct.pack("<Qiff", time, *report) for report in reports)


def battery(number, time, voltage):
    return number, struct.pack("<Qf", time, voltage)


def px4(n=3):
    subscriptions = [(0, 0, "esc_status"), (0, 1, "battery_status"), (1, 2, "battery_status")]
    data = []
    for k in range(n):
        time = 1_000_000 + 100_000 * k
        data.append(esc_status(time, (300 + k % 7, 15.5, 2.5), (310 + k % 5, 15.25, 2.0)))
        data.append(battery(1, time + 5_000, 16.0))
        data.append(battery(2, time + 40_000, 12.0))
    return ulog(ESC_FORMATS, subscriptions, data, dropouts=[500])


def test_ulog(tmp_path):
    table = read_table(write(tmp_path, px4(), "log.ulg"))
    np.testing.assert_allclose(table.columns["time"], [0, 0.04, 0.1, 0.14, 0.2, 0.24])
    columns = {
        "esc_status.esc[0].esc_rpm": [300, NAN, 301, NAN, 302, NAN],
        "esc_status.esc[1].esc_current": [2, NAN, 2, NAN, 2, NAN],
        "battery_status[0].voltage_v": [16, NAN, 16, NAN, 16, NAN],
        "battery_status[1].voltage_v": [NAN, 12, NAN, 12, NAN, 12],
    }
    for name, values in columns.items():
        np.testing.assert_array_equal(table.columns[name], values)
    assert not [name for name in table.columns if name.endswith("timestamp") and "esc[" not in name]
    assert table.remarks == ("ULog: the logger lost 0.5 s (1 dropouts)",)
    assert table.units == {"time": "s"}


def test_ulog_in_gzip_and_cut_off(tmp_path):
    whole = read_table(write(tmp_path, gzip.compress(px4()), "log.ulg.gz"))
    assert whole.columns["time"].size == 6
    cut = read_table(write(tmp_path, px4()[:-20], "log.ulg"))
    assert cut.columns["time"].size >= 5


def test_ulog_whose_types_unfold_without_end_is_refused_before_they_do(tmp_path):
    formats = [f"t{k}:t{k + 1}[60000] x;" for k in range(6)] + ["t6:uint8_t[60000] x;"]
    content = ulog(formats, [(0, 0, "t0")], [])
    with pytest.raises(InputError, match="at most 4096 fields in a topic"):
        read_table(write(tmp_path, content, "log.ulg"))
    endless = ulog(["a:b x;", "b:a x;"], [(0, 0, "a")], [])
    with pytest.raises(InputError, match="at most 4096 fields in a topic"):
        read_table(write(tmp_path, endless, "log.ulg"))


def test_a_ulog_that_its_library_would_read_for_ever_is_refused(tmp_path):
    content = ulog(ESC_FORMATS, [], []) + struct.pack("<HB", 20_000, 0)
    with pytest.raises(InputError, match="damaged near its end"):
        read_table(write(tmp_path, content, "log.ulg"))


def test_a_damaged_ulog_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"log\.ulg'; allowed is"):
        read_table(write(tmp_path, px4()[:10], "log.ulg"))


DATAFLASH_FORMATS = [
    (130, "RCOU", "QHH", "TimeUS,C1,C2"),
    (131, "BAT", "QBff", "TimeUS,Instance,Volt,Curr"),
    (132, "ESC", "QBff", "TimeUS,Instance,RPM,Curr"),
    (133, "MSG", "QZ", "TimeUS,Message"),
    (134, "UNIT", "QbZ", "TimeUS,Id,Label"),
    (135, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
]


def ardusub(n=3):
    units = {"s": b"s", "v": b"V", "A": b"A", "q": b"rpm"}
    rows = [(134, (0, ord(mark), unit)) for mark, unit in units.items()]
    rows += [(135, (0, 131, b"s#vA", b"F---")), (135, (0, 132, b"s#qA", b"F---"))]
    rows += [(133, (0, b"ArduSub V4.1"))]
    for k in range(n):
        time = 5_000_000 + 100_000 * k
        rows.append((130, (time, 1500, 1600 + k)))
        rows.append((131, (time + 1000, 0, 15.5, 2.25 + k)))
        rows.append((132, (time + 2000, 0, 300.0 + k % 7, 1.0)))
        rows.append((132, (time + 2000, 1, 310.0 + k % 5, 1.0)))
    return dataflash(DATAFLASH_FORMATS, rows)


def test_dataflash(tmp_path, capfd):
    table = read_table(write(tmp_path, ardusub(), "00000001.BIN"))
    np.testing.assert_allclose(table.columns["time"], [0, 0.1, 0.2])
    columns = {
        "RCOU.C1": [1500] * 3,
        "RCOU.C2": [1600, 1601, 1602],
        "BAT.Volt": [15.5] * 3,
        "BAT.Curr": [2.25, 3.25, 4.25],
        "ESC[0].RPM": [300, 301, 302],
        "ESC[1].RPM": [310, 311, 312],
    }
    for name, values in columns.items():
        np.testing.assert_array_equal(table.columns[name], values)
    assert not [name for name in table.columns if name.startswith(("MSG", "FMT", "UNIT"))]
    units = {"BAT.Volt": "V", "BAT.Curr": "A", "ESC[1].RPM": "rpm"}
    assert {name: table.units[name] for name in units} == units
    assert capfd.readouterr() == ("", "")


def test_damaged_parts_of_a_dataflash_log_are_left_out(tmp_path, capfd):
    content = ardusub(200)
    damaged = content[:3000] + bytes(100) + content[3000:-7]
    table = read_table(write(tmp_path, damaged, "00000001.BIN"))
    assert table.columns["time"].size >= 198
    assert table.remarks == ("DataFlash: damaged parts left out",)
    assert capfd.readouterr() == ("", "")


def ground_station():
    cells = [16_000, *[65_535] * 9]
    battery = (0, 0, 1, 2000, cells, 250, 1, 1, 50)
    frames = []
    for k in range(3):
        time = 0.1 * k
        frames.append((time, frame("HEARTBEAT", (2, 3, 0, 0, 4, 3))))
        frames.append((time, frame("HEARTBEAT", (6, 8, 0, 0, 4, 3), system=255, component=190)))
        frames.append((time + 0.001, frame("VFR_HUD", (0.0, 1.5 + k, 90, 40, 0.0, 0.0))))
        frames.append((time + 0.002, frame("BATTERY_STATUS", battery)))
        esc = ([20] * 4, [1550] * 4, [120] * 4, [0] * 4, [300 + k, 310, 0, 0], [k] * 4)
        frames.append((time + 0.003, frame("ESC_TELEMETRY_1_TO_4", esc)))
    return frames


def test_tlog(tmp_path):
    table = read_table(write(tmp_path, tlog(ground_station()), "log.tlog"))
    np.testing.assert_allclose(table.columns["time"], [0, 0.1, 0.2], atol=1e-6)
    columns = {
        "VFR_HUD.groundspeed": [1.5, 2.5, 3.5],
        "BATTERY_STATUS.voltages[0]": [16_000] * 3,
        "BATTERY_STATUS.voltages[1]": [NAN] * 3,
        "BATTERY_STATUS.current_battery": [2.5] * 3,
        "ESC_TELEMETRY_1_TO_4.rpm[0]": [300, 301, 302],
        "ESC_TELEMETRY_1_TO_4.voltage[3]": [15.5] * 3,
        "HEARTBEAT[255.190].type": [6] * 3,
        "HEARTBEAT[1.1].type": [2] * 3,
    }
    for name, values in columns.items():
        np.testing.assert_allclose(table.columns[name], values)
    units = {
        "VFR_HUD.groundspeed": "m/s",
        "BATTERY_STATUS.voltages[0]": "mV",
        "BATTERY_STATUS.current_battery": "A",
        "ESC_TELEMETRY_1_TO_4.voltage[3]": "V",
        "ESC_TELEMETRY_1_TO_4.rpm[0]": "rpm",
    }
    assert {name: table.units[name] for name in units} == units
    assert table.remarks == ()


def test_damaged_parts_of_a_tlog_are_left_out_and_counted(tmp_path):
    frames = ground_station()
    content = tlog(frames[:5]) + b"\xfe\xfd noise" + tlog(frames[5:])[:-1]
    spoilt = bytearray(content)
    spoilt[20] ^= 0xFF
    table = read_table(write(tmp_path, bytes(spoilt), "log.tlog"))
    assert table.columns["VFR_HUD.groundspeed"].tolist() == [1.5, 2.5, 3.5]
    assert any("frames that are damaged" in remark for remark in table.remarks)
    assert any(remark.startswith("MAVLink: bytes between") for remark in table.remarks)


def blueos():
    def message(kind, **fields):
        header = {"system_id": 1, "component_id": 1, "sequence": 7}
        return {"header": header, "message": {"type": kind} | fields}

    for k in range(3):
        time = 0.1 * k
        yield time, "mavlink/1/1/VFR_HUD", "json", message("VFR_HUD", groundspeed=1.5 + k)
        battery = message("BATTERY_STATUS", current_battery=250, voltages=[16_000, 65_535])
        yield time, "mavlink/1/1/BATTERY_STATUS", "json", battery
        yield time, "pump", "json", {"flow": {"rate": 2.0}, "on": True, "note": "x"}
        yield time, "raw", "mavlink", frame("VFR_HUD", VFR)
        yield time, "camera", "protobuf", b"\x00\x01"


@pytest.mark.parametrize("chunk_size", [100, 1 << 20])
def test_mavlink_in_mcap(tmp_path, chunk_size):
    table = read_table(mcap(tmp_path / "log.mcap", blueos(), chunk_size))
    columns = {
        "time": [0, 0.1, 0.2],
        "mavlink/1/1/VFR_HUD/groundspeed": [1.5, 2.5, 3.5],
        "mavlink/1/1/BATTERY_STATUS/current_battery": [2.5] * 3,
        "mavlink/1/1/BATTERY_STATUS/voltages/0": [16_000] * 3,
        "pump/flow/rate": [2.0] * 3,
        "pump/on": [1.0] * 3,
        "VFR_HUD/groundspeed": [1.5] * 3,
    }
    for name, values in columns.items():
        np.testing.assert_allclose(table.columns[name], values, atol=1e-6)
    assert table.units["mavlink/1/1/BATTERY_STATUS/voltages/0"] == "mV"
    assert table.remarks == ("camera in protobuf: messages left out (3)",)


def test_mcap_cut_off_is_read_up_to_there(tmp_path):
    path = mcap(tmp_path / "log.mcap", blueos(), chunk_size=100)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 3])
    table = read_table(path)
    assert table.columns["mavlink/1/1/VFR_HUD/groundspeed"][0] == 1.5
    assert table.remarks[0].startswith("MCAP: breaks off; the messages before are read")


def test_mcap_in_other_encodings_is_refused_by_name(tmp_path):
    path = mcap(tmp_path / "log.mcap", [(0.0, "camera", "protobuf", b"\x00\x01")])
    with pytest.raises(InputError, match="camera in protobuf"):
        read_table(path)


def test_a_chunk_that_would_fill_the_memory_is_not_unpacked(tmp_path, monkeypatch):
    path = mcap(tmp_path / "log.mcap", [(0.0, "zeros", "json", b" " * 3_000_000 + b"1")], 1 << 22)
    assert path.stat().st_size < 100_000
    monkeypatch.setattr(limits, "LARGEST_CONTENT", 1_000_000)
    with pytest.raises(InputError, match="at most 0 MiB, unpacked; write it again with smaller"):
        read_table(path)


LOGS = {
    "log.ulg": lambda path: path.write_bytes(px4(50)),
    "log.BIN": lambda path: path.write_bytes(ardusub(50)),
    "log.tlog": lambda path: path.write_bytes(tlog(ground_station())),
    "log.mcap": lambda path: mcap(path, blueos()),
}


@pytest.mark.parametrize("name", LOGS)
def test_a_table_that_would_fill_the_memory_is_refused(tmp_path, monkeypatch, name):
    LOGS[name](tmp_path / name)
    monkeypatch.setattr(limits, "LARGEST_TABLE", 20)
    with pytest.raises(InputError, match="at most 20 numbers; "):
        read_table(tmp_path / name)


def test_rows_of_a_long_log_are_fewer(tmp_path, monkeypatch):
    path = write(tmp_path, px4(50), "log.ulg")
    table = read_table(path)
    n_numbers = len(table.columns) * table.columns["time"].size
    monkeypatch.setattr(limits, "LARGEST_TABLE", n_numbers // 2)
    fewer = read_table(path)
    assert fewer.columns["time"].size == 50
    assert fewer.remarks[-1] == "time: one row in 0.1 s, for the log is long"
    np.testing.assert_array_equal(
        fewer.columns["esc_status.esc[0].esc_rpm"], 300 + np.arange(50) % 7
    )


PACKAGES = {
    "log.ulg": "pyulog.core",
    "log.BIN": "pymavlink.DFReader",
    "log.tlog": "pymavlink.dialects.v20.ardupilotmega",
    "log.mcap": "mcap.reader",
}


@pytest.mark.parametrize("name", LOGS)
def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch, name):
    LOGS[name](tmp_path / name)
    mavlink_table._dialect.cache_clear()
    mavlink_table._decoder.cache_clear()
    monkeypatch.setitem(sys.modules, PACKAGES[name], None)
    with pytest.raises(InputError, match=r"auv-fault\[logs\]") as caught:
        read_table(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["log.ulg", "log.BIN"])
def test_channels_are_proposed(tmp_path, name):
    LOGS[name](tmp_path / name)
    vehicle = propose(read_table(tmp_path / name), "vehicle").vehicle
    rpm = {"log.ulg": "esc_status.esc[{}].esc_rpm", "log.BIN": "ESC[{}].RPM"}[name]
    assert vehicle.columns["port_rpm"].name == rpm.format(0)
    assert vehicle.columns["starboard_rpm"].name == rpm.format(1)
    assert vehicle.time.name == "time"
