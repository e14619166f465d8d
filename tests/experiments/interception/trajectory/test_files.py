"""Files that a trajectory file may name: regular files below its folder, and no meta-kernels."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from infoset.experiments.common.errors import InputError
from infoset.experiments.interception.trajectory.files import named_file
from infoset.experiments.interception.trajectory.kernels import MAX_TEXT_BYTES, kernel_files


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a file in it and in a folder below, and a file beside it."""
    (tmp_path / "mine" / "below").mkdir(parents=True)
    for name in ("mine/a.oem", "mine/below/b.oem", "beside.oem"):
        (tmp_path / name).write_text("text")
    return tmp_path / "mine"


@pytest.mark.parametrize("name", ["a.oem", "below/b.oem", "below/../a.oem", "./a.oem"])
def test_file_below_the_folder_is_opened(name: str, folder: Path) -> None:
    assert named_file(name, folder, ()).read_text() == "text"


def test_absolute_path_below_the_folder_is_opened(folder: Path) -> None:
    assert named_file(str(folder / "a.oem"), folder, ()).read_text() == "text"


@pytest.mark.parametrize(
    "name", ["../beside.oem", "below/../../beside.oem", "/etc/hostname", "link.oem", "away/passwd"]
)
def test_file_elsewhere_is_refused(name: str, folder: Path) -> None:
    (folder / "link.oem").symlink_to(folder.parent / "beside.oem")
    (folder / "away").symlink_to("/etc")

    with pytest.raises(
        InputError, match=r"is not below the folder of the trajectory file; copy it there, or allow"
    ):
        named_file(name, folder, ())


def test_file_in_an_allowed_folder_is_opened(folder: Path) -> None:
    assert named_file("../beside.oem", folder, [folder.parent]).read_text() == "text"


@pytest.mark.parametrize("name", ["missing.oem", "a.oem/b", "a\0b", "loop.oem", "x" * 5000])
def test_path_that_leads_nowhere_is_refused(name: str, folder: Path) -> None:
    (folder / "loop.oem").symlink_to(folder / "loop.oem")

    with pytest.raises(InputError, match="cannot be read: ") as error:
        named_file(name, folder, ())
    assert len(str(error.value)) < 200


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with names")
def test_pipe_is_refused_at_once(folder: Path) -> None:
    os.mkfifo(folder / "pipe")

    with pytest.raises(InputError, match="is not a regular file"):
        named_file("pipe", folder, ())


def test_folder_is_refused(folder: Path) -> None:
    with pytest.raises(InputError, match="is not a regular file"):
        named_file("below", folder, ())


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="needs the endless device")
def test_endless_device_is_refused_even_if_its_folder_is_allowed(folder: Path) -> None:
    with pytest.raises(InputError, match="is not below the folder"):
        named_file("/dev/zero", folder, ())
    with pytest.raises(InputError, match="is not a regular file"):
        named_file("/dev/zero", folder, [Path("/dev")])


@pytest.mark.parametrize(
    "text",
    [
        "KPL/MK\n\\begindata\nKERNELS_TO_LOAD = ( 'other.tls' )\n",
        "KPL/LSK\n\\begindata\nKERNELS_TO_LOAD += 'other.tls'\n",  # whatever its first line says
        "\\begindata\nkernels_to_load = ( 'other.tls' )\n",
    ],
)
def test_meta_kernel_is_refused(text: str, folder: Path) -> None:
    (folder / "meta.tm").write_text(text)

    with pytest.raises(
        InputError, match=r"meta.tm: is a meta-kernel, which loads further files; name the kernels"
    ):
        kernel_files(["meta.tm"], folder, ())


def test_kernels_of_text_and_of_numbers_are_opened(folder: Path) -> None:
    (folder / "leap.tls").write_text("KPL/LSK\n\\begindata\nDELTET/K = 1.657D-3\n")
    (folder / "both.bsp").write_bytes(b"DAF/SPK KERNELS_TO_LOAD in its comments")

    assert kernel_files(["leap.tls", "both.bsp"], folder, ()) == [
        folder / "leap.tls",
        folder / "both.bsp",
    ]


def test_text_kernel_has_a_maximum_size(folder: Path) -> None:
    (folder / "large.tls").write_bytes(b" " * (MAX_TEXT_BYTES + 1))

    with pytest.raises(InputError, match=f"has more than {MAX_TEXT_BYTES} bytes"):
        kernel_files(["large.tls"], folder, ())
