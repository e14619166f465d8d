"""Make docs/flight.gif, the moving picture of the README: every fourth moment of a flight's animation, in few colours.

Run in the project's root: python docs/flight_gif.py --out docs/flight.gif
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
    """Fly the paper's single engagement and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="the file to write")
    asked = parser.parse_args()
    film = Image.open(BytesIO(animate([fly_one(load_scenario("asteroid-1997-single"))], GIF)))
    moments = [frame.convert("RGB") for frame in ImageSequence.Iterator(film)][::EVERY]
    flat = [moment.quantize(COLOURS, dither=Image.Dither.NONE) for moment in moments]
    flat[0].save(asked.out, save_all=True, append_images=flat[1:], duration=FRAME_MS, loop=0, optimize=True)


if __name__ == "__main__":
    main()
