"""Texts of orbit ephemeris messages for tests."""

from __future__ import annotations

from collections.abc import Sequence

from infoset.arrays import Floats

HEADER = "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\n\n"


def segment(
    epochs: Sequence[str], states: Floats, covariance: str = "", **metadata: str | None
) -> str:
    """Return a segment of states, shape (N, 2, 3), m and m/s; None leaves a keyword out."""
    keys: dict[str, str | None] = {
        "OBJECT_NAME": "X",
        "OBJECT_ID": "2026-001A",
        "CENTER_NAME": "SUN",
        "REF_FRAME": "EME2000",
        "TIME_SYSTEM": "TDB",
        "START_TIME": epochs[0],
        "STOP_TIME": epochs[-1],
        "INTERPOLATION": "HERMITE",
        "INTERPOLATION_DEGREE": "7",
        **metadata,
    }
    lines = [
        "META_START",
        *(f"{key} = {value}" for key, value in keys.items() if value is not None),
        "META_STOP",
        "",
    ]
    for epoch, state in zip(epochs, states, strict=True):
        numbers = " ".join(f"{1e-3 * value:.15e}" for value in state.ravel())
        lines.append(f"{epoch} {numbers}")
    return "\n".join([*lines, covariance, ""])


def covariance_block(epoch: str, matrix_m2: Floats, frame: str | None = None) -> str:
    """Return a covariance block of a matrix in m^2, m^2/s and m^2/s^2."""
    lines = ["COVARIANCE_START", f"EPOCH = {epoch}"]
    if frame is not None:
        lines.append(f"COV_REF_FRAME = {frame}")
    lines += [
        " ".join(f"{1e-6 * value:.15e}" for value in row[: index + 1])
        for index, row in enumerate(matrix_m2)
    ]
    return "\n".join([*lines, "COVARIANCE_STOP", ""])
