"""The warm process of `flownav app`: a question a line on standard input, its answer a line on standard output.

It keeps what is slow to come by: imports, compiled kernels, the log that was replayed last.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from typing import Any

from flownav.cli import option_of
from flownav.core.errors import FlownavError

Question = dict[str, Any]
Answer = dict[str, Any]


def look(question: Question) -> Answer:
    """A log's facts as `flownav info` has them, and a thumbnail of its path."""
    from flownav.app.looking import look_at

    return look_at(question["path"])


def cut(question: Question) -> Answer:
    """A log replayed with GPS cut, flow withheld or scaled: the drift, and the path."""
    from flownav.app.cutting import drift_of

    return drift_of(question)


def fly(question: Question) -> Answer:
    """One flight: the picture of its landing, and its figures."""
    from flownav.api.flying import fly_setup
    from flownav.api.scenario import Scenario
    from flownav.app.flying import picture_of
    from flownav.simulation.assemble import assemble

    names = ("gps", "wind", "vehicle")
    changes = {name: question[name] for name in names if question.get(name)}
    changes |= {"flow_sensor": question["sensor"]} if question.get("sensor") else {}
    scenario = Scenario.load(str(question.get("scenario", "landing"))).changed(**changes)
    flown = fly_setup(assemble(scenario.file), int(question.get("seed", 1)))
    return picture_of(flown.record, flown.facts)


def cloud(question: Question) -> Answer:
    """The touchdowns of a campaign as far as it has flown."""
    from flownav.app.flying import cloud_of

    return cloud_of(question["path"])


def pace(question: Question) -> Answer:
    """How long a requirement's certificate takes here."""
    from flownav.app.pacing import pace_of

    return pace_of(question["requirement"])


ANSWERS: dict[str, Callable[[Question], Answer]] = {"look": look, "cut": cut, "fly": fly, "cloud": cloud, "pace": pace}


def answered(line: str) -> Answer:
    """The answer to a question, or its error in one line."""
    try:
        question = json.loads(line)
        return ANSWERS[question["what"]](question)
    except FlownavError as error:
        return {"error": error.naming(option_of)}
    except MemoryError:
        return {"error": "there is not enough memory for this"}
    except OSError as error:
        return {"error": f"{error.filename or 'a file'}: {error.strerror or error}"}
    except Exception as error:  # a worker that ends would lose what it keeps
        return {"error": f"the work failed: {type(error).__name__}: {' '.join(str(error).split())[:200]}"}


def main() -> None:
    """Answer until standard input ends; what anything else prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    for line in sys.stdin:
        answers.write(json.dumps(answered(line)) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
