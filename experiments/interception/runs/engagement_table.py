"""Table and figures of single engagements, for `engage` and `replay`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from infoset.experiments.common.output import Output
from infoset.experiments.common.screen import BeginProgress, Part, number, number_table
from infoset.experiments.interception.published import printed_single_runs
from infoset.experiments.interception.runs.shared import allowance, bound_name
from infoset.experiments.interception.study import is_of_paper, some_wrong_images
from infoset.sim import Record, Scenario

FIGURES = ("figure-process", "figure-sets", "figure-approach")
FIGURES_OF_PAPER = ("figure-2-process", "figure-3-sets", "figure-approach")
"""Names of the figures of engagements, and with their numbers in the paper."""
FIGURE_OF_MEMBERS = "figure-wrong-images"
"""Name of the figure of engagements whose set allows for wrong images."""

MAX_LISTED_TIMES = 8
"""Number of suspected images up to which a line of the screen has all their times; chosen.

With more, it has the times of so many first ones and of the last one.
"""

PRINTED_NOTE = (
    "the paper prints impulses of one run with each noise, from z = -8 km and without a range "
    "sensor; docs/interception.md says which variants were tried, and that the difference to ours "
    "is not explained"
)


def engagement_figures(*scenarios: Scenario) -> Sequence[str]:
    """Return the names of the figures of engagements of scenarios; the first one names them."""
    names = FIGURES
    if is_of_paper(scenarios[0]):
        names = FIGURES_OF_PAPER
    if any(scenario.information_set.wrong_images for scenario in scenarios):
        return (*names, FIGURE_OF_MEMBERS)
    return names


def engagement_parts(records: Sequence[Record]) -> Iterator[Part]:
    """Yield the results of engagements side by side, for the screen.

    If one of them is of a scenario of the paper, a row has the impulses that the paper prints,
    unknown for other scenarios and noises.
    """
    printed: Mapping[str, tuple[float, float]] = {}
    if any(is_of_paper(record.scenario) for record in records):
        printed = printed_single_runs()
    bounds = sorted({bound_name(record.scenario).removesuffix(", m") for record in records})
    lateral = sorted({axis for record in records for axis in record.scenario.set_model.axes})
    titles = []
    columns = []

    for record in records:
        title = record.noise_name
        if record.scenario.range_sensor is not None:
            title += " + range sensor"
        titles.append(title)
        columns.append(_column(record, lateral, f"{' / '.join(bounds)}, m", printed))

    table = number_table("", *titles)
    for name in columns[0]:
        table.add_row(name, *(column.get(name, "") for column in columns))
    yield " | ".join(dict.fromkeys(record.scenario.name for record in records))
    yield table
    if printed:
        yield PRINTED_NOTE
    yield from dict.fromkeys(filter(None, (allowance(record.scenario) for record in records)))
    for title, record in zip(titles, records, strict=True):
        if record.scenario.information_set.wrong_images:
            head = f"{title} noise: " if len(records) > 1 else ""
            yield f"{head}{_wrong_image_line(record)}"


def _wrong_image_line(record: Record) -> str:
    """Return whether a wrong image is proved, and the images at least one of which is wrong.

    With one wrong image allowed and one suspected image, this image is wrong.
    """
    allowed = some_wrong_images(record.scenario.information_set.wrong_images)
    head = f"at most {allowed} assumed"
    proved = record.result.wrong_image_proved_s
    if proved is None or not proved.count():
        return f"{head}; none is proved"

    text = f"{head}; a wrong image is proved at {proved[0]:g} s"
    if record.inconsistency is not None:
        time_s = float(record.time_s[record.inconsistency.step])
        return (
            f"{text}, and the set became empty at {time_s:g} s: more images are wrong, or another "
            "assumption does not hold"
        )

    times = [f"{time_s:g}" for time_s in record.suspected_s]
    if len(times) < 2:
        return f"{text}: the image at {''.join(times)} s"
    at = f"{', '.join(times[:-1])} and {times[-1]}"
    if len(times) > MAX_LISTED_TIMES:
        at = f"{', '.join(times[:MAX_LISTED_TIMES])} ... and {times[-1]}"
    some = "one"
    if record.scenario.information_set.wrong_images > 1:
        some = "at least one"
    return f"{text}: {some} of the {len(times)} images at {at} s"


def _column(
    record: Record,
    lateral: Sequence[str],
    bound: str,
    printed: Mapping[str, tuple[float, float]],
) -> dict[str, str]:
    """Return the results of an engagement as text, by their titles."""
    result = {name: values[0] for name, values in record.result.to_dict().items()}
    column = {"miss, m": number(result["miss_m"])}
    for axis in lateral:
        column[f"miss along {axis}, m"] = number(result.get(f"miss_{axis}_m"))
    column["impulse, m/s"] = number(result["impulse_m_s"])
    if printed:
        impulse_m_s = None
        if is_of_paper(record.scenario) and record.noise_name in printed:
            _, impulse_m_s = printed[record.noise_name]
        column["impulse that the paper prints, m/s"] = number(impulse_m_s)
    column[bound] = number(result["guaranteed_miss_m"])

    return column | {
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


def _yes(value: bool | None) -> str:
    if value is None:
        return "-"
    return "yes" if value else "no"


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

        names = engagement_figures(*(record.scenario for record in records))
        written.draw(names, draw_flights(records, times_s), begin("figures"))
