from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from experiments.common.errors import InputError
from experiments.common.file_kinds import built_in_names
from experiments.common.input_file import read_text, to_toml
from experiments.reachability.figures import draw_all, shown_times
from experiments.reachability.file import Rendezvous, load_rendezvous
from experiments.reachability.printed_tables import compare_published, is_published, printed_tables
from experiments.reachability.report import Request, make_report
from rendezvous.reachability import solve
from sim.storage.codec import fingerprint
from sim.versions import versions
from tests.built_in import problem_text

FIGURES = ["figure-controls", "figure-planes", "figure-positions", "figure-velocities"]
KEYS = [
    *("versions", "problem", "problem_hash", "kind", "units", "elapsed_s", "route", "route_reason"),
    *(
        "optimal_miss",
        "optimal_dimension",
        "min_periods",
        "min_periods_searched",
        "sets",
        "controls",
        "control_ranges",
    ),
    *("replan", "robust"),
]

Infoset = Callable[..., tuple[int, str, str]]


@pytest.fixture
def infoset(infoset: Infoset) -> Infoset:
    """Run the command in an empty folder: exit code, stdout and stderr."""
    return partial(infoset, "reach")


def edited(problem: str, **changes: str) -> str:
    """A built-in problem with values of keys replaced, by the key's name."""
    lines = problem_text(problem).splitlines()
    for key, value in changes.items():
        places = [place for place, line in enumerate(lines) if line.split("=")[0].strip() == key]
        assert places, key
        lines[places[0]] = f"{key} = {value}"
    return "\n".join(lines) + "\n"


def test_reach_into_a_folder(infoset: Infoset, tmp_path: Path) -> None:
    folder = tmp_path / "results"
    code, out, _ = infoset("--select", "energy,l1,vertices,samples:3", "--replan", "--out", folder)
    assert code == 0
    files = [f"{name}.{kind}" for name in FIGURES for kind in ("pdf", "png")]
    assert sorted(each.name for each in folder.iterdir()) == sorted(
        [*files, "problem.toml", "published-tables.csv", "results.json", "trajectories.csv"]
    )
    found = json.loads((folder / "results.json").read_text())
    assert list(found) == KEYS
    assert found["versions"] == versions()
    assert (found["kind"], found["problem"], found["route"]) == ("reachable-rendezvous", "rendezvous-2021", "exact")
    assert found["problem_hash"] == fingerprint(load_rendezvous("rendezvous-2021"))
    assert (found["optimal_miss"], found["min_periods"], found["optimal_dimension"]) == (0.0, 3, 6)
    second = found["sets"][1]
    assert second["period"] == 2
    assert [second["forward"][key] for key in ("vertices", "facets", "dimension")] == [130, 15, 6]
    assert [second["tube"][key] for key in ("vertices", "facets", "dimension")] == [27, 9, 6]
    assert second["tube"]["min"][1] == pytest.approx(-2032.6346647262549, rel=1e-9)
    assert [each["period"] for each in found["sets"]] == [1, 2, 3, 4]
    names = [each["name"] for each in found["controls"]]
    assert names == ["energy", "l1", *(f"vertex {k}" for k in range(1, 28)), *(f"sample {k}" for k in range(1, 4))]
    energy = found["controls"][0]
    assert energy["energy"] == pytest.approx(0.14323052820, abs=1e-11)
    assert energy["nonlinear_miss"] == pytest.approx(1.668028, abs=1e-6)
    assert np.abs(energy["linear_end"]).max() < 1e-9
    assert np.shape(found["control_ranges"]) == (4, 3, 2)
    for each in found["controls"]:
        within = np.array(each["u"])[..., None] - found["control_ranges"]
        assert (within[..., 0] >= -1e-9).all()
        assert (within[..., 1] <= 1e-9).all()
    assert found["replan"]["miss"] < 1.3
    assert found["robust"] is None
    with (folder / "published-tables.csv").open() as file:
        rows = list(csv.DictReader(file))
    misses = [row for row in rows if "norm" in row["quantity"]]
    assert [row["printed"] for row in misses] == ["73.19", "75.37", "74.85"]
    assert all(float(row["computed"]) < 2.0 for row in misses)
    first = [
        abs(float(row["printed"]) - float(row["computed"]))
        for row in rows
        if row["table"] == "table 1" and row["quantity"][0] == "u"
    ]
    assert len(first) == 12
    assert max(first) <= 0.5e-4
    for piece in ("minimum terminal norm 0", "norm 0 needs at least 3 periods", "route: exact", "table 3", "replanned"):
        assert piece in out


