"""A certificate's folder for tests: made once, copied, forged by somebody who knows how digests and hashes are made."""

from __future__ import annotations

import hashlib
import json

import pyarrow as pa
import pyarrow.parquet as pq
from typer.testing import CliRunner

from flownav.campaigns.certification import verify as verifying
from flownav.campaigns.certification.cells import plan_of
from flownav.campaigns.certification.verify import verify
from flownav.campaigns.chain import DIGEST, digests_of, root_of
from flownav.campaigns.engines import Local
from flownav.campaigns.requirement import load_requirement
from flownav.campaigns.store import Dataset
from flownav.cli import app
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
    path.write_text(json.dumps(facts), encoding="utf-8")


def forged(folder, value=0.1, rows=slice(None), *, chained=True):
    """Scores of the flights overwritten by somebody who knows how digests are made."""
    (path,) = Dataset(folder).parts(0)
    table = pq.read_table(path)
    own = table.drop_columns([DIGEST])
    for name, forgery in ((SCORE, value), ("touchdown.broken", 0.0)):
        scores = table.column(name).to_numpy().copy()
        scores[rows] = forgery
        own = own.set_column(own.column_names.index(name), name, pa.array(scores))
    root = root_of(json.loads((folder / "campaign.json").read_text(encoding="utf-8")), 0)
    digests = digests_of(own, root) if chained else table.column(DIGEST).to_pylist()
    own = own.append_column(DIGEST, pa.array(digests, pa.binary(32)))
    pq.write_table(own.replace_schema_metadata(table.schema.metadata), path, write_page_checksum=True)


def forge_all(folder):
    """Everything that can be made to fit the forged rows by somebody who has this code, but for a signature."""
    facts = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
    asked = load_requirement(next(iter(facts["files"]["in"])))
    plan = plan_of(asked)
    certificate = verifying.judged_from(asked, plan, Dataset(folder))
    facts |= json.loads(json.dumps({key: value for key, value in certificate.as_json().items() if key != "ranking"}))
    facts["ranking"] = None
    page = {key: value for key, value in facts.items() if key != "schema"}
    page["files"] = {key: value for key, value in facts["files"].items() if key != "page"}
    for name in page["files"]["out"]:
        page["files"]["out"][name] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
    text = verifying.render_certificate(page, verifying.drawn(certificate))
    (folder / "certificate.html").write_text(text, encoding="utf-8")
    (folder / "certificate.json").write_text(json.dumps(facts), encoding="utf-8")
    rehashed(folder)
    assert facts["verdict"] == "pass"
