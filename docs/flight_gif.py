"""Make docs/flight.gif, the animation in the README.

Run in the root of the project: python docs/flight_gif.py --out docs/flight.gif
"""

from __future__ import annotations

import argparse
from pathlib import Path

from infoset import fly_one, load_scenario
from infoset.experiments.interception.figures.animation import animate

FRAMES = 18


def main() -> None:
    """Simulate the single engagement of the paper and write the animation."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="the file to write")
    arguments = parser.parse_args()
    record = fly_one(load_scenario("asteroid-1997-single"))
    arguments.out.write_bytes(animate([record], FRAMES))


if __name__ == "__main__":
    main()
