"""Minimal logs of autopilots, by the specifications of their formats."""

import json
import struct

from mcap.writer import CompressionType, Writer
from pymavlink.dialects.v20 import ardupilotmega

START = 1_700_000_000_000_000  # us since 1970


def ulog(formats, subscriptions, data, dropouts=()):
    """A ULog: formats as text, subscriptions (instance, id, topic), data (id, bytes)."""

    def message(kind, content):
        return struct.pack("<HB", len(content), ord(kind)) + content

    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]
    parts += [message("B", bytes(40))]
    parts += [message("F", text.encode()) for text in formats]
    parts += [message("A", struct.pack("<BH", *one[:2]) + one[2].encode()) for one in subscriptions]
    parts += [message("D", struct.pack("<H", number) + content) for number, content in data]
    parts += [message("O", struct.pack("<H", duration)) for duration in dropouts]
    return b"".join(parts)


def dataflash(formats, rows):
    """A DataFlash log: formats (id, name, types, fields), rows (id, values)."""
    sizes = {"B": "B", "H": "H", "h": "h", "I": "I", "Q": "Q", "f": "f", "n": "4s", "N": "16s"}
    sizes |= {"Z": "64s", "b": "b", "d": "d"}
    structs = {
        number: struct.Struct("<" + "".join(sizes[one] for one in types))
        for number, _, types, _ in formats
    }
    head = b"\xa3\x95"
    parts = []
    describe = struct.Struct("<BB4s16s64s")
    own = (128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns")
    for number, name, types, fields in (own, *formats):
        size = 3 + (describe.size if number == 128 else structs[number].size)
        values = (number, size, name.encode(), types.encode(), fields.encode())
        parts.append(head + b"\x80" + describe.pack(*values))
    for number, values in rows:
        parts.append(head + bytes([number]) + structs[number].pack(*values))
    return b"".join(parts)


def frame(kind, values, system=1, component=1):
    """A frame of MAVLink 2: the name of the message and its values in order."""
    link = ardupilotmega.MAVLink(None, srcSystem=system, srcComponent=component)
    message = getattr(ardupilotmega, f"MAVLink_{kind.lower()}_message")(*values)
    return bytes(message.pack(link))


def tlog(frames):
    """A .tlog: frames with their times [s]."""
    return b"".join(struct.pack(">Q", START + round(1e6 * time)) + one for time, one in frames)


def mcap(path, messages, chunk_size=1 << 20):
    """An MCAP file without a profile: messages (time [s], topic, encoding, value or bytes)."""
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD, chunk_size=chunk_size)
        writer.start(profile="", library="test")
        channels = {}
        for time, topic, encoding, value in messages:
            if topic not in channels:
                schema = writer.register_schema(topic, "jsonschema", b"{}")
                channels[topic] = writer.register_channel(topic, encoding, schema)
            data = value if isinstance(value, bytes) else json.dumps(value).encode()
            stamp = 1000 * (START + round(1e6 * time))
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()
    return path
