"""Every test is run: pytest leaves out folders of some names without a word."""

import fnmatch
from pathlib import Path

import pytest

TESTS = Path(__file__).parent


def test_no_folder_of_tests_is_passed_by(pytestconfig: pytest.Config) -> None:
    folders = {path.parent.relative_to(TESTS) for path in TESTS.rglob("test_*.py")}
    passed_by = pytestconfig.getini("norecursedirs")
    assert len(folders) > 20
    assert not [
        folder for folder in folders for part in folder.parts for name in passed_by if fnmatch.fnmatch(part, name)
    ]


def test_the_files_that_are_put_first_are_there(pytestconfig: pytest.Config) -> None:
    root = next(plugin for plugin in pytestconfig.pluginmanager.get_plugins() if hasattr(plugin, "LONGEST"))
    assert not [name for name in root.LONGEST if not (TESTS / name).is_file()]
