"""A certificate's folder for tests: made once, copied, forged by somebody who knows how digests and hashes are made."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace

import pyarrow as pa
import pyarrow.parquet as pq
from typer.testing import CliRunner

from flownav.campaigns.certification import verify as verifying
from flownav.campaigns.certification.again import Again, deciding
from flownav.campaigns.certification.cells import plan_of
from flownav.campaigns.certification.verify import verify
from flownav.campaigns.certification.written import written
from flownav.campaigns.chain import DIGEST, digests_of, root_of
from flownav.campaigns.engines import Local
from flownav.campaigns.requirement import load_requirement
from flownav.campaigns.store import Dataset, limited_by, rows_of_table
from flownav.cli import app
from flownav.core.provenance import hash_of
from flownav.scoring.errors import SCORE_COLUMNS, touchdown_rows
from flownav.scoring.landings import verdict_of
from requirements import ASKED

SCORE = "touchdown.contact.distance_m"
STRICT = ASKED.replace("0.5", "0.3")


def run(*arguments):
    return CliRunner().invoke(app, ["certify", *map(str, arguments)])


def found(folder, **more):
    """The findings by the part that was checked; of two with the same name the first that does not hold."""
    told = {}
    for check in verify(folder, Local(), **{"sample": 8} | more).checks:
        if told.get(check.what, ("",))[0] != "does not hold":
            told[check.what] = (check.found, check.said)
    return told


def wrong(folder, **more):
    return {what: said for what, (of, said) in found(folder, **more).items() if of == "does not hold"}


def rehashed(folder, change=lambda facts: None):
    """certificate.json with other facts, and with the hashes of the files as they are now."""
    path = folder / "certificate.json"
    facts = json.loads(path.read_text(encoding="utf-8"))
    change(facts)
    for names in (facts["files"]["out"], facts["files"]["page"]):
        for name in names:
            if (folder / name).exists():
                names[name] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
    path.write_text(written(facts), encoding="utf-8")


def forged(folder, value=0.1, rows=slice(None), *, chained=True):
    """Scores of the flights overwritten, and the words that follow from them, by somebody who knows how digests are
    made.
    """

    def change(own):
        for name, forgery in ((SCORE, value), ("touchdown.broken", 0.0)):
            scores = own.column(name).to_numpy().copy()
            scores[rows] = forgery
            own = with_column(own, name, scores)
        scores = rows_of_table(own)
        words = [verdict_of(one) for one in touchdown_rows(scores[:, : len(SCORE_COLUMNS)])]
        return with_column(with_column(own, "verdict", words), "limited_by", [limited_by(one) for one in scores])

    rewritten(folder, change, chained=chained)


def with_column(table, name, values):
    """A table with other values in one column."""
    return table.set_column(table.column_names.index(name), name, pa.array(values))


def rewritten(folder, change, cell=0, *, chained=True):
    """A cell's only part with its rows changed; chained: with digests that fit."""
    (path,) = Dataset(folder).parts(cell)
    table = pq.read_table(path)
    own = change(table.drop_columns([DIGEST]))
    root = root_of(json.loads((folder / "campaign.json").read_text(encoding="utf-8")), cell)
    digests = digests_of(own, root) if chained else table.column(DIGEST).to_pylist()
    own = own.append_column(DIGEST, pa.array(digests, pa.binary(32)))
    pq.write_table(own.replace_schema_metadata(table.schema.metadata), path, write_page_checksum=True)


def forge_all(folder, change=lambda facts: None):
    """Everything that can be made to fit the rows by somebody who has this code, but for a signature; change: of the
    facts, which the page then has, too. The verdict.
    """
    facts = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    asked = load_requirement(next(iter(facts["files"]["in"])))
    plan = plan_of(asked)
    certificate = verifying.judged_from(asked, plan, Dataset(folder))
    margin = len(deciding(asked, certificate.judgements, certificate.flown.rows))
    certificate = replace(certificate, again=Again(facts["flown_again"]["sample"], margin))
    facts = {"schema": facts["schema"]} | json.loads(json.dumps(certificate.as_json())) | {
        key: facts[key] for key in ("assumed", "made_by", "files")
    }  # fmt: skip
    change(facts)
    outs = facts["files"]["out"]
    outs |= {name: hash_of(folder / name) for name in outs if (folder / name).exists()}
    page = {key: value for key, value in facts.items() if key != "schema"}
    page["files"] = {key: value for key, value in facts["files"].items() if key != "page"}
    text = verifying.render_certificate(page, verifying.drawn(certificate))
    (folder / "certificate.html").write_text(text, encoding="utf-8")
    (folder / "certificate.json").write_text(written(facts), encoding="utf-8")
    rehashed(folder)
    return facts["verdict"]
