"""What `engage` and `replay` show of single engagements: a table, and figures 2 and 3."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table
from rich.text import Text

from experiments.common.screen import (
    allowance,
    certificate,
    guaranteed_miss_name,
    number,
    table_console,
)
from experiments.interception.published import PRINTED_SINGLE_RUN, SINGLE
from sim import Record

FIGURE_2 = "figure-2-process"
FIGURE_3 = "figure-3-sets"


def show_engagements(records: Sequence[Record], stdout_taken: bool) -> None:
    """Print the results of engagements side by side, beside the paper's where it has them.

    Parameters
    ----------
    records : sequence of Record
    stdout_taken : bool
        Whether to print on stderr.
    """
    table = Table("", box=None, pad_edge=False)
    columns: list[list[str]] = []
    for record in records:
        scenario, result = record.scenario, record.result
        meter = " + range meter" if scenario.range_sensor is not None else ""
        table.add_column(Text(f"{record.noise_name}{meter}"), justify="right")
        columns.append(
            [
                number(float(result.miss_m[0])),
                number(float(result.impulse_m_s[0])),
                number(result.guaranteed_miss_m.tolist()[0]),
                _outcome(record),
                certificate(result),
                number(result.truth_margin_m.tolist()[0]),
                str(len(record.steps)),
                f"{record.seed}, {record.run}",
                record.strategy,
            ]
        )
        paper = PRINTED_SINGLE_RUN.get(record.noise_name)
        if scenario.name == SINGLE and scenario.range_sensor is None and paper is not None:
            table.add_column("paper", justify="right")
            columns.append([number(paper[0]), number(paper[1]), *[""] * 7])
    names = {guaranteed_miss_name(record.scenario.set_model.kind.value) for record in records}
    titles = [
        "miss, m",
        "impulse, m/s",
        f"{' / '.join(sorted(names))}, m",
        "outcome",
        "certificate",
        "least margin of the truth in its section, m",
        "steps",
        "seed, run",
        "strategy",
    ]
    for title, *values in zip(titles, *columns, strict=True):
        table.add_row(title, *(Text(value) for value in values))
    console = table_console(stdout_taken)
    console.print(Text(" | ".join(dict.fromkeys(record.scenario.name for record in records))), soft_wrap=True)
    console.print(table)
    for line in dict.fromkeys(filter(None, (allowance(record.scenario) for record in records))):
        console.print(Text(line), soft_wrap=True)


def _outcome(record: Record) -> str:
    outcome, found = record.result.outcomes[0].value, record.inconsistency
    if found is None:
        return outcome
    return f"{outcome} at {record.steps[found.step].time_s:g} s, label {found.label_m / 1e3:.0f} km"


def draw_engagements(records: Sequence[Record], folder: Path) -> None:
    """Draw figures 2 and 3 of one or two engagements into a folder.

    Parameters
    ----------
    records : sequence of Record
    folder : Path
    """
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures
    from experiments.interception.figures.process import draw_process
    from experiments.interception.figures.sets import draw_sets

    for name, figure in ((FIGURE_2, draw_process(records)), (FIGURE_3, draw_sets(records))):
        with reporting_failures(folder):
            save_figure(figure, folder, name)
