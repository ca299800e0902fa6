"""What keeps a delayed loop stable: energy tanks with passivity controllers, and a model rendered at the operator.

Pure, and next to the codec and the protocol without knowing either: it sees forces, positions, energies and the
measured delay. `weberlink.control.table` lists the schemes; both sides of a scheme are built from it.
"""
