"""Attack a parser for some minutes, guided by what of its code an input reaches.

    python -m tests.fuzzing.coverage_guided scenario --seconds 600 --work /tmp/fuzzing

Needs the extra `fuzz`. Inputs that raise anything but what the parser documents are kept in WORK/TARGET/defects, one a
place in the code, as are inputs over two seconds of the processor. Those that never end or take over 500 MB end the
process; libFuzzer keeps them in WORK/TARGET. The last line is the row of the table in benchmarks/README.md.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import random
import re
import subprocess
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

TARGETS = (
    *("scenario", "pareto-encounter", "multipoint", "pursuit-evasion", "reachable-rendezvous", "observer"),
    *("record", "expressions"),
)
MAX_SECONDS_AN_INPUT = 2.0
MAX_SECONDS_OF_THE_CLOCK = 60
"""Beside other work the clock tells little; it only finds what never ends."""
MAX_MEGABYTES = 500
CODE = ("experiments", "sim.storage", "sim.stopping_rule", "tomllib", "zipfile", "json")
"""Whose branches guide the search; the libraries in C are run, but not looked into."""

Parse = Callable[[bytes], None]
Mutate = Callable[[bytes, random.Random], bytes]


def main() -> None:
    """Attack one parser, again where an input has ended the process, and print a row of the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("target", choices=TARGETS)
    parser.add_argument("--seconds", type=int, default=600)
    parser.add_argument("--work", type=Path, required=True, help="folder for corpus and findings")
    parser.add_argument("--child", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    folder: Path = given.work / given.target
    for part in ("corpus", "defects", "scratch"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    if given.child:
        _attack(given.target, folder, given.seconds)
        return
    begun, executions, edges, features, ended = time.monotonic(), 0, 0, 0, 0
    while (left := given.seconds - (time.monotonic() - begun)) > 5:
        command = [sys.executable, "-m", "tests.fuzzing.coverage_guided", given.target, "--child"]
        command += ["--seconds", str(int(left)), "--work", str(given.work)]
        done = subprocess.run(command, stderr=subprocess.PIPE, text=True, errors="replace", check=False)
        (folder / f"log-{ended}.txt").write_text(done.stderr[-100_000:])
        counts = re.findall(r"^#(\d+)\s.*?cov: (\d+) ft: (\d+)", done.stderr, re.MULTILINE)
        if counts:
            executions += int(counts[-1][0])
            edges, features = max(edges, int(counts[-1][1])), max(features, int(counts[-1][2]))
        if done.returncode == 0:
            break
        ended += 1
        if not counts:
            sys.exit(done.stderr[-3000:])
    seconds = time.monotonic() - begun
    defects = len(list((folder / "defects").glob("*.txt")))
    sys.stdout.write(
        f"| {given.target} | {seconds:.0f} | {executions} | {edges} | {features} | {defects} | {ended} |\n"
    )


def _attack(target: str, folder: Path, seconds: int) -> None:
    import atheris

    importlib.import_module("numba")  # the kernels are not looked into
    for each in [name for name in sys.modules if name.split(".")[0] in ("zipfile", "json", "tomllib")]:
        del sys.modules[each]
    with atheris.instrument_imports(include=list(CODE)):
        parse, mutate, seeds = _subject(target, folder)
    for place, seed in enumerate(seeds):
        (folder / "corpus" / f"seed-{place}").write_bytes(seed)
    warnings.simplefilter("error")
    base = _megabytes()

    def one(content: bytes) -> None:
        begun = time.process_time()
        try:
            parse(content)
            if time.process_time() - begun > MAX_SECONDS_AN_INPUT:
                raise TimeoutError(f"took {time.process_time() - begun:.1f} s")
        except Exception as error:
            _keep(error, content, folder / "defects")

    def custom(content: bytes, most: int, seed: int) -> bytes:
        draw = random.Random(seed)
        new = mutate(content, draw) if draw.random() < 0.6 else atheris.Mutate(content, most)
        return bytes(new[:most])

    options = [
        *("-max_len=200000", "-len_control=0", f"-max_total_time={seconds}", f"-timeout={MAX_SECONDS_OF_THE_CLOCK}"),
        *(f"-rss_limit_mb={base + MAX_MEGABYTES}", f"-artifact_prefix={folder}/", "-reload=0", "-print_final_stats=1"),
    ]
    atheris.Setup([sys.argv[0], *options, str(folder / "corpus")], one, custom_mutator=custom)
    atheris.Fuzz()


def _megabytes() -> int:
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


def _keep(error: Exception, content: bytes, folder: Path) -> None:
    """Keep an input that raised what it should not, one a place in the code."""
    own = [each for each in traceback.extract_tb(error.__traceback__) if "tests/fuzzing" not in each.filename]
    place = f"{Path(own[-1].filename).stem}-{own[-1].lineno}" if own else "check"
    nearest = next((f"{Path(each.filename).stem}-{each.lineno}" for each in reversed(own) if _is_ours(each)), "")
    name = f"{type(error).__name__}-{nearest}-{place}"
    if not (folder / f"{name}.txt").exists():
        (folder / f"{name}.txt").write_text("".join(traceback.format_exception(error))[-20_000:], errors="replace")
        (folder / f"{name}.bin").write_bytes(content)


def _is_ours(frame: traceback.FrameSummary) -> bool:
    return any(f"/{part}/" in frame.filename for part in ("experiments", "sim", "rendezvous"))


def _subject(target: str, folder: Path) -> tuple[Parse, Mutate, list[bytes]]:
    if target == "expressions":
        return _expressions()
    if target == "record":
        return _record(folder)
    from experiments.common.errors import InputError

    from .mutations import mutated_toml
    from .subjects import attempted, text_files

    kind = text_files()[target]
    file = folder / "scratch" / "input.toml"

    def parse(content: bytes) -> None:
        file.write_bytes(content)
        found, message = attempted(lambda: kind.read(str(file)), InputError)
        assert found is not None or str(file) in message or "written again" in message

    def mutate(content: bytes, draw: random.Random) -> bytes:
        return mutated_toml(content.decode(errors="replace"), draw)

    return parse, mutate, [text.encode() for text in kind.texts]


def _record(folder: Path) -> tuple[Parse, Mutate, list[bytes]]:
    """Give a record as it comes, and one whose checksums have been made to fit."""
    from experiments.common.errors import InputError
    from experiments.interception.record_file import load_record, write_record

    from .mutations import mutated_bytes
    from .subjects import attempted, remade_record, same_records, small_record

    record, file = small_record(), folder / "scratch" / "input.npz"
    write_record(record, file, overwrite=True)
    original = file.read_bytes()

    def parse(content: bytes) -> None:
        file.write_bytes(content)
        found, message = attempted(lambda: load_record(file), InputError)
        assert found is not None or str(file) in message

    def mutate(content: bytes, draw: random.Random) -> bytes:
        if draw.random() < 0.3:
            return mutated_bytes(content, draw)

        def change(header: dict[str, Any], members: dict[str, bytes]) -> None:
            if draw.random() < 0.4:
                try:
                    header.update(json.loads(mutated_bytes(json.dumps(header).encode(), draw)))
                except ValueError:
                    header.pop(draw.choice([*header]), None)
            else:
                name = draw.choice([*members])
                members[name] = mutated_bytes(members[name], draw)

        try:
            return remade_record(content, change)
        except Exception:  # what has been damaged before can no longer be made to fit
            return remade_record(original, change)

    assert same_records(load_record(file), record)
    return parse, mutate, [original]


def _expressions() -> tuple[Parse, Mutate, list[bytes]]:
    """Give the small languages of the command line: --vary, --until, --require, --x, --set."""
    from experiments.campaigns.sweep_axes import sweep_axes, sweep_cells
    from experiments.common.errors import InputError
    from experiments.interception.scenario_file import load_scenario
    from experiments.pursuit.file import load_pursuit
    from experiments.pursuit.map import read_axis
    from sim import QuantileName, StoppingRule
    from sim.requirement import parse_requirement

    from .mutations import mutated_bytes
    from .subjects import attempted

    scenario = load_scenario("asteroid-1997")

    def parse(content: bytes) -> None:
        text = content[1:].decode(errors="surrogateescape")
        attempted(lambda: _given(content[:1], text), InputError)
        for read_text in (QuantileName.parse, StoppingRule.parse, parse_requirement):
            read, _ = attempted(lambda reader=read_text: reader(text), ValueError)  # type: ignore[misc]
            assert not isinstance(read, QuantileName) or QuantileName.parse(str(read)) == read

    def _given(option: bytes, text: str) -> None:
        if option == b"v":
            axes = sweep_axes(text, scenario)
            sweep_cells(scenario, [_first(axes[0])])
        elif option == b"x":
            read_axis("--x", text)
        elif option == b"s":
            name, _, value = text.partition("=")
            load_pursuit("geo-pursuit", [f"{name}={value}"])

    def _first(axis: Any) -> Any:
        return type(axis)(axis.key, axis.values[:3], axis.scale)

    def mutate(content: bytes, draw: random.Random) -> bytes:
        pieces = (b"log:", b"nan", b"1e-400:1e15:3", b"1e999", b"_", b"9" * 30, b":2", b",", b".min", b"0.0", b"-")
        text = content
        for _ in range(draw.choice((1, 2))):
            at = draw.randrange(len(text) + 1)
            text = text[:at] + draw.choice(pieces) + text[at:] if draw.random() < 0.4 else mutated_bytes(text, draw)
        return text

    vary = "vangle_sensor.scale=1:8:8,thruster.max_impulse_m_s=2.5:20:8"
    texts = [vary, "vinformation_set.sections=log:5:50:3", "vthruster.budget_m_s=log:1:1000:4", "rmiss_m p99<10"]
    texts += ["vuncertainty.x_km.min=5000:5300:2", "rmiss_m p99 ci<0.5", "rimpulse_m_s p50", "xphase_deg=-60:60:61"]
    return parse, mutate, [text.encode() for text in [*texts, "sevader.thrust_N=5", "spursuer.mass_kg=2e3"]]


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
