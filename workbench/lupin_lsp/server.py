"""The language server: connects the protocol (pygls) with the functions of this package.

Completion must be immediate and uses the last model; hover, definition and rename rebuild it when a text has
changed. After a keystroke the changed file is checked and its findings are published; the other files follow
when typing pauses.
"""

from __future__ import annotations

import asyncio
import gc
import logging
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, TypeVar

from lsprotocol import types as lsp
from pygls import uris
from pygls.exceptions import JsonRpcException
from pygls.lsp.server import LanguageServer

from lupin_engine import __version__
from lupin_engine.errors import Severity
from lupin_engine.missions import forget
from lupin_engine.plugin import Catalog
from lupin_lsp import completion, navigation
from lupin_lsp.folder import Folder, Found, folder_of
from lupin_lsp.hover import hover
from lupin_lsp.navigation import Symbol, mention_under
from lupin_lsp.places import Spanned, definition
from lupin_lsp.problems import Problem, corrected, problem, spelling
from lupin_lsp.rename import Refused, renamable, rename
from lupin_lsp.scan import Scan, scan

NAME = "lupin"
#: How long after a keystroke its file is checked, and after the last one the rest of the folder, in seconds.
#: The first is no more than it takes to see that several keystrokes have come at once.
MOMENT = 0.01
PAUSE = 0.3
#: After how many checks the charts of texts that nobody will see again are forgotten.
MANY = 20

_SEVERITIES = {
    Severity.INFO: lsp.DiagnosticSeverity.Information,
    Severity.WARN: lsp.DiagnosticSeverity.Warning,
    Severity.ERROR: lsp.DiagnosticSeverity.Error,
}
_SYMBOLS = {
    "section": lsp.SymbolKind.Namespace,
    "name": lsp.SymbolKind.Variable,
    "parallel": lsp.SymbolKind.Struct,
    "final": lsp.SymbolKind.Event,
    "history": lsp.SymbolKind.Event,
}
_T = TypeVar("_T")


