"""How an emulated HID device looks in /sys, in the text formats of umockdev; pure."""

from dataclasses import dataclass

LONGEST_DESCRIPTOR = 4096


@dataclass(frozen=True, slots=True)
class HidIdentity:
    """What a USB device with one HID interface says of itself.

    Args:
        vendor: 16 bits.
        product: 16 bits.
        name: of the product.
        report_descriptor: its bytes.
        report_size: of a report either way, without a number [bytes].
        serial_number: empty for none.
        manufacturer: empty for none.
    """

    vendor: int
    product: int
    name: str
    report_descriptor: bytes
    report_size: int
    serial_number: str = ""
    manufacturer: str = ""


def node_of(number: int) -> str:
    return f"/dev/hidraw{number}"


def paths(identity: HidIdentity, number: int, instance: int) -> tuple[str, str, str, str]:
    """Of the USB device, its interface, the HID device and the node in /sys; the outermost first.

    Args:
        identity: of the device.
        number: of the node.
        instance: another one at each plugging in, as the kernel counts them.
    """
    usb = f"/devices/pci0000:00/0000:00:14.0/usb1/1-{instance}"
    interface = f"{usb}/1-{instance}:1.0"
    hid = f"{interface}/0003:{identity.vendor:04X}:{identity.product:04X}.{instance:04X}"
    return usb, interface, hid, f"{hid}/hidraw/hidraw{number}"


def description(identity: HidIdentity, number: int, instance: int) -> str:
    """The device for umockdev, without a node in /dev, which it could not take away again."""
    usb, interface, hid, node = paths(identity, number, instance)
    product = f"{identity.vendor:x}/{identity.product:x}/100"
    name = " ".join(filter(None, (identity.manufacturer, identity.name)))
    devices = (
        (
            usb,
            ("DEVTYPE=usb_device", "SUBSYSTEM=usb", f"PRODUCT={product}"),
            (
                f"idVendor={identity.vendor:04x}",
                f"idProduct={identity.product:04x}",
                "bcdDevice=0100",
                f"product={identity.name}",
                *([f"manufacturer={identity.manufacturer}"] if identity.manufacturer else []),
                *([f"serial={identity.serial_number}"] if identity.serial_number else []),
            ),
        ),
        (interface, ("DEVTYPE=usb_interface", "SUBSYSTEM=usb", f"PRODUCT={product}"), ("bInterfaceNumber=00",)),
        (
            hid,
            (
                "SUBSYSTEM=hid",
                f"HID_ID=0003:{identity.vendor:08X}:{identity.product:08X}",
                f"HID_NAME={name}",
                f"HID_PHYS=usb-{instance}/input0",
                f"HID_UNIQ={identity.serial_number}",
            ),
            (),
        ),
        (node, (f"DEVNAME={node_of(number)}", "SUBSYSTEM=hidraw", "MAJOR=240", f"MINOR={number}"), ()),
    )
    return "\n".join(
        "".join([f"P: {path}\n", *(f"E: {each}\n" for each in properties), *(f"A: {each}\n" for each in attributes)])
        for path, properties, attributes in devices
    )


def ioctls(identity: HidIdentity, number: int) -> str:
    """What the node answers to those that ask for the report descriptor."""
    size = len(identity.report_descriptor).to_bytes(4, "little").hex().upper()
    padded = identity.report_descriptor.ljust(LONGEST_DESCRIPTOR, b"\0").hex().upper()
    return f"@DEV {node_of(number)}\nHIDIOCGRDESCSIZE 0 {size}\nHIDIOCGRDESC 0 {size}{padded}\n"
