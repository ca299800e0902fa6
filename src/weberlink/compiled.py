"""The compiled build: the mark that its compiler reads in the source, and whether it runs.

`setup.py` names the modules that can be compiled. If `WEBERLINK_PURE` is 1 in the environment when weberlink is first
imported, they run as Python all the same.
"""

from importlib.machinery import EXTENSION_SUFFIXES
from importlib.util import find_spec

TYPE_CHECKING = False
if TYPE_CHECKING:
    from mypy_extensions import mypyc_attr
else:

    def mypyc_attr(**_attributes):
        """Tell the compiler how a class is used; Python needs no telling."""
        return lambda cls: cls


__all__ = ["build", "is_compiled", "mypyc_attr"]


def is_compiled() -> bool:
    """Whether this process runs the compiled build; all of its modules are compiled, or none is."""
    spec = find_spec("weberlink.update")
    return spec is not None and str(spec.origin).endswith(tuple(EXTENSION_SUFFIXES))


def build(*, compiled: bool) -> str:
    """One of the two builds in words, and how to get the other one."""
    if compiled:
        return "compiled build (the source instead: WEBERLINK_PURE=1)"
    return "Python build (compiled, with less time for a tick: a wheel for this platform, or make compiled)"
