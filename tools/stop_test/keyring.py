"""The keys of a bus under test: whoever drives by them may run out of time, or be revoked."""

import shutil
import subprocess
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.serialization import Encoding, load_pem_private_key

from lira.hal.bus.security.keys import CERTIFICATE, KEY
from lira.tools.authority import AUTHORITY
from lira.tools.launch.processes import lira_command
from lira.tools.stop_test.errors import StopTestError
from lira.tools.stop_test.setups import BRIEF, GUEST, LEAVER, RIVAL

BRIEF_S, PATIENCE_S = 10.0, 20.0


class Keyring:
    """Bundles for a robot and some peers: a guest only looks, who is brief does not stay, a leaver is shut out.

    Raises `StopTestError` if `lira keys` does not do what it should.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._expires = datetime.now(UTC)
        self._revoked: set[str] = set()
        lira_keys("init", str(folder))
        lira_keys("enroll", GUEST, str(folder), "--viewer")
        for name in (RIVAL, BRIEF, LEAVER):
            lira_keys("enroll", name, str(folder))

    def prepare(self, name: str) -> Path:
        """Return a bundle to be used now: who is brief has a while, who was shut out is let in again."""
        if name in self._revoked:
            shutil.rmtree(self.folder / name)
            lira_keys("enroll", name, str(self.folder))
            self._revoked.remove(name)
        if name == BRIEF:
            self._expires = shorten(self.folder, name, BRIEF_S)
        return self.folder / name

    def wait_expired(self) -> None:
        """Wait until the certificate that is brief runs out."""
        time.sleep(max((self._expires - datetime.now(UTC)).total_seconds(), 0.0))

    def revoke(self, name: str) -> None:
        """Shut a name out."""
        lira_keys("revoke", name, str(self.folder))
        self._revoked.add(name)


def lira_keys(*words: str) -> None:
    """Run `lira keys`. Raises `StopTestError` if it does not do it."""
    done = subprocess.run(lira_command("keys", *words), capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    if done.returncode != 0:
        raise StopTestError(f"lira keys {words[0]} ended with status {done.returncode}", f"It wrote: {done.stderr}")


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
