"""A bounded rate of updates in a session: every channel keeps it, and the report holds by how much it cost."""

from tests.session.systems import configuration
from weberlink.codec.rate import LEAST_BURST
from weberlink.session.simulation import simulate

FILE = "rotation.yaml"
MOST = 5.0
SECONDS = 2.5
CHANNELS = {
    "force": "force",
    "position": "position",
    "torque": "rotation.torque",
    "orientation": "rotation.orientation",
}
NARROW = (
    "codec.force.weber=0", "codec.force.floor_n=0.001", "codec.position.weber=0", "codec.position.bound_m=0.00001",
    "codec.rotation.torque.weber=0", "codec.rotation.torque.floor_nm=0.0001", "codec.rotation.orientation.weber=0",
    "codec.rotation.orientation.bound_rad=0.0001",
)  # fmt: skip
BOUNDED = tuple(
    f"codec.{key}.max_updates_per_s={MOST:g}"
    for key in ("force", "position", "rotation.torque", "rotation.orientation")
)


def test_every_channel_keeps_its_rate() -> None:
    free = simulate(configuration(*NARROW, file=FILE), SECONDS)[0].to_json()
    bounded = simulate(configuration(*NARROW, *BOUNDED, file=FILE), SECONDS)[0].to_json()
    assert bounded["outcome"] == "completed"
    for name in CHANNELS:
        assert free[name]["packets"] > 2 * (MOST * SECONDS + LEAST_BURST)
        assert free[name]["widened_fraction"] == 0.0
        assert free[name]["widened_max"] is None
        assert bounded[name]["packets"] <= MOST * SECONDS + LEAST_BURST + 2, "and one forced at the beginning"
        assert 0.2 < bounded[name]["widened_fraction"] <= 1.0
        assert bounded[name]["widened_max"] > 0.0
    assert bounded["force"]["coding"]["violation_fraction"] == 0.0
