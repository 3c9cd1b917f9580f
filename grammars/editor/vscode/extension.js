// Shows the problems of `scenario check FILE --json` when a file is opened and saved, and offers
// the check as a task. Plain JavaScript: no build step, no dependencies.
"use strict";

const { execFile } = require("node:child_process");
const path = require("node:path");
const vscode = require("vscode");

const LANGUAGES = new Set(["fpm", "scenery", "variation"]);
const FILE_NAMES = /(^|\.)(campaign|mission|oracles|walls)\.ya?ml$/;
const MODELINE = /^#\s*yaml-language-server:.*\b(campaign|mission|robot|sut|oracles|walls)\.schema\.json/m;
const TIME_LIMIT = 60_000; // milliseconds

/** Return whether `scenario check` can check a document. */
function isOurs(document) {
  if (document.uri.scheme !== "file") return false;
  if (LANGUAGES.has(document.languageId)) return true;
  if (document.languageId !== "yaml") return false;
  return FILE_NAMES.test(path.basename(document.uri.fsPath)) || MODELINE.test(document.getText());
}

function folderOf(uri) {
  return vscode.workspace.getWorkspaceFolder(uri)?.uri.fsPath ?? path.dirname(uri.fsPath);
}

function commandFor(uri) {
  const command = vscode.workspace.getConfiguration("scenario", uri).get("command", "scenario");
  // A bare name is looked up on the PATH, anything with a separator in the workspace folder.
  return /[\\/]/.test(command) ? path.resolve(folderOf(uri), command) : command;
}

/** Turn the output of `scenario check --json` into [absolute file, diagnostic] pairs. */
function problemsOf(report, folder) {
  return Object.values(report.files ?? {})
    .flat()
    .map((finding) => {
      const line = Math.max(finding.where.line - 1, 0);
      const column = Math.max(finding.where.column - 1, 0);
      // An empty range is drawn below the word it stands in.
      const range = new vscode.Range(line, column, line, column);
      const message = finding.hint ? `${finding.message}\n${finding.hint}` : finding.message;
      const severity = vscode.DiagnosticSeverity[finding.severity === "warning" ? "Warning" : "Error"];
      const diagnostic = new vscode.Diagnostic(range, message, severity);
      diagnostic.source = "scenario";
      return [path.resolve(folder, finding.where.file), diagnostic];
    });
}

/** Checker of documents that shows the problems; a campaign includes those of its layers. */
class Checker {
  constructor(collection, log) {
    this.collection = collection;
    this.log = log;
    this.problems = new Map(); // checked file -> [file, diagnostic] pairs
    this.running = new Map(); // checked file -> child process
  }

  check(document) {
    const file = document.uri.fsPath;
    const folder = folderOf(document.uri);
    this.stop(file);
    return new Promise((done) => {
      const child = execFile(
        commandFor(document.uri),
        ["check", "--json", file],
        { cwd: folder, timeout: TIME_LIMIT, maxBuffer: 16 * 1024 * 1024 },
        (error, stdout, stderr) => {
          // A later check of the same file has replaced this one.
          if (this.running.get(file) === child) {
            this.running.delete(file);
            this.take(file, folder, error, stdout, stderr);
          }
          done();
        },
      );
      this.running.set(file, child);
    });
  }

  /** End the check of a file, if one runs. */
  stop(file) {
    const child = this.running.get(file);
    // A command that could not be started has no pid; Node would signal pid 0, which is
    // everything in the process group of the editor.
    if (child?.pid) child.kill();
  }

  take(file, folder, error, stdout, stderr) {
    let report;
    try {
      report = JSON.parse(stdout);
    } catch {
      this.log.appendLine(`scenario check ${file} gave no answer: ${error ?? ""}\n${stderr}`);
      if (error?.code === "ENOENT") {
        this.log.appendLine('Say where the command is with the setting "scenario.command".');
      }
      return;
    }
    this.problems.set(file, problemsOf(report, folder));
    this.publish();
  }

  forget(document) {
    this.stop(document.uri.fsPath);
    this.running.delete(document.uri.fsPath);
    if (this.problems.delete(document.uri.fsPath)) this.publish();
  }

  /** Show each problem once, also when a campaign and an open layer both report it. */
  publish() {
    const byFile = new Map();
    for (const [file, diagnostic] of [...this.problems.values()].flat()) {
      const key = `${diagnostic.range.start.line}:${diagnostic.range.start.character}:${diagnostic.message}`;
      if (!byFile.has(file)) byFile.set(file, new Map());
      byFile.get(file).set(key, diagnostic);
    }
    this.collection.clear();
    for (const [file, diagnostics] of byFile) {
      this.collection.set(vscode.Uri.file(file), [...diagnostics.values()]);
    }
  }
}

function taskFor(definition, scope, folder) {
  const command = commandFor(folder);
  const execution = new vscode.ShellExecution(command, ["check", definition.file]);
  const name = `check ${definition.file}`;
  return new vscode.Task(definition, scope, name, "scenario", execution, "$scenario");
}

const taskProvider = {
  async provideTasks() {
    const files = await vscode.workspace.findFiles("**/{campaign,*.campaign}.yaml", "**/.venv*/**");
    return files.map((uri) => {
      const file = vscode.workspace.asRelativePath(uri, false);
      const scope = vscode.workspace.getWorkspaceFolder(uri) ?? vscode.TaskScope.Workspace;
      return taskFor({ type: "scenario", file }, scope, uri);
    });
  },
  resolveTask(task) {
    const folder = task.scope?.uri ?? vscode.workspace.workspaceFolders?.[0]?.uri;
    if (!task.definition.file || !folder) return undefined;
    return taskFor(task.definition, task.scope ?? vscode.TaskScope.Workspace, folder);
  },
};

function activate(context) {
  const collection = vscode.languages.createDiagnosticCollection("scenario");
  const log = vscode.window.createOutputChannel("Scenario");
  const checker = new Checker(collection, log);
  const checkIfWanted = (document) => {
    const wanted = vscode.workspace.getConfiguration("scenario", document.uri).get("check", true);
    if (wanted && vscode.workspace.isTrusted && isOurs(document)) checker.check(document);
  };
  const checkAll = () => vscode.workspace.textDocuments.forEach(checkIfWanted);
  context.subscriptions.push(
    collection,
    log,
    vscode.workspace.onDidOpenTextDocument(checkIfWanted),
    vscode.workspace.onDidSaveTextDocument(checkIfWanted),
    vscode.workspace.onDidCloseTextDocument((document) => checker.forget(document)),
    vscode.workspace.onDidGrantWorkspaceTrust(checkAll),
    vscode.tasks.registerTaskProvider("scenario", taskProvider),
    vscode.commands.registerCommand("scenario.checkFile", () => {
      const document = vscode.window.activeTextEditor?.document;
      const possible = document?.uri.scheme === "file" && vscode.workspace.isTrusted;
      return possible ? checker.check(document) : undefined;
    }),
  );
  checkAll();
}

module.exports = { activate, deactivate() {} };
