"""Hypothesis strategies of sound files, each kind over what it permits, made so that their commands take little."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from hypothesis import strategies as st

from experiments.common.orbit_checks import EARTH_M3_S2, EARTH_RADIUS_M
from experiments.pareto.file import TERMINAL
from guidance import NoiseKind, TieRule, strategy_names
from infoset.model import InitialSet, Model, Recovery
from infoset.sensors import Bias
from sim import Manoeuvre

Draw = Callable[[st.SearchStrategy[float]], float]
Values = Mapping[str, object]
NOTHING: Values = {}


def sizes(minimum: float, maximum: float) -> st.SearchStrategy[float]:
    """Numbers of any order of magnitude between two."""
    return st.floats(math.log10(minimum), math.log10(maximum)).map(lambda power: float(f"{10.0**power:.4g}"))


def signed(maximum: float, span: float = 1e4) -> st.SearchStrategy[float]:
    """Numbers of either sign and some orders of magnitude, and zero."""
    return st.just(0.0) | sizes(maximum / span, maximum) | sizes(maximum / span, maximum).map(lambda size: -size)


def angles(minimum: float = 0.0, maximum: float = 360.0) -> st.SearchStrategy[float]:
    """Degrees of four places."""
    return st.floats(minimum, maximum).map(lambda value: round(value, 4))


def vectors(maximum: float) -> st.SearchStrategy[list[float]]:
    """Arrays of three numbers."""
    return st.lists(signed(maximum), min_size=3, max_size=3)


def toml(top: Values, tables: Mapping[str, Values | Sequence[Values]]) -> str:
    """Write a file; a sequence of tables is an array of them, and what is None is left out."""
    lines = _lines(top)
    for name, table in tables.items():
        arrays = [] if isinstance(table, Mapping) else [("", f"[[{name}]]", *_lines(each)) for each in table]
        blocks = [("", f"[{name}]", *_lines(table))] if isinstance(table, Mapping) and table else arrays
        lines += [line for block in blocks for line in block]
    return "\n".join(lines) + "\n"


def _lines(table: Values) -> list[str]:
    return [f"{key} = {_text(value)}" for key, value in table.items() if value is not None]


def _text(value: object) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else repr(value)


@st.composite
def _angles_in_space(draw: st.DrawFn, error: float) -> Values:
    """Keys of an angle sensor in space."""
    along_y = draw(st.none() | st.just(0.5 * error))
    return {
        "error_at_nominal_range_y_rad": along_y,
        "error_at_zero_range_y_rad": along_y,
    }


@st.composite
def _cameras(draw: st.DrawFn, error: float, threshold_m: float) -> Values:
    """Keys of a camera in place of the linear bound."""
    return {
        "nominal_range_km": None,
        "error_at_nominal_range_rad": None,
        "error_at_zero_range_rad": None,
        "error_at_nominal_range_y_rad": None,
        "error_at_zero_range_y_rad": None,
        "pixel_error_rad": error,
        "centroid_error_m": draw(st.sampled_from([None, 0.0, 0.01 * threshold_m])),
        "bias": draw(st.sampled_from(Bias)).value,
    }


@st.composite
def _times(draw: st.DrawFn, duration_s: float) -> tuple[Values, Values]:
    """Keys of the window of measurements, and of the times of impulses."""
    last_s = draw(st.sampled_from([0.0, 0.2 * duration_s]))
    measured = {
        "first_image_s": draw(st.sampled_from([None, 0.5 * duration_s, 2.0 * duration_s])),
        "last_image_s": last_s,
        "miss_probability": draw(st.sampled_from([0.0, 0.1, 0.9])),
    }
    given = {
        "last_impulse_s": draw(st.sampled_from([None, 0.0, 0.1 * duration_s])),
        "impulses_s": draw(st.sampled_from([None, [], [0.6 * duration_s], [0.6 * duration_s, 0.2 * duration_s]])),
        "delay_steps": draw(st.sampled_from([None, 0, 1])),
    }
    return measured, given


@st.composite
def scenarios(draw: st.DrawFn) -> str:
    """Flights of 3 to 25 steps in a millisecond to a thousand seconds, at 1 m/s to 100 km/s, with every option."""
    speed, duration_s = draw(sizes(1e-3, 1e2)), draw(sizes(1e-3, 1e3))
    range_km, step_s, part = speed * duration_s, duration_s / draw(st.integers(3, 25)), draw(sizes(1e-6, 0.2))
    across, slow = range_km * draw(sizes(1e-8, 1e-2)), speed * draw(sizes(1e-8, 1e-2))
    guaranteed = draw(st.booleans())
    error, slope = draw(sizes(1e-12, 0.5 if guaranteed else 1e-3)), draw(sizes(1.0, 3.0))
    sections, switch = draw(st.integers(1, 9)), draw(st.sampled_from(Manoeuvre))
    box = {
        "z_km": [-across, across],
        "x_km": [range_km, range_km * (1.0 + part)],
        "vz_km_s": [-slow, slow],
        "vx_km_s": [-speed * (1.0 + part), -speed * (1.0 - part)],
    }
    is_spatial = draw(st.booleans())
    if is_spatial:
        box |= {"y_km": [-across, 0.5 * across], "vy_km_s": [-slow, 0.5 * slow]}
    threshold_km = range_km * draw(sizes(1e-6, 0.3))
    measured, given = draw(st.just((NOTHING, NOTHING)) | _times(duration_s))
    period_s, sun_km = step_s * draw(st.integers(1, 3)), range_km * draw(sizes(10.0, 1e4))
    impulse = slow * 1e3 * draw(sizes(1e-3, 10.0))
    optional = draw(st.lists(st.sampled_from(["sun", "range_sensor", "rate_sensor", "target", "body"]), unique=True))
    rare: dict[str, Values] = {
        "sun": {
            "gravitational_parameter_km3_s2": speed**2 * sun_km * draw(sizes(1e-6, 1e-2)),
            "distance_km": sun_km,
            "direction_deg": draw(angles(-360.0, 360.0)),
            "elevation_deg": draw(angles(-90.0, 90.0)) if is_spatial else None,
        },
        "range_sensor": {"period_s": period_s, "relative_error": draw(sizes(1e-6, 0.9))},
        "rate_sensor": {"period_s": period_s, "error_rad_s": draw(sizes(1e-12, 1e-2))},
        "target": {
            "manoeuvre": switch.value,
            "acceleration_m_s2": draw(sizes(1e-9, 1.0)),
            "switching_period_s": step_s,
            "acceleration_y_m_s2": draw(st.none() | sizes(1e-9, 1.0)) if is_spatial else None,
        },
        "body": {"radius_m": range_km * draw(sizes(1e-9, 1e2))},
    }
    tables: dict[str, Values] = {
        "uncertainty": box,
        "dispersion": box,
        "angle_sensor": {
            "period_s": step_s,
            "error_at_nominal_range_rad": error,
            "error_at_zero_range_rad": min(error * slope, 0.9),
            "nominal_range_km": range_km,
            **(draw(_angles_in_space(error)) if is_spatial else {}),
            **draw(st.just(NOTHING) | _cameras(error, threshold_km * 1e3)),
            **measured,
        },
        "thruster": {
            "budget_m_s": impulse * draw(sizes(0.1, 1e3)),
            "min_impulse_m_s": impulse * draw(st.sampled_from([0.0, 0.1, 1.0])),
            "max_impulse_m_s": impulse,
            "execution_error_relative": draw(st.sampled_from([0.0, 0.1])),
            "pointing_error_rad": draw(st.sampled_from([0.0, 0.01])) if is_spatial else None,
            **given,
        },
        "information_set": {
            "model": (Model.GUARANTEED if guaranteed else Model.PAPER).value,
            "initial_set": draw(st.sampled_from(InitialSet)).value,
            "sections": sections,
            "fewest_sections": draw(st.integers(1, sections)),
            "recovery": draw(st.sampled_from(Recovery)).value,
            "range_threshold_km": threshold_km,
            "disturbance_m_s2": draw(st.just(0.0) | sizes(1e-9, 1.0)),
            "disturbance_y_m_s2": draw(st.none() | sizes(1e-9, 1.0)) if is_spatial else None,
        },
    }
    top = {
        "name": "any",
        "description": draw(st.none() | st.just("One of many.")),
        "nominal_range_km": range_km,
        "closing_speed_km_s": speed,
        "step_s": step_s,
        "strategy": draw(st.sampled_from(strategy_names())),
        "noise": draw(st.sampled_from(NoiseKind)).value,
        "tie": draw(st.sampled_from(TieRule)).value,
    }
    return toml(top, tables | {name: rare[name] for name in optional})


@st.composite
def encounters(draw: st.DrawFn) -> str:
    """One to four craft that meet within 0.01 to 3 radians of the orbit."""
    rate, intercept = draw(sizes(1e-7, 7e-4)), draw(st.booleans())
    duration_s, size = draw(sizes(1e-2, 3.0)) / rate, draw(sizes(1e-2, 1e6))
    names = [name for name in TERMINAL if not (intercept and name.startswith("v"))]
    free = draw(st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True))
    craft = [
        {
            "name": f"craft {place}",
            "position_m": draw(vectors(size)),
            "velocity_m_s": draw(vectors(size * rate)),
            "weight": draw(sizes(1e-3, 1e3)),
            "start_s": duration_s * draw(st.sampled_from([0.0, 0.5])),
        }
        for place in range(draw(st.integers(1, 4)))
    ]
    top = {
        "kind": "pareto-encounter",
        "name": "any",
        "orbit_rate_rad_s": rate,
        "duration_s": duration_s,
        "free": free,
        "meet": "intercept" if intercept else "rendezvous",
        "max_control_m_s2": draw(st.none() | sizes(1e-6, 10.0)),
    }
    return toml(top, {"craft": craft})


@st.composite
def tours(draw: st.DrawFn) -> str:
    """One to three targets in axes of Hill, met at given times."""
    rate, size = draw(sizes(1e-7, 7e-4)), draw(sizes(1e-1, 1e6))
    gap_s = draw(sizes(1e-2, 1.0)) / rate
    targets = [
        {
            "name": f"target {place}",
            "position_m": draw(vectors(size)),
            "velocity_m_s": draw(vectors(size * rate)),
            "time_s": (place + 1) * gap_s,
            "meet": draw(st.sampled_from(["flyby", "rendezvous"])),
        }
        for place in range(draw(st.integers(1, 3)))
    ]
    top = {
        "kind": "multipoint",
        "name": "any",
        "orbit_rate_rad_s": rate,
        "eccentricity": draw(st.sampled_from([0.0, 0.0, 0.3])),
        "true_anomaly_deg": draw(angles(-360.0, 360.0)),
        "max_control_m_s2": draw(st.none() | sizes(1e-6, 10.0)),
    }
    chaser = {"position_m": draw(vectors(size)), "velocity_m_s": draw(vectors(size * rate))}
    return toml(top, {"chaser": chaser, "target": targets})


@st.composite
def pursuits(draw: st.DrawFn) -> str:
    """Two spacecraft on orbits of any size about bodies of any mass."""
    axis_km = draw(sizes(7e3, 1e6))
    top = {
        "kind": "pursuit-evasion",
        "name": "any",
        "capture_radius_km": axis_km * draw(st.sampled_from([0.0, 1e-6])),
    }
    gravity = {
        "parameter_km3_s2": draw(sizes(5e3, 1e12)),
        "planet_radius_km": axis_km * draw(st.sampled_from([0.0, 0.1, 0.5])),
    }
    tables: dict[str, Values] = {"gravity": gravity}
    thrusts = {"pursuer": 20.0, "evader": draw(st.sampled_from([0.0, 2.0, 15.0]))}
    for (name, thrust), farther in zip(thrusts.items(), (1.0, 1.4), strict=True):
        mass = draw(sizes(1.0, 1e6))
        tables[f"{name}.orbit"] = {
            "semi_major_axis_km": axis_km * farther * draw(st.floats(1.0, 1.1)),
            "eccentricity": draw(angles(0.0, 0.1)),
            "inclination_deg": draw(angles(0.0, 180.0)),
            "raan_deg": draw(angles(0.0, 360.0)),
            "argument_of_perigee_deg": draw(angles(0.0, 360.0)),
            "true_anomaly_deg": draw(angles(0.0, 360.0)),
        }
        tables[name] = {
            "mass_kg": mass,
            "dry_mass_kg": mass * draw(angles(0.0, 0.9)),
            "thrust_N": thrust * mass * 1e-3 * draw(sizes(0.1, 10.0)),
            "specific_impulse_s": draw(sizes(50.0, 5e3)),
        }
    return toml(top, tables)


@st.composite
def rendezvous(draw: st.DrawFn) -> str:
    """Two or three periods of any length toward a craft on any ellipse, in a box, perhaps in a cone."""
    mu = draw(sizes(1e9, 1e15))
    axis_km = EARTH_RADIUS_M / 1e3 * math.cbrt(mu / EARTH_M3_S2) * draw(sizes(6.0, 900.0))
    rate = math.sqrt(mu / (axis_km * 1e3) ** 3)
    period_s, size = draw(sizes(1e-3, 0.5)) / rate, draw(sizes(1.0, 1e6))
    position = draw(vectors(size))
    top = {
        "kind": "reachable-rendezvous",
        "name": "any",
        "periods": draw(st.integers(2, 3)),
        "period_s": period_s,
        "acceleration_m_s2": size / period_s**2 * draw(sizes(0.1, 10.0)),
        "model": draw(st.sampled_from(["frozen", "time-varying"])),
        "thrust": draw(st.sampled_from(["box", "ball"])),
    }
    cone = {
        "apex_m": [-size, 0.0, 0.0],
        "axis": [1.0, 0.0, 0.0],
        "half_angle_deg": draw(angles(1.0, 89.0)),
        "faces": 4,
        "from_period": 2,
    }
    tables: dict[str, Values] = {
        "orbit": {
            "semi_major_axis_km": axis_km,
            "eccentricity": draw(angles(0.0, 0.8)),
            "true_anomaly_deg": draw(angles(0.0, 360.0)),
            "gravitational_parameter_m3_s2": mu,
        },
        "initial": {"position_m": position, "velocity_m_s": draw(vectors(size / period_s))},
        "bounds": {"position_m": 2.0 * size, "velocity_m_s": 2.0 * size / period_s, "control": 1.0},
        "cone": draw(st.sampled_from([{}, cone])),
    }
    return toml(top, tables)


@st.composite
def observers(draw: st.DrawFn) -> str:
    """One to three states of any size, one or two outputs, in boxes, zonotopes or triangles."""
    states, outputs = draw(st.integers(1, 3)), draw(st.integers(1, 2))
    size = draw(sizes(1e-6, 1e6))

    def rows(count: int, width: int, scale: float) -> list[list[float]]:
        return [[scale * draw(st.integers(-64, 64)) / 64 for _ in range(width)] for _ in range(count)]

    box = {"lower": [-size] * states, "upper": [size] * states}
    zonotope = {"center": [0.0] * states, "generators": rows(draw(st.integers(1, 3)), states, 0.1 * size)}
    triangle = {"vertices": rows(states + 1, states, size)}
    system: Values = {
        "A": rows(states, states, 1.5),
        "B": rows(states, 1, size),
        "C": rows(outputs, states, 2.0),
    }
    tables: dict[str, Values] = {
        "system": system,
        "initial": draw(st.sampled_from([box, triangle])),
        "disturbance": draw(st.sampled_from([box, zonotope, triangle])),
        "noise": {"half_width": [size * draw(st.sampled_from([0.0, 0.1, 3.0]))] * outputs},
        "simulation": {"steps": draw(st.integers(1, 4)), "missing": [1]},
    }
    return toml({"kind": "observer", "name": "any"}, tables)


KINDS: Mapping[str, tuple[str, st.SearchStrategy[str]]] = {
    "scenario": ("engage", scenarios()),
    "pareto-encounter": ("pareto", encounters()),
    "multipoint": ("multipoint", tours()),
    "pursuit-evasion": ("pursuit", pursuits()),
    "reachable-rendezvous": ("reach", rendezvous()),
    "observer": ("observe", observers()),
}
"""Kinds of files: the command that runs one, and sound ones."""
