"""A certificate is believed as far as it holds: a folder in which anything was altered."""

from __future__ import annotations

import json
import re
import shutil

import pytest

from certificates import forge_all, forged, found, rehashed, run, wrong
from flownav.campaigns.requirement import RequirementTable
from flownav.core.errors import InputError, VerdictError
from requirements import ASKED, HEAD, WINDY, write


# -- the folder looked through -----------------------------------------------------------------------------------
def test_a_folder_that_is_as_it_was_written_holds(made, folder):
    done = run("--verify", folder, "--again", 8)
    assert done.exit_code == 0, done.exception
    assert done.stdout.startswith("HOLDS  small, certified as: fail\n")
    told = json.loads(run("--verify", folder, "--again", 8, "--json").stdout)
    assert (told["verification"], told["verdict"], told["requirement"]) == ("holds", "fail", "small")
    checks = {check["what"]: check for check in told["checks"]}
    assert {what for what, check in checks.items() if check["found"] == "holds"} == {
        "files", "digests", "requirement", "files that the flights are made from", "version", "plan",
        "flights and inputs", "figures", "flights flown again", "ranking", "certificate.json", "page",
    }  # fmt: skip
    assert {what for what, check in checks.items() if check["found"] == "not checked"} == {
        "signature", "scores of the other flights", "flights of the ranking", "records of the worst flights",
        "command, time, libraries, and how many flights were drawn when it was written",
        "whether flights were planned and flown elsewhere before these",
    }  # fmt: skip
    assert checks["flights flown again"]["said"].startswith("8 of 52 drawn at random and ")


@pytest.mark.parametrize(("name", "said"), [
    ("certificate.html", "certificate.html: has another SHA-256"),
    ("campaign.json", "campaign.json: has another SHA-256"),
    ("flights/cell-000/part-00000.parquet", "part-00000.parquet: has another SHA-256"),
])  # fmt: skip
def test_a_file_that_was_altered_is_named(folder, name, said):
    path = folder / name
    path.write_bytes(path.read_bytes().replace(b"landing", b"LANDING"))
    if "parquet" in name:
        forged(folder)
    assert said in wrong(folder)["files"]


def test_scores_with_digests_and_hashes_that_fit_are_told_by_the_figures_and_then_by_the_flights(folder):
    forged(folder)
    rehashed(folder)
    assert 'verdict is "fail" in the certificate and "pass" by the rows' in wrong(folder)["figures"]
    assert forge_all(folder) == "pass"
    told = wrong(folder)
    assert set(told) == {"flights flown again"}
    assert "is not what is flown: " in told["flights flown again"]


@pytest.mark.parametrize(("change", "what", "said"), [
    (lambda facts: facts.update(verdict="pass"), "figures",
     'verdict is "pass" in the certificate and "fail" by the rows'),
    (lambda facts: facts.update(failures=0), "figures", "failures is 0 in the certificate and "),
    (lambda facts: facts["requirement"]["requirements"][0].update(at_most=0.3000001), "figures",
     "requirement.requirements[0].at_most is 0.3000001 in the certificate and 0.3 by the rows"),
    (lambda facts: facts["requirement"]["requirements"][0].update(sentence="touchdown at most 0.5 m"), "requirement",
     "asks for touchdown.horizontal_m at most 0.3 m with 90 % probability"),
    (lambda facts: facts["requirement"]["requirements"].append(facts["requirement"]["requirements"][0]), "requirement",
     "asks for 1 things, the certificate for 2"),
    (lambda facts: facts["worst"][0].update(flight=1), "figures", "worst: the flights are others"),
    (lambda facts: facts["worst"][0].update(report="other.html"), "page", "certificate.html is not what"),
    (lambda facts: facts["assumed"].update(truth="linear"), "figures", "assumed.truth"),
    (lambda facts: facts["envelope"]["bins"][3].update(failures=99), "figures", "envelope.bins[3].failures is 99"),
    (lambda facts: facts.update(ranking=None), "page", "certificate.html is not what"),
    (lambda facts: facts["ranking"][3].update(total=0.5), "ranking", "ranking[3].total is 0.5 in the certificate"),
    (lambda facts: facts["split"][0].update(known="never"), "ranking", "split[0].known is \"never\""),
    (lambda facts: facts.update(ranking_rows=32), "ranking", "outcomes of its samples are missing or damaged"),
    (lambda facts: facts.update(ranking_rows=2**40), "certificate.json", "ValueError: 1099511627776 rows: a power"),
    (lambda facts: facts["files"].pop("page"), "files", "certificate.html: has no hash"),
    (lambda facts: facts["files"]["out"].update({"../x": "0"}), "files", "../x: lies elsewhere"),
    (lambda facts: facts["files"]["out"].update({"/etc/passwd": "0"}), "files", "/etc/passwd: lies elsewhere"),
    (lambda facts: facts["files"]["out"].update({"absent": "0"}), "files", "absent: cannot be read (No such file"),
    (lambda facts: facts["files"]["out"].pop("flights/cell-000/part-00000.parquet"), "digests", "has no hash"),
    (lambda facts: facts.update(files=7), "certificate.json", "is not as certify writes it (TypeError"),
    (lambda facts: facts["made_by"].pop("flownav"), "certificate.json", "is not as certify writes it (KeyError"),
])  # fmt: skip
def test_a_fact_that_was_altered_is_named(folder, change, what, said):
    if what == "certificate.json":
        path = folder / "certificate.json"
        facts = json.loads(path.read_text(encoding="utf-8"))
        change(facts)
        path.write_text(json.dumps(facts), encoding="utf-8")
    else:
        rehashed(folder) if what != "files" else None
        facts = json.loads((folder / "certificate.json").read_text(encoding="utf-8"))
        change(facts)
        (folder / "certificate.json").write_text(json.dumps(facts), encoding="utf-8")
    assert said in wrong(folder)[what]


