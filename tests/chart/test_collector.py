"""Python's collector of garbage while charts are loaded: off meanwhile, and afterwards as it was."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_engine.missions import load
from lupin_engine.missions.load import check_chart, default_missions_folder, forget, lifecycle_in
from lupin_engine.plugin.registry import Catalog

MISSION = default_missions_folder() / "inspection.yaml"


class Circle:
    """Something that only the collector can remove."""

    def __init__(self) -> None:
        self.itself = self


@pytest.fixture(autouse=True)
def collector() -> Iterator[None]:
    """Begin with the collector on and nothing young or frozen, and leave it so."""
    forget()
    gc.unfreeze()
    gc.collect()
    yield
    gc.unfreeze()
    gc.enable()


def loaded(catalog: Catalog) -> object:
    """Load the shipped mission."""
    chart, _ = check_chart(lifecycle_in(Path(MISSION).parent), [MISSION], catalog)
    assert chart is not None
    return chart


def test_what_was_loaded_is_old_at_once(catalog: Catalog) -> None:
    """The next look, which is at what is young, need not go through a chart."""
    chart = loaded(catalog)
    assert gc.isenabled()
    assert any(found is chart for found in gc.get_objects(generation=2))


def test_garbage_is_found_in_the_end(catalog: Catalog, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python does not count what is made old; we do, and look at all of it when it is much."""
    circle = Circle()
    gone = weakref.ref(circle)
    loaded(catalog)
    del circle
    forget()
    assert gone() is not None
    monkeypatch.setattr(load, "MAX_UNSEEN", 0)
    loaded(catalog)
    assert gone() is None


def test_what_somebody_froze_stays_frozen(catalog: Catalog) -> None:
    """Then the collector is only paused."""
    gc.freeze()
    frozen = gc.get_freeze_count()
    chart = loaded(catalog)
    assert gc.isenabled()
    assert gc.get_freeze_count() > frozen // 2
    assert not any(found is chart for found in gc.get_objects(generation=2))


def test_who_wants_no_collector_gets_none(catalog: Catalog) -> None:
    """It is not turned on behind anybody's back."""
    gc.disable()
    loaded(catalog)
    assert not gc.isenabled()
