"""The reader of orbit ephemeris messages."""

from __future__ import annotations

import numpy as np
import pytest

from infoset.experiments.common.ephemeris.oem import OemSegment, read_oem
from infoset.experiments.common.errors import InputError
from tests.oem_text import HEADER, covariance_block, segment

EPOCHS = ("2029-03-01T00:00:00", "2029-03-01T00:01:00", "2029-03-01T00:02:30.5")
STATES = np.arange(1.0, 19.0).reshape(3, 2, 3) * 1e3
SIMPLE = HEADER + segment(EPOCHS, STATES)


def read(text: str | bytes) -> list[OemSegment]:
    return read_oem(text.encode() if isinstance(text, str) else text, "a.oem")


def refused(text: str | bytes) -> str:
    with pytest.raises(InputError) as error:
        read(text)
    message = str(error.value)
    assert message.startswith("a.oem: ")
    assert "\n" not in message
    return message


def test_states_and_epochs_are_read_from_the_file() -> None:
    (found,) = read(SIMPLE)

    np.testing.assert_allclose(found.states, STATES, rtol=1e-15)
    seconds = np.array([float(each - found.seconds[0]) for each in found.seconds])
    np.testing.assert_array_equal(seconds, [0.0, 60.0, 150.5])
    assert (found.scale, found.method, found.degree, found.number) == ("TDB", "HERMITE", 7, 1)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        # What the standard and its versions allow.
        ("CCSDS_OEM_VERS = 2.0", "CCSDS_OEM_VERS = 1.0"),
        ("CCSDS_OEM_VERS = 2.0", "CCSDS_OEM_VERS = 3.0\nCLASSIFICATION = none\nMESSAGE_ID = 7"),
        ("CCSDS_OEM_VERS = 2.0", "CCSDS_OEM_VERS=2.0"),
        (" = ", "="),
        (" = ", "    =\t"),
        ("CREATION_DATE", "COMMENT = a comment with KEY = VALUE\nCREATION_DATE"),
        ("META_STOP", "META_STOP\nCOMMENT between metadata and data"),
        ("\n", "\r\n"),
        ("INTERPOLATION = HERMITE", "INTERPOLATION = hermite"),
        ("TIME_SYSTEM = TDB", "TIME_SYSTEM = tdb"),
        ("2029-03-01T", "2029-060T"),
        ("T00:01:00 ", "T00:01:00Z "),
        ("START_TIME", "USEABLE_START_TIME = 2029-03-01T00:00:00\nSTART_TIME"),
    ],
)
def test_layout_that_the_standard_allows_is_read(old: str, new: str) -> None:
    assert old in SIMPLE

    (found,) = read(SIMPLE.replace(old, new))

    np.testing.assert_allclose(found.states, STATES, rtol=1e-15)


def test_accelerations_are_read_over() -> None:
    (found,) = read(SIMPLE.rstrip() + " 1.0 2.0 3.0\n")

    np.testing.assert_allclose(found.states, STATES, rtol=1e-15)


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbf" + SIMPLE.encode(),
        SIMPLE.replace("TEST", "TEST\nCOMMENT Universit\u00e4t").encode("latin-1"),
        b"\xef\xbb\xbf"
        + SIMPLE.replace("TEST", "TEST\nCOMMENT Universit\u00e4t").encode("latin-1"),
        SIMPLE.replace("TEST", "TEST\nCOMMENT Universit\u00e4t").encode("utf-8"),
        SIMPLE.replace("TEST", "TEST\nCOMMENT and so on\u2026 for ever").encode("cp1252"),
    ],
    ids=["BOM", "Latin-1", "BOM and Latin-1", "UTF-8", "Windows"],
)
def test_latin_1_and_byte_order_mark_are_read(content: bytes) -> None:
    np.testing.assert_allclose(read(content)[0].states, STATES, rtol=1e-15)


def test_each_segment_has_its_own_metadata() -> None:
    later = ("2029-03-02T00:00:00", "2029-03-02T00:01:00", "2029-03-02T00:02:00")

    one, other = read(
        SIMPLE
        + segment(later, STATES, CENTER_NAME="EARTH", REF_FRAME="ITRF2000", TIME_SYSTEM="UTC")
    )

    assert (one.metadata["CENTER_NAME"], one.scale) == ("SUN", "TDB")
    assert (other.metadata["CENTER_NAME"], other.metadata["REF_FRAME"], other.scale) == (
        "EARTH",
        "ITRF2000",
        "UTC",
    )
    assert other.number == 2