def test_json_alone_and_nothing_written(infoset: Infoset, tmp_path: Path) -> None:
    code, out, err = infoset("--select", "energy", "--json", "-", "--route", "lifted")
    assert code == 0
    found: Any = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert (found["route"], found["route_reason"]) == ("lifted", "as asked")
    assert found["sets"][1]["tube"]["vertices"] is None
    assert "minimum terminal norm" in err
    assert list(tmp_path.iterdir()) == []
    assert infoset("--select", "energy", "-q") == (0, "", "")


def test_samples_follow_the_seed(infoset: Infoset) -> None:
    drawn = [
        json.loads(infoset("--select", "samples:2", "--json", "-", "-q", "--seed", seed)[1])["controls"]
        for seed in (1, 1, 2)
    ]
    assert drawn[0] == drawn[1]
    assert drawn[0] != drawn[2]


def test_help_has_an_example(infoset: Infoset) -> None:
    code, out, _ = infoset("--help")
    assert code == 0
    assert "Example: infoset reach" in out


def test_every_built_in_problem_is_sound() -> None:
    names = built_in_names([Rendezvous.kind])
    assert names == ["approach-cone", "rendezvous-16-periods", "rendezvous-2021"]
    for name in names:
        loaded = load_rendezvous(name)
        assert loaded.name == name
        assert read_text(Rendezvous, to_toml(loaded), "written") == loaded
        assert solve(loaded.problem).optimal.miss == 0.0


def test_the_cone_is_inside_its_angle_and_kept() -> None:
    given = load_rendezvous("approach-cone")
    problem = given.problem
    assert problem.normals is not None
    assert problem.offsets is not None
    # Points of the pyramid are inside the circular cone, and its edges are on it.
    generator = np.random.default_rng(0)
    points = generator.uniform(-900.0, 500.0, (20000, 3))
    inside = (points @ problem.normals[:, :3].T <= problem.offsets[0]).all(axis=1)
    away = points[inside] - [0.0, 15.0, 0.0]
    angles = np.degrees(np.arctan2(np.linalg.norm(away[:, ::2], axis=1), -away[:, 1]))
    assert 19.0 < angles.max() <= 20.0 + 1e-9
    report = make_report(given, Request(["energy", "analytic"]))
    for each in report.members:
        gaps = each.linear @ problem.normals.T - problem.offsets
        assert gaps.max() < 1e-6
    assert report.robustness is not None
    assert report.robustness.plan is not None
    assert report.min_periods == 9


def test_constraints_between_the_periods_bind(tmp_path: Path) -> None:
    # Short of the bound at whole periods only, a control may break it between them.
    text = edited(
        "rendezvous-2021",
        model='"time-varying"',
        position_m="[-2540.0, -2990.0, 2120.0]",
        velocity_m_s="[2.0, -1.0, 3.0]",
    )
    free, bound = tmp_path / "free.toml", tmp_path / "bound.toml"
    free.write_text(text)
    bound.write_text(text.replace("model =", "checks_between_periods = 5\nmodel ="))
    loose = make_report(load_rendezvous(free), Request(["energy"])).members[0]
    kept = make_report(load_rendezvous(bound), Request(["energy"])).members[0]
    assert loose.between > 1e-3
    assert kept.between < 0.2 * loose.between


