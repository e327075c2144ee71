"""A project: the recordings, builds and settings that lie in one folder, and what the studio remembers of them."""

import os
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from shlex import join

import msgspec

from thenar.compiler.glove.prices import Part, load_prices
from thenar.compiler.hand import HandShape, load_layout
from thenar.compiler.recordings import RecordingError
from thenar.compiler.recordings.edits import TrialId, apply_edits, trials_of
from thenar.compiler.recordings.graspset import GraspSet
from thenar.compiler.recordings.merging import merge
from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.build import Build, load_manifest
from thenar.runtime.files import write_atomically
from thenar.runtime.harness.loading import load_harness
from thenar.runtime.harness.wiring import Harness
from thenar.runtime.names import fault, shortened

from .edits import EDITS_NAME, load_edits

_STATE = "studio.json"
# Bytes of a name, to which numbers and endings are added: file systems take 255.
_LONGEST = 200
# What each kind of member is called, in a folder.
_KINDS = {"set": "*.grasps", "recording": "*.mcap", "build": "*/build.json"}


class State(msgspec.Struct, forbid_unknown_fields=True):
    """What is remembered in studio.json.

    build   the name of the build in use
    wearer  the name of the person
    aside   the names of the sets that are left aside
    took    the seconds that each kind of work last took
    """

    build: str = ""
    wearer: str = "me"
    aside: tuple[str, ...] = ()
    took: dict[str, float] = {}