def test_metadata_without_interpolation_have_hermite_of_degree_seven() -> None:
    (found,) = read(HEADER + segment(EPOCHS, STATES, INTERPOLATION=None, INTERPOLATION_DEGREE=None))

    assert (found.method, found.degree) == ("HERMITE", 7)


def test_linear_interpolation_has_degree_one_for_any_written_degree() -> None:
    (found,) = read(
        HEADER + segment(EPOCHS, STATES, INTERPOLATION="LINEAR", INTERPOLATION_DEGREE="7")
    )

    assert (found.method, found.degree) == ("LINEAR", 1)


def test_usable_span_is_within_the_span_and_the_states() -> None:
    text = SIMPLE.replace(
        "INTERPOLATION =", "USEABLE_START_TIME = 2029-03-01T00:00:30\nINTERPOLATION ="
    )

    (found,) = read(
        text.replace("STOP_TIME = 2029-03-01T00:02:30.5", "STOP_TIME = 2029-03-05T00:00:00")
    )

    assert found.start - found.seconds[0] == 30
    assert found.stop == found.seconds[-1]


def test_covariances_are_read_with_epoch_and_frame() -> None:
    generator = np.random.default_rng(1)
    root = generator.normal(size=(6, 6)) * 100.0
    matrix = root @ root.T
    blocks = covariance_block(EPOCHS[0], matrix) + covariance_block(EPOCHS[1], 4.0 * matrix, "RTN")
    joined = blocks.replace("COVARIANCE_STOP\nCOVARIANCE_START\n", "")

    for text in (blocks, joined):
        (found,) = read(SIMPLE + text)
        first, second = found.covariances
        np.testing.assert_allclose(first.matrix, matrix, rtol=1e-14)
        np.testing.assert_allclose(second.matrix, 4.0 * matrix, rtol=1e-14)
        assert (first.frame, second.frame) == (None, "RTN")
        assert second.seconds - first.seconds == 60