def test_other_values_are_not_compared_with_the_paper(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(edited("rendezvous-2021", name='"other"'))
    assert is_published(load_rendezvous(file))  # a name changes nothing
    file.write_text(edited("rendezvous-2021", period_s="181.0"))
    assert not is_published(load_rendezvous(file))


def test_tables_of_the_paper() -> None:
    given = load_rendezvous("rendezvous-2021")
    first, second, third = compare_published(given, solve(given.problem))
    assert first.max_difference <= 0.5e-4
    assert third.max_difference <= 0.5e-4
    assert 1e-3 < second.max_difference < 1e-2
    assert all(np.linalg.norm(each.ours.nonlinear[-1]) < 2.0 for each in (first, second, third))
    assert printed_tables()["table 2"].controls[0].tolist() == [-0.1254, 0.0373, -0.2612]


def test_zero_out_of_reach_is_looked_for_further_on(infoset: Infoset, tmp_path: Path) -> None:
    file = tmp_path / "short.toml"
    file.write_text(edited("rendezvous-2021", periods="2"))
    code, out, _ = infoset(file, "--json", "-", "--select", "energy", "-q")
    assert code == 0
    found = json.loads(out)
    assert found["optimal_miss"] == pytest.approx(611.79357068, abs=1e-8)
    assert (found["min_periods"], found["min_periods_searched"]) == (3, 8)
    assert found["optimal_dimension"] == 0


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["rendezvous-2020"], ["rendezvous-2020", "did you mean"]),
        (["--select", "enrgy"], ["--select", "did you mean energy?"]),
        (["--select", "energy,energy"], ["named twice"]),
        (["--select", ""], ["--select", "choose one of"]),
        (["--select", "samples"], ['must be a whole number, found ""', "--select samples:20"]),
        (["--select", "samples:0"], ["must be from 1 to 1000"]),
        (["--select", "samples:-5"], ["must be from 1 to 1000, found -5"]),
        (["--select", "energy:4"], ["takes no number"]),
        (["--route", "exakt"], ['--route: there is no "exakt"; did you mean exact?']),
        (["--noisy-flights", "-1"], ["--noisy-flights: must be from 0 to 1000, found -1;"]),
        (["--json", "missing/x.json"], ["there is no folder missing"]),
        (["--json", "out/results.json", "--out", "out"], ["also a file of --out"]),
    ],
)
def test_what_is_wrong_is_said_before_the_work(
    arguments: list[str], parts: list[str], infoset: Infoset, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("experiments.reachability.run.make_report", lambda *_, **__: pytest.fail("began to work"))
    code, out, err = infoset(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("error: ") == 1
    for part in parts:
        assert part in err
    assert list(tmp_path.iterdir()) == []


POSITION = "[-2540.0, -2650.0, 2120.0]"
CONE = "[cone]\napex_m = [0.0, 20.0, 0.0]\naxis = {}\nhalf_angle_deg = 20.0\n[orbit]"
KEEP_IN = "[[keep_in]]\nnormals = {}\noffsets_m = {}\n[orbit]"


@pytest.mark.parametrize(
    ("problem", "old", "new", "line"),
    [
        ("rendezvous-2021", "[orbit]", KEEP_IN.format("[[1, 0, 0]]", "[1, 2]"), "offsets_m: must have 1 numbers"),
        ("rendezvous-2021", "[orbit]", KEEP_IN.format("[[0, 0, 0]]", "[1]"), "normals: must have no row of zeros"),
        ("rendezvous-2021", "[orbit]", CONE.format("[0, 0, 0]"), "cone: axis: must have a direction"),
        ("rendezvous-2021", "[orbit]", CONE.format("[0, -1, 0]"), "is outside its constraints: face 3 of the cone by"),
        ("rendezvous-2021", POSITION, "[3200.0, -2650.0, 2120.0]", "is outside its constraints: x by 200"),
        ("rendezvous-2021", "10000.0", "6000.0", "orbit: semi_major_axis_m: the orbit meets the planet"),
        ("rendezvous-2021", "180.0", "1e9", "period_s, in all periods, is 2.53e+06 radians of the orbit"),
        ("rendezvous-2021", "0.15 ", "1e6 ", "acceleration_m_s2: full thrust over a period changes a state by"),
        ("rendezvous-2021", "control = 1.0", "control = [1, 1, 0]", "bounds.control: must be greater than 0"),
        ("rendezvous-16-periods", "control = 1.0", "control = [1, 1, 0.5]", "in a ball the bounds on controls must"),
        ("approach-cone", "[orbit]", "checks_between_periods = 1\n[orbit]", "checks_between_periods: must be 0 with"),
    ],
)
def test_contradictions_are_refused(problem: str, old: str, new: str, line: str) -> None:
    with pytest.raises(InputError, match=re.escape(line)) as caught:
        read_text(Rendezvous, problem_text(problem).replace(old, new, 1), "mine.toml")
    assert str(caught.value).startswith("mine.toml: ")


def test_a_bound_is_one_number_or_one_for_each_axis() -> None:
    one, three = (load_rendezvous("approach-cone", [f"bounds.control={value}"]) for value in ("0.5", "[0.5, 0.5, 0.5]"))
    assert one.bounds.control == (0.5, 0.5, 0.5)
    assert fingerprint(one) == fingerprint(three)


def test_a_conflict_says_when_and_by_how_much(infoset: Infoset, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(edited("rendezvous-2021", control="0.01", velocity_m_s="[2.0, -7.0, 3.0]"))
    code, _, err = infoset(file)
    assert code == 2
    assert "they conflict at t = 1 (the bound on y at t = 1" in err
    assert "relax all constraints on states by" in err
    by = float(err.split("relax all constraints on states by ")[1].split(" %")[0]) / 100.0
    lines = file.read_text().splitlines()
    # Relaxed by so much and a little more, it can be kept.
    text = "\n".join(lines).replace("position_m = 3000.0", f"position_m = {3000.0 * (1.0 + by * 1.001):.9f}")
    file.write_text(text.replace("velocity_m_s = 7.5", f"velocity_m_s = {7.5 * (1.0 + by * 1.001):.9f}"))
    assert infoset(file, "--select", "energy")[0] == 0


def test_what_the_exact_route_and_vertices_cannot_do_is_said(infoset: Infoset) -> None:
    code, _, err = infoset("rendezvous-16-periods", "--route", "exact")
    assert code == 2
    assert "--route exact: for thrust in a ball" in err
    code, _, err = infoset("approach-cone", "--select", "vertices")
    assert code == 2
    assert "choose for example --select samples:20" in err


def test_a_tube_that_cannot_be_drawn_ends_in_a_message(infoset: Infoset, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> str:
        raise ArithmeticError("a convex program was not solved")

    monkeypatch.setattr("experiments.reachability.run.reachability_page", fail)
    code, _, err = infoset("--select", "energy", "--html", "page.html", "-q")
    assert code == 2
    assert "cannot draw the tube: a convex program was not solved; the numbers are in" in err


def test_nothing_is_replaced_unless_told(infoset: Infoset, tmp_path: Path) -> None:
    precious = tmp_path / "x.json"
    precious.write_text("precious")
    code, _, err = infoset("--json", precious, "--select", "energy")
    assert code == 2
    assert "--overwrite" in err
    assert precious.read_text() == "precious"
    assert infoset("--select", "energy", "--json", precious, "--overwrite", "-q")[0] == 0
    assert json.loads(precious.read_text())["problem"] == "rendezvous-2021"


def test_figures_show_sets_members_and_ranges() -> None:
    report = make_report(load_rendezvous("rendezvous-2021"), Request(["energy", "l1", "norms"]))
    positions, velocities, planes, controls = draw_all(report)
    assert "nonlinear" in positions.legends[0].get_texts()[0].get_text()
    assert velocities.axes[0].get_xlabel() == "$v_x$ (radial), m/s"
    along = ["y (along-track), m"] * 2 + ["$v_y$ (along-track), m/s"] * 2
    assert [each.get_xlabel() for each in planes.axes] == along
    across = ["x (radial), m", "z (normal), m", "$v_x$ (radial), m/s", "$v_z$ (normal), m/s"]
    assert [each.get_ylabel() for each in planes.axes] == across
    # The minimum sum of norms is the minimum L1 here, and is drawn once.
    assert [each.get_text() for each in planes.legends[0].get_texts()][2:] == [
        "start",
        "terminal state of minimum norm",
        "tube at t",
    ]
    assert len(controls.axes) == 3
    assert shown_times(4) == [1, 2, 3]
    assert shown_times(64) == [1, 13, 26, 38, 51, 63]
    assert shown_times(1) == []
