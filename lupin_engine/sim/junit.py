"""The results of scenarios as JUnit's XML, which every CI server reads."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree

from lupin_engine.sim.suite import ScenarioResult

#: What XML 1.0 cannot hold.
_UNWRITABLE = dict.fromkeys({*range(32)} - {9, 10, 13})


def junit(results: Sequence[ScenarioResult]) -> str:
    """Return the report: a case for each scenario, its folder as the class."""
    root = ElementTree.Element("testsuites")
    suite = ElementTree.SubElement(
        root,
        "testsuite",
        name="lupin",
        tests=str(len(results)),
        failures=str(sum(1 for result in results if result.failures)),
        errors=str(sum(1 for result in results if result.problem)),
        time=f"{sum(result.took for result in results):.3f}",
    )
    for result in results:
        _add(suite, result)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _add(suite: ElementTree.Element, result: ScenarioResult) -> None:
    folder = ".".join(part for part in result.file.parent.parts if part not in ("/", "."))
    place = {"classname": folder or "scenarios", "file": str(result.file)}
    case = ElementTree.SubElement(suite, "testcase", place, name=result.name, time=f"{result.took:.3f}")
    if result.problem:
        first = result.problem.splitlines()[0].translate(_UNWRITABLE)
        ElementTree.SubElement(case, "error", message=first).text = result.problem.translate(_UNWRITABLE)
    for failure in result.failures:
        message = f"{failure.what}: expected {failure.expected}, got {failure.actual}"
        told = ElementTree.SubElement(case, "failure", message=message.translate(_UNWRITABLE))
        told.text = str(failure).translate(_UNWRITABLE)
