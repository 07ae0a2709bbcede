"""A rig's numbers, as `magsteer hal describe FILE` prints them."""

import json
from dataclasses import dataclass


@dataclass(frozen=True)
class Rig:
    """What a driver must know of its rig; lists are in command order."""

    name: str
    fingerprint: int
    coils: list
    frames: list
    magnets: list

    @staticmethod
    def load(path) -> "Rig":
        """Reads the JSON object from a file."""
        with open(path, encoding="utf-8") as file:
            sheet = json.load(file)
        return Rig(
            name=sheet["rig"],
            fingerprint=int(sheet["fingerprint"], 16),
            coils=sheet["coils"],
            frames=sheet["frames"],
            magnets=sheet["magnets"],
        )
