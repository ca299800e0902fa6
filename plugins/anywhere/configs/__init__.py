"""The file of two hosts, and the relay."""

OTHERS = {"relay/": "a relay of one's own: mailbox and TURN server"}
