"""Compare every number that the commands write, between two checkouts.

    python -m benchmarks.same_numbers OLD NEW

Each command runs in both checkouts with ``--json``, with the built-in scenarios and problems and
fixed seeds. The script prints the keys that only one checkout writes, and for each number that
differs the largest relative difference. The exit code is 1 if a number differs by more than
``--tolerance``. Times (``elapsed_s``) and versions are left out.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

COMMANDS = (
    "experiment asteroid-1997 --model paper",
    "experiment asteroid-1997 --model guaranteed",
    "experiment asteroid-1997-single --model guaranteed",
    "experiment comet-fast --model guaranteed",
    "experiment asteroid-1997-space --runs 5",
    "engage asteroid-1997-single --noise both",
    "engage dart-2022",
    "compare asteroid-1997 --runs 20 --model guaranteed",
    "bound asteroid-1997 --model paper",
    "adversary --strategy symmetric-miss --budget 200 --model paper",
    "campaign --noise mixed --runs 400 --model paper --out DIR",
    (
        "sweep --vary angle_sensor.error_at_nominal_range_rad=0.5e-4:5e-4:3 --runs 50 --model "
        "paper --out DIR"
    ),
    (
        "reach rendezvous-2021 --select "
        "energy,l1,norms,peak,chebyshev,analytic,vertices,samples:5 --replan"
    ),
    "reach rendezvous-16-periods",
    "reach approach-cone",
    "pareto pareto-2008 --prefer x_m=0,z_m=50",
    "multipoint service-2",
    "multipoint service-3 --order best --times best",
    "multipoint service-5 --order best",
    "multipoint asteroid-tour",
    "pursuit geo-pursuit --certify --feedback coast",
    "pursuit leo-pursuit",
    "pursuit-map geo-pursuit --x phase_deg=-60:60:5 --y thrust_ratio=0:0.9:3",
    "observe observer-2005 --smooth",
    "reproduce",
)
IGNORED = ("elapsed_s", "version", "versions", "made_by", "python", "duration_s")
"""Keys that differ from one run to the next."""


def numbers_of(checkout: Path, command: str) -> object:
    """Run a command in an empty folder and return what it writes as JSON."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "numbers.json"
        arguments = [
            str(Path(folder) / "out") if word == "DIR" else word for word in command.split()
        ]
        line = [sys.executable, "-m", "infoset", *arguments, "--json", str(file), "--quiet"]
        done = subprocess.run(
            line,
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(checkout)},
            capture_output=True,
            text=True,
            check=False,
        )
        if not file.exists():
            return {"failed": done.stderr[-2000:]}
        return json.loads(file.read_text(encoding="utf-8"))


def differences(old: object, new: object, path: str = "") -> Iterator[tuple[str, object, object]]:
    """Yield the key path and both values of everything that differs; all items of a list have the
    same path.
    """
    if isinstance(old, dict) and isinstance(new, dict):
        for key in (*old, *(key for key in new if key not in old)):
            if key in IGNORED:
                continue
            if key not in old or key not in new:
                yield (
                    f"{path}.{key}",
                    "written" if key in old else "-",
                    "written" if key in new else "-",
                )
            else:
                yield from differences(old[key], new[key], f"{path}.{key}")
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for before, after in zip(old, new, strict=True):
            yield from differences(before, after, f"{path}[]")
    elif old != new:
        yield path, old, new


def relative(old: object, new: object) -> float:
    """Return the relative difference of two numbers, and infinity for anything else that
    differs.
    """
    if isinstance(old, int | float) and isinstance(new, int | float) and not isinstance(old, bool):
        return abs(old - new) / max(abs(old), abs(new))
    return float("inf")


def main() -> None:
    """Compare two checkouts command by command."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--tolerance", type=float, default=0.0)
    parser.add_argument("--only", default="", help="run the commands that begin with this word")
    options = parser.parse_args()
    differs = False
    for command in COMMANDS:
        if not command.startswith(options.only):
            continue
        before_all, after_all = (
            numbers_of(checkout.resolve(), command) for checkout in (options.old, options.new)
        )
        largest: dict[str, tuple[float, object, object]] = {}
        for path, before, after in differences(before_all, after_all):
            size = relative(before, after)
            if path not in largest or size > largest[path][0]:
                largest[path] = size, before, after
        sys.stdout.write(f"{command}: {'different' if largest else 'the same'}\n")
        for path, (size, before, after) in largest.items():
            sys.stdout.write(f"    {path}: {size:.1e} ({str(before)[:60]} -> {str(after)[:60]})\n")
            differs |= size > options.tolerance
        sys.stdout.flush()
    sys.exit(int(differs))


if __name__ == "__main__":
    main()
