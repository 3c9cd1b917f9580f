"""The files of tests that take long, and that are therefore begun first.

A file is the work of one process of the tests. Begun last, a file of half a minute leaves every
other processor without work until it is done.
"""

from collections import Counter
from pathlib import Path

ROOT = Path(__file__).parent

LONG = (
    "batch/worker/test_kept_results.py",
    "batch/worker/test_dask.py",
    "batch/worker/test_worker.py",
    "batch/test_survival.py",
    "batch/worker/test_other_ledgers.py",
    "batch/worker/test_unusable_spool.py",
    "batch/worker/test_inputs_on_their_way.py",
    "analysis/search/test_client.py",
    "people/cli/test_run_limits.py",
    "batch/test_cuts.py",
    "people/terminal/test_first_hour.py",
    "people/dashboard/test_dashboard.py",
    "docs/test_tutorials.py",
    "people/cli/test_examples.py",
    "people/test_pytest_plugin.py",
    "people/dashboard/test_terminal.py",
    "people/cli/test_build_servers.py",
    "people/pictures/test_pictures.py",
    "analysis/blame/test_saving.py",
    "batch/test_chaos.py",
    "batch/worker/test_process_trees.py",
    "languages/errors/test_errors.py",
    "people/cli/test_verify.py",
    "batch/test_quota.py",
    "people/cli/test_real_runs.py",
    "people/cli/test_real_parts.py",
    "people/dashboard/test_children.py",
    "people/dashboard/test_driving_for_real.py",
    "people/dashboard/test_poisoned.py",
    "people/cli/test_real_search.py",
    "batch/model/test_kernels.py",
)
"""By how long they take, beside three others: from a minute to 5 s. Most have few tests."""


def order_by_file(items):
    """Put the files that take long first, the others by how many tests they have; in place."""
    ranks = {ROOT / name: rank for rank, name in enumerate(LONG)}
    sizes = Counter(item.path for item in items)
    items.sort(key=lambda item: (ranks.get(item.path, len(LONG)), -sizes[item.path]))
