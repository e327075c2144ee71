"""`thenar record --web`: the page of a collection, and the accuracy so far."""

from collections.abc import Mapping, Sequence
from concurrent.futures import BrokenExecutor
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from msgspec import to_builtins

from thenar.compiler.evaluation.interim import InterimAccuracy, interim_accuracy_of
from thenar.compiler.hand import drawn_glove
from thenar.compiler.recordings.taxonomy import ANY, MOVEMENTS, Taxonomy
from thenar.compiler.workers import BackgroundTask
from thenar.drivers.closing import Closing
from thenar.runtime.published import NONE
from thenar.runtime.recording.guide import CollectionGuide, Trial
from thenar.runtime.recording.session import Session
from thenar.runtime.web.guided import collection_page, posed, posed_hand
from thenar.simulator.handmaps.handmap import hand_map
from thenar.simulator.planning.prehension import Prehension, load_prehensions

from .printing import say_page

_OPEN = {"thumb_abduction": 42.0}


def shown(taxonomy: Taxonomy, trial: Trial) -> Mapping[str, object]:
    """Return the page's view of a trial: title, detail, and the pose to draw, or None for an unknown posture."""
    if trial.grasp == NONE and NONE not in taxonomy.types:
        doing = MOVEMENTS.get(trial.object, "touch nothing")
        return {"title": f"Nothing held: {trial.object}", "detail": doing, "pose": posed(_OPEN)}
    full = dict(zip(taxonomy.types, taxonomy.full_names, strict=True))[trial.grasp]
    title = trial.grasp if full == trial.grasp else f"{full} ({trial.grasp})"
    detail = "" if trial.object == ANY else f"with: {trial.object}"
    return {"title": title, "detail": detail, "pose": postures(taxonomy.name).get(trial.grasp)}


@cache
def postures(taxonomy: str) -> dict[str, list[float]]:
    """Return the pose of each type of a taxonomy that has nominal postures, for the drawn hand."""
    file = files("thenar.simulator.planning") / "data" / f"{taxonomy}.toml"
    return {name: _pose(grasp) for name, grasp in load_prehensions(file).items()} if file.is_file() else {}


def _pose(grasp: Prehension) -> list[float]:
    """Return the angles of a drawn hand from those of the simulator's: abduction, first, second and third flexion.

    The drawn hand turns its thumb about other axes, so the result is only for display.
    """
    abduction, flexion, first, second = grasp.thumb
    thumb = {"rotation": 20 + 1.3 * abduction, "abduction": 42 - 0.7 * flexion, "mpj": first, "ij": second}
    degrees = {f"thumb_{joint}": angle for joint, angle in thumb.items()}
    for finger in ("index", "middle", "ring", "little"):
        bends = zip(("mpj", "pij", "dij"), getattr(grasp, finger)[1:], strict=True)
        degrees |= {f"{finger}_{joint}": angle for joint, angle in bends}
    return posed(degrees)


class StudiedPage(Closing):
    """The page of a collection, with the accuracy so far: computed after each round, in another process."""

    def __init__(self, address: str, token: str | None, session: Session, taxonomy: Taxonomy, recording: Path) -> None:
        """Serve the page and print its address. Raises SettingError or SinkError if that is impossible."""
        assert session.collection is not None
        self._recording, self._round = recording, len(session.collection.tasks)
        hands = {"glove": drawn_glove(session, hand_map()), "pose": posed_hand()}
        self._page = collection_page(address, token=token, session=session, hands=hands, shown=partial(shown, taxonomy))
        say_page(self._page.url)
        self._background: BackgroundTask[InterimAccuracy | None] = BackgroundTask()
        self._studied = -1

    def press(self, now_us: int, guide: CollectionGuide) -> None:
        """Pass the keys pressed on a page to the guide."""
        self._page.press(now_us, guide)

    def show(self, now_us: int, guide: CollectionGuide, devices: Any) -> None:
        """Show the guide's state, and start or finish the computation."""
        self._page.show(now_us, guide, devices)
        try:
            if (found := self._background.fetch()) is not None:
                self._page.study({"problem": "", **to_builtins(found)})
        except BrokenExecutor as wrong:
            self._page.study({"problem": f"the accuracy so far could not be computed: {wrong}"})
        if self._background.busy or guide.done < 2 or guide.done == self._studied:
            return
        if self._studied < 0 or abs(guide.done - self._studied) >= self._round or guide.trial is None:
            self._studied = guide.done
            self._background.start(interim_accuracy_of, self._recording)

    def warn(self, warnings: Sequence[str]) -> None:
        """Show what is odd in the set that was written, instead of the accuracy so far."""
        self._page.study({"problem": "; ".join(warnings)})

    def close(self) -> None:
        """Stop computing the accuracy, and close the page."""
        self._background.close()
        self._page.close()
