"""Recordings that are wrong inside and sound outside, through everything that reads recordings: rows, a sentence, or
an error of ours, and nothing else.
"""

import resource
from pathlib import Path
from random import Random

import pytest
from material import loaded_build
from mutating_mcap import Record, joined, mcap_file, records_of
from of_recordings import FORMATS, STEPS, recognised

from thenar.drivers.errors import SettingError, ThenarError
from thenar.runtime.live.replay import replayed
from thenar.simulator.playing.performance import of_recording


@pytest.mark.parametrize(
    "seeds",
    [pytest.param(range(400), id="a few"), pytest.param(range(400, 3_400), marks=pytest.mark.slow, id="3,000")],
)
def test_no_mutant_raises_anything_but_our_errors(tmp_path: Path, seeds: range) -> None:
    path, wholes = tmp_path / "mutant.mcap", FORMATS[0].seeds()
    made = dict.fromkeys(STEPS, 0)
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for seed in seeds:
        path.write_bytes(mcap_file(wholes[seed % len(wholes)], Random(seed)))
        for step in STEPS:
            try:
                step(path)
                made[step] += 1
            except (ThenarError, OSError) as reason:
                said = str(reason)
                assert 0 < len(said) < 2000, said
                assert said.isprintable(), said
    # A step reads one of the two healthy recordings, and many mutants of it: the fuzz goes deep.
    assert all(many > len(seeds) / 10 for many in made.values()), made
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 200_000


def test_a_replay_and_an_emulation_tell_of_damage(tmp_path: Path) -> None:
    path, said = tmp_path / "damaged.mcap", list[str]()
    path.write_bytes(recognised())
    list(replayed(loaded_build(), path, warn=said.append))
    assert said == []
    data = bytearray(path.read_bytes())
    place = data.rindex(b'{"time_us"')
    data[place + len('{"time_us":')] ^= 1
    path.write_bytes(data)
    list(replayed(loaded_build(), path, warn=said.append))
    of_recording(path, 10_000, warn=said.append)
    assert said == ["damaged.mcap is altered: the checksum of its data does not match"] * 2


def test_a_replay_of_other_switches_than_the_builds_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "others.mcap"
    kept = ",".join(f'"{switch.name}"' for switch in loaded_build().manifest.switches).encode()
    others = kept.replace(b"finger", b"thumbs")
    records = [
        Record(op, data.replace(b"[" + kept + b"]", b"[" + others + b"]")) for op, data in records_of(recognised())
    ]
    path.write_bytes(joined(records))
    with pytest.raises(SettingError, match="names other switches than its build"):
        list(replayed(loaded_build(), path))
