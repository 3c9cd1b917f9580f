"""The files of tests that take long, and that are therefore begun first.

A file is the work of one process of the tests. Begun last, a file of half a minute leaves every
other processor without work until it is done.
"""

from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parent

LONG = (
    "daemon/batch/worker/test_kept_results.py",
    "daemon/batch/worker/test_dask.py",
    "daemon/batch/worker/test_worker.py",
    "daemon/batch/test_survival.py",
    "daemon/batch/worker/test_other_ledgers.py",
    "daemon/batch/worker/test_unusable_spool.py",
    "daemon/batch/worker/test_inputs_on_their_way.py",
    "daemon/search/test_client.py",
    "scenario_tui/cli/test_run_limits.py",
    "daemon/batch/test_cuts.py",
    "scenario_tui/terminal/test_first_hour.py",
    "scenario_tui/dashboard/test_dashboard.py",
    "language_docs/test_tutorials.py",
    "scenario_tui/cli/test_examples.py",
    "scenario_tui/test_pytest_plugin.py",
    "scenario_tui/dashboard/test_terminal.py",
    "scenario_tui/cli/test_build_servers.py",
    "scenario_tui/test_pictures.py",
    "daemon/analysis/blame/test_saving.py",
    "daemon/batch/test_chaos.py",
    "daemon/batch/worker/test_process_trees.py",
    "grammars/errors/test_errors.py",
    "scenario_tui/cli/test_verify.py",
    "daemon/batch/test_quota.py",
    "scenario_tui/cli/test_real_runs.py",
    "scenario_tui/cli/test_real_parts.py",
    "scenario_tui/dashboard/test_children.py",
    "scenario_tui/dashboard/test_driving_for_real.py",
    "scenario_tui/dashboard/test_poisoned.py",
    "scenario_tui/cli/test_real_search.py",
    "daemon/model/test_kernels.py",
)
"""By how long they take, beside three others: from a minute to 5 s. Most have few tests."""


def order_by_file(items):
    """Put the files that take long first, the others by how many tests they have; in place."""
    ranks = {ROOT / name: rank for rank, name in enumerate(LONG)}
    sizes = Counter(item.path for item in items)
    items.sort(key=lambda item: (ranks.get(item.path, len(LONG)), -sizes[item.path]))
