"""A certificate for a server on loopback, as the files of the relay want it, and the authority that signed it."""

from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

HOST = "127.0.0.1"


def write(folder: Path) -> Path:
    """Write cert.pem, chain.pem and privkey.pem; returns the file of the authority."""
    keys = [ec.generate_private_key(ec.SECP256R1()) for _ in range(2)]
    names = [x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, text)]) for text in ("authority", HOST)]
    now = datetime.now(UTC)
    made = []
    for key, name, extension in zip(
        keys,
        names,
        (
            x509.BasicConstraints(ca=True, path_length=0),
            x509.SubjectAlternativeName([x509.IPAddress(ip_address(HOST))]),
        ),
        strict=True,
    ):
        builder = x509.CertificateBuilder(names[0], name, key.public_key(), x509.random_serial_number())
        builder = builder.not_valid_before(now - timedelta(hours=1)).not_valid_after(now + timedelta(hours=1))
        made.append(builder.add_extension(extension, critical=True).sign(keys[0], SHA256()))
    files = {"chain.pem": made[0], "cert.pem": made[1]}
    for file, certificate in files.items():
        (folder / file).write_bytes(certificate.public_bytes(Encoding.PEM))
    private = keys[1].private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    (folder / "privkey.pem").write_bytes(private)
    return folder / "chain.pem"
