// Runs the extension against a stand-in for VS Code's API and prints what it shows, as JSON.
// node extension_host.js EXTENSION FOLDER FILE LANGUAGE COMMAND TRUST
"use strict";

const fs = require("node:fs");
const Module = require("node:module");
const path = require("node:path");

const [extension, folder, file, languageId, command, trust] = process.argv.slice(2);
const listeners = {};
const shown = {};
const lines = [];
let provider;
const handlers = {};

class Range {
  constructor(line, column, endLine, endColumn) {
    this.start = { line, character: column };
    this.end = { line: endLine, character: endColumn };
  }
}
class Diagnostic {
  constructor(range, message, severity) {
    Object.assign(this, { range, message, severity });
  }
}
class ShellExecution {
  constructor(program, args) {
    Object.assign(this, { program, args });
  }
}
class Task {
  constructor(definition, scope, name, source, execution, matcher) {
    Object.assign(this, { definition, scope, name, source, execution, matcher });
  }
}
const Uri = { file: (fsPath) => ({ scheme: "file", fsPath }) };
const on = (event) => (listener) => {
  listeners[event] = listener;
  return { dispose() {} };
};
const workspaceFolder = { uri: Uri.file(folder), name: "folder", index: 0 };
const vscode = {
  Range,
  Diagnostic,
  ShellExecution,
  Task,
  Uri,
  DiagnosticSeverity: { Error: 0, Warning: 1 },
  TaskScope: { Workspace: 2 },
  languages: {
    createDiagnosticCollection: () => ({
      clear: () => Object.keys(shown).forEach((key) => delete shown[key]),
      set: (uri, found) => (shown[uri.fsPath] = found),
    }),
  },
  window: { createOutputChannel: () => ({ appendLine: (line) => lines.push(line) }) },
  tasks: { registerTaskProvider: (type, given) => ((provider = given), { dispose() {} }) },
  commands: { registerCommand: (name, run) => ((handlers[name] = run), { dispose() {} }) },
  workspace: {
    textDocuments: [],
    isTrusted: trust === "trusted",
    workspaceFolders: [workspaceFolder],
    getWorkspaceFolder: () => workspaceFolder,
    getConfiguration: () => ({ get: (key, usual) => (key === "command" ? command : usual) }),
    asRelativePath: (uri) => path.relative(folder, uri.fsPath),
    findFiles: async () => [Uri.file(path.join(folder, "campaign.yaml"))],
    onDidOpenTextDocument: on("open"),
    onDidSaveTextDocument: on("save"),
    onDidCloseTextDocument: on("close"),
    onDidGrantWorkspaceTrust: on("trust"),
  },
};

const load = Module._load;
Module._load = (name, ...rest) => (name === "vscode" ? vscode : load(name, ...rest));

async function main() {
  require(extension).activate({ subscriptions: [] });
  const document = {
    uri: Uri.file(file),
    languageId,
    getText: () => fs.readFileSync(file, "utf8"),
  };
  vscode.window.activeTextEditor = { document };
  listeners.open(document);
  listeners.save(document); // the second check takes the place of the first
  await new Promise((done) => process.once("beforeExit", done));
  const diagnostics = JSON.parse(JSON.stringify(shown));
  const [task] = await provider.provideTasks();
  const again = provider.resolveTask({ definition: task.definition, scope: workspaceFolder });
  listeners.close(document);
  const answer = { diagnostics, lines, task, again, afterClosing: Object.keys(shown) };
  process.stdout.write(JSON.stringify(answer));
}
main();
