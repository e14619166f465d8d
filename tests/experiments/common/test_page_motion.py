"""Faces and outlines of sets on pages of moving craft."""

from __future__ import annotations

import numpy as np
import pytest

from infoset.experiments.common.page_motion import faces_of


# At 2e8, about half the distance of the Moon in m, the quotient by 1e-300 is above 1.8e308.
@pytest.mark.parametrize("space", [2, 3])
def test_points_in_one_place_far_away_are_one_face(space: int) -> None:
    points = np.full((5, space), 2e8)

    (face,) = faces_of(points)

    np.testing.assert_array_equal(np.unique(face, axis=0), points[:1])


def test_points_on_a_line_far_away_have_its_ends() -> None:
    points = np.array([[2e8, 0.0], [2e8, 1.0], [2e8, 2.0], [2e8, 3.0]])

    (face,) = faces_of(points)

    np.testing.assert_array_equal([face.min(axis=0), face.max(axis=0)], points[[0, 3]])
