"""The colours of frames."""

Colour = tuple[int, int, int]

PAPER = (250, 251, 252)
PANEL = (255, 255, 255)
INK = (33, 41, 52)
FAINT = (112, 121, 133)
GRID = (226, 231, 236)
BLUE = (30, 104, 196)
VIOLET = (142, 68, 190)
STEEL = (150, 160, 172)
WARNING = (255, 152, 20)
PALE_WARNING = (255, 206, 140)
WARNING_EDGE = (196, 84, 0)
SIDES = {"port": (200, 32, 48), "starboard": (0, 132, 72)}  # the nautical side lights
HULL = (236, 214, 120)
FIN = (206, 176, 70)
