"""A small certificate authority in a folder: `authority/` signs, every other folder is one peer's bundle.

Keys are written readable by their owner alone, and nothing is ever written over.
"""

import os
import re
import shutil
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import (
    Encoding,
    NoEncryption,
    PrivateFormat,
    load_pem_private_key,
)
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from hal.errors import ConfigError, StorageError
from hal.keys import CA, CERTIFICATE, KEY, KEY_MODE, WRITERS

AUTHORITY, ROBOT, LAPTOP = "authority", "robot", "laptop"
AUTHORITY_DAYS = 3650
PEER_DAYS = 730
CLOCK_SKEW = timedelta(days=1)  # a robot without a battery for its clock may wake up yesterday


def init(folder: Path) -> None:
    """Make the authority, the robot's and the laptop's bundle. Raises `ConfigError` if there are any."""
    if (folder / AUTHORITY).exists():
        raise ConfigError(f"{folder} holds keys already", "Choose another folder, or add a peer with: lira keys enroll")
    key = ec.generate_private_key(ec.SECP256R1())
    certificate = _certify("lira authority", key.public_key(), key, None, AUTHORITY_DAYS)
    try:
        _write(folder / AUTHORITY, key, certificate)
        enroll(folder, ROBOT, drives=False)
        enroll(folder, LAPTOP, drives=True)
    except OSError as error:
        raise StorageError(f"cannot write below {folder}: {error.strerror}", "Choose another folder.") from error


def enroll(folder: Path, name: str, *, drives: bool) -> None:
    """Make one peer's bundle; with `drives` the robot takes its commands. Raises `ConfigError`, `StorageError`."""
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,40}", name):
        raise ConfigError(f"'{name}' is no name for a peer", "Use up to 40 letters, digits, - and _.")
    if (folder / name).exists():
        raise ConfigError(f"{folder / name} exists already", "Choose another name.")
    signer, authority = _load(folder / AUTHORITY)
    key = ec.generate_private_key(ec.SECP256R1())
    certificate = _certify(name, key.public_key(), signer, authority, PEER_DAYS)
    try:
        _write(folder / name, key, certificate)
        shutil.copyfile(folder / AUTHORITY / CERTIFICATE, folder / name / CA)
        (folder / name / WRITERS).write_text("" if name == ROBOT else f"{ROBOT}\n", encoding="utf-8")
        if drives:
            with (folder / ROBOT / WRITERS).open("a", encoding="utf-8") as writers:
                writers.write(f"{name}\n")
    except OSError as error:
        raise StorageError(f"cannot write {folder / name}: {error.strerror}", "Choose another folder.") from error


def expiries(folder: Path) -> list[tuple[str, str, str]]:
    """Return name, last day and days left of every certificate in a folder of bundles."""
    rows = []
    for path in sorted(folder.glob(f"*/{CERTIFICATE}")):
        until = x509.load_pem_x509_certificate(path.read_bytes()).not_valid_after_utc
        rows.append((path.parent.name, f"{until:%Y-%m-%d}", str((until - datetime.now(UTC)).days)))
    return rows


def _load(folder: Path) -> tuple[ec.EllipticCurvePrivateKey, x509.Certificate]:
    try:
        key = load_pem_private_key((folder / KEY).read_bytes(), None)
        certificate = x509.load_pem_x509_certificate((folder / CERTIFICATE).read_bytes())
    except (OSError, ValueError) as error:
        raise ConfigError(f"{folder} holds no authority", f"Make one with: lira keys init {folder.parent}") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ConfigError(f"{folder / KEY} is not one of ours", f"Make new ones with: lira keys init {folder.parent}")
    return key, certificate


def _write(folder: Path, key: ec.EllipticCurvePrivateKey, certificate: x509.Certificate) -> None:
    folder.mkdir(parents=True, mode=0o700)
    pem = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    # Never readable by others, not even for a moment.
    with os.fdopen(os.open(folder / KEY, os.O_WRONLY | os.O_CREAT | os.O_EXCL, KEY_MODE), "wb") as file:
        file.write(pem)
    (folder / CERTIFICATE).write_bytes(certificate.public_bytes(Encoding.PEM))


def _certify(
    name: str,
    key: ec.EllipticCurvePublicKey,
    signer: ec.EllipticCurvePrivateKey,
    issuer: x509.Certificate | None,
    days: int,
) -> x509.Certificate:
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    now = datetime.now(UTC)
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject if issuer is None else issuer.subject)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - CLOCK_SKEW)
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.BasicConstraints(ca=issuer is None, path_length=None), critical=True)
    )
    if issuer is not None:
        usages = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
        builder = builder.add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        builder = builder.add_extension(x509.SubjectAlternativeName([x509.DNSName(name)]), critical=False)
    return builder.sign(signer, hashes.SHA256())
