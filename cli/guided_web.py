"""`thenar record --web`: the page of a trial, the drawing of a glove, and the accuracy so far."""

from collections.abc import Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from msgspec import to_builtins

from thenar.compiler.evaluation.sofar import InterimAccuracy, recording_so_far
from thenar.compiler.recordings.taxonomy import ANY, MOVEMENTS, Taxonomy
from thenar.compiler.workers import BackgroundTask
from thenar.drivers.closing import Closing
from thenar.runtime.hand import DrawnSwitch, DrawnTaxel, HandDrawing, Spot, drawn_joints
from thenar.runtime.manifest import Calibration
from thenar.runtime.published import NONE
from thenar.runtime.recording.guide import CollectionGuide, Trial
from thenar.runtime.recording.session import Session
from thenar.runtime.web.guided import GuidePage

from .web_options import say_page

# For a glove whose switch positions are unknown.
_COLUMNS, _PITCH_MM = 4, (50.0, 22.0)


def shown(taxonomy: Taxonomy, trial: Trial) -> Mapping[str, object]:
    """Return the page's view of a trial: title, detail, and the pose to draw, or None for an unknown posture."""
    if trial.grasp == NONE and NONE not in taxonomy.types:
        doing = MOVEMENTS.get(trial.object, "touch nothing")
        return {"title": f"Nothing held: {trial.object}", "detail": doing, "pose": _pose((0.0,) * 4, [(0.0,) * 4] * 4)}
    full = dict(zip(taxonomy.types, taxonomy.full_names, strict=True))[trial.grasp]
    title = trial.grasp if full == trial.grasp else f"{full} ({trial.grasp})"
    detail = "" if trial.object == ANY else f"with: {trial.object}"
    return {"title": title, "detail": detail, "pose": postures(taxonomy.name).get(trial.grasp)}


@cache
def postures(taxonomy: str) -> dict[str, list[float]]:
    """Return the pose of each type of a taxonomy that has nominal postures, in the order of POSED."""
    from thenar.simulator.planning.prehension import load_prehensions

    file = files("thenar.simulator.planning") / "data" / f"{taxonomy}.toml"
    if not file.is_file():
        return {}
    return {
        name: _pose(each.thumb, [each.index, each.middle, each.ring, each.little])
        for name, each in load_prehensions(file).items()
    }


# The joints of a pose, and the movement of each, for the posed hand of hand.js.
POSED = (
    *(("thumb", "rotation"), ("thumb", "abduction"), ("thumb", "mcp"), ("thumb", "ip")),
    *((digit, joint) for digit in ("index", "middle", "ring", "little") for joint in ("mcp", "pip", "dip")),
)


def _pose(thumb: tuple[float, ...], fingers: list[tuple[float, ...]]) -> list[float]:
    """Return the angles of POSED from those of the simulator's hand: abduction, first, second and third flexion.

    The posed hand turns its thumb about other axes, so the result is only for display.
    """
    abduction, flexion, *bends = thumb
    return [20 + 1.3 * abduction, 42 - 0.7 * flexion, *bends, *(angle for finger in fingers for angle in finger[1:])]


def drawn_pose() -> HandDrawing:
    """Return the drawing of a hand that shows poses: joints, and no switch."""
    joints = [Calibration(at, f"{digit} {moves}", "deg", 0, 0.0, 90, 90.0) for at, (digit, moves) in enumerate(POSED)]
    return HandDrawing(view="", placed=False, radius_mm=1.0, switches=(), taxels=(), joints=drawn_joints(joints))


