"""The colours and markers of all figures and of the live page."""

PORT = "#c0392b"
STARBOARD = "#1e8449"
SPEED = "#1f4e79"
COMMAND = "#8a949e"
TRUTH = "#111111"
COLOURS = (
    PORT,
    SPEED,
    STARBOARD,
    "#b9770e",
    "#7d3c98",
    "#117a8b",
    "#8d6e63",
    "#d4478c",
    "#5d6d7e",
    "#a3b81e",
    "#f0a8b8",
    "#4a235a",
)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
