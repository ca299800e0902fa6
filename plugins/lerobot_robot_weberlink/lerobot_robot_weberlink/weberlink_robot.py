"""The robot: the follower of a live session, and what LeRobot leads it with."""

from contextlib import suppress
from functools import cached_property
from typing import Any

from lerobot.cameras.utils import make_cameras_from_configs
from lerobot.robots.robot import Robot
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

from lerobot_robot_weberlink.config_weberlink import WeberlinkRobotConfig
from weberlink_arms.live_ends import LiveEnd, find_end
from weberlink_arms.remote_lead import AxisUnits, RemoteLead


class WeberlinkRobot(Robot):
    """The follower of a live session on this host.

    The names of its features are those of the session, so a session must run when they are first asked for.
    """

    config_class = WeberlinkRobotConfig
    name = "weberlink"

    def __init__(self, config: WeberlinkRobotConfig) -> None:
        super().__init__(config)
        self.config = config
        self.cameras = make_cameras_from_configs(config.cameras)
        self._end: LiveEnd | None = None
        self._lead: RemoteLead | None = None
        self._is_connected = False

    @cached_property
    def _units(self) -> AxisUnits:
        return AxisUnits(self._attached(), use_degrees=self.config.use_degrees)

    def _attached(self) -> LiveEnd:
        if self._end is None:
            self._end = find_end("slave", self.config.session, max(1, self.config.force_window))
        return self._end

    @cached_property
    def observation_features(self) -> dict[str, type | tuple[int, int, int]]:
        """Angles, torques and windows as numbers: LeRobot takes a tuple for the shape of a camera's image."""
        units, config = self._units, self.config
        names = [*units.positions, *(units.efforts if config.torque else ()), *units.window_names(config.force_window)]
        images = {name: (camera.height, camera.width, 3) for name, camera in config.cameras.items()}
        return {**dict.fromkeys(names, float), **images}

    @cached_property
    def action_features(self) -> dict[str, type]:
        return dict.fromkeys(self._units.positions, float)

    @property
    def is_connected(self) -> bool:
        return (
            self._is_connected
            and self._end is not None
            and self._end.is_alive
            and (self._lead is None or self._lead.is_alive)
            and all(camera.is_connected for camera in self.cameras.values())
        )

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002 - the daemons know their arms
        """Attach to the session, and take its lead unless `observe`.

        Raises:
            NoSessionError: none runs here, or more than one and no session named.
            NotRemoteError: no program may lead this session.
            TargetInUseError: another program leads it.
        """
        self.disconnect()  # of a session that has ended
        try:
            self._attached().sample()
            _ = self._units
            if not self.config.observe:
                self._lead = RemoteLead(self.config.session)
            for camera in self.cameras.values():
                camera.connect()
        except BaseException:
            self.disconnect()
            raise
        self._is_connected = True

    @property
    def is_calibrated(self) -> bool:
        return True

    def calibrate(self) -> None:
        """The driver of the session calibrates its arm."""

    def configure(self) -> None:
        """The session's file configures it."""

    @check_if_not_connected
    def get_observation(self) -> dict[str, Any]:
        """The newest angles and torques of the follower, and the newest images; never waits.

        Raises:
            NoSessionError: the daemon stands still.
        """
        sample, units, config = self._attached().sample(), self._units, self.config
        observation: dict[str, Any] = units.features(sample.position)
        if config.torque:
            observation.update(zip(units.efforts, sample.effort.tolist(), strict=True))
        if config.force_window:
            observation.update(
                zip(units.window_names(config.force_window), sample.efforts.ravel().tolist(), strict=True)
            )
        for name, camera in self.cameras.items():
            observation[name] = camera.read_latest()
        return observation

    @check_if_not_connected
    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Lead the follower to these angles.

        Returns:
            The angles that were sent, within the leader's limits. With `observe`, the follower's newest command.

        Raises:
            ValueError: an angle is missing, or is not finite.
            NoSessionError: the daemon stands still.
        """
        if self._lead is None:
            return self._units.features(self._attached().sample().command)
        return self._units.features(self._lead.send(self._units.values(action)))

    def disconnect(self) -> None:
        """Let go of the lead: the follower holds."""
        self._is_connected = False
        if self._lead is not None:
            self._lead.close()
            self._lead = None
        if self._end is not None:
            self._end.close()
            self._end = None
        for camera in self.cameras.values():
            with suppress(ConnectionError):  # it is not connected
                camera.disconnect()
