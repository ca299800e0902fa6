"""`weberlink monitor` as a process, for the tests that look at it as a browser or Prometheus does."""

from trials.rig import Command


class Monitor(Command):
    """`monitor`, `try`, which also runs a session, or another server, on any free port if none is given."""

    def __init__(self, *arguments: object, command: str = "monitor") -> None:
        port = () if "--port" in arguments else ("--port", "0")
        super().__init__(*command.split(), *port, *arguments)

    @property
    def url(self) -> str:
        return self.until_said(r"(http://[^ /]+)/#")

    @property
    def address(self) -> str:
        return self.until_said(r"http://\S+#key=\S+")

    @property
    def key(self) -> str:
        return self.address.partition("#key=")[2]
