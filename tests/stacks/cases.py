"""Files of cases: ``--- NAME``, lines that are given, and lines ``=> …`` that came of them."""


def cases(path):
    """Yield the name of each case and the lines that are given."""
    for case in path.read_text("utf-8").split("--- ")[1:]:
        name, *lines = case.splitlines()
        yield name, [line for line in lines if not line.startswith("=> ")]


def written(case, results):
    """Return the lines of a case with its results."""
    name, lines = case
    return [f"--- {name}", *lines, *(f"=> {result}" for result in results)]
