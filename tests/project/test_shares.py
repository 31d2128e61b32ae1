"""How tests are dealt out to workers."""

from dataclasses import dataclass

from shares import dealt


@dataclass(frozen=True)
class Item:
    path: str
    name: int
    slow: bool

    def get_closest_marker(self, name):
        return (name == "slow" and self.slow) or None


# Modules in the order in which they are collected, with as many tests; capitals have a slow one.
ITEMS = [
    Item(path=module, name=k, slow=module.isupper() and k == 1)
    for module, count in {"a": 20, "B": 4, "c": 5, "D": 9, "e": 30, "F": 3, "G": 2}.items()
    for k in range(count)
]


def test_each_share_begins_with_modules_that_have_slow_tests():
    workers = 3
    found = dealt(ITEMS, workers)
    assert sorted(found, key=ITEMS.index) == ITEMS  # none is lost
    began, size = [], 0
    for left in range(workers, 0, -1):  # as pytest-xdist cuts what is left
        began.append(found[size].path)
        size += (len(found) - size) // left
    assert began == ["B", "D", "F", "G"][:workers]
    order = [item.path for k, item in enumerate(found) if item.path != found[k - 1].path]
    assert all(order.count(heavy) == 1 for heavy in "BDFG")  # with fixtures of their own
