"""The teleoperator: the newest angles of a session's leader, read from the telemetry of its daemon."""

from functools import cached_property
from typing import Any

from lerobot.teleoperators.teleoperator import Teleoperator
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

from lerobot_teleoperator_weberlink.config_weberlink import WeberlinkTeleoperatorConfig
from weberlink_arms.live_ends import LiveEnd, find_end
from weberlink_arms.remote_lead import AxisUnits


class WeberlinkTeleoperator(Teleoperator):
    """The leader of a live session. The daemons of the session close the loop of force at their own rate.

    The names of its features are those of the session, so a session must run when they are first asked for.
    """

    config_class = WeberlinkTeleoperatorConfig
    name = "weberlink"

    def __init__(self, config: WeberlinkTeleoperatorConfig) -> None:
        super().__init__(config)
        self.config = config
        self._end: LiveEnd | None = None
        self._is_connected = False

    @cached_property
    def _units(self) -> AxisUnits:
        return AxisUnits(self._attached(), use_degrees=self.config.use_degrees)

    def _attached(self) -> LiveEnd:
        if self._end is None:
            self._end = find_end(self.config.side, self.config.session)
        return self._end

    @cached_property
    def action_features(self) -> dict[str, type]:
        return dict.fromkeys(self._units.positions, float)

    @cached_property
    def feedback_features(self) -> dict[str, type]:
        """The torques that the leader displays [N m]: what `get_feedback` returns."""
        return dict.fromkeys(self._units.efforts, float)

    @property
    def is_connected(self) -> bool:
        return self._is_connected and self._end is not None and self._end.is_alive

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002 - the daemons know their arms
        """Attach to the session.

        Raises:
            NoSessionError: none runs here, or more than one and no session named.
        """
        self.disconnect()  # of a session that has ended
        self._attached().sample()
        _ = self._units
        self._is_connected = True

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        """The driver of the session calibrates its arm."""

    def configure(self) -> None:
        """The session's file configures it."""

    @check_if_not_connected
    def get_action(self) -> dict[str, float]:
        """The newest angles; never waits.

        Raises:
            NoSessionError: the daemon stands still.
        """
        sample = self._attached().sample()
        return self._units.features(sample.position if self.config.side == "master" else sample.command)

    @check_if_not_connected
    def get_feedback(self) -> dict[str, float]:
        """The newest torques on the operator's hand [N m]."""
        return dict(zip(self._units.efforts, self._attached().sample().effort.tolist(), strict=True))

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing: the session displays the force of its own follower, a thousand times a second."""

    def disconnect(self) -> None:
        self._is_connected = False
        if self._end is not None:
            self._end.close()
            self._end = None
