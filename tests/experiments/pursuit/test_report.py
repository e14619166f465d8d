"""What the screen, the JSON and the page say of a certificate."""

from __future__ import annotations

from dataclasses import replace

import pytest

from infoset.experiments.common.input_file import load_problem
from infoset.experiments.pursuit.page import pursuit_page
from infoset.experiments.pursuit.report import (
    PursuitReport,
    report_json,
    report_lines,
    saddle_point,
)
from infoset.rendezvous.pursuit_evasion import (
    CaptureSolution,
    Certificate,
    CertificateVerdict,
    certify,
    solve,
)

PROBLEM = load_problem("leo-pursuit")


@pytest.fixture(scope="module")
def solved() -> CaptureSolution:
    return solve(PROBLEM.game)


@pytest.fixture(scope="module")
def certificate(solved: CaptureSolution) -> Certificate:
    return certify(solved)


@pytest.mark.parametrize(
    ("found", "said", "is_claimed"),
    [
        (120, "saddle point: all checks hold", True),
        (
            60,
            (
                "saddle point: no check failed; 60 of 120 directions were not decided (no "
                "farthest extremal was"
            ),
            True,
        ),
        (7, "saddle point: not claimed: 113 of 120 directions were not decided", False),
    ],
)
def test_screen_and_json_agree_on_the_claim(
    found: int, said: str, is_claimed: bool, solved: CaptureSolution, certificate: Certificate
) -> None:
    scanned = replace(certificate, directions_tried=120, directions_found=found)
    report = PursuitReport(PROBLEM, solved, scanned, None)

    assert saddle_point(scanned).startswith(said)
    assert any(said in str(part) for part in report_lines(report))
    printed = report_json(report)["certificate"]
    assert isinstance(printed, dict)
    assert printed["saddle_point"] is is_claimed
    assert printed["failures"] == ()


def test_page_has_the_verdict(solved: CaptureSolution) -> None:
    not_certified = replace(solved, verdict=CertificateVerdict.BRANCH_NOT_CERTIFIED)

    page = pursuit_page(PursuitReport(PROBLEM, not_certified, None, None))

    assert "branch-not-certified: the extremals are a saddle up to" in page
    assert "captured at" not in page
    assert "captured at" in pursuit_page(PursuitReport(PROBLEM, solved, None, None))
