"""Files of tests that take long are begun first."""

from types import SimpleNamespace

from tests.file_order import LONG, ROOT, order_by_file


def test_the_files_that_take_long_are_there():
    assert [name for name in LONG if not (ROOT / name).is_file()] == []
    assert len(set(LONG)) == len(LONG)


def test_they_come_first_and_then_the_files_with_most_tests():
    begun = ["a.py", "b.py", LONG[1], "b.py", LONG[0], "b.py", "c.py"]
    items = [SimpleNamespace(path=ROOT / name, number=n) for n, name in enumerate(begun)]
    order_by_file(items)
    assert [item.number for item in items] == [4, 2, 1, 3, 5, 0, 6]
