"""A converter quantises forces to counts, in even steps, and saturates at its range.

An amplifier converts a pad's conductance, and so its force, to a proportional voltage (Interlink's FSR integration
guide, current-to-voltage converter): counts are linear in newtons. 12 bits are those of an MCP3208 or ADS7828; 10 N is
the upper limit in data sheets of the FSR 402 (0.1 to 10 N; newer ones: 0.2 to 20 N).
"""

from typing import Annotated

from msgspec import Meta

from ..pipeline.batch import Batch
from ..pipeline.effect import Effect, SceneSetting, Step
from ..pipeline.glove import TAXEL_ADC, TaxelConverter
from ..streams import Draw


def prepare(
    setting: SceneSetting,
    *,
    bits: Annotated[int, Meta(ge=1, le=15)] = 12,
    full_n: Annotated[float, Meta(gt=0.0, le=1000.0)] = 10.0,
) -> Step:
    """Return the step that converts every reading.

    Number of bits, and full-scale force in newtons.
    """
    converter = TaxelConverter(bits, full_n)

    def step(batch: Batch, draw: Draw) -> None:
        batch.taxels = converter.codes(batch.taxels_n)

    return step


MEMBER = Effect(
    name=TAXEL_ADC,
    summary="a converter quantises forces to counts",
    order=770,
    reads=("taxels_n",),
    writes=("taxels",),
    prepare=prepare,
)