class Project:
    """The folder of a project.

    Parameters
    ----------
    folder : Path
        Its folder. Sets and recordings lie in it, a build is a folder in it, the settings are glove.toml, layout.toml
        and prices.toml.
    hand : HandShape
        The glove laid flat that is drawn without a layout.toml.

    Raises
    ------
    SettingError
        If studio.json is damaged.
    """

    def __init__(self, folder: Path, hand: HandShape) -> None:
        self.folder, self._usual = folder, hand
        self._state = folder / _STATE
        self.state = State()
        if self._state.exists():
            try:
                self.state = msgspec.json.decode(self._state.read_bytes(), type=State)
            except msgspec.DecodeError as wrong:
                raise SettingError(f"{self._state}: {wrong}: correct it, or delete it to begin anew") from None

    @property
    def name(self) -> str:
        """The name of the folder."""
        return self.folder.resolve().name

    def remember(self, **changes: object) -> None:
        """Change the state, and write it."""
        for name, value in changes.items():
            setattr(self.state, name, value)
        write_atomically(self._state, msgspec.json.format(msgspec.json.encode(self.state)))

    def members(self, kind: str) -> dict[str, Path]:
        """Return the members of a kind, "set", "recording" or "build", in the order of their names, by their ids.

        Pages name a member by its id. Links are followed, also out of the folder: its owner made them, and no page can
        make one.
        """
        found = sorted(path for path in self.folder.glob(_KINDS[kind]) if path.exists())
        paths = [path.parent if kind == "build" else path for path in found]
        # A name that is no text cannot be sent to a page.
        return {
            sha256(path.name.encode()).hexdigest()[:12]: path
            for path in paths
            if path.name == path.name.encode(errors="ignore").decode()
        }

    def path(self, kind: str, member: str) -> Path:
        """Return the path of a member. Raises SettingError if there is none of this id."""
        found = self.members(kind).get(member)
        if found is None:
            raise SettingError(f"the project has no {kind} {shortened(repr(member))}: load the page again")
        return found

    def sets(self) -> list[Path]:
        """Return the sets in use."""
        return [path for path in self.members("set").values() if path.name not in self.state.aside]

    def recordings(self, paths: Sequence[Path] = ()) -> tuple[GraspSet, list[TrialId], list[str]]:
        """Return these sets, or all in use, as one; and for each of its rows the trial as it was recorded.

        The third value has a sentence on each set that does not fit, and on each edit that is not used.

        Raises ThenarError if there is no set, or the log of edits is damaged before its last line.
        """
        loaded, unused = dict[str, GraspSet](), list[str]()
        for path in paths or self.sets():
            try:
                loaded[path.name] = GraspSet.load(path)
            except ThenarError as reason:
                unused.append(f"{path.name} is left aside: {reason}")
        sets, misfits = _fitting(loaded)
        unused += misfits
        if not sets:
            none = "the project has no recordings yet: record some, or import a table with thenar import"
            raise SettingError("; ".join(unused) or none)
        edits, damaged = load_edits(self.edits)
        # Those of sets that were left aside wait, and so do those of recordings for trials that get into a set later.
        there = {trial for name, one in sets.items() for trial in trials_of(name, one)}
        waiting = {path.name for path in self.members("set").values()} - sets.keys()
        waiting |= {f"{path.stem}.grasps" for path in self.members("recording").values()}
        used = [edit for edit in edits if edit.set not in waiting or edit.of in there]
        grasp_set, trials, missing = apply_edits(sets, used)
        return grasp_set, trials, [*unused, *missing, *filter(None, [damaged])]

    @property
    def edits(self) -> Path:
        """The path of the log of edits, which may not be there."""
        return self.folder / EDITS_NAME

    def command(self, words: Sequence[object], sets: Sequence[Path] = (), more: Sequence[object] = ()) -> str:
        """Return a command of thenar: its first `words`, the sets, and `more`.

        Several sets, and edits of one, are merged by a command before it.
        """
        first, given = "", [*sets]
        if sets and (len(sets) > 1 or self.edits.exists()):
            # Next to the project: in it, it would be one more set. Commands that are run one after the other write it.
            given = [self.folder.resolve().parent / f"{self.name}-merged.grasps"]
            edits = ["--edits", self.edits] if self.edits.exists() else []
            first = f"{self.command(['merge', *sets, *edits, '--overwrite', '-o', *given])} && "
        return first + join(map(str, ["thenar", *words, *given, *more]))

    @property
    def harness(self) -> Path:
        """The path of glove.toml, which may not be there."""
        return self.folder / "glove.toml"

    def wiring(self) -> Harness:
        """Return the harness. Raises SettingError if there is none, HarnessError or OSError."""
        if not self.harness.exists():
            raise SettingError("the project has no glove.toml: connect a glove on the page Glove first")
        return load_harness(self.harness)

    def hand(self) -> HandShape:
        """Return the glove laid flat. Raises MapError."""
        layout = self.folder / "layout.toml"
        return load_layout(layout) if layout.exists() else self._usual

    def parts(self, names: Sequence[str]) -> dict[str, Part]:
        """Return the part for each sensor, if there is a prices.toml. Raises ThenarError."""
        prices = self.folder / "prices.toml"
        return dict(load_prices(prices, names)) if prices.exists() else {}

    def options(self) -> list[str]:
        """Return the options of `thenar compile` that name the files of layout and prices."""
        files = {"--layout": self.folder / "layout.toml", "--prices": self.folder / "prices.toml"}
        return [word for option, path in files.items() if path.exists() for word in (option, str(path))]

    def build(self) -> tuple[Path, Build]:
        """Return the folder of the build in use, and the build. Raises SettingError without one, BuildError."""
        path = self.folder / self.state.build
        if not (self.state.build and (path / "build.json").exists()):
            raise SettingError("the project has no build in use: train one on the page Choose, or choose one")
        return path, Build.load(path)

    def build_of(self, checksum: str) -> tuple[Path, Build] | None:
        """Return the folder of the build with a checksum, and the build; None without one. Raises BuildError."""
        for path in self.members("build").values():
            # One that is damaged, or half written by another process, is not the one.
            with suppress(ThenarError, OSError):
                if load_manifest(path).checksum == checksum:
                    return path, Build.load(path)
        return None

    def new_path(self, name: str, ending: str = "", *others: str) -> Path:
        """Return the path of a new member: its name, with a number if a file with one of the endings has it already.

        Raises SettingError for a name that a file cannot have.
        """
        if reason := fault(name):
            raise SettingError(f"the name {shortened(repr(name))} {reason}")
        # A name that begins with - would be an option of the commands that pages show.
        if "/" in name or name.startswith((".", "-")) or len(os.fsencode(name)) > _LONGEST:
            raise SettingError(f"the name {shortened(repr(name))} is not possible: use some letters, digits and spaces")
        for number in range(1, 10_000):
            stem = name if number == 1 else f"{name}-{number}"
            if not any((self.folder / f"{stem}{end}").exists() for end in (ending, *others)):
                return self.folder / f"{stem}{ending}"
        raise ThenarError(f"{self.folder} has too many files called {name}")


def _fitting(sets: dict[str, GraspSet]) -> tuple[dict[str, GraspSet], list[str]]:
    """Return the sets that fit those with the most frequent columns, and a sentence on each other."""
    try:
        merge(sets)
        return sets, []
    except RecordingError:
        fitting, misfits = dict[str, GraspSet](), list[str]()
    columns = {name: frozenset((*one.element_names, *one.joint_names)) for name, one in sets.items()}
    counts = Counter(columns.values())
    for name in sorted(sets, key=lambda name: -counts[columns[name]]):
        try:
            merge({**fitting, name: sets[name]})
            fitting[name] = sets[name]
        except RecordingError as reason:
            misfits.append(f"{name} is left aside: {reason}")
    return {name: one for name, one in sets.items() if name in fitting}, misfits
