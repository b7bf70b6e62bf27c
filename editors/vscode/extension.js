// Starts `lupin lsp` for the YAML of the folder that is open. All that it knows is in the server.
"use strict";

const path = require("path");
const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

// A command with a slash is meant from the folder that is open, so that a project can name its own .venv.
function command(folder) {
  const named = workspace.getConfiguration("lupin").get("command");
  return folder && /[/\\]/.test(named) ? path.resolve(folder, named) : named;
}

exports.activate = async () => {
  const folder = workspace.workspaceFolders?.[0]?.uri.fsPath;
  client = new LanguageClient(
    "lupin",
    "Lupin missions",
    { command: command(folder), args: ["lsp"], options: { cwd: folder } },
    { documentSelector: [{ scheme: "file", language: "yaml" }] },
  );
  await client.start();
};

exports.deactivate = () => client?.stop();
