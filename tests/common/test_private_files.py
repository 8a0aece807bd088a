"""Files and folders that no other user can write to."""

import os
from pathlib import Path

import pytest

from footfall.common.private_files import NotPrivateError, make_private_folder, read_private, write_private


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "programs" / "one"
    write_private(path, b"code")
    assert read_private(path) == b"code"
    assert [each.stat().st_mode & 0o777 for each in (path, path.parent)] == [0o600, 0o700]
    return path


def test_neither_group_nor_others_may_write_to_a_file_or_its_folder(file: Path) -> None:
    for mode in (0o020, 0o002):
        file.chmod(0o600 | mode)
        with pytest.raises(NotPrivateError):
            read_private(file)
        file.chmod(0o600)
        file.parent.chmod(0o700 | mode)
        for act in (lambda: read_private(file), lambda: write_private(file, b"")):
            with pytest.raises(NotPrivateError, match=str(file.parent)):
                act()
        file.parent.chmod(0o700)


def test_links_to_own_files_and_folders_and_files_of_another_user_are_refused(
    file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    link = file.with_name("link")
    link.symlink_to(file)
    with pytest.raises(OSError):  # noqa: PT011
        read_private(link)
    (tmp_path / "link").symlink_to(file.parent)
    for act in (read_private, lambda path: write_private(path, b"")):
        with pytest.raises(NotPrivateError):
            act(tmp_path / "link" / file.name)
    assert read_private(file) == b"code"
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    with pytest.raises(NotPrivateError):
        read_private(file)


def test_a_private_folder_is_made_for_its_owner_alone(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "cache"
    make_private_folder(folder)
    assert folder.stat().st_mode & 0o777 == 0o700
    (folder / "one").touch(0o664)  # no other user has access
    (folder / "one").chmod(0o664)
    make_private_folder(folder)


@pytest.mark.parametrize("change", ["folder", "file", "owner", "link"])
def test_a_private_folder_others_may_write_to_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: str
) -> None:
    folder = tmp_path / "cache"
    folder.mkdir(mode=0o755)
    (folder / "one").touch(0o644)
    make_private_folder(folder)
    if change == "folder":
        folder.chmod(0o777)
    elif change == "file":
        (folder / "one").chmod(0o666)
    elif change == "owner":
        monkeypatch.setattr(os, "getuid", lambda: 12345)
    else:
        folder.rename(tmp_path / "elsewhere")
        folder.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(NotPrivateError):
        make_private_folder(folder)
