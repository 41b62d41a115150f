import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auv_fault_env import CHANNELS, PRESETS
from auv_fault_env.channels import READINGS
from auv_fault_env.errors import InputError
from training.field.vehicle_file import (
    BAND,
    NOISE,
    Column,
    VehicleFile,
    as_toml,
    read_vehicle,
    write_vehicle,
)

MINIMAL = '[vehicle]\nsample_rate = 10\n[channels.speed]\ncolumn = "u"\n'
DOCUMENT = Path(__file__).parents[3] / "docs" / "vehicle.md"


def read(tmp_path, text):
    path = tmp_path / "vehicle.toml"
    path.write_text(text, encoding="utf-8")
    return read_vehicle(path)


def test_smallest_file_has_the_preset_and_its_defaults(tmp_path):
    vehicle = read(tmp_path, MINIMAL)
    assert vehicle.vehicle == PRESETS["thesis1992"]
    assert vehicle.columns == {"speed": Column("u", 1.0, 0.0)}
    assert (vehicle.time, vehicle.sample_rate, vehicle.shafts) == (None, 10, 2)
    assert (vehicle.band, vehicle.noise) == (BAND, NOISE)
    assert (vehicle.hotel_load, vehicle.battery) == (0.0, 0.0)
    assert vehicle.diagnoser == "filter_bank"


def test_units_scale_and_offset(tmp_path):
    text = MINIMAL + 'unit = "kn"\nscale = -2.0\noffset = 0.1\n[time]\ncolumn = "t"\nunit = "ms"\n'
    vehicle = read(tmp_path, text)
    assert vehicle.columns["speed"] == Column("u", pytest.approx(-2 * 1852 / 3600), 0.1)
    assert vehicle.time == Column("t", 1e-3, 0.0)


def test_parameters_band_and_noise(tmp_path):
    text = (
        MINIMAL + "[parameters]\nalpha = -0.2\n[healthy_band]\nbeta = 0.2\n[noise]\nspeed = 0.5\n"
    )
    vehicle = read(tmp_path, text)
    assert vehicle.vehicle == replace(PRESETS["thesis1992"], alpha=-0.2)
    assert vehicle.band == {**BAND, "beta": 0.2}
    assert vehicle.noise == {**NOISE, "speed": 0.5}


def some_vehicle():
    columns = {
        channel: Column(f"{channel} [x]", 1.0 + k / 7, -k / 3) for k, channel in enumerate(CHANNELS)
    }
    columns |= {
        "speed": Column('Speed "quoted" \\ µ\x7f', -1852 / 3600, 0.0),
        "rudder": Column("deg", np.pi / 180),
        "port_voltage": Column("duty", 0.01, 0.0, "supply"),
    }
    return VehicleFile(
        vehicle=replace(PRESETS["npsnet1995"], name="number 5", alpha=np.float64(-1 / 13)),
        columns=columns,
        time=Column("t", 1e-9),
        sample_rate=99.7,
        band={"alpha": 1 / 30},
        noise={"speed": 1 / 70},
        hotel_load=12.5,
        battery=np.float64(800.1),
        diagnoser="cusum",
        poor_fit='likely mistakes: "speed"; a \\ and µ',
    )


@pytest.mark.parametrize(
    "vehicle",
    [
        some_vehicle(),
        VehicleFile(replace(PRESETS["thesis1992"], shafts=1), {"port_rpm": Column("n", 60.0)}),
    ],
    ids=["everything", "least"],
)
def test_written_file_is_read_back_equal(tmp_path, vehicle):
    path = tmp_path / "vehicle.toml"
    write_vehicle(path, vehicle, {"vehicle.sample_rate": "two\nlines"})
    assert read_vehicle(path) == vehicle


def test_text_has_units_comments_and_only_what_differs():
    text = as_toml(some_vehicle(), {"channels.speed.column": "by its name"})
    assert "sample_rate = 99.7  # Hz\n" in text
    assert 'preset = "npsnet1995"' in text
    assert re.search(r'column = "Speed .*"  # by its name\nunit = "kn"\nscale = -1.0\n', text)
    assert re.search(
        r"\[parameters\]\nalpha = -0.0769\d+  # 1/m: .*\n\n\[healthy_band\]\nalpha = ", text
    )


