"""The log of edits of a project: a page relabels trials, leaves them out, and takes this back.

Each is appended, also an undo, which edits the trials back; the recordings stay as they are.
"""

import os
from collections.abc import Container, Sequence
from datetime import UTC, datetime
from pathlib import Path
from threading import Lock

import msgspec

from thenar.compiler.recordings.edits import Edit, TrialId, named, read_edits
from thenar.compiler.text import counted
from thenar.drivers.errors import SettingError
from thenar.runtime.files import sync_folder

EDITS_NAME = "edits.jsonl"
# Pages edit, and so does a collection, on another thread.
_WRITING = Lock()


def load_edits(path: Path) -> tuple[list[Edit], str]:
    """Return the edits of `read_edits`; none if there is no file."""
    return read_edits(path) if path.exists() else ([], "")


def change(path: Path, trials: Sequence[TrialId], new: str) -> None:
    """Make trials this type in one action; an empty type leaves them out.

    Raises SettingError if all trials are so already, RecordingError for a damaged log, and OSError.
    """
    with _WRITING:
        edits = load_edits(path)[0]
        now = {edit.of: edit.new for edit in edits}
        changed = [trial for trial in dict.fromkeys(trials) if now.get(trial, trial[3]) != new]
        if not changed:
            raise SettingError("these trials are left out already" if not new else f"these trials are {new} already")
        _append(path, edits, [(trial, now.get(trial, trial[3]), new) for trial in changed])


def undo(path: Path) -> None:
    """Take back the last action that was not taken back yet.

    Raises SettingError if there is none, RecordingError for a damaged log, and OSError.
    """
    with _WRITING:
        edits = load_edits(path)[0]
        last = last_action(edits)
        if not last:
            raise SettingError("there is nothing to undo")
        _append(path, edits, [(edit.of, edit.new, edit.old) for edit in last], last[0].action)


def restore(path: Path, name: str, kept: Container[int]) -> None:
    """Take back what became of the trials of the set `name` with other numbers than `kept`.

    Their actions cannot be undone any more. Raises RecordingError for a damaged log, and OSError.
    """
    with _WRITING:
        edits = load_edits(path)[0]
        latest = {edit.of: edit for edit in edits if edit.set == name and edit.trial not in kept}
        for last in (edit for edit in latest.values() if edit.new != edit.grasp):
            now, undone = last.new, {edit.undo for edit in edits}
            for edit in edits:
                if edit.of == last.of and not edit.undo and edit.action not in undone:
                    _append(path, load_edits(path)[0], [(edit.of, now, edit.grasp)], edit.action)
                    now = edit.grasp


def last_action(edits: Sequence[Edit]) -> list[Edit]:
    """Return the edits of the last action that was not taken back yet."""
    undone = {edit.undo for edit in edits}
    left = [edit for edit in edits if not edit.undo and edit.action not in undone]
    return [edit for edit in left if edit.action == left[-1].action]


def edits_shown(path: Path) -> dict[str, object]:
    """Return for pages the last action that can be taken back, in words, and what became of trials.

    Raises RecordingError for a damaged log, and OSError.
    """
    edits = load_edits(path)[0]
    last, latest = last_action(edits), {edit.of: edit for edit in edits}
    what = counted(len(last), "trial") if len(last) > 1 else named(last[0].of) if last else ""
    done = f"{what} {f'made {last[0].new}' if last[0].new else 'left out'}" if last else ""
    made = [(edit.new, edit.set, edit.trial) for edit in latest.values() if edit.new != edit.grasp]
    return {"words": done, "made": made}


def _append(path: Path, edits: Sequence[Edit], changes: Sequence[tuple[TrialId, str, str]], undo: int = 0) -> None:
    """Append an action: for each trial the type before and after. It is on the disk before this returns."""
    action = 1 + max((edit.action for edit in edits), default=0)
    time = datetime.now(UTC).isoformat(timespec="seconds")
    made = [Edit(time, action, *trial, old, new, undo) for trial, old, new in changes]
    text = b"".join(msgspec.json.encode(edit) + b"\n" for edit in made)
    with path.open("a+b") as file:
        file.seek(0)
        good = b"".join(file.read().splitlines(keepends=True)[: len(edits)])
        # What a killed writer left of a line goes.
        file.truncate(len(good))
        file.write((b"\n" if good and not good.endswith(b"\n") else b"") + text)
        file.flush()
        os.fsync(file.fileno())
    sync_folder(path.parent)
