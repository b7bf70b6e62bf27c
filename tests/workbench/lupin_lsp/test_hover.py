"""What is said of a name, and where it was declared."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_engine.plugin.registry import Catalog
from lupin_lsp.completion import complete
from lupin_lsp.folder import Folder
from lupin_lsp.hover import hover
from lupin_lsp.navigation import mention_under, references
from lupin_lsp.places import definition

INSPECTION, LIFECYCLE, PART = "inspection.yaml", "lifecycle.yaml", "parts/visit_targets.yaml"
NAV = "lupin_nav/catalog.py"

#: file, the name with a `|` in it, what is said of it, where it was declared as `FILE: TEXT OF THE LINE`.
CASES = {
    "a state of the lifecycle": (
        INSPECTION,
        "on_error: FA|ULT",
        ["state FAULT", "lifecycle.yaml"],
        "lifecycle.yaml: FAULT:",
    ),
    "a state of a part": (
        PART,
        "target: SCANNING.REA|DING",
        [
            "state MISSION.InspectionMission.INSPECTING.SCANNING.READING",
            "published as phase SCANNING, does `bridge.read_tag`",
        ],
        "visit_targets.yaml: READING:",
    ),
    "the state around it": (
        PART,
        "target: SCAN|NING.READING",
        ["state MISSION.InspectionMission.INSPECTING.SCANNING"],
        "visit_targets.yaml: SCANNING:",
    ),
    "a state that is asked for": (
        LIFECYCLE,
        "in_state('PREP|ARE')",
        ["state MISSION.InspectionMission.PREPARE"],
        "inspection.yaml: PREPARE:",
    ),
    "history": (
        LIFECYCLE,
        "MISSION.his|tory",
        ["history state"],
        "lifecycle.yaml: history: shallow                       # a divert comes back to the family it left",
    ),
    "a word of the language": (INSPECTION, "not_em|pty", ["**not_empty** — "], ""),
    "one of a few words": (LIFECYCLE, "severity: in|fo", ["**severity** — ", "`info`, `warn`, `error`"], ""),
    "an operation": (
        PART,
        "do: nav.go|_to",
        [
            "operation nav.go_to(pose, max_variance?)",
            "Drive to a pose; refused at once when the robot does not know well enough where it is.",
            "- `pose`: pose {x: length, y: length, yaw: angle} — where to drive, in frame `map`",
            "Fails with: `nav_status_0` (navigation retry)",
            "Uses: base.",
            "A hold cancels it; it is begun again when the hold is released.",
        ],
        f'{NAV}: "go_to": Operation(',
    ),
    "an argument": (
        INSPECTION,
        "{max_va|riance",
        ["`max_variance`: number — largest variance of x, y (m²) and yaw (rad²) that passes"],
        f'{NAV}: "max_variance": Argument(NUMBER, '
        '"largest variance of x, y (m²) and yaw (rad²) that passes"),',
    ),
    "the engine's operation": (
        LIFECYCLE,
        "plugins.rea|dy",
        ["operation plugins.ready()"],
        'plugin/builtin.py: "ready": Operation(',
    ),
    "an action": (
        PART,
        "arm.pre|set",
        ["action arm.preset(name)", "It moves the robot: while held it waits for the release."],
        'lupin_arm/catalog.py: "preset": Action(',
    ),
    "the engine's action": (
        PART,
        "itinerary.adv|ance",
        ["action itinerary.advance()", "Go on to the next target"],
        "",
    ),
    "a function": (
        INSPECTION,
        "tags.na|med(",
        ["tags.named(names: list of text) -> list of tag"],
        f'{NAV}: "tags.named": Function(',
    ),
    "the engine's function": (LIFECYCLE, "kno|wn(input.pose)", ["known(input.NAME) -> bool"], ""),
    "a parameter": (
        PART,
        "param.nav_time|out_s",
        [
            "param.nav_timeout_s: duration in s",
            "longest drive to a target for one attempt",
            "Default: 60 s; range: at least 1 s.",
            "From visit_targets.yaml.",
        ],
        "visit_targets.yaml: nav_timeout_s: {type: duration, default: 60 s, min: 1 s, "
        "summary: longest drive to a target for one attempt}",
    ),
    "a plugin's parameter": (
        INSPECTION,
        "param.tag_se|quence)",
        ["param.tag_sequence: list of text", "From plugin nav."],
        f'{NAV}: "tag_sequence": Parameter(list_of(TEXT), [], '
        '"tags to visit when a request names none; empty: all"),',
    ),
    "a share": (
        LIFECYCLE,
        "param.battery_hyst|eresis",
        ["Default: 0.05; range: 0 to 0.5."],
        "lifecycle.yaml: battery_hysteresis: {type: number, default: 5 %, min: 0 %, max: 50 %, "
        "summary: a low battery must rise this far above the threshold}",
    ),
    "a code": (
        INSPECTION,
        "not_empty: no_|tags",
        ["code no_tags", "no tags to visit (warn)"],
        "inspection.yaml: no_tags: {label: no tags to visit, severity: warn}",
    ),
    "a plugin's code": (
        PART,
        "amcl_drift|_var",
        ["code amcl_drift_var", "localization drifted (warn)"],
        f'{NAV}: "amcl_drift_var",',
    ),
    "a hold": (
        PART,
        "during: pa|use",
        ["hold pause", "Engaged by `operator.pause`, released by `operator.resume`"],
        "lifecycle.yaml: pause:",
    ),
    "an input": (
        LIFECYCLE,
        "guard: input.bat|tery.low",
        ["input.battery: number", "charge of the battery", "Levels: `low`."],
        "lifecycle.yaml: battery:",
    ),
    "a level, as an event": (
        LIFECYCLE,
        "input.battery.lo|w:",
        ["input.battery.low: bool"],
        'lifecycle.yaml: low: {below: "${ param.battery_low_threshold }", '
        'hysteresis: "${ param.battery_hysteresis }"}',
    ),
    "a live value": (
        LIFECYCLE,
        "robot.est|op",
        ["robot.estop: bool", "whether the emergency stop is engaged"],
        f'{NAV}: "robot.estop": LiveValue("whether the emergency stop is engaged", BOOL, initial=False),',
    ),
    "a variable": (
        LIFECYCLE,
        "guard: rea|son ==",
        ["reason: text", "why we are returning", "At start: ''."],
        'lifecycle.yaml: reason: {type: text, default: "", '
        'summary: "why we are returning; kept from entry, never re-read from a live input"}',
    ),
    "a field of the request": (
        INSPECTION,
        "request.tag_s|equence",
        ["request.tag_sequence: list of tag"],
        "inspection.yaml: tag_sequence:",
    ),
    "what an expression reads": (PART, "approach(tar|get)", ["**target** — ", "target: tag {id: text"], ""),
    "a field of it": (PART, "target.i|d", ["target.id: text"], ""),
    "why an operation failed": (PART, "error.co|de", ["error.code: text", "`nav_rejected`"], ""),
    "a part": (
        INSPECTION,
        "use: visit_t|argets",
        ["part visit_targets", "Drive to each target", "Needs: itinerary."],
        "visit_targets.yaml: part: visit_targets",
    ),
    "a type": (
        INSPECTION,
        "list of t|ag",
        ["type tag {id: text, x: length, y: length}"],
        f'{NAV}: types={{"tag": TAG, "quaternion": QUATERNION, "seen_tag": SEEN_TAG}},',
    ),
    "a request": (
        PART,
        "operator.skip_cur|rent",
        ["request operator.skip_current", "The operator skips the current target."],
        "",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_says_what_a_name_means(case: str, folder: Folder) -> None:
    """Type, unit, range, codes and documentation, from wherever they are declared."""
    name, marked, said, _ = CASES[case]
    path = folder.path / name
    found = hover(folder, path, offset_of(folder, path, marked))
    assert found is not None
    assert [piece for piece in said if piece not in found.text] == []


@pytest.mark.parametrize(
    ("guard", "said"),
    [
        ("find(request.tag_sequence, t.|x > '1 m').id == 'a'", "t.x: length"),
        ("any([each.|id == 'a' for each in tags.numeric_order()])", "each.id: text"),
    ],
)
def test_the_element_of_a_loop_has_the_type_of_what_its_list_holds(
    guard: str, said: str, typed: Callable[[str, str, str], tuple[Path, int]], folder: Folder
) -> None:
    """Though no file declares it."""
    path, offset = typed(PART, "guard: itinerary.open              #", f"guard: {guard} #")
    found = hover(folder, path, offset)
    assert found is not None
    assert said in found.text


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("visit_in_or|der: [in_state('PREPARE'), in_state('INSPECTING')]", "none before the one to its left"),
        (
            "visit_all: [in_state('PREPARE'), in_state('INSP|ECTING')]",
            "state MISSION.InspectionMission.INSPECTING",
        ),
    ],
)
def test_a_pattern_and_its_places_are_explained(
    written: str, said: str, typed: Callable[[str, str, str], tuple[Path, int]], folder: Folder
) -> None:
    """The word by its meaning, a place by its state."""
    path, offset = typed(
        INSPECTION, "initial: PREPARE", f"properties: {{tour: {{{written}}}}}\ninitial: PREPARE"
    )
    found = hover(folder, path, offset)
    assert found is not None
    assert said in found.text


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("guard: clo|ck.time > '06:00' #", "What the robot's clock shows"),
        ("guard: clock.ti|me > '06:00' #", "clock.time: time_of_day"),
    ],
)
def test_the_robots_clock_is_explained(
    written: str, said: str, typed: Callable[[str, str, str], tuple[Path, int]], folder: Folder
) -> None:
    """And typed."""
    path, offset = typed(PART, "guard: itinerary.open              #", written)
    found = hover(folder, path, offset)
    assert found is not None
    assert said in found.text


@pytest.mark.parametrize("case", CASES)
def test_leads_to_where_a_name_was_declared(case: str, folder: Folder) -> None:
    """In a file of the folder, or in the catalog of the plugin that offers it."""
    name, marked, _, wanted = CASES[case]
    path = folder.path / name
    mention = mention_under(folder, path, offset_of(folder, path, marked))
    assert mention is not None
    lines = []
    for place in definition(folder, path, mention):
        text = place.file.read_text(encoding="utf-8")
        line = text.splitlines()[text.count("\n", 0, place.start)]
        short = place.file.relative_to(place.file.parents[1]) if place.file.suffix == ".py" else None
        lines.append(f"{short or place.file.name}: {line.strip()}")
    assert lines == ([wanted] if wanted else [])


def test_a_set_leads_to_the_variable(folder: Folder) -> None:
    """The argument of `set` is no argument."""
    path = folder.lifecycle
    mention = mention_under(folder, path, offset_of(folder, path, "set: {rea|son"))
    assert mention is not None
    (place,) = definition(folder, path, mention)
    assert folder.scan(path).lines.position(place.start) == line_of(folder, path, "reason: {type: text")


def test_finds_every_mention(folder: Folder) -> None:
    """Of a variable: its declaration, where it is set and where it is read."""
    path = folder.lifecycle
    mention = mention_under(folder, path, offset_of(folder, path, "guard: rea|son =="))
    assert mention is not None
    found = references(folder, path, mention)
    text = folder.text(path)
    assert {text[each.mention.start : each.mention.end] for each in found} == {"reason"}
    assert len(found) == 11
    assert [each.mention.declares for each in found].count(True) == 1


def test_says_nothing_of_free_text(folder: Folder) -> None:
    """A summary is for people."""
    path = folder.lifecycle
    assert hover(folder, path, offset_of(folder, path, "summary: What ev|ery")) is None


def offset_of(folder: Folder, path: Path, marked: str) -> int:
    """Return where the `|` in a piece of a file is."""
    return folder.text(path).index(marked.replace("|", "", 1)) + marked.index("|")


def line_of(folder: Folder, path: Path, text: str) -> tuple[int, int]:
    """Return line and column of a piece of a file."""
    return folder.scan(path).lines.position(folder.text(path).index(text))


def test_a_question_and_its_answers_are_known(missions: Path, catalog: Catalog) -> None:
    """As events, with the text that people see; names in the question as anywhere else."""
    text = (Path(__file__).parents[3] / "docs" / "examples" / "choice.yaml").read_text(encoding="utf-8")
    inside = "".join(
        f"    {line}\n" for line in text.replace("Is the", "${ request.tags } is the").splitlines()
    )
    asking = "mission: Asking\nrequest:\n  tags: {type: count, default: 1}\nstates:\n  A:\n"
    path = missions / "asking.yaml"
    path.write_text(f"{asking}{inside}  done: {{type: final}}\ninitial: A\n", encoding="utf-8")
    folder = Folder(missions, catalog)
    assert [str(found) for found in folder.survey().get(path, ())] == []
    said = [hover(folder, path, offset_of(folder, path, name)) for name in ("answer.op|en", "request.ta|gs")]
    assert ["It is open" in found.text for found in said if found is not None] == [True, False]
    offers = complete(folder, path, offset_of(folder, path, "answer.shut: do|ne") - len("t: do"))
    assert "answer.shut" in [offer.label for offer in offers.found]
