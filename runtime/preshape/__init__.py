"""Grasp types to preshapes of a robot hand, and when to change from one to the next."""

from .loading import SHIPPED, load_preshapes, preshape_selector
from .selector import Preshape, PreshapeError, PreshapeSelector, PreshapeTable

__all__ = [
    "SHIPPED",
    "Preshape",
    "PreshapeError",
    "PreshapeSelector",
    "PreshapeTable",
    "load_preshapes",
    "preshape_selector",
]
