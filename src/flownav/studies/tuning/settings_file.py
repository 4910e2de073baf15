"""The proposal as a settings file: each value with what it was, its interval, its unit, and where it came from."""

from __future__ import annotations

from pathlib import Path

from flownav.core.errors import InputError
from flownav.core.guard import written_whole
from flownav.core.parameter_files import load
from flownav.core.version import __version__
from flownav.navigation.settings import NavigatorSettingsFile
from flownav.studies.tuning.job import OfLog, Proposed, Tuned
from flownav.studies.tuning.judge import Judged


def write_settings(path: Path, tuned: Tuned, stated: NavigatorSettingsFile | None, command: str) -> None:
    """Write an accepted proposal, and read it back as `replay --settings` does.

    stated: what the fit started from; its other keys are kept. InputError where the file cannot be written.
    """
    try:
        with written_whole(path) as temporary:
            temporary.write_text(settings_text(tuned, stated, command), encoding="utf-8", errors="backslashreplace")
            load(temporary, NavigatorSettingsFile)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); give another --out") from error


def settings_text(tuned: Tuned, stated: NavigatorSettingsFile | None, command: str) -> str:
    """The file as TOML; the same for the same logs, command and version."""
    proposed = {row.key for row in tuned.proposed}
    kept = {} if stated is None else stated.model_dump(exclude_unset=True)
    lines = [
        "# Settings of flownav's navigator; use them with `flownav replay LOG --settings FILE`.",
        f"# Made with flownav {__version__} by: {' '.join(command.split())}",
        *(f"# {_part(log)}" for log in tuned.logs),
        f"# Held-out windows: {gain_words(tuned.judgement.error)}.",
        "",
        *(f"{key} = {float(value)!r}" for key, value in kept.items() if key not in proposed),
        *(_line(row) for row in tuned.proposed),
    ]
    return "\n".join(lines) + "\n"


def gain_words(error: Judged | None) -> str:
    """What the proposal does to the path's error, with the interval."""
    if error is None:
        return "nothing shows the path's error"
    interval = f"95 % interval {error.low:.3f} to {error.high:.3f}, {error.windows} windows"
    return f"gain of the path's error {error.mean:.3f} nats ({interval}); half the error would be 0.53"


def _part(log: OfLog) -> str:
    """How a log took part, in one line of a comment."""
    fitted = "held out whole" if log.split.whole else f"fitted on {len(log.split.fit)} windows"
    name = "".join(character if character.isprintable() else "?" for character in log.name)
    return f"{name}: {fitted}, judged on {len(log.split.held)}, by {log.reference or 'nothing'}"


def _line(row: Proposed) -> str:
    interval = f"95 % {row.low:.4g} to {row.high:.4g}"
    return f"{row.key} = {row.value!r}  # {row.unit}; was {row.default:g}; {interval}; {row.knob}"
