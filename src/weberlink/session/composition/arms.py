"""What both sides of a session of arms build alike from a configuration."""

from weberlink.arms.contract import ArmSpec
from weberlink.codec.sample import INT16_MAX
from weberlink.config import ConfigurationError, System
from weberlink.config.joints import per_axis
from weberlink.geometry.joints import Joints
from weberlink.session.composition.channels import streams


def joint_names(system: System) -> tuple[str, ...]:
    assert system.codec.joints is not None
    return system.codec.joints.names


def has_gripper(system: System) -> bool:
    return system.codec.gripper is not None


def within(where: str, setting: float | tuple[float, ...] | None, most: Joints) -> Joints:
    return most if setting is None else tuple(map(min, most, each_axis(where, setting, len(most))))


def each_axis(where: str, setting: float | tuple[float, ...], count: int) -> Joints:
    try:
        return per_axis(setting, count)
    except ValueError as error:
        raise ConfigurationError(f"{where}: {error}") from None


def check_arm_axes(where: str, spec: ArmSpec, system: System) -> None:
    names = joint_names(system)
    if spec.joints != names:
        raise ConfigurationError(
            f"codec.joints.names: {', '.join(names)}; but {where} {spec.name} has {', '.join(spec.joints)}"
            + ("; map its axes with master.joint_mapping" if where == "master.device" else "; use these names")
        )
    if spec.gripper is not has_gripper(system):
        raise ConfigurationError(
            f"codec.gripper: {where} {spec.name} has {'a' if spec.gripper else 'no'} gripper; "
            + ("add gripper: {} under codec" if spec.gripper else "leave it out")
        )


def check_angles(where: str, spec: ArmSpec, system: System) -> None:
    """A wire that cannot say an angle would move the arm elsewhere."""
    limit = streams(system)[0][0].value_quantizer.limit
    reach = max(map(abs, (*spec.lower, *spec.upper)))
    if reach > limit:
        raise ConfigurationError(
            f"codec.joints.angle.step_rad: spans {limit:g} rad but {where} reaches {reach:g} rad; use a step of at "
            f"least {reach / INT16_MAX:.2g}"
        )
