"""Perceptual coding of haptic samples: quantizer, deadband, predictors, encoder and its mirror decoder.

Pure: no clock, no bytes, no I/O. Time is the sender's tick number; an `Update` holds integers. The scheme is that of
Xu, Kammerl, Chaudhari and Steinbach, "Hybrid signal-based and geometry-based prediction for haptic data reduction",
HAVE 2011 ("the paper" throughout this package).
"""

from weberlink.codec.channel import Channel, force_channel, position_channel
from weberlink.codec.coder import Decoder, Encoder
from weberlink.update import Update

__all__ = ["Channel", "Decoder", "Encoder", "Update", "force_channel", "position_channel"]
