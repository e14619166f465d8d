"""Another processor, as far as one machine can show it: code for the plainest one, NumPy without its vectors."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

_FLY = """
import sys
from dataclasses import replace
import numba
import numpy as np
from experiments import load_scenario
from guidance import NoiseKind
from infoset import InitialSet, Model
from sim import simulate

assert numba.config.CPU_NAME == (sys.argv[2] or None)
flown = []
for noise in NoiseKind:
    paper = replace(load_scenario("asteroid-1997"), noise=noise)
    sound = replace(paper.set_model, kind=Model.GUARANTEED, initial_set=InitialSet.BOX)
    for scenario in (paper, replace(paper, set_model=sound)):
        results = simulate(scenario, 20)
        flown += [results.miss_m, results.impulse_m_s, results.truth_margin_m, results.guaranteed_miss_m.filled(-1.0)]
np.save(sys.argv[1], np.array(flown))
"""

# Everything past what every 64-bit Intel or AMD processor has.
_VECTORS = "SSE41 SSE42 AVX F16C FMA3 AVX2 AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR"


def flown(folder: Path, processor: str) -> NDArray[np.float64]:
    """Misses, impulses, margins and bounds flown by a process of its own."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / f"cache {processor}")}
    if processor:
        environment |= {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": "", "NPY_DISABLE_CPU_FEATURES": _VECTORS}
    place = folder / f"flown {processor}.npy"
    command = [sys.executable, "-W", "ignore", "-c", _FLY, str(place), processor]
    subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    return np.asarray(np.load(place, allow_pickle=False))


@pytest.mark.thorough
def test_results_do_not_depend_on_the_processor(tmp_path: Path) -> None:
    here, plainest = flown(tmp_path, ""), flown(tmp_path, "generic")
    assert here.shape == (16, 20)
    np.testing.assert_allclose(plainest, here, rtol=1e-9, atol=1e-9)
