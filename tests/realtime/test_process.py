"""What the kernel grants, asked in child processes, because most of it cannot be taken back."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from weberlink.realtime.process import prepare

ASK = """
import json, os, sys
from weberlink.realtime.process import prepare

grants = prepare(*json.loads(sys.argv[1]))
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(json.dumps({
    "grants": grants.as_dict(),
    "fifo": os.sched_getscheduler(0) == os.SCHED_FIFO,
    "priority": os.sched_getparam(0).sched_priority,
    "locked_kb": int(status["VmLck"].split()[0]),
    "cpus": sorted(os.sched_getaffinity(0)),
    "slack_ns": int(open("/proc/self/timerslack_ns").read()),
}))
"""

GIVE_UP_RIGHTS = """
import json, os, resource
from weberlink.realtime import process
for limit in (resource.RLIMIT_RTPRIO, resource.RLIMIT_NICE, resource.RLIMIT_MEMLOCK):
    resource.setrlimit(limit, (0, 0))
if os.geteuid() == 0:
    os.setgroups([])
    os.setgid(65534)
    os.setuid(65534)
"""

ORPHAN = """
import os, signal, subprocess, sys
child = subprocess.Popen([sys.executable, "-c", '''
import signal, time
from weberlink.realtime.process import die_with_parent
die_with_parent(signal.SIGKILL)
print("tied", flush=True)
time.sleep(60)
'''])
child.wait()
"""


def python(code, *arguments, **options):
    return subprocess.Popen([sys.executable, "-c", code, *arguments], **options)


def ask(priority, lock_memory, cpu, *, before=""):
    with python(before + ASK, json.dumps([priority, lock_memory, cpu]), stdout=subprocess.PIPE) as child:
        output, _ = child.communicate(timeout=20)
    assert child.returncode == 0
    return json.loads(output)


def test_granted_rights_are_in_force_and_others_name_what_they_need():
    cpu = max(os.sched_getaffinity(0))
    seen = ask(7, True, cpu)
    grants = seen["grants"]
    assert seen["cpus"] == [cpu]
    assert grants["cpu"] == {"granted": True, "detail": f"CPU {cpu}"}
    assert seen["fifo"] is grants["priority"]["granted"]
    assert seen["priority"] == (7 if seen["fifo"] else 0)
    assert ("SCHED_FIFO 7" if seen["fifo"] else "needs CAP_SYS_NICE") in grants["priority"]["detail"]
    assert (seen["locked_kb"] > 0) is grants["memory"]["granted"]


def test_process_without_rights_names_what_it_lacks_and_goes_on():
    seen = ask(7, True, None, before=GIVE_UP_RIGHTS)
    assert seen["grants"]["priority"] == {
        "granted": False,
        "detail": "not permitted: needs CAP_SYS_NICE or an rtprio limit of 7 or more",
    }
    assert seen["grants"]["memory"] == {
        "granted": False,
        "detail": "not permitted: needs CAP_IPC_LOCK or a larger memlock limit",
    }
    assert (seen["fifo"], seen["locked_kb"]) == (False, 0)


AWAKE = """
import json, os, sys
from weberlink.realtime import process
process.LATENCY_REQUEST = sys.argv[1]
grant = process.prepare(0, False, None, wakeful=json.loads(sys.argv[2])).wakeful
opened = [os.path.realpath(f"/proc/self/fd/{fd}") for fd in os.listdir("/proc/self/fd")]
held = [path for path in opened if path == os.path.realpath(sys.argv[1])]
print(json.dumps([grant.granted, grant.detail, len(held)]))
"""


def awake(place, asked):
    with python(AWAKE, str(place), json.dumps(asked), stdout=subprocess.PIPE, text=True) as child:
        return json.loads(child.communicate()[0])


def test_latency_request_is_held_until_the_process_ends(tmp_path):
    request = tmp_path / "latency"
    request.touch()
    assert awake(request, True) == [True, "processors awake", 1]
    assert request.read_bytes() == bytes(4), "zero microseconds, as the kernel reads it"


def test_latency_request_that_fails_is_reported(tmp_path):
    assert awake(tmp_path / "none", True) == [False, f"not possible: this kernel has no {tmp_path / 'none'}", 0]
    assert awake(tmp_path / "none", False) == [False, "not asked for", 0]


def test_missing_cpu_is_reported_with_those_that_exist():
    before = os.sched_getaffinity(0)
    answer = prepare(0, False, 100_000).cpu
    assert not answer
    assert answer.detail == f"not possible: this process may run on CPU {', '.join(map(str, sorted(before)))}"
    assert os.sched_getaffinity(0) == before


@pytest.mark.parametrize("priority", [-1, 100])
def test_a_priority_that_no_machine_has_is_refused(priority):
    with pytest.raises(ValueError, match=f"priority must be .* got {priority}"):
        prepare(priority, False, None)


def test_the_kernel_ends_a_tied_child_when_its_parent_is_killed():
    with python(ORPHAN, stdout=subprocess.PIPE) as parent:
        assert parent.stdout.readline() == b"tied\n"
        parent.kill()
        # The child holds the other end of this pipe: it reaches its end only when the child is gone as well.
        output, _ = parent.communicate(timeout=20)
    assert output == b""


def test_a_child_whose_parent_is_already_gone_ends_by_the_same_signal():
    code = (
        "import signal; from weberlink.realtime.process import die_with_parent;"
        " die_with_parent(signal.SIGTERM, parent=1)"
    )
    with python(code + "; print('still here')", stdout=subprocess.PIPE) as child:
        output, _ = child.communicate(timeout=20)
    assert child.returncode == -signal.SIGTERM
    assert output == b""


DIE = """
import os, resource, sys
from weberlink.realtime.process import forbid_core_dumps

try:
    resource.setrlimit(resource.RLIMIT_CORE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
except ValueError:
    sys.exit("not permitted")
if sys.argv[1] == "forbidden":
    forbid_core_dumps()
if os.fork() == 0:
    os.abort()
_, status = os.wait()
if os.WCOREDUMP(status) == (sys.argv[1] == "allowed"):  # the limit holds for children too
    os.abort()
"""


def dumps_core(folder: Path, how: str) -> bool:
    """Whether a process that aborts leaves a core, and its child too."""
    arguments = ["sh", "-c", 'cd "$0" && exec "$@"', str(folder), sys.executable, "-c", DIE, how]
    status = os.waitpid(os.posix_spawn("/bin/sh", arguments, os.environ), 0)[1]
    if os.WIFEXITED(status) and os.WEXITSTATUS(status) == 1:
        pytest.skip("the limit of core dumps is lower here, and only root can raise it")
    assert os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGABRT
    return os.WCOREDUMP(status)


def test_a_process_that_holds_a_key_leaves_no_core(tmp_path: Path) -> None:
    if Path("/proc/sys/kernel/core_pattern").read_text().startswith("|"):
        pytest.skip("cores go to a program here")
    assert dumps_core(tmp_path, "allowed")
    for core in tmp_path.iterdir():
        core.unlink()
    assert not dumps_core(tmp_path, "forbidden")
    assert list(tmp_path.iterdir()) == []
