from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rendezvous.pursuit_evasion._extremal import eliminate


@given(st.integers(1, 7), st.integers(1, 4), st.integers(0, 10_000))
def test_it_solves_what_lapack_solves(size: int, width: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    matrix, right = random.standard_normal((size, size)), random.standard_normal((size, width))
    matrix[0, 0] = 0.0 if size > 1 else matrix[0, 0]
    found = right.copy()
    determinant = eliminate(matrix.copy(), found)
    assert determinant == pytest.approx(float(np.linalg.det(matrix)), rel=1e-6, abs=1e-12)
    scale = np.abs(found).max() * np.abs(matrix).max()
    np.testing.assert_allclose(matrix @ found, right, atol=1e-12 * max(1.0, float(scale)))


def test_a_singular_matrix_has_no_determinant() -> None:
    assert eliminate(np.array([[1.0, 2.0], [2.0, 4.0]]), np.eye(2)) == 0.0
    assert eliminate(np.zeros((3, 3)), np.eye(3)) == 0.0
