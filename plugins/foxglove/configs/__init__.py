"""The layouts."""

OTHERS = {
    "foxglove-layout.json": "layout of Foxglove for an exported recording",
    "foxglove-live-layout.json": "layout of Foxglove for weberlink bridge foxglove",
}
