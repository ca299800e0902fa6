"""The key file, a real one."""

from pathlib import Path

from tests.apps.doctor.machine import machine, only
from weberlink.apps.doctor import Finding, Grade, Host, Needs
from weberlink.apps.doctor.key import key_file
from weberlink.protocol.keys import generate


def found(path: Path | None, host: Host | None = None) -> Finding:
    return only(key_file, host or Host(), Needs(file=Path("x.yaml"), key_file=path))


def test_a_key_of_ones_own_is_fine_and_is_not_shown(tmp_path: Path) -> None:
    path = tmp_path / "key"
    generate(path)
    finding = found(path)
    assert finding.grade is Grade.OK
    assert path.read_text().split()[1] not in repr(finding)


def test_no_key_asked_for_is_fine() -> None:
    assert found(None).grade is Grade.OK


def test_what_is_wrong_with_a_key_comes_with_its_fix(tmp_path: Path) -> None:
    missing, public, empty = tmp_path / "missing", tmp_path / "public key", tmp_path / "empty"
    generate(public)
    public.chmod(0o640)
    empty.touch(0o600)
    fixes = {path: found(path).fix or "" for path in (missing, public, empty)}
    assert all(found(path).grade is Grade.PROBLEM for path in fixes)
    assert fixes[missing].startswith(f"weberlink keygen {missing} ")
    assert fixes[public] == f"chmod 600 '{public}'"
    assert "expected one line" in fixes[empty]


def test_a_key_of_another_user_is_a_problem(tmp_path: Path) -> None:
    path = tmp_path / "key"
    generate(path)
    stranger = machine(tmp_path, user=path.stat().st_uid + 12345)
    finding = found(path, stranger)
    assert finding.grade is Grade.PROBLEM
    assert "sudo chown" in (finding.fix or "")
    assert path.read_text().split()[1] not in repr(finding)


def test_a_folder_is_no_key(tmp_path: Path) -> None:
    assert found(tmp_path).grade is Grade.PROBLEM


def test_a_link_to_a_key_is_a_problem_as_for_the_daemons(tmp_path: Path) -> None:
    generate(tmp_path / "key")
    (tmp_path / "link").symlink_to(tmp_path / "key")
    finding = found(tmp_path / "link")
    assert finding.grade is Grade.PROBLEM
    assert (finding.fix or "").endswith(f"link.key_file: {tmp_path / 'key'}")
