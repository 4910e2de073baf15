"""The first lines of a report: whether it landed, where, how sure it was, what limited it; and how it was flown."""

from typing import Any

from flownav.core.record import Record, mapping
from flownav.report.panels import metres, number
from flownav.report.sureness import sure_at_touchdown_m

SIGMA = "3 \N{GREEK SMALL LETTER SIGMA}"
LIMITS = {"estimate_m": "the navigator's estimate", "guidance_m": "guidance", "pad_m": "where it took the pad to be"}
FLOWN_ON = {"estimate": "steered by the navigator's estimate", "truth": "steered by the truth"}


def headline(record: Record) -> str:
    """A few sentences on the landing, and on the flights that it is one of; "" of a record that was not to land."""
    scores = mapping(record.manifest.get("scores"))
    landing = mapping(scores.get("touchdown"))
    contact = mapping(landing.get("contact"))
    if not landing:
        return ""
    off = contact.get("distance_m")
    place = "" if not _is_number(off) else f" {metres(off)} m from the pad's centre"
    if landing.get("broken"):
        sentences = [f"It crashed{place}: {', '.join(map(str, landing['broken']))}."]
    elif landing.get("reason") or not place:
        sentences = [f"It did not land{': ' + str(landing['reason']) if landing.get('reason') else ''}."]
    else:
        sentences = [f"It landed: it touched{place}."]
    sure = sure_at_touchdown_m(record) if place else None
    if sure is not None:
        sentences.append(f"As it touched, the navigator was sure of its place within {metres(sure)} m ({SIGMA}).")
    limits: dict[str, Any] = {words: mapping(landing.get("limited_by")).get(name) for name, words in LIMITS.items()}
    known = {words: float(size) for words, size in limits.items() if _is_number(size)}
    if place and known:
        most = max(known, key=lambda words: known[words])
        sentences.append(f"The largest part of that distance is due to {most} ({metres(known[most])} m).")
    return " ".join([*_of_many(record), *sentences])


def _of_many(record: Record) -> list[str]:
    """How the flights ended of which the record is the median one; nothing of a flight by itself."""
    many = mapping(record.manifest.get("many"))
    places, r95_m = many.get("north_m"), many.get("r95_m")
    if not _is_number(many.get("flights")) or not isinstance(places, list):
        return []
    within = f", 95 % within {metres(float(r95_m))} m of the pad's centre" if _is_number(r95_m) and r95_m else ""
    this = f"This is flight {record.manifest.get('flight', 0)}, whose largest error is the median."
    return [f"{len(places)} of {many['flights']} flights touched the ground{within}.", this]


def flown_with(record: Record) -> str:
    """How it was flown or fused, as one sentence."""
    manifest = record.manifest
    if manifest.get("kind") != "fly":
        return f"Fused by flownav's filter of the kind {manifest['filter']}." if manifest.get("filter") else ""
    parts = ["Simulated"]
    if manifest.get("truth"):
        model = {"matched": "as the navigator believes it to be", "dispersed": "other than the navigator believes"}
        belief = model.get(str(manifest.get("truth_model")), "")
        parts.append(f" with a {manifest['truth']} vehicle" + (f", {belief}" if belief else ""))
    if manifest.get("gps"):
        parts.append(f", a GPS of the model {manifest['gps']}")
    if manifest.get("filter"):
        parts.append(f", the filter {manifest['filter']}")
    if FLOWN_ON.get(str(manifest.get("feedback"))):
        parts.append(f", {FLOWN_ON[str(manifest['feedback'])]}")
    if manifest.get("seed") is not None:
        parts.append(f"; seed {manifest['seed']}, flight {manifest.get('flight', 0)}")
    return "".join(parts) + "."


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and number(value) != number(None)
