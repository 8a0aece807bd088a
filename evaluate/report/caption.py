"""The line of text at the top of a film, clear of a player's controls: time, command, a fall."""

from functools import cache

import numpy as np
from PIL import Image, ImageDraw, ImageFont

TEXT_HEIGHT, TEXT_TOP, MARGIN = 21, 5, 8  # pixels
WHITE, RED, SHADE = (255, 255, 255), (255, 150, 140), 0.45
AXES = (("forward", "backward", "m/s"), ("left", "right", "m/s"), ("turn left", "turn right", "rad/s"))


def with_caption(
    picture: np.ndarray, time_s: float, command: np.ndarray, fell_at_s: float | None
) -> np.ndarray:
    """A copy of a picture (height, width, 3) uint8 with the caption at its top.

    Args:
        picture: the rendered picture.
        time_s: since walking began.
        command: forward m/s, leftward m/s, yaw rad/s, (3,).
        fell_at_s: time of the fall; None if the robot has not fallen.
    """
    copy = picture.copy()
    band = TEXT_HEIGHT + 2 * MARGIN
    copy[:band] = (copy[:band] * SHADE).astype(np.uint8)
    image = Image.fromarray(copy)
    draw = ImageDraw.Draw(image)
    draw.text((MARGIN, TEXT_TOP), f"{time_s:.1f} s", WHITE, _font())
    text, ink = (command_text(command), WHITE) if fell_at_s is None else (f"fell at {fell_at_s:.1f} s", RED)
    draw.text((image.width - MARGIN, TEXT_TOP), text, ink, _font(), anchor="ra")
    return np.asarray(image)


def command_text(command: np.ndarray) -> str:
    """'forward 0.6 m/s, turn left 0.8 rad/s', or 'stand'."""
    parts = [
        f"{names[0] if value > 0 else names[1]} {abs(value):.1f} {names[2]}"
        for names, value in zip(AXES, command, strict=True)
        if abs(value) >= 0.05
    ]
    return ", ".join(parts) or "stand"


@cache
def _font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(TEXT_HEIGHT)
