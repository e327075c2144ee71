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
