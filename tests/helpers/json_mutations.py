"""Damage to what JSON files say, decided by a seed: values of other types and sizes in place of what stands there."""

from __future__ import annotations

import copy
import json
from random import Random
from typing import Any

from log_mutations import mutate

ODD: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**31, 2**63, 10**30, -(10**9), 1e308, -1e308, float("nan"), float("inf"), 0.5, "",
    "x", "\u0000", "../../x", "x" * 5000, [], {}, [[]], [None], [[0, 10**9], [0, 5 - 10**9]], {"": 0}, {"value": "x"},
)  # fmt: skip
DEEP = 50_000


def mutate_json(content: bytes, seed: int) -> bytes:
    """One to three nodes of the tree made odd, or bytes of the text, or both."""
    random = Random(seed)
    if random.random() < 0.25:
        return mutate(content, content, seed)
    tree = [json.loads(content)]
    for _ in range(random.choice((1, 1, 2, 3))):
        place, key = random.choice(list(_places(tree)))
        deed = random.randrange(6)
        if deed == 0 and isinstance(place, dict):
            del place[key]
        elif deed == 1 and isinstance(place, dict):
            place[random.choice(("", "x", "schema", key + "x"))] = place[key]
        elif deed == 2 and isinstance(place[key], list):
            place[key] = place[key] * random.choice((0, 2, 50))
        else:
            place[key] = copy.deepcopy(random.choice(ODD))
    text = json.dumps(tree[0])
    if random.random() < 0.02:
        text = text.replace(":", ":" + "[" * DEEP, 1)
    return text.encode()


def _places(node: Any) -> Any:
    """Every place of the tree: its list or object, and the index or key."""
    pairs = list(node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ())
    for key, child in pairs:
        yield node, key
        yield from _places(child)
