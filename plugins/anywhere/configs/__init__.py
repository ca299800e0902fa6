OTHERS = {"relay/": "a relay of one's own: mailbox and TURN server"}