WRONG = {
    "unknown table": ("[motor]\n" + MINIMAL, ["'motor'", "parameters", "channels"]),
    "unknown key": (
        MINIMAL.replace("sample_rate", "sampel_rate"),
        ["'sampel_rate'", "did you mean 'sample_rate'"],
    ),
    "no sample rate": (
        MINIMAL.replace("sample_rate", "shafts").replace("10", "1"),
        ["sample_rate [Hz]"],
    ),
    "rate of zero": (MINIMAL.replace("10", "0"), ["sample_rate [Hz]", "got 0", "0.5"]),
    "rate as text": (MINIMAL.replace("10", '"10 Hz"'), ["sample_rate [Hz]", "'10 Hz'"]),
    "misspelt preset": (
        MINIMAL.replace("10\n", '10\npreset = "thesis1993"\n'),
        ["did you mean 'thesis1992'"],
    ),
    "three shafts": (MINIMAL.replace("10\n", "10\nshafts = 3\n"), ["shafts", "got 3", "1 or 2"]),
    "name is a number": (
        MINIMAL.replace("10\n", "10\nname = 3\n"),
        ["name of the vehicle", "got 3"],
    ),
    "negative battery": (MINIMAL.replace("10\n", "10\nbattery = -1\n"), ["battery [Wh]", "-1"]),
    "infinite hotel load": (
        MINIMAL.replace("10\n", "10\nhotel_load = inf\n"),
        ["hotel_load [W]", "inf"],
    ),
    "unknown diagnoser": (
        MINIMAL.replace("10\n", '10\ndiagnoser = "residual"\n'),
        ["diagnoser", "did you mean 'residuals'"],
    ),
    "no channels": ("[vehicle]\nsample_rate = 10\n", ["channels", "speed"]),
    "commands only": (
        MINIMAL.replace("speed", "rudder"),
        ["channels", "'rudder'", "at least one of speed"],
    ),
    "unknown channel": (
        MINIMAL.replace("channels.speed", "channels.sped"),
        ["'sped'", "did you mean 'speed'"],
    ),
    "channel is no table": (
        '[vehicle]\nsample_rate = 10\n[channels]\nspeed = "u"\n',
        ["channels.speed", "'u'"],
    ),
    "starboard of one shaft": (
        MINIMAL.replace("10\n", "10\nshafts = 1\n") + '[channels.starboard_rpm]\ncolumn = "n"\n',
        ["'starboard_rpm'", "shafts = 1"],
    ),
    "channel without column": (
        MINIMAL.replace("column", "offset").replace('"u"', "1.0"),
        ["channels.speed.column"],
    ),
    "column without a name": (MINIMAL.replace('"u"', '""'), ["channels.speed.column", "''"]),
    "unknown unit": (MINIMAL + 'unit = "knts"\n', ["channels.speed.unit", "did you mean 'kn'"]),
    "unit of another kind": (MINIMAL + 'unit = "V"\n', ["channels.speed.unit", "'V'", "m/s"]),
    "scale of zero": (MINIMAL + "scale = 0\n", ["channels.speed.scale", "other than 0"]),
    "offset not a number": (MINIMAL + "offset = nan\n", ["channels.speed.offset", "nan"]),
    "times a number": (MINIMAL + "times = 3\n", ["channels.speed.times", "got 3"]),
    "time times a column": (
        MINIMAL + '[time]\ncolumn = "t"\ntimes = "u"\n',
        ["time.times", "'u'", "no factor"],
    ),
    "time without column": (MINIMAL + '[time]\nunit = "s"\n', ["time.column", "None"]),
    "unknown parameter": (
        MINIMAL + "[parameters]\nalfa = -1\n",
        ["'alfa'", "did you mean 'alpha'"],
    ),
    "parameter out of range": (MINIMAL + "[parameters]\nalpha = 0.1\n", ["alpha", "0.1", "-10"]),
    "band of a constant": (MINIMAL + "[healthy_band]\ndensity = 0.1\n", ["'density'", "alpha"]),
    "band too wide": (
        MINIMAL + "[healthy_band]\nalpha = 5\n",
        ["healthy_band.alpha", "got 5", "0.9"],
    ),
    "noise of a command": (MINIMAL + "[noise]\nrudder = 0.1\n", ["'rudder'", "speed"]),
    "negative noise": (MINIMAL + "[noise]\nspeed = -0.1\n", ["noise.speed", "-0.1"]),
    "not TOML": ("speed: u\n", ["vehicle file", "readable TOML", "line 1"]),
    "an array of tables": ("[[vehicle]]\nsample_rate = 10\n", ["vehicle", "a table [vehicle]"]),
}


@pytest.mark.parametrize(("text", "words"), WRONG.values(), ids=WRONG)
def test_wrong_file_is_refused_in_one_line(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("name", ["nowhere.toml", "folder", "latin.toml"])
def test_unreadable_file_is_refused(tmp_path, name):
    (tmp_path / "folder").mkdir()
    (tmp_path / "latin.toml").write_bytes("# Größe".encode("latin-1"))
    with pytest.raises(
        InputError, match=r"vehicle file: got '.*'; allowed is a readable TOML file"
    ):
        read_vehicle(tmp_path / name)


def test_path_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(InputError, match="a place that can be written"):
        write_vehicle(tmp_path / "none" / "vehicle.toml", some_vehicle())


def test_every_reading_can_be_a_channel_with_noise(tmp_path):
    entries = "".join(f'[channels.{name}]\ncolumn = "{name}"\n' for name in READINGS)
    vehicle = read(tmp_path, "[vehicle]\nsample_rate = 1\n" + entries)
    assert tuple(vehicle.columns) == READINGS == tuple(vehicle.noise)


EXAMPLES = re.findall(r"```toml\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize(
    ("text", "shafts", "rate"), list(zip(EXAMPLES, (2, 1), (10.0, 1.0), strict=True))
)
def test_examples_of_the_document(tmp_path, text, shafts, rate):
    vehicle = read(tmp_path, text)
    assert (vehicle.shafts, vehicle.sample_rate) == (shafts, rate)
    assert ("port_rpm" in vehicle.columns) == (shafts == 2)