def drawn_glove(session: Session) -> HandDrawing:
    """Return the drawing of the recorded glove: every switch as the bit that it has in a frame.

    Switches named as on thenar's own hand are drawn there, others in a grid.
    """
    from thenar.simulator.handmaps.handmap import hand_map

    names = (*session.switches, *session.taxels)
    hand = hand_map().fitted(names)
    if hand is None:
        wide, high = _PITCH_MM
        places = [(wide * (at % _COLUMNS), -high * (at // _COLUMNS)) for at in range(len(names))]
        drawn: dict[str, Any] = {"view": "", "placed": False, "radius_mm": 3.0}
    else:
        places = hand.places[hand.numbers_of(names)].round(1).tolist()
        labels = zip(hand.part_names, hand.labels.round(1).tolist(), strict=False)
        drawn = {
            "view": hand.view,
            "placed": True,
            "radius_mm": hand.radius_mm,
            "outline": _line(hand.outline),
            "strips": tuple(map(_line, hand.strips)),
            "creases": tuple(map(_line, hand.creases)),
            "labels": tuple(Spot(name, x, y) for name, (x, y) in labels),
        }
    n = len(session.switches)
    spots = list(zip(names, places, strict=True))
    return HandDrawing(
        switches=tuple(DrawnSwitch(name, x, y, bit) for bit, (name, (x, y)) in enumerate(spots[:n])),
        # One level each: hand.js draws how far a taxel is pressed, and no frame has a bit for it.
        taxels=tuple(DrawnTaxel(name, x, y, ((0, n + at),)) for at, (name, (x, y)) in enumerate(spots[n:])),
        joints=drawn_joints([_joint(at, session) for at in range(len(session.sensors))]),
        **drawn,
    )


def _line(points: Any) -> tuple[tuple[float, float], ...]:
    return tuple((x, y) for x, y in points.round(1).tolist())


def _joint(number: int, session: Session) -> Calibration:
    """Return a sensor as a joint of the drawing: in degrees if it is calibrated, else as its byte."""
    name = session.sensors[number]
    for line in () if session.calibration is None else session.calibration.sensors:
        if line.name == name:
            return Calibration(number, name, "deg", line.raw_a, line.value_a, line.raw_b, line.value_b)
    return Calibration(number, name, "raw", 1, 1.0, 255, 255.0)


@dataclass(frozen=True, slots=True)
class PageAt:
    """The address at which to serve the page of a collection."""

    address: str
    token: str | None

    def serve(self, session: Session, taxonomy: Taxonomy, recording: Path) -> "StudiedPage":
        """Serve the page and print its address. Raises SettingError or SinkError if that is impossible."""
        page = GuidePage(
            self.address,
            token=self.token,
            session=session,
            hands={"glove": drawn_glove(session), "pose": drawn_pose()},
            shown=partial(shown, taxonomy),
        )
        say_page(page.url)
        assert session.collection is not None
        return StudiedPage(page, recording, len(session.collection.tasks))


class StudiedPage(Closing):
    """The page of a collection, with the accuracy so far: computed after each round, in another process."""

    def __init__(self, page: GuidePage, recording: Path, round_trials: int) -> None:
        self._page, self._recording, self._round = page, recording, round_trials
        self._background: BackgroundTask[InterimAccuracy | None] = BackgroundTask()
        self._studied = -1

    def press(self, now_us: int, guide: CollectionGuide) -> None:
        """Pass the keys pressed on a page to the guide."""
        self._page.press(now_us, guide)

    def show(self, now_us: int, guide: CollectionGuide, devices: Any) -> None:
        """Show the guide's state, and start or finish the computation."""
        self._page.show(now_us, guide, devices)
        self._fetch()
        if self._background.busy or guide.done < 2 or guide.done == self._studied:
            return
        if self._studied < 0 or abs(guide.done - self._studied) >= self._round or guide.trial is None:
            self._studied = guide.done
            self._background.start(recording_so_far, self._recording)

    def _fetch(self) -> None:
        try:
            found = self._background.fetch()
        except BrokenExecutor as wrong:
            self._page.tell({"problem": f"the accuracy so far could not be computed: {wrong}"})
            return
        if found is not None:
            self._page.tell({"problem": "", **to_builtins(found)})

    def warn(self, warnings: Sequence[str]) -> None:
        """Show what is odd in the set that was written, instead of the accuracy so far."""
        self._page.tell({"problem": "; ".join(warnings)})

    def close(self) -> None:
        """Stop computing the accuracy, and close the page."""
        self._background.close()
        self._page.close()
