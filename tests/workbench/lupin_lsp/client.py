"""A small client of language servers: JSON-RPC over the standard streams of a process."""

from __future__ import annotations

import itertools
import json
import os
import queue
import subprocess
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: How long one answer may take on a busy machine, in seconds.
PATIENCE = 90.0

Message = dict[str, Any]


class ServerError(Exception):
    """The server answered with an error."""


class Client:
    """One server, started for one folder."""

    def __init__(self, command: list[str], root: Path, capabilities: Message | None = None) -> None:
        self.root = root
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, cwd=root
        )
        self._numbers = itertools.count(1)
        self._versions: dict[str, int] = {}
        self._incoming: queue.Queue[Message | None] = queue.Queue()
        self._waiting: list[Message] = []
        self._settings: Message = {}
        threading.Thread(target=self._read, daemon=True).start()
        self.capabilities = self.request(
            "initialize",
            {"processId": None, "rootUri": root.as_uri(), "capabilities": capabilities or {}},
        )["capabilities"]
        self.notify("initialized", {})

    # -- messages ------------------------------------------------------------------------------------------

    def request(self, method: str, params: Message) -> Any:
        """Ask and return the answer."""
        number = next(self._numbers)
        self._send({"id": number, "method": method, "params": params})
        answer = self.wait(lambda message: message.get("id") == number and "method" not in message)
        if "error" in answer:
            raise ServerError(answer["error"]["message"])
        return answer.get("result")

    def notify(self, method: str, params: Message) -> None:
        """Tell something."""
        self._send({"method": method, "params": params})

    def wait(self, wanted: Callable[[Message], bool]) -> Message:
        """Return the first message that is wanted, now or before; what it overtakes is kept."""
        for index, message in enumerate(self._waiting):
            if wanted(message):
                return self._waiting.pop(index)
        while True:
            message = self._incoming.get(timeout=PATIENCE)
            if message is None:
                raise ServerError("the server has ended")
            if wanted(message):
                return message
            if "id" in message and "method" in message:
                self._answer(message)
            else:
                self._waiting.append(message)

    def settings(self, settings: Message) -> None:
        """Set what the server is told when it asks for its configuration."""
        self._settings = settings
        self.notify("workspace/didChangeConfiguration", {"settings": settings})

    def _answer(self, message: Message) -> None:
        """Answer a question of the server."""
        result: Any = None
        if message["method"] == "workspace/configuration":
            result = [self._settings.get(item.get("section", "")) for item in message["params"]["items"]]
        self._send({"id": message["id"], "result": result})

    def _send(self, message: Message) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        assert self._process.stdin is not None
        self._process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self._process.stdin.flush()

    def _read(self) -> None:
        stream = self._process.stdout
        assert stream is not None
        while True:
            length = 0
            while (line := stream.readline().strip()) != b"":
                name, _, value = line.partition(b":")
                length = int(value) if name.lower() == b"content-length" else length
            if not length:
                break
            self._incoming.put(json.loads(stream.read(length)))
        self._incoming.put(None)

    @property
    def errors(self) -> str:
        """What the server has written to standard error."""
        return os.pread(self._errors.fileno(), 1 << 20, 0).decode()

    def close(self) -> int:
        """End the server as editors do; return its exit code."""
        try:
            self.request("shutdown", {})
            self.notify("exit", {})
            return self._process.wait(PATIENCE)
        finally:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdin, self._process.stdout, self._errors):
                assert stream is not None
                stream.close()

    # -- documents -----------------------------------------------------------------------------------------

    def open(self, path: Path, text: str | None = None, language: str = "yaml") -> None:
        """Open a file, with another text than it has."""
        text = path.read_text(encoding="utf-8") if text is None else text
        self._versions[path.as_uri()] = 1
        document = {"uri": path.as_uri(), "languageId": language, "version": 1, "text": text}
        self.notify("textDocument/didOpen", {"textDocument": document})

    def change(self, path: Path, text: str) -> int:
        """Replace the text of a file; return its version."""
        return self.edit(path, [{"text": text}])

    def edit(self, path: Path, changes: list[Message]) -> int:
        """Change pieces of a file; return its version."""
        self._versions[path.as_uri()] += 1
        version = self._versions[path.as_uri()]
        document = {"uri": path.as_uri(), "version": version}
        self.notify("textDocument/didChange", {"textDocument": document, "contentChanges": changes})
        return version

    def ask(self, what: str, path: Path, line: int, character: int, **more: Any) -> Any:
        """Ask about a place in a file."""
        position = {"line": line, "character": character}
        params = {"textDocument": {"uri": path.as_uri()}, "position": position, **more}
        return self.request(f"textDocument/{what}", params)

    def diagnostics(self, path: Path, version: int | None = None) -> list[Message]:
        """Return the next findings of a file, of a version of it when there is one."""

        def wanted(message: Message) -> bool:
            return _tells(message, path) and version in (None, message["params"].get("version"))

        found: list[Message] = self.wait(wanted)["params"]["diagnostics"]
        return found

    def until_found(self, path: Path) -> list[Message]:
        """Wait until something is found in a file, and return it."""
        told = self.wait(lambda message: _tells(message, path) and bool(message["params"]["diagnostics"]))
        found: list[Message] = told["params"]["diagnostics"]
        return found

    def last_diagnostics(self, path: Path) -> list[Message]:
        """Return the findings of a file that were told last: what comes before an answer was told before."""
        self.request("textDocument/documentSymbol", {"textDocument": {"uri": path.as_uri()}})
        *_, last = [message["params"]["diagnostics"] for message in self._waiting if _tells(message, path)]
        return list(last)


def _tells(message: Message, path: Path) -> bool:
    """Say whether a message is about what is found in a file."""
    about = message.get("method") == "textDocument/publishDiagnostics"
    return about and bool(message["params"]["uri"] == path.as_uri())


def at(text: str, marked: str) -> tuple[int, int]:
    """Return line and column of the `|` in a piece of a text, whose first occurrence is meant."""
    offset = text.index(marked.replace("|", "", 1)) + marked.index("|")
    line = text.count("\n", 0, offset)
    return line, offset - (text.rfind("\n", 0, offset) + 1)
