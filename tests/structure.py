"""The house in figures: ``python -m tests.structure [FOLDER]`` measures a checkout.

Only :mod:`ast` is used, nothing is imported: an older checkout is measured by the same ruler.
"""

import ast
import sys
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

FLOORS = ("grammars", "templates", "daemon", "scenario_tui")
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


class Module:
    """One file: its text, its tree and what it is called."""

    def __init__(self, path, top):
        parts = path.relative_to(top).with_suffix("").parts
        self.is_package = parts[-1] == "__init__"
        self.name = ".".join(parts[:-1] if self.is_package else parts)
        self.text = path.read_text(encoding="utf-8")
        self.lines = self.text.splitlines()
        self.tree = ast.parse(self.text)

    @property
    def header(self):
        """Lines of docstring, imports and ``__all__`` ahead of and among the code."""
        heads = [n for n in self.tree.body if _is_header(n)]
        return sum((n.end_lineno or n.lineno) - n.lineno + 1 for n in heads)

    @property
    def code(self):
        """Lines that are neither blank nor only a comment."""
        return sum(bool(s) and not s.startswith("#") for s in map(str.strip, self.lines))

    @property
    def comments(self):
        """Lines that are only a comment."""
        return sum(line.strip().startswith("#") for line in self.lines)

    def libraries(self):
        """Top names of everything that is imported anywhere, also by ``import_module``."""
        found = set()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
                found.add(node.module)
            elif isinstance(node, ast.Call) and _called(node) in ("import_module", "__import__"):
                found |= {arg.value for arg in node.args if isinstance(arg, ast.Constant)}
        return {str(name).partition(".")[0] for name in found}

    def imports(self, known):
        """Modules of ours that this one imports anywhere, for type checkers only as well."""
        found = set()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    inner = f"{node.module}.{alias.name}"
                    found.add(inner if inner in known else node.module)
        return (found & known) - {self.name}


def _called(call):
    """Return the last part of the name of what is called."""
    function = call.func
    return getattr(function, "attr", "") or getattr(function, "id", "")


def _is_header(node):
    if isinstance(node, ast.Import | ast.ImportFrom):
        return True
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant)
    if isinstance(node, ast.If):
        return isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
    if isinstance(node, ast.Assign):
        return any(isinstance(t, ast.Name) and t.id == "__all__" for t in node.targets)
    return False


def circles(graph):
    """Groups of modules each of which imports, over others, every module of its group."""
    reach = {name: _reachable(graph, name) for name in graph}
    groups = {frozenset(n for n in reach[name] if name in reach[n]) for name in graph}
    return sorted(sorted(group) for group in groups if len(group) > 1)


def _reachable(graph, start):
    seen = set()
    waiting = [start]
    while waiting:
        fresh = graph[waiting.pop()] - seen
        seen |= fresh
        waiting += fresh
    return seen


def _long(module):
    for node in ast.walk(module.tree):
        if isinstance(node, _FUNCTIONS):
            yield f"{module.name}:{node.name}", (node.end_lineno or 0) - node.lineno + 1


def _exported(package):
    for node in package.tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.List | ast.Tuple):
            targets = [t.id for t in node.targets if isinstance(t, ast.Name)]
            if targets == ["__all__"]:
                return len(node.value.elts)
    return 0


def _spread(values):
    quantiles = np.percentile(values, (50, 90)).astype(int)
    return f"median {quantiles[0]}, 90 % {quantiles[1]}, largest {max(values)}"


def read_modules(top):
    """All modules of the product in a checkout, packages included."""
    return [Module(p, top) for floor in FLOORS for p in sorted((top / floor).rglob("*.py"))]


def import_graph(modules):
    """Which module of ours imports which, wherever in it the import stands."""
    known = {module.name for module in modules}
    return {module.name: module.imports(known) for module in modules}


def class_homes(modules):
    """The modules that define a class of each name."""
    homes = defaultdict(list)
    for module in modules:
        for node in ast.walk(module.tree):
            if isinstance(node, ast.ClassDef):
                homes[node.name].append(module.name)
    return dict(homes)


def main(top):
    modules = read_modules(top)
    files = [module for module in modules if len(module.lines) > 1]
    graph = import_graph(modules)
    functions = dict(entry for module in modules for entry in _long(module))
    lines = dict.fromkeys(FLOORS, 0)
    crowded = []
    for module in modules:
        lines[module.name.partition(".")[0]] += len(module.lines)
        for node in ast.walk(module.tree):
            if isinstance(node, ast.ClassDef):
                methods = sum(isinstance(n, _FUNCTIONS) for n in node.body)
                if methods > 20:
                    crowded.append(f"{module.name}:{node.name} {methods}")
    rooms = Counter(m.name.rpartition(".")[0] for m in modules if not m.is_package)
    packages = {m.name: _exported(m) for m in modules if m.is_package}
    code = sum(module.code for module in modules)
    print(f"modules        {len(modules)} in {len(packages)} packages; {_total(lines)}")
    print(f"module lines   {_spread([len(m.lines) for m in files])}")
    print(f"function lines {_spread(list(functions.values()))}")
    print(f"header share   {sum(m.header for m in modules) / sum(lines.values()):.1%}")
    print(
        f"comments       {100 * sum(m.comments for m in modules) / code:.1f} per 100 lines of code"
    )
    print(f"under 60 lines {sum(len(m.lines) < 60 for m in modules if not m.is_package)} modules")
    print("rooms a floor  " + ", ".join(f"{f} {_rooms(packages, f)}" for f in FLOORS))
    print("names a face   " + _spread([n for n in packages.values() if n]))
    print("files a room   " + _spread(list(rooms.values())))
    _show("import circles", [", ".join(c) for c in circles(graph)])
    _show("functions over 60 lines", [f"{n} {k}" for n, k in functions.items() if k > 60])
    _show("classes over 20 methods", crowded)
    shared = {n: w for n, w in class_homes(modules).items() if len(w) > 1}
    _show("class names used twice", [f"{n}: {', '.join(w)}" for n, w in sorted(shared.items())])


def _rooms(packages, floor):
    return sum(name.startswith(f"{floor}.") for name in packages)


def _total(lines):
    parts = ", ".join(f"{floor} {count}" for floor, count in lines.items())
    return f"{sum(lines.values())} lines ({parts})"


def _show(title, found):
    print(f"{title}: {len(found)}")
    for line in found:
        print(f"    {line}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else ".").resolve())
