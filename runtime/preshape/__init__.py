"""From grasp types to preshapes of a robot hand, and when to change them."""

from .loading import SHIPPED, load_preshapes, preshape_selector
from .selector import Preshape, PreshapeSelector, PreshapeTable

__all__ = [
    "SHIPPED",
    "Preshape",
    "PreshapeSelector",
    "PreshapeTable",
    "load_preshapes",
    "preshape_selector",
]
