"""What `import infoset` offers, and that nothing else is imported under a name of its own."""

from __future__ import annotations

import importlib
import pkgutil
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

import infoset
from infoset import load_scenario

PACKAGES = ("infoset", "infoset.guidance", "infoset.sim", "infoset.experiments")
ANY_SCENARIO = "asteroid-1997-single"


def run_python(code: str, folder: Path) -> str:
    """Return what code prints in a new process that starts in a folder."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_dir_lists_every_public_name_and_package() -> None:
    assert set(infoset.__all__) < set(dir(infoset))
    assert {"experiments", "guidance", "rendezvous", "sim", "__version__"} < set(dir(infoset))
    for name in dir(infoset):
        assert getattr(infoset, name) is not None


def test_unknown_name_is_an_attribute_error() -> None:
    face: Any = infoset
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = face.simulat


def test_a_public_name_means_one_object() -> None:
    owners: dict[str, set[int]] = {}
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in module.__all__:
            owners.setdefault(name, set()).add(id(getattr(module, name)))
    assert [name for name, objects in owners.items() if len(objects) > 1] == []


def test_importing_infoset_loads_no_library(tmp_path: Path) -> None:
    code = "import sys, infoset; print(*sorted({name.partition('.')[0] for name in sys.modules}))"

    loaded = set(run_python(code, tmp_path).split())

    assert loaded - set(sys.stdlib_module_names) - {"sitecustomize", "__main__"} <= {
        "infoset",
        *startup(tmp_path),
    }


def startup(folder: Path) -> set[str]:
    """Return the packages that Python loads at its start in this environment."""
    code = "import sys; print(*sorted({name.partition('.')[0] for name in sys.modules}))"
    return set(run_python(code, folder).split())


def test_files_of_the_user_with_names_of_the_folders_are_not_imported(tmp_path: Path) -> None:
    for name in ("sim", "guidance", "rendezvous"):
        (tmp_path / f"{name}.py").write_text(f"raise ImportError('{name}.py of the user')")
    (tmp_path / "experiments").mkdir()
    (tmp_path / "experiments" / "__init__.py").write_text("raise ImportError('folder of the user')")
    code = (
        "import sys, infoset.experiments.cli, infoset.guidance, infoset.sim\n"
        "import infoset.rendezvous.pareto\n"
        f"print(infoset.load_scenario('{ANY_SCENARIO}').name)\n"
        "print(*{'experiments', 'guidance', 'rendezvous', 'sim'} & set(sys.modules))"
    )

    assert run_python(code, tmp_path) == f"{ANY_SCENARIO}\n\n"


def test_all_modules_have_names_in_infoset(tmp_path: Path) -> None:
    modules = [
        module.name
        for package in (infoset.guidance, infoset.sim, infoset.rendezvous, infoset.experiments)
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    ]
    assert len(modules) > 200
    code = (
        f"import importlib, sys\nfor name in {modules}: importlib.import_module(name)\n"
        "print(*{'experiments', 'guidance', 'rendezvous', 'sim'} & set(sys.modules))"
    )

    assert run_python(code, tmp_path) == "\n"


def test_installation_has_one_top_level_name() -> None:
    distribution = metadata.distribution("infoset")
    files = distribution.files or []
    if any(file.suffix == ".pth" for file in files):
        pytest.skip("installed for development; .ci/run runs this test with a wheel")

    inside = {file.parts[0] for file in files if file.parts[0] != ".."}

    assert inside == {"infoset", f"infoset-{distribution.version}.dist-info"}


def test_python_m_infoset_is_the_command(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "infoset", "--version"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.fullmatch(r"infoset \d+\.\d+\.\d+\S*", done.stdout.splitlines()[0])


def test_scenario_by_name_is_refused_with_the_function_that_loads_it() -> None:
    name: Any = ANY_SCENARIO
    for function in (infoset.simulate, infoset.fly_one, infoset.find_worst, infoset.lower_bound):
        with pytest.raises(
            TypeError, match=r"got 'asteroid-1997-single'; infoset\.load_scenario returns it"
        ):
            function(name)


def test_unknown_strategy_is_refused() -> None:
    with pytest.raises(ValueError, match="no strategy is called 'patience'"):
        infoset.simulate(load_scenario(ANY_SCENARIO), 1, strategy="patience")


def test_failed_guarantee_is_a_warning_of_the_package() -> None:
    with pytest.warns(infoset.GuaranteeWarning, match="the model paper does not promise") as caught:
        infoset.simulate(load_scenario("asteroid-1997"), 20)
    assert [Path(warning.filename).name for warning in caught] == ["test_public_face.py"]
