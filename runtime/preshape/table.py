"""Which grasp type takes which preshape."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..names import list_names
from .preshape import Preshape, PreshapeError


@dataclass(frozen=True, slots=True)
class PreshapeTable:
    """The preshapes of one robot hand: `chosen` holds one for every grasp type that the table names."""

    name: str
    chosen: Mapping[str, Preshape]

    def find(self, grasp: str) -> Preshape | None:
        """Return the preshape for a grasp type, or None where the table does not name it."""
        return self.chosen.get(grasp)

    def check(self, grasps: Iterable[str]) -> str:
        """Return what is missing for a build that recognises `grasps`, as a sentence for the user, or nothing.

        Raises PreshapeError if the table names none of them: it is for another taxonomy.
        """
        wanted = tuple(grasps)
        missing = tuple(grasp for grasp in wanted if grasp not in self.chosen)
        if not missing:
            return ""
        if len(missing) == len(wanted):
            raise PreshapeError(
                f"preshapes {self.name}: none of the build's grasp types ({list_names(wanted)}) is among the table's "
                f"({list_names(tuple(self.chosen))}): take a table for the taxonomy of the build"
            )
        return f"preshapes {self.name}: none for {', '.join(missing)}: nothing is sent to the hand on those"
