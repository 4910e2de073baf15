"""Signatures of certificates: the right key, another, keys that are none."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from certificates import found, run, wrong
from flownav.core.errors import InputError, VerdictError


# -- signatures --------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """Two keys of OpenSSL's, one of OpenSSH's format, one of another kind, one that is locked."""
    from cryptography.hazmat.primitives import serialization as form
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519

    place = tmp_path_factory.mktemp("keys")
    for name, key in (("own", ed25519.Ed25519PrivateKey.generate()), ("other", ed25519.Ed25519PrivateKey.generate()),
                      ("curve", ec.generate_private_key(ec.SECP256R1()))):  # fmt: skip
        private = key.private_bytes(form.Encoding.PEM, form.PrivateFormat.PKCS8, form.NoEncryption())
        (place / f"{name}.pem").write_bytes(private)
        public = key.public_key()
        (place / f"{name}.pub.pem").write_bytes(
            public.public_bytes(form.Encoding.PEM, form.PublicFormat.SubjectPublicKeyInfo)
        )
        (place / f"{name}.ssh").write_bytes(
            key.private_bytes(form.Encoding.PEM, form.PrivateFormat.OpenSSH, form.NoEncryption())
        )
        (place / f"{name}.ssh.pub").write_bytes(public.public_bytes(form.Encoding.OpenSSH, form.PublicFormat.OpenSSH))
        locked = form.BestAvailableEncryption(b"secret")
        (place / f"{name}.locked").write_bytes(key.private_bytes(form.Encoding.PEM, form.PrivateFormat.PKCS8, locked))
    return place


def signed(made, folder, key):
    return run(made / "small.toml", "--out", folder, "--ranking", 0, "--records", 0, "--sign", key)


@pytest.mark.parametrize(("private", "public"), [("own.pem", "own.ssh.pub"), ("own.ssh", "own.pub.pem")])
def test_a_signed_certificate_is_held_against_the_key(made, folder, keys, private, public):
    assert isinstance(signed(made, folder, keys / private).exception, VerdictError)
    assert found(folder, key=keys / public)["signature"] == ("holds", "certificate.json is signed")
    assert "was not signed by this key" in wrong(folder, key=keys / "other.pub.pem")["signature"]
    assert found(folder)["signature"][0] == "not checked"
    path = folder / "certificate.json"
    path.write_bytes(path.read_bytes() + b" ")
    assert "was not signed by this key" in wrong(folder, key=keys / public)["signature"]


def test_another_tool_checks_the_signature(made, folder, keys):
    signed(made, folder, keys / "own.pem")
    asked = ["openssl", "pkeyutl", "-verify", "-pubin", "-inkey", keys / "own.pub.pem", "-rawin"]
    asked += ["-in", folder / "certificate.json", "-sigfile", folder / "certificate.sig"]
    if shutil.which("openssl") is None:
        pytest.skip("there is no openssl")
    assert subprocess.run(asked, capture_output=True).returncode == 0


def test_a_certificate_that_is_written_anew_without_a_key_loses_the_signature(made, folder, keys):
    signed(made, folder, keys / "own.pem")
    run(made / "small.toml", "--out", folder, "--ranking", 0, "--records", 0)
    assert not (folder / "certificate.sig").exists()
    assert "there is no certificate.sig for this key" in wrong(folder, key=keys / "own.pub.pem")["signature"]


@pytest.mark.parametrize(("option", "name", "said"), [
    ("--sign", "absent", "cannot be read (No such file"),
    ("--sign", "own.pub.pem", "no private key that can be read"),
    ("--sign", "curve.pem", "not an Ed25519 key; `openssl genpkey -algorithm ed25519` makes one"),
    ("--sign", "own.locked", "the key has a passphrase; sign certificate.json with your own tool"),
    ("--key", "own.pem", "no public key that can be read"),
    ("--key", "curve.pub.pem", "not an Ed25519 key"),
])  # fmt: skip
def test_keys_that_are_none(made, folder, keys, option, name, said):
    done = run("--verify", folder, option, keys / name) if option == "--key" else signed(made, folder, keys / name)
    assert isinstance(done.exception, InputError)
    assert said in str(done.exception)


def test_options_that_do_not_go_together(tmp_path, keys):
    assert "give --sign to sign one" in str(run("approach", "--key", keys / "own.pub.pem").exception)
    assert "REQUIREMENT: give one of takeoff, landing" in str(run().exception)
    assert "--again 0: must be from 1" in str(run("approach", "--again", 0).exception)


def test_signatures_without_the_library_are_told_of(monkeypatch, keys):
    import builtins

    real = builtins.__import__

    def without(name, *rest):
        if name.startswith("cryptography"):
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    assert 'pip install "flownav[sign]"' in str(run("approach", "--sign", keys / "own.pem").exception)
