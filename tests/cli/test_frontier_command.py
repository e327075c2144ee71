"""`thenar frontier` as a user calls it, and `compile --from` after it."""

import csv
import json
import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from thenar.compiler import GraspSet
from thenar.compiler.frontier import price
from thenar.compiler.frontier.cache import stored
from thenar.compiler.frontier.points import Frontier, frontier_from_bytes
from thenar.compiler.frontier.price import machine_name
from thenar.runtime import Build

from .conftest import refusal, thenar, works

# A trainer of which nothing is left to choose.
SETTLED = ("--trainer", "logitboost", "--shrinkage", 1, "--max-bins", 65536)
QUICK = (
    *("--target", "host", "--methods", "elimination,id3"),
    *("--rounds", 6, "--finalists", 2, "--repeats", 1, "--jobs", 1, *SETTLED),
)
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", autouse=True)
def _timed_once() -> Iterator[None]:
    """Let this machine be timed once: how fast it is is no matter here."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(price, "fit_here", stored(1, here=True)(cache(price.fit_here)))
        yield


@pytest.fixture(scope="module")
def found_folder(set_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("found") / "frontier"
    works("frontier", set_file, "-o", folder, *QUICK, "--rate", 0.5)
    return folder


@pytest.fixture(scope="module")
def found(found_folder: Path) -> Frontier:
    return frontier_from_bytes((found_folder / "frontier.json").read_bytes())


def test_the_folder_holds_tables_the_picture_and_the_store(found_folder: Path) -> None:
    names = {path.name for path in found_folder.iterdir()}
    assert names == {"frontier.json", "frontier.csv", "frontier.svg", "store.sqlite"}


def test_every_point_stands_in_the_csv(found_folder: Path, found: Frontier) -> None:
    with (found_folder / "frontier.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(found.points) > 0


def test_the_picked_point_is_the_fastest_that_recognises_enough(found: Frontier) -> None:
    assert found.picked is not None
    picked = found.point(found.picked)
    good = [each for each in found.points if each.rate.mean >= 0.5]
    assert picked.frame.us == min(each.frame.us for each in good)
    assert (found.by, picked.rate.what) == ("pooled", "pooled, trials")


def test_running_again_asks_nothing_twice_and_json_is_the_frontier(
    set_file: Path, found_folder: Path, found: Frontier, tmp_path: Path
) -> None:
    again = tmp_path / "again"
    shutil.copytree(found_folder, again)
    done = works("frontier", set_file, "-o", again, *QUICK, "--rate", 0.5, "--json")
    assert json.loads(done.stdout) == json.loads((again / "frontier.json").read_bytes())
    assert (again / "store.sqlite").read_bytes() == (found_folder / "store.sqlite").read_bytes()
    second = frontier_from_bytes((again / "frontier.json").read_bytes())
    assert second.points == found.points


def test_every_time_names_its_machine_and_a_guess_says_so(
    set_file: Path, found_folder: Path, found: Frontier, tmp_path: Path
) -> None:
    assert found.machine == machine_name()
    again = tmp_path / "again"
    shutil.copytree(found_folder, again)
    done = works("frontier", set_file, "-o", again, *QUICK, "--target", "pi")
    printed = " ".join(done.stdout.split())
    guess = f"on Raspberry Pi, a guess: 4 times {machine_name()}"
    assert printed.count(guess) == 2  # above the table, and in the sentence below it
    there = frontier_from_bytes((again / "frontier.json").read_bytes())
    assert f"on {there.machine}" == guess
    assert {each.how for point in there.points for each in (point.classify, point.frame)} == {"guess"}
    assert {point.scan.how for point in there.points if point.setting.wiring == "mcp23017"} <= {"guess"}
    assert {row["frame_how"] for row in csv.DictReader((again / "frontier.csv").read_text().splitlines())} == {"guess"}


@pytest.mark.parametrize("worth", ["best", "joints"])
def test_a_point_becomes_a_build(
    set_file: Path, found_folder: Path, found: Frontier, tmp_path: Path, worth: str
) -> None:
    point = max(found.points, key=lambda each: (worth == "joints" and not each.switches, each.rate.mean))
    build = tmp_path / "build"
    works(
        *("compile", set_file, "-o", build, "--folds", 0),
        *("--from", found_folder / "frontier.json", "--point", point.number),
    )
    made = Build.load(build).manifest
    assert tuple(switch.name for switch in made.switches) == point.switches
    assert (made.options.rounds, made.options.width, made.options.table_bits) == (
        point.setting.rounds,
        point.setting.width,
        point.setting.table_bits,
    )
    assert (made.scan_sha256 is not None) == bool(point.switches)


def test_options_that_the_point_settles_cannot_be_given_as_well(
    set_file: Path, found_folder: Path, tmp_path: Path
) -> None:
    assert "--rounds is set by the point" in refusal(
        "compile", set_file, "-o", tmp_path / "b", "--from", found_folder / "frontier.json", "--point", 1, "--rounds", 5
    )


def test_a_frontier_of_other_recordings_is_refused(small_set: GraspSet, found_folder: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.grasps"
    small_set.rows(list(range(50))).save(other)
    assert "found for other recordings" in refusal(
        "compile", other, "-o", tmp_path / "b", "--from", found_folder / "frontier.json", "--point", 1
    )


def test_a_point_that_does_not_exist_is_told(set_file: Path, found_folder: Path, tmp_path: Path) -> None:
    assert "there is no point 999" in refusal(
        "compile", set_file, "-o", tmp_path / "b", "--from", found_folder / "frontier.json", "--point", 999
    )


def test_a_budget_that_nothing_meets_ends_with_a_code(set_file: Path, found_folder: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    shutil.copytree(found_folder, again)
    done = thenar("frontier", set_file, "-o", again, *QUICK, "--budget-us", 0.001)
    assert done.returncode == 1
    assert "no point qualifies" in done.stderr
    assert (again / "frontier.json").exists()


def test_points_of_the_best_sensors_stay_within_number_price_and_limits(set_file: Path, tmp_path: Path) -> None:
    """The best point becomes a build of the same sensors, for which the price list need not be given again."""
    prices, frontier = tmp_path / "prices.toml", tmp_path / "frontier"
    prices.write_text(
        '[[part]]\nname = "dear"\nprice = 9\nsensors = ["s0"]\n[[part]]\nname = "plain"\nprice = 2\nsensors = ["*"]'
    )
    limits = ("--sensors", 5, "--price", 8, "--prices", prices, "--have", "s2", "--never", "s1")
    quick = ("--rounds", 6, "--finalists", 3, "--repeats", 1, "--jobs", 1, *SETTLED)
    done = works("frontier", set_file, "-o", frontier, *quick, *limits)
    assert "sensors" in done.stdout
    assert "rough, from screening: " in done.stderr
    found = frontier_from_bytes((frontier / "frontier.json").read_bytes())
    for point in found.points:
        kept = {*point.switches, *point.joints}
        # One that is there already is not bought.
        assert len(kept) == point.size <= 5
        assert "s2" in kept
        assert not kept & {"s0", "s1"}
    best = max(found.points, key=lambda each: each.size)
    build = tmp_path / "build"
    works(
        *("compile", set_file, "-o", build, "--folds", 0, "--from", frontier / "frontier.json", "--point", best.number)
    )
    manifest = Build.load(build).manifest
    assert {*(switch.name for switch in manifest.switches), *(joint.name for joint in manifest.joints)} == {
        *best.switches,
        *best.joints,
    }


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (("--sensors", 2, "--methods", "cmim"), "--sensors and --price all kinds: give one of them"),
        (("--have", "s2"), "--have, --never and --prices are for --sensors or --price: add one of these"),
        (("--price", 3), "the price of s0"),
    ],
)
def test_a_mistake_with_sensors_is_one_sentence(
    set_file: Path, tmp_path: Path, asked: tuple[object, ...], said: str
) -> None:
    assert said in " ".join(refusal("frontier", set_file, "-o", tmp_path / "frontier", *asked).split())
    assert not (tmp_path / "frontier").exists()