class LupinServer(LanguageServer):
    """A server for the folders of missions whose files are open."""

    def __init__(self, catalog: Catalog) -> None:
        super().__init__(NAME, __version__, text_document_sync_kind=lsp.TextDocumentSyncKind.Incremental)
        self._catalog = catalog
        self._folders: dict[Path, Folder] = {}
        self._published: dict[Path, set[Path]] = {}
        self._broken: dict[Path, dict[Path, Found]] = {}
        self._uris: dict[Path, str] = {}
        self._checks = 0
        self._near: dict[Path, asyncio.Handle] = {}
        self._far: dict[Path, asyncio.Handle] = {}

    # -- folders -------------------------------------------------------------------------------------------

    def folder(self, path: Path) -> Folder:
        """Return the folder of missions that a file belongs to."""
        at = folder_of(path)
        return self._folders.setdefault(at, Folder(at, self._catalog))

    def changed(self, uri: str) -> None:
        """Take the text of a document, and schedule its check."""
        path = path_of(uri)
        self._uris[path] = uri
        folder = self.folder(path)
        folder.put(path, self.workspace.get_text_document(uri).source)
        self._later(self._near, path, MOMENT, lambda: self._check(folder, path))
        self._later(self._far, folder.path, PAUSE, lambda: self._pause(folder))

    def closed(self, uri: str) -> None:
        """Drop the unsaved text of a document."""
        path = path_of(uri)
        folder = self.folder(path)
        folder.drop(path)
        self._survey(folder)

    def saved_elsewhere(self, uris_: Iterable[str]) -> None:
        """Check folders again in which files were changed outside of the editor."""
        for at in {folder_of(path_of(uri)) for uri in uris_}:
            if at in self._folders:
                self._folders[at].touch()
                self._survey(self._folders[at])

    def _later(
        self, waiting: dict[Path, asyncio.Handle], key: Path, seconds: float, work: Callable[[], None]
    ) -> None:
        if key in waiting:
            waiting[key].cancel()
        waiting[key] = asyncio.get_running_loop().call_later(seconds, work)

    # -- findings ------------------------------------------------------------------------------------------

    def _check(self, folder: Folder, path: Path) -> None:
        if path in folder.open:
            self._checks += 1
            self._publish(folder, path, folder.check(path))

    def _pause(self, folder: Folder) -> None:
        """Do work that a keystroke should not wait for: check the rest of the folder, and collect garbage."""
        if self._checks > MANY:
            self._checks = 0
            forget()
        self._survey(folder)
        gc.collect()

    def _survey(self, folder: Folder) -> None:
        found = {path: list(findings) for path, findings in folder.survey().items()} if folder.open else {}
        self._broken[folder.path] = folder.broken() if folder.open else {}
        for path in [*self._published.get(folder.path, ()), *self._broken[folder.path], *folder.open]:
            found.setdefault(path, [])
        for path, findings in found.items():
            self._publish(folder, path, tuple(findings))

    def _publish(self, folder: Folder, path: Path, found: Found) -> None:
        """Publish the findings of a file; for a missing file only if there are any."""
        text = folder.scan(path)
        broken = self._broken.get(folder.path, {}).get(path, ())
        problems = [self._diagnostic(text, problem(text, finding)) for finding in (*found, *broken)]
        document = self.workspace.text_documents.get(self.uri(path))
        version = document.version if document else None
        self.text_document_publish_diagnostics(
            lsp.PublishDiagnosticsParams(self.uri(path), problems, version=version)
        )
        published = self._published.setdefault(folder.path, set())
        (published.add if problems else published.discard)(path)

    def _diagnostic(self, text: Scan, found: Problem) -> lsp.Diagnostic:
        return lsp.Diagnostic(
            self.range(text, found.start, found.end),
            found.message,
            severity=_SEVERITIES[found.finding.severity],
            code=found.finding.rule,
            source=NAME,
            tags=[lsp.DiagnosticTag.Unnecessary] if found.unused else None,
        )

    # -- places --------------------------------------------------------------------------------------------

    def uri(self, path: Path) -> str:
        """Return the client's URI of a file."""
        return self._uris.get(path) or uris.from_fs_path(str(path)) or path.as_uri()

    def offset(self, text: Scan, position: lsp.Position) -> int:
        """Return the offset of a position of the client."""
        lines = text.lines
        if position.line >= len(lines.starts):
            return len(text.text)
        row = text.text[lines.starts[position.line] : lines.end(position.line)]
        if row.isascii():
            return lines.offset(position.line, position.character)
        units = self.workspace.position_codec.client_num_units
        column = next((n for n in range(len(row)) if units(row[:n]) >= position.character), len(row))
        return lines.offset(position.line, column)

    def range(self, text: Scan, start: int, end: int) -> lsp.Range:
        """Return a range in the client's coordinates."""
        return lsp.Range(self._position(text, start), self._position(text, end))

    def _position(self, text: Scan, offset: int) -> lsp.Position:
        line, column = text.lines.position(offset)
        begin = text.lines.starts[line]
        units = self.workspace.position_codec.client_num_units(text.text[begin : begin + column])
        return lsp.Position(line, units)

    def location(self, folder: Folder, place: Spanned) -> lsp.Location:
        """Return a piece of a file, of this folder or another."""
        inside = folder_of(place.file) == folder.path
        text = folder.scan(place.file) if inside else scan(place.file.read_text(encoding="utf-8"))
        return lsp.Location(self.uri(place.file), self.range(text, place.start, place.end))

    def at(self, document: lsp.TextDocumentIdentifier, position: lsp.Position) -> tuple[Folder, Path, int]:
        """Return the folder, the file and the offset of a request."""
        path = path_of(document.uri)
        folder = self.folder(path)
        return folder, path, self.offset(folder.scan(path), position)


def path_of(uri: str) -> Path:
    """Return the file of a document's URI."""
    return Path(uris.to_fs_path(uri) or uri)


