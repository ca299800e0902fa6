// The example programs of ws-protocol ask for the protocol by its former name alone; loaded before them.
require("@foxglove/ws-protocol").FoxgloveClient.SUPPORTED_SUBPROTOCOL = "foxglove.sdk.v1";
