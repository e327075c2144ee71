"""Grasp types to preshapes of a robot hand, and when to change from one to the next."""

from .loading import SHIPPED, load_preshapes
from .preshape import Preshape, PreshapeError
from .selector import PreshapeSelector
from .table import PreshapeTable

__all__ = ["SHIPPED", "Preshape", "PreshapeError", "PreshapeSelector", "PreshapeTable", "load_preshapes"]