def serve(catalog: Catalog, stdout: BinaryIO) -> None:
    """Serve the editor that started this process, until it ends.

    Garbage is collected when typing pauses, not in the middle of a keystroke: every check leaves a chart
    behind. In `benchmarks/editor.py` the findings are there after 27 ms (slowest 48), with automatic
    collection after 40 ms (slowest 330).
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    logging.getLogger("pygls.protocol.json_rpc").addFilter(_is_no_refusal)
    make_server(catalog).start_io(stdout=stdout)


def make_server(catalog: Catalog) -> LupinServer:
    """Return a server with the catalog of these plugins."""
    server = LupinServer(catalog)
    _watch_documents(server)
    _answer_completion(server)
    _answer_questions(server)
    _answer_rename(server)
    return server


def _watch_documents(server: LupinServer) -> None:
    @server.feature(lsp.INITIALIZED)
    async def initialized(_: lsp.InitializedParams) -> None:
        await _watch_files(server)

    @server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)
    def opened(params: lsp.DidOpenTextDocumentParams) -> None:
        server.changed(params.text_document.uri)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)
    def changed(params: lsp.DidChangeTextDocumentParams) -> None:
        server.changed(params.text_document.uri)

    @server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)
    def closed(params: lsp.DidCloseTextDocumentParams) -> None:
        server.closed(params.text_document.uri)

    @server.feature(lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def saved_elsewhere(params: lsp.DidChangeWatchedFilesParams) -> None:
        server.saved_elsewhere(change.uri for change in params.changes)


def _answer_completion(server: LupinServer) -> None:
    options = lsp.CompletionOptions(trigger_characters=[".", " ", "{", "(", "'", '"', "-"])

    @server.feature(lsp.TEXT_DOCUMENT_COMPLETION, options)
    def complete(params: lsp.CompletionParams) -> lsp.CompletionList:
        folder, path, offset = server.at(params.text_document, params.position)
        if folder.model is None:
            folder.refresh()
        offers = completion.complete(folder, path, offset)
        span = server.range(folder.scan(path), offers.start, max(offers.end, offset))
        return lsp.CompletionList(
            is_incomplete=False,
            items=[
                lsp.CompletionItem(
                    offer.label,
                    kind=offer.kind,
                    detail=offer.detail or None,
                    documentation=_markdown(offer.doc) if offer.doc else None,
                    sort_text=f"{index:04}",
                    text_edit=lsp.TextEdit(span, offer.insert or offer.label),
                )
                for index, offer in enumerate(offers.found)
            ],
        )


def _answer_questions(server: LupinServer) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_HOVER)
    def hovered(params: lsp.HoverParams) -> lsp.Hover | None:
        folder, path, offset = server.at(params.text_document, params.position)
        folder.refresh()
        found = hover(folder, path, offset)
        if found is None:
            return None
        return lsp.Hover(_markdown(found.text), server.range(folder.scan(path), found.start, found.end))

    @server.feature(lsp.TEXT_DOCUMENT_DEFINITION)
    def defined(params: lsp.DefinitionParams) -> list[lsp.Location]:
        folder, path, offset = server.at(params.text_document, params.position)
        folder.refresh()
        mention = mention_under(folder, path, offset)
        found = definition(folder, path, mention) if mention else []
        return [server.location(folder, place) for place in found]

    @server.feature(lsp.TEXT_DOCUMENT_REFERENCES)
    def referred(params: lsp.ReferenceParams) -> list[lsp.Location]:
        folder, path, offset = server.at(params.text_document, params.position)
        folder.refresh()
        mention = mention_under(folder, path, offset)
        found = navigation.references(folder, path, mention) if mention else []
        wanted = [each for each in found if params.context.include_declaration or not each.mention.declares]
        return [server.location(folder, place) for place in navigation.spans(wanted)]

    @server.feature(lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL)
    def outlined(params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
        path = path_of(params.text_document.uri)
        folder = server.folder(path)
        text = folder.scan(path)
        return [_symbol(server, text, symbol) for symbol in navigation.outline(folder, path)]

    @server.feature(
        lsp.TEXT_DOCUMENT_CODE_ACTION, lsp.CodeActionOptions(code_action_kinds=[lsp.CodeActionKind.QuickFix])
    )
    def mended(params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
        path = path_of(params.text_document.uri)
        text = server.folder(path).scan(path)
        ours = [found for found in params.context.diagnostics if found.source == NAME]
        return [fix for found in ours for fix in _fixes(server, params.text_document.uri, text, found)]


def _answer_rename(server: LupinServer) -> None:
    @server.feature(lsp.TEXT_DOCUMENT_PREPARE_RENAME)
    def prepare(params: lsp.PrepareRenameParams) -> lsp.PrepareRenamePlaceholder:
        folder, path, offset = server.at(params.text_document, params.position)
        folder.refresh()
        with_reason = _or_refuse(lambda: renamable(folder, path, offset))
        span = server.range(folder.scan(path), with_reason.start, with_reason.end)
        return lsp.PrepareRenamePlaceholder(span, with_reason.name)

    @server.feature(lsp.TEXT_DOCUMENT_RENAME, lsp.RenameOptions(prepare_provider=True))
    def renamed(params: lsp.RenameParams) -> lsp.WorkspaceEdit:
        folder, path, offset = server.at(params.text_document, params.position)
        folder.refresh()
        edits = _or_refuse(lambda: rename(folder, path, offset, params.new_name))
        return lsp.WorkspaceEdit(
            changes={
                server.uri(file): [
                    lsp.TextEdit(server.range(folder.scan(file), edit.start, edit.end), edit.text)
                    for edit in found
                ]
                for file, found in edits.items()
            }
        )


def _or_refuse(work: Callable[[], _T]) -> _T:
    """Return the result of a call; its refusal becomes the error that the client shows."""
    try:
        return work()
    except Refused as reason:
        raise JsonRpcException(str(reason), lsp.LSPErrorCodes.RequestFailed) from reason


def _is_no_refusal(said: logging.LogRecord) -> bool:
    """Filter refusals out of the log, since the client shows them; pygls would log their tracebacks."""
    error = said.exc_info[1] if said.exc_info else None
    return not isinstance(getattr(error, "__cause__", None), Refused)


async def _watch_files(server: LupinServer) -> None:
    """Ask the client to report files changed by other programs."""
    workspace = server.client_capabilities.workspace
    watching = workspace.did_change_watched_files if workspace else None
    if watching is None or not watching.dynamic_registration:
        return
    options = lsp.DidChangeWatchedFilesRegistrationOptions([lsp.FileSystemWatcher("**/*.yaml")])
    wanted = lsp.Registration("lupin-files", lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES, options)
    await server.client_register_capability_async(lsp.RegistrationParams([wanted]))


def _markdown(text: str) -> lsp.MarkupContent:
    return lsp.MarkupContent(lsp.MarkupKind.Markdown, text)


def _symbol(server: LupinServer, text: Scan, symbol: Symbol) -> lsp.DocumentSymbol:
    return lsp.DocumentSymbol(
        symbol.name,
        _SYMBOLS.get(symbol.kind, lsp.SymbolKind.Class),
        server.range(text, symbol.start, symbol.end),
        server.range(text, symbol.name_start, symbol.name_end),
        detail=symbol.detail or None,
        children=[_symbol(server, text, child) for child in symbol.children],
    )


def _fixes(server: LupinServer, uri: str, text: Scan, found: lsp.Diagnostic) -> Iterator[lsp.CodeAction]:
    """Yield the quick fix for a misspelt word."""
    meant = spelling(found.message)
    if meant:
        start, end = (server.offset(text, each) for each in (found.range.start, found.range.end))
        edit = lsp.TextEdit(found.range, corrected(text.text[start:end], meant))
        yield lsp.CodeAction(
            f"Change to {meant!r}",
            kind=lsp.CodeActionKind.QuickFix,
            diagnostics=[found],
            edit=lsp.WorkspaceEdit(changes={uri: [edit]}),
            is_preferred=True,
        )
