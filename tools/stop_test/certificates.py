"""Certificates that run out while somebody looks."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key

from hal.keys import CERTIFICATE, KEY
from tools.authority import AUTHORITY


def shorten(folder: Path, name: str, lifetime_s: float) -> datetime:
    """Sign one peer's certificate anew so that it runs out in so many seconds; returns when."""
    old = x509.load_pem_x509_certificate((folder / name / CERTIFICATE).read_bytes())
    own = folder / AUTHORITY / name  # a peer may have an authority of its own
    signer = load_pem_private_key(((own if own.exists() else own.parent) / KEY).read_bytes(), None)
    assert isinstance(signer, ec.EllipticCurvePrivateKey)
    until = (datetime.now(UTC) + timedelta(seconds=lifetime_s)).replace(microsecond=0)
    builder = (
        x509.CertificateBuilder()
        .subject_name(old.subject)
        .issuer_name(old.issuer)
        .public_key(old.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(old.not_valid_before_utc)
        .not_valid_after(until)
    )
    for extension in old.extensions:
        builder = builder.add_extension(extension.value, extension.critical)
    certificate = builder.sign(signer, hashes.SHA256())
    (folder / name / CERTIFICATE).write_bytes(certificate.public_bytes(Encoding.PEM))
    return until