COVARIANCE = covariance_block(EPOCHS[0], np.eye(6))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "has no segment"),
        (HEADER, "has no segment"),
        ("hello", "line 1: is not an OEM file"),
        ("CCSDS_OPM_VERS = 2.0", "line 1: is not an OEM file"),
        (SIMPLE.replace("2.0", "4.0", 1), 'CCSDS_OEM_VERS "4.0" is not one of 1.0, 2.0, 3.0'),
        ('<?xml version="1.0"?><oem/>', "is XML"),
        (b"\xff\xfeC\0C\0S\0D\0S\0", "is not text"),
        (
            SIMPLE.replace("ORIGINATOR = TEST", "ORIGINATOR TEST"),
            "line 3: must be KEYWORD = VALUE in the header",
        ),
        (
            SIMPLE.replace("ORIGINATOR", "CREATION_DATE"),
            "CREATION_DATE is written again in the header",
        ),
        (
            SIMPLE.replace("OBJECT_ID", "OBJECT_NAME"),
            "OBJECT_NAME is written again in the metadata",
        ),
        (
            SIMPLE.replace("CENTER_NAME = SUN\n", ""),
            "CENTER_NAME is missing in the metadata of segment 1",
        ),
        (SIMPLE.replace("REF_FRAME = EME2000\n", ""), "REF_FRAME is missing"),
        (SIMPLE.replace("TIME_SYSTEM = TDB", "TIME_SYSTEM = "), "TIME_SYSTEM is missing"),
        (
            SIMPLE.replace("= SUN", "= S\x1b[31mUN"),
            "CENTER_NAME has control characters in the metadata",
        ),
        (b"\xef\xbb\xbf<oem/>", "is XML"),
        (SIMPLE.replace("TDB", "UT1"), "TIME_SYSTEM: time scale UT1 is not one of"),
        (
            SIMPLE.replace("HERMITE", "CHEBYSHEV"),
            'INTERPOLATION "CHEBYSHEV" is not one of HERMITE, LAGRANGE, LINEAR',
        ),
        (
            SIMPLE.replace("DEGREE = 7", "DEGREE = 7.1"),
            "INTERPOLATION_DEGREE must be a whole number from 1 to 20",
        ),
        (SIMPLE.replace("DEGREE = 7", "DEGREE = 0"), "INTERPOLATION_DEGREE must be"),
        (SIMPLE.replace("DEGREE = 7", "DEGREE = 999999999"), "INTERPOLATION_DEGREE must be"),
        (SIMPLE.replace("META_STOP", ""), "must be KEYWORD = VALUE in the metadata"),
        (SIMPLE[: SIMPLE.index("META_STOP")], "META_STOP is missing at the end of the file"),
        (HEADER + segment(EPOCHS[:1], STATES[:1]).splitlines()[0], "META_STOP is missing"),
        (SIMPLE[: SIMPLE.index("META_STOP")] + "META_STOP\n", "segment 1 has no states"),
        (
            SIMPLE[: SIMPLE.index("META_STOP")] + "META_STOP\n" + COVARIANCE,
            "segment 1 has no states",
        ),
        (SIMPLE.rstrip() + " 1.0\n", "must be an epoch and 6 numbers, or 9"),
        (SIMPLE + "2029-03-01T00:03:00 1 2 3 4 5 six\n", "must be numbers, found"),
        (SIMPLE + "2029-03-01T00:03:00 1 2 3 4 5 nan\n", "must be numbers, found"),
        (SIMPLE + "2029-03-01T00:03:00 1 2 3 4 5 1e300\n", "must be numbers, found"),
        (
            SIMPLE + "2029-03-01T00:02:30.5 1 2 3 4 5 6\n",
            "is not later than the one before; sort the states",
        ),
        (SIMPLE + "2029-02-01T00:02:30 1 2 3 4 5 6\n", "is not later than the one before"),
        (SIMPLE + "yesterday 1 2 3 4 5 6\n", '"yesterday" is not an epoch such as'),
        (SIMPLE.replace("START_TIME = 2029", "START_TIME = 20x9"), "START_TIME of segment 1: "),
        (
            SIMPLE + COVARIANCE.replace("EPOCH = 2029-03-01T00:00:00\n", ""),
            "EPOCH of the covariance is missing",
        ),
        (SIMPLE + COVARIANCE.replace("EPOCH", "TIME"), "must be KEYWORD = VALUE in the covariance"),
        (
            SIMPLE + "COVARIANCE_START\nEPOCH = 2029-03-01\n1\n1 2 3\n",
            "row 2 of the covariance must have 2 numbers",
        ),
        (
            SIMPLE + "COVARIANCE_START\nEPOCH = 2029-03-01\n1\nCOVARIANCE_STOP\n",
            "the covariance ends after 1 of 6 rows",
        ),
        (
            SIMPLE + "COVARIANCE_START\nEPOCH = 2029-03-01\n1\nEPOCH = 2\n",
            "the covariance has 1 rows, it must have 6",
        ),
        (
            SIMPLE + "COVARIANCE_START\nEPOCH = 2029-03-01\n",
            "COVARIANCE_STOP is missing at the end of the file",
        ),
    ],
)
def test_damaged_file_is_refused_with_its_line(text: str | bytes, problem: str) -> None:
    assert problem in refused(text)


def test_message_names_the_line() -> None:
    lines = SIMPLE.splitlines()
    lines[-1] = "2029-03-01T00:03:00 1 2 3"

    assert refused("\n".join(lines)).startswith(f"a.oem: line {len(lines)}: ")


@pytest.mark.parametrize("seed", range(200))
def test_randomly_damaged_file_is_read_or_refused_with_one_line(seed: int) -> None:
    generator = np.random.default_rng(seed)
    content = bytearray((SIMPLE + COVARIANCE + segment(EPOCHS, STATES)).encode())
    for _ in range(int(generator.integers(1, 6))):
        place = int(generator.integers(len(content)))
        match generator.integers(3):
            case 0:
                content[place] = int(generator.integers(256))
            case 1:
                del content[place : place + int(generator.integers(1, 60))]
            case _:
                content[place:place] = content[: int(generator.integers(1, 200))]

    try:
        segments = read(bytes(content))
    except InputError as error:
        assert "\n" not in str(error)  # noqa: PT017  # both outcomes are right
        return
    assert all(len(each.states) == len(each.seconds) > 0 for each in segments)
