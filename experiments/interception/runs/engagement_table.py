"""Table and figures of single engagements, for `engage` and `replay`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from infoset.experiments.common.output import Output
from infoset.experiments.common.screen import BeginProgress, Part, number, number_table
from infoset.experiments.interception.published import printed_single_runs
from infoset.experiments.interception.runs.shared import allowance, bound_name
from infoset.experiments.interception.study import is_of_paper
from infoset.sim import Record, Scenario

FIGURES = ("figure-process", "figure-sets", "figure-approach")
FIGURES_OF_PAPER = ("figure-2-process", "figure-3-sets", "figure-approach")
"""Names of the figures of engagements, and with their numbers in the paper."""


PRINTED_NOTE = (
    "the paper prints impulses of one run with each noise, from z = -8 km and without a range "
    "sensor; docs/interception.md says which variants were tried, and that the difference to ours "
    "is not explained"
)


def engagement_figures(scenario: Scenario) -> Sequence[str]:
    """Return the names of the figures of engagements of a scenario."""
    return FIGURES_OF_PAPER if is_of_paper(scenario) else FIGURES


def engagement_parts(records: Sequence[Record]) -> Iterator[Part]:
    """Yield the results of engagements side by side, with the paper's for its scenario, for the
    screen.
    """
    bounds = sorted({bound_name(record.scenario).removesuffix(", m") for record in records})
    lateral = sorted({axis for record in records for axis in record.scenario.set_model.axes})
    printed = (
        printed_single_runs() if any(is_of_paper(record.scenario) for record in records) else {}
    )
    columns: list[tuple[str, dict[str, str]]] = []
    for record in records:
        result = {name: values[0] for name, values in record.result.to_dict().items()}
        meter = " + range sensor" if record.scenario.range_sensor is not None else ""
        values = {
            "miss, m": number(result["miss_m"]),
            **{f"miss along {axis}, m": number(result.get(f"miss_{axis}_m")) for axis in lateral},
            "impulse, m/s": number(result["impulse_m_s"]),
            **_printed_impulse(record, printed),
            f"{' / '.join(bounds)}, m": number(result["guaranteed_miss_m"]),
            "outcome": _outcome(record),
            "true state inside the set\nat every step": _yes(result["truth_kept"]),
            "smallest distance from the true\nstate to the set's boundary, m": number(
                result["truth_margin_m"]
            ),
            "miss within the bound Phi": _yes(result["phi_held"]),
            "steps": str(record.steps),
            "seed, run": f"{record.seed}, {record.run}",
            "strategy": record.strategy,
        }
        columns.append((f"{record.noise_name}{meter}", values))
    table = number_table("", *(title for title, _ in columns))
    for name in columns[0][1]:
        table.add_row(name, *(values.get(name, "") for _, values in columns))
    yield " | ".join(dict.fromkeys(record.scenario.name for record in records))
    yield table
    if printed:
        yield PRINTED_NOTE
    yield from dict.fromkeys(filter(None, (allowance(record.scenario) for record in records)))


def _printed_impulse(record: Record, printed: Mapping[str, tuple[float, float]]) -> dict[str, str]:
    """Return the row with the impulse that the paper prints for a noise; no row without printed
    numbers.
    """
    if not printed:
        return {}
    of_noise = printed.get(record.noise_name) if is_of_paper(record.scenario) else None
    return {"impulse that the paper prints, m/s": number(None if of_noise is None else of_noise[1])}


def _yes(value: bool | None) -> str:
    return "-" if value is None else "yes" if value else "no"


def _outcome(record: Record) -> str:
    outcome = record.ending
    contradiction = record.inconsistency
    if contradiction is None:
        return outcome
    time_s = float(record.time_s[contradiction.step])
    label_km = contradiction.label_m / 1e3
    return f"{outcome}; set empty at {time_s:g} s, section {label_km:.0f} km"


def draw_engagements(
    records: Sequence[Record], written: Output, begin: BeginProgress, times_s: Sequence[float] = ()
) -> None:
    """Draw the figures of one or two engagements into the folder, if there is one."""
    if written.folder is not None:
        from infoset.experiments.interception.figures.commands import draw_flights

        names = engagement_figures(records[0].scenario)
        written.draw(names, draw_flights(records, times_s), begin("figures"))
