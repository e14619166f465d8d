"""Make docs/flight.gif, the animation in the README: every fourth frame of one engagement, in few colours.

Run in the root of the project: python docs/flight_gif.py --out docs/flight.gif
"""

from __future__ import annotations

import argparse
from io import BytesIO
from pathlib import Path

from PIL import Image, ImageSequence

from experiments import load_scenario
from experiments.interception.figures.animation import GIF, animate
from sim import fly_one

EVERY = 4
COLOURS = 12
FRAME_MS = 400


def main() -> None:
    """Simulate the single engagement of the paper and write the animation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="the file to write")
    arguments = parser.parse_args()
    animation = Image.open(BytesIO(animate([fly_one(load_scenario("asteroid-1997-single"))], GIF)))
    frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(animation)][::EVERY]
    flat = [frame.quantize(COLOURS, dither=Image.Dither.NONE) for frame in frames]
    flat[0].save(arguments.out, save_all=True, append_images=flat[1:], duration=FRAME_MS, loop=0, optimize=True)


if __name__ == "__main__":
    main()
