"""What a frontier promises of the points that it picks, against their rates on fresh grasps; small cases of
`benchmarks/luck.py`.
"""

from pathlib import Path

import pytest

from ...conftest import module_at


@pytest.mark.slow
def test_promised_intervals_cover_the_rates_of_hands_that_nobody_recorded() -> None:
    luck = module_at(Path(__file__).parents[3] / "benchmarks" / "luck.py")
    cases = luck.cases(range(1, 7), "new subject", 1)
    assert len(cases) == 6
    assert sum(case.covered for case in cases) >= 0.9 * len(cases)
    assert all(0.0 <= case.luck < 0.1 for case in cases)
    assert any(case.luck > 0.001 for case in cases)
