"""The greeting of a page: configuration, scene, names of states, and the settings that may be changed."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from weberlink.config import MASTER, SLAVE
from weberlink.protocol.states import State
from weberlink.telemetry.fault import Fault
from weberlink_figures.watching.scene import drawn

HYBRID = "hybrid"


def hello(session: str, descriptions: Mapping[str, dict[str, Any] | None]) -> dict[str, Any]:
    """The greeting of a session, without what depends on who watches and on the time.

    `descriptions`: of the present sides, see `weberlink.session.description`; None if unknown.
    """
    any_: dict[str, Any] = next((each for each in descriptions.values() if each is not None), {})
    system = any_.get("system", {})
    codec, emulated = system.get("codec", {}), system.get("link", {}).get("emulate")
    force = (codec.get("joints") or {}).get("torque") or codec.get("force", {})
    bank, choice = list(any_.get("bank", ())), codec.get("force", {}).get("predictor", HYBRID)
    workspace = _workspace(descriptions.get("master") or {})
    changes = list(any_.get("changes", ()))
    return {
        "type": "hello",
        "session": session,
        "readonly": not changes,
        "sides": {side: descriptions.get(side) for side in ("master", "slave")},
        "present": sorted(descriptions),
        "names": names(descriptions),
        "scene": drawn(system.get("slave", {}).get("scene", ())),
        "changes": changes,
        "predictors": [*bank, choice] if len(bank) > 1 else bank,
        # Settings and link as configured; the daemons know later changes.
        "settings": {"weber": force.get("weber"), "predictor": force.get("predictor")},
        "scheme": system.get("control", {}).get("scheme"),
        "generation": 0,
        "link": None if emulated is None else {key: emulated.get(key) for key in ("delay_ms", "jitter_ms", "loss")},
        "drivable": workspace is not None,
        "workspace_m": workspace,
        "rate_hz": any_.get("rate_hz"),
        "states": {str(state.value): state.name.lower() for state in State},
        "faults": {str(fault.value): fault.name.lower() for fault in Fault},
    }


def names(descriptions: Mapping[str, dict[str, Any] | None]) -> dict[str, str | None]:
    """What a session is made of, by name; None where nothing is known.

    Returns:
        `file`: the configuration; `device` and `robot`: their drivers; `peer`: the address of the slave, or its name
        where a path to it is found; `master` and `slave`: what the two sides call themselves.
    """
    any_: dict[str, Any] = next((each for each in descriptions.values() if each is not None), {})
    system = any_.get("system", {})
    link = system.get("link", {})

    def own(side: str) -> str | None:
        described, other = (descriptions.get(each) or {} for each in (side, SLAVE if side == MASTER else MASTER))
        heard = (other.get("peer") or {}).get("name")
        name: str | None = described.get("name") or heard or (link.get("names") or {}).get(side)
        return name

    return {
        "file": Path(any_["file"]).name if "file" in any_ else None,
        "device": system.get("master", {}).get("device", {}).get("driver"),
        "robot": system.get("slave", {}).get("robot", {}).get("driver"),
        "peer": ((link.get("finder") or {}).get("peer") or own(SLAVE)) if any_.get("finds_path") else link.get("slave"),
        "master": own(MASTER),
        "slave": own(SLAVE),
    }


def _workspace(master: Mapping[str, Any]) -> float | None:
    """Half the edge of the workspace of a `pointer` device [m]; None for any other device."""
    device = dict(master.get("system", {}).get("master", {}).get("device", {}))
    if device.pop("driver", None) != "pointer":
        return None
    from weberlink.master.devices import DEVICES  # noqa: PLC0415 - for this device only

    options = DEVICES.load("pointer").Options.model_validate(device)
    return float(getattr(options, "workspace_m"))  # noqa: B009 - of this driver
