"""Makes, renews and revokes keys, in a folder: every folder in it is one peer's bundle, but `authority/` signs.

There is an authority for each peer, so that the robot can stop trusting one of them: `authority/NAME` signs the
certificate of NAME alone, and the robot's bundle lists the authorities of those who are enrolled. zenoh knows no
revocation lists. Keys are written readable by their owner alone, and nothing but lists and certificates is ever written
over, in one piece: a running robot reads them.
"""

import os
import shutil
from dataclasses import dataclass
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

from lira.hal.bus.security.expiry import SOON_DAYS
from lira.hal.bus.security.keys import CA, CERTIFICATE, KEY, KEY_MODE, NAME, NAMES, ROLES, Role, load_roles
from lira.hal.errors import ConfigError, StorageError

AUTHORITY, ROBOT, LAPTOP = "authority", "robot", "laptop"
REVOKED = "revoked"
AUTHORITY_LIFE = timedelta(days=3650)
ROBOT_LIFE = timedelta(days=730)
PEER_LIFE = timedelta(days=30)  # a lost laptop that nobody misses is shut out by then
CLOCK_SKEW = timedelta(days=1)  # a robot without a battery for its clock may wake up yesterday


@dataclass(frozen=True, slots=True)
class Enrolled:
    """A bundle, for `lira keys show`. `role` is the robot's word for it, or that it is revoked."""

    name: str
    role: str
    until: datetime

    @property
    def days_left(self) -> int:
        """Whole days until its certificate ends, negative after that."""
        return (self.until - datetime.now(UTC)).days

    @property
    def warning(self) -> str:
        """What to do about it, "" for nothing."""
        if self.role == REVOKED or self.days_left > SOON_DAYS:
            return ""
        return f"{'ended' if self.days_left < 0 else 'ends soon'}: lira keys renew {self.name}"


def init(folder: Path, life: timedelta = PEER_LIFE) -> None:
    """Make the robot's and the laptop's bundle. Raises `ConfigError` if there are any, `StorageError`."""
    if (folder / AUTHORITY).exists():
        raise ConfigError(f"{folder} holds keys already", "Choose another folder, or add a peer with: lira keys enroll")
    made_here = not folder.exists()
    try:
        _make(folder, ROBOT, ROBOT_LIFE)
        if made_here:
            (folder / ".gitignore").write_text("*\n")  # nobody commits a private key by accident
        (folder / ROBOT / CA).write_bytes(b"")
        (folder / ROBOT / ROLES).write_bytes(b"")
    except OSError as error:
        raise StorageError(f"cannot write below {folder}: {error.strerror}", "Choose another folder.") from error
    enroll(folder, LAPTOP, life=life)


def enroll(folder: Path, name: str, role: Role = Role.OPERATOR, life: timedelta = PEER_LIFE) -> None:
    """Make one peer's bundle, and let the robot trust it. Raises `ConfigError`, `StorageError`."""
    if NAMES.fullmatch(name) is None or name in (AUTHORITY, REVOKED):
        raise ConfigError(f"'{name}' is no name for a peer", "Use up to 40 letters, digits, - and _.")
    roles = _roles(folder)
    if (folder / name).exists() or name in roles:
        raise ConfigError(f"{folder / name} exists already", "Choose another name, or move that folder away.")
    try:
        _make(folder, name, life)
        shutil.copyfile(folder / AUTHORITY / ROBOT / CERTIFICATE, folder / name / CA)
        _list(folder, {**roles, name: role})
    except OSError as error:
        raise StorageError(f"cannot write {folder / name}: {error.strerror}", "Choose another folder.") from error


def renew(folder: Path, name: str, life: timedelta | None = None) -> None:
    """Give a peer a certificate that begins now, with its name and key. Raises `ConfigError`, `StorageError`."""
    if name != ROBOT and name not in _roles(folder):
        raise ConfigError(f"nobody named '{name}' is enrolled in {folder}", "Look who is with: lira keys show")
    life = life or (ROBOT_LIFE if name == ROBOT else PEER_LIFE)
    signer, authority = _load(folder / AUTHORITY / name)
    try:
        before = x509.load_pem_x509_certificate((folder / name / CERTIFICATE).read_bytes())
        key = before.public_key()
        if not isinstance(key, ec.EllipticCurvePublicKey):
            raise ConfigError(f"{folder / name / CERTIFICATE} is not one of ours", "Enroll it under another name.")
        _write_over(folder / name / CERTIFICATE, _pem(_certify(name, key, signer, authority, life)))
    except (OSError, ValueError) as error:
        raise StorageError(f"cannot renew {folder / name}: {error}", "Look at that folder.") from error


