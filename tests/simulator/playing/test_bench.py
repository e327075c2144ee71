from pathlib import Path

import pytest

from thenar.drivers.errors import SettingError
from thenar.runtime.harness.loading import parse_harness
from thenar.runtime.sources.cyberglove import GloveDevice
from thenar.simulator.playing.bench import Bench


@pytest.mark.parametrize("sensors", [18, 22])
def test_the_glove_has_as_many_sensors_as_its_harness_says(sensors: int, tmp_path: Path) -> None:
    harness = parse_harness(f'[cyberglove]\nport = "x"\nsensors = {sensors}\n', "glove.toml")
    shown = bytes(range(1, sensors + 1))
    with Bench(harness, (), tmp_path) as bench:
        bench.show([], shown)
        assert bench.harness.cyberglove is not None
        device = GloveDevice(bench.harness.cyberglove)
        try:
            device.open()
            frame = device.read(5.0)
        finally:
            device.close()
        assert frame is not None
        assert frame.sensors == shown
        with pytest.raises(SettingError, match=f"{sensors} sensors need as many bytes"):
            bench.show([], bytes(range(1, sensors)))
