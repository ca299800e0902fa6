"""The handle is moved by hand along every axis, without force: a sign that is wrong would turn a wall into a motor."""

from collections.abc import Callable, Mapping

from weberlink.apps.device_test.dialog import Dialog, View
from weberlink.apps.device_test.outcome import DeviceTestError
from weberlink.apps.device_test.sense import Frame, Sense, sense
from weberlink.geometry.vector import subtract
from weberlink.master.devices.contract import Device

TRIES = 3
"""Motions that say nothing, in a row, until something else must be wrong."""


def check_signs(
    device: Device, frame: Frame, options: Mapping[str, str], view_of: Callable[[Device], View], dialog: Dialog
) -> None:
    """Ask for a motion along every axis.

    Args:
        device: open, and without force.
        frame: where its axes lead.
        options: which option turns an axis round, by axis; for the advice.
        view_of: makes what is shown meanwhile.
        dialog: with the person.

    Raises:
        DeviceTestError: the position goes elsewhere than the hand.
    """
    dialog.tell("", "The signs. You move the handle; there is no force.")
    senses = [_sense(axis, device, frame, view_of(device), dialog) for axis in device.spec.axes]
    dialog.tell("", *(each.in_words(frame) for each in senses))
    crossed = [f"{each.asked} comes out as {each.axis}" for each in senses if each.axis != each.asked]
    if crossed:
        raise DeviceTestError(
            f"{device.spec.name}: axes are interchanged ({', '.join(crossed)}), so there must be no force: "
            "is it another model than the options say, or are cables crossed?"
        )
    flips = [f"{each.asked} ({options.get(each.asked, 'its direction')})" for each in senses if not each.right]
    if flips:
        raise DeviceTestError(
            f"{device.spec.name}: moves the wrong way, so there must be no force; in the options, turn round "
            f"{', '.join(flips)}, and test it again"
        )


def _sense(axis: str, device: Device, frame: Frame, view: View, dialog: Dialog) -> Sense:
    for _ in range(TRIES):
        dialog.ask("\nHold the handle in the middle of its workspace, then Enter: ")
        start = device.latest(dialog.now()).position
        dialog.watch(view, f"Move it {frame[axis]} by about 5 cm, hold it there, then Enter: ")
        found = sense(axis, subtract(device.latest(dialog.now()).position, start), frame)
        if isinstance(found, Sense):
            return found
        dialog.tell(found)
    raise DeviceTestError(
        f"{device.spec.name}: no motion along {axis} could be told; does it stand at its home pose when it is homed, "
        "and is it the model that the options say?"
    )
