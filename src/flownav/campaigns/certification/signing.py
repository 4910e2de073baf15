"""A certificate's signature: Ed25519 over certificate.json, which has the hashes of all else (extra `sign`).

The signature is the 64 bytes and nothing more, so that another tool can hold it against the file:

    openssl pkeyutl -verify -pubin -inkey PUBLIC.pem -rawin -in certificate.json -sigfile certificate.sig

Keys are files as OpenSSL (`openssl genpkey -algorithm ed25519`) or OpenSSH (`ssh-keygen -t ed25519`) write them.
"""

from pathlib import Path
from typing import Any

from flownav.core.errors import InputError, arg
from flownav.core.files import written_whole
from flownav.core.guard import an_input

SIGNATURE = "certificate.sig"
SIGNATURE_BYTES = 64
MOST_KEY_BYTES = 65_536
SSH_PRIVATE, SSH_PUBLIC = b"-----BEGIN OPENSSH", b"ssh-"


def private_key(path: Path) -> Any:
    """The key that signs. InputError where it is none, or is locked by a passphrase."""
    serialization, of = _library()
    text = _text_of(path, "sign")
    load = serialization.load_ssh_private_key if SSH_PRIVATE in text else serialization.load_pem_private_key
    try:
        key = load(text, None)
    except TypeError as error:
        raise InputError(
            f"{arg('sign')} {path}: the key has a passphrase; sign certificate.json with your own tool"
        ) from error
    except Exception as error:  # the library has many, of OpenSSL and its own
        raise InputError(f"{arg('sign')} {path}: no private key that can be read") from error
    if not isinstance(key, of.Ed25519PrivateKey):
        raise InputError(f"{arg('sign')} {path}: not an Ed25519 key; `openssl genpkey -algorithm ed25519` makes one")
    return key


def public_key(path: Path) -> Any:
    """The key that a signature is held against. InputError where it is none."""
    serialization, of = _library()
    text = _text_of(path, "key")
    load = serialization.load_ssh_public_key if text.startswith(SSH_PUBLIC) else serialization.load_pem_public_key
    try:
        key = load(text)
    except Exception as error:
        raise InputError(f"{arg('key')} {path}: no public key that can be read") from error
    if not isinstance(key, of.Ed25519PublicKey):
        raise InputError(f"{arg('key')} {path}: not an Ed25519 key")
    return key


def sign(file: Path, key: Any) -> Path:
    """Write a file's signature beside it. OSError where it cannot be written."""
    path = file.with_name(SIGNATURE)
    with written_whole(path) as temporary:
        temporary.write_bytes(key.sign(file.read_bytes()))
    return path


def is_signed_by(file: bytes, signature: bytes, key: Any) -> bool:
    """Whether these bytes were signed by the owner of a public key."""
    from cryptography.exceptions import InvalidSignature

    try:
        key.verify(signature, file)
    except InvalidSignature:
        return False
    return True


def _text_of(path: Path, argument: str) -> bytes:
    try:
        with an_input(path).open("rb") as file:
            return file.read(MOST_KEY_BYTES)
    except OSError as error:
        raise InputError(f"{arg(argument)} {path}: cannot be read ({error.strerror})") from error


def _library() -> tuple[Any, Any]:
    """The modules that read keys. InputError where the package is missing."""
    try:
        from cryptography.hazmat.primitives import serialization
        from cryptography.hazmat.primitives.asymmetric import ed25519
    except ImportError:
        raise InputError('signatures need the package cryptography; pip install "flownav[sign]"') from None
    return serialization, ed25519