def test_a_requirement_that_was_altered_since_is_told_to_the_last_digit(made, folder, tmp_path):
    text = (made / "small.toml").read_text(encoding="utf-8")
    other = tmp_path / "other.toml"
    other.write_text(text.replace("0.3", "0.3000001"), encoding="utf-8")
    told = wrong(folder, requirement=str(other))
    assert "it asks for touchdown.horizontal_m at most 0.3000001 m" in told["requirement"]
    assert "the certificate for touchdown.horizontal_m at most 0.3 m" in told["requirement"]
    assert "has another seed, asked than the requirement makes" in told["plan"]
    other.write_text(text + "# later\n", encoding="utf-8")
    assert "it is another than when the flights were flown" in wrong(folder, requirement=str(other))["requirement"]


def test_without_the_requirement_nothing_is_shown(tmp_path):
    path = write(tmp_path, HEAD + WINDY + ASKED)
    run(path, "--out", tmp_path / "out", "--ranking", 0, "--records", 0)
    moved = shutil.move(path, tmp_path / "moved.toml")
    told = found(tmp_path / "out")
    assert told["plan, flights and inputs, figures, flights flown again"][0] == "not checked"
    assert "name it as well" in told["plan, flights and inputs, figures, flights flown again"][1]
    done = run("--verify", tmp_path / "out")
    assert isinstance(done.exception, VerdictError)
    assert str(done.exception).endswith("out: plan, flights and inputs, figures, flights flown again: not checked: "
                                        "the requirement's file is not there; name it as well")  # fmt: skip
    assert run("--verify", tmp_path / "out", moved, "--again", 4).exit_code == 0


def test_what_says_that_another_version_made_it_is_not_shown(folder):
    """Or who forges everything would only have to say so."""
    forged(folder)
    assert forge_all(folder) == "pass"
    rehashed(folder, lambda facts: facts["made_by"].update(code_sha256="0" * 64))
    told = found(folder)
    assert told["version, flights and inputs, flights flown again, page"][0] == "not checked"
    assert "of another code than this one" in told["version, flights and inputs, flights flown again, page"][1]
    assert told["figures"][0] == "holds"
    done = run("--verify", folder)
    assert isinstance(done.exception, VerdictError)
    assert done.stdout.startswith("NOT SHOWN  small, certified as: pass")
    assert "version, flights and inputs, flights flown again, page: not checked: made by flownav" in str(done.exception)
    assert json.loads(run("--verify", folder, "--json").stdout)["verification"] == "not shown"


@pytest.mark.parametrize(("text", "said"), [
    (None, r"certificate.json: cannot be read"), ("{", "cannot be read"), ("[]", "it holds no object"),
    ("{}", "is no certificate"), ("[" * 100_000, "cannot be read"),
])  # fmt: skip
def test_a_folder_without_a_certificate_is_bad_input(tmp_path, text, said):
    if text is not None:
        (tmp_path / "certificate.json").write_text(text, encoding="utf-8")
    done = run("--verify", tmp_path)
    assert isinstance(done.exception, InputError)
    assert re.search(said, str(done.exception))


def test_what_does_not_hold_is_exit_status_1_and_one_line(folder):
    rehashed(folder, lambda facts: facts.update(verdict="pass"))
    done = run("--verify", folder)
    assert isinstance(done.exception, VerdictError)
    assert str(done.exception).startswith(f'{folder}: figures: verdict is "pass"')
    assert "\n" not in str(done.exception)
    assert done.stdout.startswith("DOES NOT HOLD  small, certified as: pass")


# -- what was chosen ---------------------------------------------------------------------------------------------
def test_a_chosen_seed_and_a_chosen_number_of_flights_show(tmp_path):
    path = write(tmp_path, HEAD.replace("[set.filter]", "seed = 7\n[set.filter]") + WINDY + ASKED)
    done = run(path, "--out", tmp_path / "out", "--ranking", 0, "--records", 0, "--flights", 60)
    assert "chosen    seed 7\nchosen    flights 60\n" in done.stdout
    facts = json.loads((tmp_path / "out" / "certificate.json").read_text(encoding="utf-8"))
    assert facts["chosen"] == {"seed": 7, "flights": 60, "vehicle": None}
    page = (tmp_path / "out" / "certificate.html").read_text(encoding="utf-8")
    assert "The seed 7 was chosen; left alone, it comes of what is asked." in page
    assert "The number of flights, 60, was chosen;" in page
    assert run("--verify", tmp_path / "out", "--again", 4).exit_code == 0


def test_what_was_left_alone_is_not_told_of(made):
    page = (made / "out" / "certificate.html").read_text(encoding="utf-8")
    assert "was chosen" not in page
    facts = json.loads((made / "out" / "certificate.json").read_text(encoding="utf-8"))
    assert facts["chosen"] == {"seed": None, "flights": None, "vehicle": None}


@pytest.mark.parametrize(
    ("limit", "said"), [("0.3", "0.3 m"), ("0.3000001", "0.3000001 m"), ("2", "2 m"), ("1e-9", "0.000000001 m")]
)
def test_a_limit_is_told_to_its_last_digit(limit, said):
    table = RequirementTable(measure="touchdown.horizontal_m", at_most=float(limit), probability=0.9970000001)
    assert (
        table.sentence() == f"touchdown.horizontal_m at most {said} with 99.70000001 % probability at 90 % confidence"
    )