def revoke(folder: Path, name: str) -> None:
    """Let the robot trust a peer no longer, for good. Raises `ConfigError`, `StorageError`."""
    roles = _roles(folder)
    if name not in roles:
        raise ConfigError(f"nobody named '{name}' is enrolled in {folder}", "Look who is with: lira keys show")
    del roles[name]
    try:
        _list(folder, roles)
        shutil.rmtree(folder / AUTHORITY / name)  # nothing it signed is ever trusted again, and it signs no more
    except OSError as error:
        raise StorageError(
            f"cannot write below {folder}: {error.strerror}", "It may not be done: try again."
        ) from error


def enrolled(folder: Path) -> list[Enrolled]:
    """Return every bundle in a folder of bundles, by name. Raises `ConfigError` if there is no robot's."""
    roles = {**_roles(folder), ROBOT: ROBOT}
    found = []
    for path in sorted(folder.glob(f"*/{CERTIFICATE}")):
        name = path.parent.name
        until = x509.load_pem_x509_certificate(path.read_bytes()).not_valid_after_utc
        found.append(Enrolled(name, str(roles.get(name, REVOKED)), until))
    return found


def _roles(folder: Path) -> dict[str, Role]:
    roles = load_roles(folder / ROBOT)
    if roles is None:
        raise ConfigError(f"{folder} holds no keys", f"Make some with: lira keys init {folder}")
    return roles


def _list(folder: Path, roles: dict[str, Role]) -> None:
    """Write down at the robot whom it trusts, as what."""
    authorities = [(folder / AUTHORITY / name / CERTIFICATE).read_bytes() for name in roles]
    _write_over(folder / ROBOT / CA, b"".join(authorities))
    _write_over(folder / ROBOT / ROLES, "".join(f"{name} {role}\n" for name, role in roles.items()).encode())


def _make(folder: Path, name: str, life: timedelta) -> None:
    """Make an authority for one peer, and what it signs: all of its bundle but whom it trusts."""
    signer, key = ec.generate_private_key(ec.SECP256R1()), ec.generate_private_key(ec.SECP256R1())
    authority = _certify(f"authority of {name}", signer.public_key(), signer, None, AUTHORITY_LIFE)
    _write(folder / AUTHORITY / name, signer, authority)
    _write(folder / name, key, _certify(name, key.public_key(), signer, authority, life))
    (folder / name / NAME).write_text(f"{name}\n", encoding="utf-8")


def _load(folder: Path) -> tuple[ec.EllipticCurvePrivateKey, x509.Certificate]:
    try:
        key = load_pem_private_key((folder / KEY).read_bytes(), None)
        certificate = x509.load_pem_x509_certificate((folder / CERTIFICATE).read_bytes())
    except (OSError, ValueError) as error:
        raise ConfigError(f"{folder} holds no authority", "Renew keys where they were made.") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey):
        raise ConfigError(f"{folder / KEY} is not one of ours", "Renew keys where they were made.")
    return key, certificate


def _write(folder: Path, key: ec.EllipticCurvePrivateKey, certificate: x509.Certificate) -> None:
    folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    folder.mkdir(mode=0o700)
    pem = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    # Never readable by others, not even for a moment.
    with os.fdopen(os.open(folder / KEY, os.O_WRONLY | os.O_CREAT | os.O_EXCL, KEY_MODE), "wb") as file:
        file.write(pem)
    (folder / CERTIFICATE).write_bytes(_pem(certificate))


def _write_over(path: Path, data: bytes) -> None:
    """Replace a file in one piece: whoever reads it meanwhile gets the old or the new."""
    fresh = path.with_name(path.name + ".new")
    fresh.write_bytes(data)
    fresh.replace(path)


def _pem(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(Encoding.PEM)


def _certify(
    name: str,
    key: ec.EllipticCurvePublicKey,
    signer: ec.EllipticCurvePrivateKey,
    issuer: x509.Certificate | None,
    life: timedelta,
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
        .not_valid_after(now + life)
        .add_extension(x509.BasicConstraints(ca=issuer is None, path_length=None), critical=True)
    )
    if issuer is not None:
        usages = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
        builder = builder.add_extension(x509.ExtendedKeyUsage(usages), critical=False)
        builder = builder.add_extension(x509.SubjectAlternativeName([x509.DNSName(name)]), critical=False)
    return builder.sign(signer, hashes.SHA256())
