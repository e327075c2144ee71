"""What is written into the page, without a browser."""

import base64
import hashlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from thenar.compiler import adapt, compile_build
from thenar.compiler.artifact.documents import Documents, report_of_build
from thenar.compiler.pictures import PALETTE
from thenar.compiler.report import tryout
from thenar.compiler.report.page import embedded
from thenar.compiler.report.tryout import MOST_BYTES, sample, scoped

from ..conftest import make_set, with_none


@pytest.fixture(scope="module")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tried") / "build"
    compile_build(make_set(), folder, documents=Documents(), rounds=3, folds=0)
    return folder


def test_the_pages_policy_allows_only_its_script_and_style(build: Path) -> None:
    page = (build / "report.html").read_text()
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', page)
    (script,) = re.findall(r'<script type="module">(.*?)</script>', page, re.DOTALL)
    (style,) = re.findall(r"<style>(.*?)</style>", page, re.DOTALL)
    for kind, text in (("script", script), ("style", style)):
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{kind}-src 'sha256-{digest}'" in policy
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy
    assert not re.search(r"\son\w+=|https?://(?!www\.w3\.org/2000/svg)", page)
    assert len(re.findall("<script", page)) == 2


def test_the_page_holds_the_very_tables_and_rows_of_every_type(build: Path) -> None:
    page = (build / "report.html").read_text()
    data = _data(build)
    assert base64.b64decode(data["tables"]) == (build / "tables.bin").read_bytes()
    assert data["hand"] == json.loads((build / "hand.json").read_bytes())
    manifest = json.loads((build / "build.json").read_bytes())
    assert {row[0] for row in data["rows"]} == set(range(len(manifest["grasps"])))
    assert len(page.encode()) <= MOST_BYTES


def test_the_page_states_its_first_frame_and_empty_hand_knowledge(build: Path, tmp_path: Path) -> None:
    page, warning = (build / "report.html").read_text(), "This build was trained without an empty hand"
    assert ">All switches open, joints in the middle</button>" in page
    assert warning in page
    compile_build(with_none(make_set()), tmp_path / "none", rounds=3, folds=0, documents=Documents())
    assert warning not in (tmp_path / "none" / "report.html").read_text()


def test_large_pages_hold_fewer_rows_or_are_omitted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    size = len(json.dumps(_data(_compiled(tmp_path / "whole")), separators=(",", ":")))
    monkeypatch.setattr(tryout, "MOST_BYTES", size - 500)
    assert size - 700 < len(json.dumps(_data(_compiled(tmp_path / "less")), separators=(",", ":"))) <= size - 500
    monkeypatch.setattr(tryout, "MOST_BYTES", 2_000)
    bare = _compiled(tmp_path / "none")
    assert list(_data(bare)) == ["hand"]
    assert "too large for a page" in (bare / "report.html").read_text()


def test_a_build_without_a_report_gets_one_made_of_its_folder(build: Path, tmp_path: Path) -> None:
    assert report_of_build(build) == (build / "report.html").read_bytes()
    compile_build(make_set(), tmp_path / "bare", rounds=3, folds=0)
    page = _data(report_of_build(tmp_path / "bare"))
    assert page == {**_data(build), "rows": [], "joints": page["joints"]}
    mine = adapt(tmp_path / "bare", make_set().rows(np.arange(12)), output=tmp_path / "mine").folder
    assert "within subject" in report_of_build(mine).decode()


def _data(page: Path | bytes) -> dict[str, Any]:
    text = page.decode() if isinstance(page, bytes) else (page / "report.html").read_text()
    found = re.findall(r'id="page-data">(.*?)</script>', text, re.DOTALL)[0]
    data: dict[str, Any] = json.loads(found)
    return data


def _compiled(folder: Path) -> Path:
    return compile_build(make_set(), folder, documents=Documents(), rounds=3, folds=0).folder


def test_a_sample_takes_turns_among_the_types() -> None:
    labels = np.array([2, 0, 0, 2, 0, 2, 2])
    assert sample(labels, 3) == [1, 0, 2, 3, 4, 5, 6]
    many = sample(np.arange(10_000) % 4, 4)
    assert (len(many), len(set(many))) == (400, 400)
    assert len(sample(np.arange(1000), 1000)) == 1000


def test_data_end_no_tag() -> None:
    text = embedded({"a": "</script><!-- & \u2028"})
    assert not set("<>&") & set(text)
    assert json.loads(text) == {"a": "</script><!-- & \u2028"}


def test_a_module_becomes_a_scope_that_gives_its_exports() -> None:
    module = "const own = 1;\nexport function a() {}\nexport class B {}\n"
    text = scoped(module)
    assert text.startswith("const { a, B } = (() => {\n")
    assert text.endswith("return { a, B };\n})();\n")
    assert "export" not in text
    assert scoped("go();\n") == "(() => {\ngo();\n})();\n"


def test_the_hand_has_the_colours_of_the_report() -> None:
    pages = Path(tryout.__file__).parents[1].parent / "runtime" / "web" / "pages"
    used = set(re.findall(r"var\(--([\w-]+)", (pages / "hand.css").read_text())) - {"letter"}
    assert len(used) > 8
    assert used <= set(PALETTE)
    # Pages have all of them as well, and the skin has the same colours there.
    given = dict(re.findall(r"--([\w-]+): (.*);", (pages / "base.css").read_text()))
    assert used <= set(given)
    for name in ("skin", "side", "outline", "crease"):
        assert given[name] == f"light-dark({', '.join(PALETTE[name])})"
