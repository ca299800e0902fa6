"""Messages as the maker's documentation prints them: docs.haply.co/inverseSDK (3.5.x), pages `websocket-protocol`,
`control-commands`, `device-config` and `http`; and states as public clients quote them."""

from typing import Any

VEC0 = {"x": 0, "y": 0, "z": 0}
ANGLES0 = {"a0": 0.0, "a1": 0.0, "a2": 0.0}
INVENTORY: dict[str, Any] = {
    "session_id": 7,
    "inverse3": [
        {
            "device_id": "049D",
            "config": {
                "type": "inverse3",
                "port": "COM12",
                "device_info": {"major_version": 7, "minor_version": 4, "id": "049D", "device_type": 4, "uuid": "…"},
                "extended_device_id": "…",
                "extended_firmware_version": "…",
                "gravity_compensation": {"enabled": True, "scaling_factor": 1.0},
                "handedness": "right",
                "streaming_mode": "USB",
                "torque_scaling": {"enabled": True},
                "home_return": {"enabled": False},
                "preset": "defaults",
                "basis": {"permutation": "XYZ"},
                "mount": {"position": VEC0, "rotation": {"w": 1, **VEC0}, "scale": {"x": 1, "y": 1, "z": 1}},
                "filters": {"force_gate": {"gain": 0.3}, "damping": {"scalar": 0.0}},
            },
            "state": {
                "cursor_position": {"x": 0.0, "y": -0.12, "z": 0.15},
                "cursor_velocity": {"x": 0.0, "y": 0.0, "z": 0.0},
                "angular_position": ANGLES0,
                "angular_velocity": ANGLES0,
                "body_orientation": {"w": 1.0, "x": 0.0, "y": 0.0, "z": 0.0},
                "current_cursor_force": {"x": 0.0, "y": 0.0, "z": 0.0},
                "current_cursor_position": {"x": 0.0, "y": 0.0, "z": 0.0},
                "current_angular_torques": ANGLES0,
                "current_angular_position": ANGLES0,
                "control_domain": "cartesian",
                "control_mode": "idle",
            },
        }
    ],
}
"""The first message of the service."""
STATUS = {"calibrated": True, "in_use": False, "power_supply": True, "ready": True, "started": True}
"""Of a device, quoted in a comment of a public plugin for SOFA."""
FORCE_UP = {
    "inverse3": [{"device_id": "049D", "commands": {"set_cursor_force": {"vector": {"x": 0.0, "y": 0.0, "z": 1.5}}}}]
}
"""`set_cursor_force`, 3.5."""
FORMER_FORCE_UP = {
    "inverse3": [{"device_id": "049D", "commands": {"set_cursor_force": {"values": {"x": 0.0, "y": 0.0, "z": 1.5}}}}]
}
"""The same before, as Isaac Lab and the maker's earlier examples send it."""
PRESET = {"preset": {"preset": "arm_front_centered"}}
"""`configure` of a device."""
GRIP = {
    "device_id": "6A1F",
    "state": {"orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}, "buttons": {"a": False}},
}
"""Of `wireless_verse_grip`, as public clients read it."""
