"""What the kernel grants, asked in child processes, because most of it cannot be taken back."""

import json
import os
import resource
import signal
import subprocess
import sys

import pytest

from weberlink.realtime.process import prepare

ASK = """
import dataclasses, json, os, sys
from weberlink.realtime.process import prepare

grants = prepare(*json.loads(sys.argv[1]))
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
print(json.dumps({
    "grants": dataclasses.asdict(grants),
    "fifo": os.sched_getscheduler(0) == os.SCHED_FIFO,
    "priority": os.sched_getparam(0).sched_priority,
    "locked_kb": int(status["VmLck"].split()[0]),
    "cpus": sorted(os.sched_getaffinity(0)),
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
AWAKE = """
import json, os, sys
from weberlink.realtime import process
process.LATENCY_REQUEST = sys.argv[1]
grant = process.prepare(0, False, None, wakeful=json.loads(sys.argv[2])).wakeful
opened = [os.path.realpath(f"/proc/self/fd/{fd}") for fd in os.listdir("/proc/self/fd")]
print(json.dumps([grant.granted, grant.detail, opened.count(os.path.realpath(sys.argv[1]))]))
"""
ORPHAN = """
import subprocess, sys
subprocess.Popen([sys.executable, "-c", '''
import signal, time
from weberlink.realtime.process import die_with_parent
die_with_parent(signal.SIGKILL)
print("tied", flush=True)
time.sleep(60)
''']).wait()
"""
LATE = """
import signal
from weberlink.realtime.process import die_with_parent
die_with_parent(signal.SIGTERM, parent=1)
print("still here")
"""
FORBID = """
import json, resource, sys
from weberlink.realtime import process
getattr(process, sys.argv[1])()
print(json.dumps([*resource.getrlimit(resource.RLIMIT_CORE), process.LIBC.prctl(3, 0, 0, 0, 0)]))  # PR_GET_DUMPABLE
"""


def python(code, *arguments):
    return subprocess.Popen([sys.executable, "-c", code, *arguments], stdout=subprocess.PIPE, text=True)


def told(code, *arguments):
    with python(code, *arguments) as child:
        return json.loads(child.communicate(timeout=20)[0])


def test_granted_rights_are_in_force_and_others_name_what_they_need():
    cpu = max(os.sched_getaffinity(0))
    seen = told(ASK, json.dumps([7, True, cpu]))
    grants = seen["grants"]
    assert seen["cpus"] == [cpu]
    assert grants["cpu"] == {"granted": True, "detail": f"CPU {cpu}"}
    assert seen["fifo"] is grants["priority"]["granted"]
    assert seen["priority"] == (7 if seen["fifo"] else 0)
    assert (seen["locked_kb"] > 0) is grants["memory"]["granted"]


def test_process_without_rights_names_what_it_lacks_and_goes_on():
    seen = told(GIVE_UP_RIGHTS + ASK, json.dumps([7, True, None]))
    for name, lacks in (
        ("priority", "CAP_SYS_NICE or an rtprio limit of 7 or more"),
        ("memory", "CAP_IPC_LOCK or a larger memlock limit"),
    ):
        assert seen["grants"][name] == {"granted": False, "detail": f"not permitted: needs {lacks}"}
    assert (seen["fifo"], seen["locked_kb"]) == (False, 0)


def test_latency_request_is_held_until_the_process_ends(tmp_path):
    request, none = tmp_path / "latency", tmp_path / "none"
    request.touch()
    assert told(AWAKE, str(request), "true") == [True, "processors awake", 1]
    assert request.read_bytes() == bytes(4), "zero microseconds, as the kernel reads it"
    assert told(AWAKE, str(none), "true") == [False, f"not possible: this kernel has no {none}", 0]
    assert told(AWAKE, str(none), "false") == [False, "not asked for", 0]


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


def test_a_child_ends_with_its_parent_also_with_one_that_has_gone_before():
    with python(ORPHAN) as parent:
        assert parent.stdout.readline() == "tied\n"
        parent.kill()
        # The child holds the other end of this pipe: it reaches its end only when the child is gone as well.
        assert parent.communicate(timeout=20)[0] == ""
    with python(LATE) as child:
        assert child.communicate(timeout=20)[0] == ""
    assert child.returncode == -signal.SIGTERM


@pytest.mark.parametrize(("call", "dumpable"), [("forbid_core_dumps", 1), ("conceal_memory", 0)])
def test_a_process_that_holds_a_key_leaves_no_core(call, dumpable):
    _, hard = resource.getrlimit(resource.RLIMIT_CORE)
    # One byte: at a limit of none the kernel would still start a program that is named in core_pattern.
    assert told(FORBID, call) == [*[0 if hard == 0 else 1] * 2, dumpable]
