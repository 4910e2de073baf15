"""The option that chooses an engine, of campaigns and certificates."""

from __future__ import annotations

from typing import Annotated

import typer

EngineOption = Annotated[str, typer.Option(help="Where it flies: local, ray (a cluster), cuda (a GPU).")]
