"""Charts that are nearly wrong: each stands right beside what a rule finds, and nothing may be said of it.

What the rules do find, and how they tell it, is tested in test_broken_charts.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.missions.folders import LIFECYCLE
from lupin_engine.missions.load import check_chart
from lupin_engine.plugin.registry import Catalog

CHARTS = Path(__file__).parents[3] / "charts"
MISSIONS = Path(__file__).parents[4] / "missions"

#: What every mission here begins with.
HEAD = """\
mission: M
context:
  laps: {type: count, default: 0}
inputs:
  pose: {value: robot.pose}
initial: A
entry:
  - set: {laps: "${ laps + (1 if known(input.pose) and reason == '' else 0) }"}
"""
DOCK = "{do: nav.dock, with: {pose: '${ param.dock_pose }'}, timeout: {after: 5 s, code: late}}"
LOOK = "{do: nav.localize, with: {max_variance: 1}, timeout: {after: 5 s, code: late}}"

RIGHT = {
    "no-deadline: a wait for the world that time ends, or a person": """\
  A:
    on:
      input.battery.low: B
    after: {10 s: B}
  B:
    on:
      input.battery.low: done
      operator.skip_current: done
  done: {type: final}
""",
    "never-wins: a guard that is not always false": """\
  A:
    on:
      operator.dock: {target: done, guard: laps > 2 and laps < 9 and not reason == 'late'}
  done: {type: final}
""",
    "never-wins: an exact name before the wildcard that covers it": """\
  A:
    on:
      operator.dock: done
      operator.*: {target: done, guard: laps > 2}
  done: {type: final}
""",
    "never-wins: a level that one transition takes while held and the other does not": """\
  A:
    on:
      input.estop:
        - target: B
        - {target: done, during: estop}
    after: {1 h: done}
  B: {after: {1 s: done}}
  done: {type: final}
""",
    "never-wins: one inner state leaves the event to the outer one": """\
  A:
    on:
      operator.dock: done
    initial: B
    states:
      B: {on: {operator.dock: C}}
      C: {on: {operator.dock: {target: B, guard: laps > 2}}}
  done: {type: final}
""",
    "never-wins: what only one state hears gets past those inside": """\
  A:
    budget: {after: 1 min, code: late, target: done}
    invoke: {do: nav.localize, with: {max_variance: 1}, timeout: {after: 5 s, code: late}}
    on_done: done
    on_error: done
    after: {1 h: done}
    on:
      input.estop: {target: done, during: estop}
      operator.skip_current: done
    initial: B
    states:
      B: {on: {"*": C}}
      C: {on: {nav.*: B, "*": {target: B, guard: laps > 2}}}
  done: {type: final}
""",
    "unknown-input: elements and orders wait for it": """\
  A:
    for_each:
      item: tag
      in: "${ tags.numeric_order() if input.pose.x > '1 m' else tags.numeric_order() }"
      key: "${ tag.id if input.pose.x > '1 m' else tag.id }"
      invoke: {do: bridge.read_tag, with: {tag_id: "${ tag.id }"}, timeout: {after: 5 s, code: late}}
    after: {1 s: B}
  B:
    itinerary: {items: "${ tags.numeric_order() }", order: "${ input.pose.x - target.x }"}
    on_done: done
    initial: GOING
    states:
      GOING: {after: {1 s: {target: over, do: [itinerary.close: {status: OK}]}}}
      over: {type: final}
  done: {type: final}
""",
    "never-wins: both guards are false while the pose is not known": """\
  A:
    always:
      - {target: B, guard: known(input.pose) and input.pose.x > '1 m'}
      - {target: done, guard: known(input.pose) and input.pose.x <= '1 m'}
  B: {after: {1 s: done}}
  done: {type: final}
""",
    "both-can-win: guards that exclude each other": """\
  A:
    on:
      operator.dock:
        - {target: B, guard: "reason in ('late', 'lost') and laps > 2"}
        - {target: C, guard: reason == 'lost' and not laps > 2}
        - {target: done, guard: "reason not in ['late', 'lost']"}
      operator.skip_current:
        - {target: B, guard: laps < 3}
        - {target: C, guard: 3 <= laps and laps < 5}
        - {target: done, guard: laps >= 5}
  B: {after: {1 s: done}}
  C: {after: {1 s: done}}
  done: {type: final}
""",
    "both-can-win: if, else": """\
  A:
    always:
      - {target: B, guard: laps > 2}
      - target: done
  B: {after: {1 s: done}}
  done: {type: final}
""",
    "both-can-win: a list is an order": """\
  A:
    on:
      operator.dock:
        - {target: B, guard: reason == 'late'}
        - {target: done, guard: held(pause)}
    after: {1 s: done}
  B: {after: {1 s: done}}
  done: {type: final}
""",
    "both-can-win: a refusal in front is an exception": """\
  A:
    on:
      operator.dock:
        - {refuse: late, guard: laps > 2}
        - {refuse: stopped, guard: reason == 'late'}
        - {target: done, guard: known(input.pose)}
  done: {type: final}
""",
    "both-can-win: whichever is taken, the same follows": """\
  A:
    on:
      operator.dock:
        - {target: done, guard: laps > 2, do: [set: {laps: 0}]}
        - {target: done, guard: reason == 'late', do: [set: {laps: 0}]}
  done: {type: final}
""",
    "both-can-win: two regions answer an event and neither leaves": """\
  A:
    type: parallel
    on:
      operator.skip_current: done
    states:
      LEFT: {initial: B, states: {B: {on: {operator.dock: C}}, C: {on: {operator.dock: B}}}}
      RIGHT: {initial: D, states: {D: {on: {operator.dock: E}}, E: {on: {operator.dock: D}}}}
  done: {type: final}
""",
    "both-can-win: one region leaves when the other does not move": """\
  A:
    type: parallel
    states:
      LEFT: {initial: B, states: {B: {on: {operator.dock: {target: C, guard: laps < 2}}}, C: {}}}
      RIGHT: {on: {operator.dock: {target: done, guard: laps >= 2}}}
  done: {type: final}
""",
    "unhandled-outcome: every code has its guard": f"""\
  A:
    invoke: {DOCK}
    on_done: done
    on_error:
      - {{target: done, guard: "error.code in ['nav_rejected', 'late', 'amcl_drift_var']"}}
      - {{target: B, guard: error.code == 'nav_status_5' or error.code == 'nav_status_6'}}
  B: {{after: {{1 s: done}}}}
  done: {{type: final}}
""",
    "unhandled-outcome: all codes between them, whatever the others ask": f"""\
  A:
    invoke: {DOCK}
    on_done: done
    on_error:
      - {{target: B, guard: error.code == 'nav_rejected'}}
      - {{target: done, guard: "error.code in ['late', 'amcl_drift_var', 'nav_status_5']"}}
      - {{target: done, guard: error.code == 'nav_status_6' and laps > 2}}
      - {{target: done, guard: error.code == 'nav_status_6' and laps <= 2}}
  B: {{after: {{1 s: done}}}}
  done: {{type: final}}
""",
    "unhandled-outcome: an operation that cannot fail, one that never ends in time": """\
  A:
    invoke: {do: nav.localize, with: {max_variance: 1}, timeout: never}
    on_done: done
    after: {1 h: done}
  done: {type: final}
""",
    "both-can-win: the same effect, written twice": """\
  A:
    on:
      operator.dock:
        - {target: done, guard: laps > 2, do: [set: {laps: "${ laps + 1 }"}]}
        - {target: done, guard: reason == 'late', do: [set: {laps: "${ laps + 1 }"}]}
  done: {type: final}
""",
    "never-wins: two of three guards leave something over": """\
  A:
    on:
      operator.dock:
        - {target: done, guard: laps < 2}
        - {target: B, guard: laps > 3}
        - {target: A, guard: laps == 2}
      operator.skip_current:
        - {target: done, guard: laps < 2}
        - {target: B, guard: laps >= 2}
  B: {after: {1 s: done}}
  done: {type: final}
""",
    "unhandled-outcome: one of the guards is true": f"""\
  A:
    invoke: {LOOK}
    on_done:
      - {{target: B, guard: laps < 3 or reason == 'late'}}
      - {{target: done, guard: laps >= 3 and reason != 'late'}}
    on_error: done
  B: {{after: {{1 s: done}}}}
  done: {{type: final}}
""",
    "unhandled-outcome: an end that something else leaves": """\
  A:
    after: {10 s: done}
    states:
      B: {after: {1 s: over}}
      over: {type: final}
  done: {type: final}
""",
    "unhandled-outcome: the end of a region is the parallel state's": """\
  A:
    type: parallel
    on_done: done
    states:
      LEFT: {states: {B: {after: {1 s: over}}, over: {type: final}}}
      RIGHT: {states: {C: {after: {2 s: over}}, over: {type: final}}}
  done: {type: final}
""",
    "always-loop: counting ends it": """\
  A:
    always: {target: B, guard: laps < 3, do: [set: {laps: "${ laps + 1 }"}]}
    after: {1 s: done}
  B: {always: {target: A, guard: laps < 5}, after: {1 s: done}}
  done: {type: final}
""",
    "always-loop: what leads there does not lead back": """\
  A: {always: {target: B, guard: laps < 3}, after: {1 s: done}}
  B:
    always:
      - {target: done, guard: laps < 3}
      - target: A
  done: {type: final}
""",
    "always-loop: actions that end themselves": """\
  A:
    always: {guard: laps < 3, do: [set: {laps: "${ laps + 1 }"}]}
    after: {1 s: done}
  done: {type: final}
""",
    "always-loop: a state that waits lies in between": """\
  A: {always: B}
  B: {after: {1 s: A}, on: {operator.dock: done}}
  done: {type: final}
""",
    "always-loop: where one is counts too": """\
  A:
    always: {target: B, guard: in_state('A')}
    after: {1 s: done}
  B: {always: {target: A, guard: in_state('B')}}
  done: {type: final}
""",
    "double-close: a way back, or a way in from outside, to where it may be closed": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    on: {operator.dock: {target: AWAY, do: [itinerary.close_rest: {status: SKIPPED}]}}
    on_done: done
    initial: GOING
    states:
      GOING: {after: {1 s: {target: THERE, do: [itinerary.close: {status: OK}]}}}
      THERE: {after: {1 s: {target: toured, do: [itinerary.close: {status: OK}]}}}
      toured: {type: final}
  AWAY: {after: {1 s: A.THERE}}
  done: {type: final}
""",
    "double-close: the end of a walk takes an event before it is heard": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    on:
      operator.dock:
        target: done
        do:
          - itinerary.close: {status: SKIPPED}
          - itinerary.close_rest: {status: SKIPPED}
    on_done: done
    initial: GOING
    states:
      GOING: {after: {1 s: {target: toured, do: [itinerary.close: {status: OK}]}}}
      toured: {type: final}
  done: {type: final}
""",
    "double-close: what never rests hears nothing": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    on_done: done
    initial: GOING
    states:
      GOING:
        on:
          operator.dock: {target: PASSING, do: [itinerary.close: {status: SKIPPED}]}
        after: {1 s: {target: PASSING, do: [itinerary.close: {status: OK}]}}
      PASSING:
        on:
          operator.skip_current: {target: toured, do: [itinerary.close: {status: SKIPPED}]}
        always: toured
      toured: {type: final}
  done: {type: final}
""",
    "double-close: regions, elements and walks inside are not followed": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    on_done: B
    initial: GOING
    states:
      GOING: {after: {1 s: {target: LEGS, do: [itinerary.close: {status: OK}]}}}
      LEGS:
        type: parallel
        on_done: {target: toured, do: [itinerary.close: {status: OK}]}
        states:
          L: {states: {C: {after: {1 s: over}}, over: {type: final}}}
          R: {states: {C: {after: {1 s: over}}, over: {type: final}}}
      toured: {type: final}
  B:
    itinerary: {items: "${ tags.numeric_order() }"}
    on_done: C
    initial: GOING
    states:
      GOING: {after: {1 s: {target: READING, do: [itinerary.close: {status: OK}]}}}
      READING:
        for_each:
          item: tag
          in: ${ tags.numeric_order() }
          key: ${ tag.id }
          invoke: {do: bridge.read_tag, with: {tag_id: "${ tag.id }"}, timeout: {after: 5 s, code: late}}
        after: {1 s: {target: toured, do: [itinerary.close: {status: OK}]}}
      toured: {type: final}
  C:
    itinerary: {items: "${ tags.numeric_order() }"}
    on_done: done
    initial: GOING
    states:
      GOING: {after: {1 s: {target: D, do: [itinerary.close: {status: OK}]}}}
      D:
        itinerary: {items: "${ tags.numeric_order() }"}
        on_done: toured
        initial: E
        states:
          E: {after: {1 s: {target: over, do: [itinerary.close: {status: OK}]}}}
          over: {type: final}
      toured: {type: final, entry: [itinerary.close: {status: OK}]}
  done: {type: final}
""",
    "always-loop: leaving, entering and releasing end it": """\
  A:
    entry: [set: {laps: "${ laps + 1 }"}]
    always: {target: B, guard: laps < 3}
    after: {1 s: C}
  B: {always: {target: A, guard: laps < 5}, after: {1 s: C}}
  C:
    exit: [set: {reason: over}]
    always: {target: D, guard: reason == ''}
    after: {1 s: D}
  D: {always: {target: C, guard: reason != 'over'}, after: {1 s: E}}
  E:
    always: {target: F, guard: held(pause), releases: pause}
    after: {1 s: F}
  F: {always: {target: E, guard: held(pause)}, after: {1 s: done}}
  done: {type: final}
""",
    "always-loop: a walk goes on, or begins anew": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    on_done: B
    initial: GOING
    states:
      GOING:
        always: {target: THERE, guard: target.x > '1 m', do: [itinerary.close: {status: OK}]}
        after: {1 s: THERE}
      THERE:
        always: {target: GOING, guard: target.x > '2 m', do: itinerary.advance}
        after: {1 s: toured}
      toured: {type: final}
  B:
    itinerary: {items: "${ tags.numeric_order() }"}
    always: {target: B, guard: itinerary.remaining > 3}
    on_done: done
    initial: GOING
    states:
      GOING: {after: {1 s: {target: over, do: [itinerary.close: {status: OK}]}}}
      over: {type: final}
  done: {type: final}
""",
    "always-loop: a sweep ends, and the state that begins the next one waits": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }", sweeps: 0}
    initial: GOING
    states:
      GOING:
        invoke: {do: bridge.read_tag, with: {tag_id: "${ target.id }"}, timeout: {after: 1 s, code: late}}
        on_done: {target: NEXT, do: [itinerary.close: {status: OK}]}
        on_error: {target: NEXT, do: [itinerary.close: {status: UNREACHABLE}]}
      NEXT:
        always:
          - {target: GOING, guard: laps == 0 and itinerary.closed < itinerary.total, do: itinerary.advance}
          - target: RESTING
      RESTING: {after: {1 s: {target: GOING, do: itinerary.advance}}, on: {operator.dock: done}}
  done: {type: final}
""",
    "always-loop: what comes back is not known": """\
  A: {always: B.history}
  B:
    history: shallow
    on: {operator.dock: B.D}
    initial: C
    states: {C: {always: A}, D: {after: {1 s: done}}}
  done: {type: final}
""",
    "always-loop: the hold that a level engages goes before": """\
  A: {on: {input.estop: B}, after: {1 s: done}}
  B: {on: {input.estop: {target: A, during: pause}}, after: {1 s: done}}
  done: {type: final}
""",
    "always-loop: a guard that is never true is told as that, and others are not of one mind": """\
  A:
    always: {target: B, guard: laps < 3}
    after: {1 s: done}
  B:
    always: {target: A, guard: laps >= 3}
    after: {1 s: done}
  done: {type: final}
""",
    "double-close: closed only where it is open": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    on_done: done
    on:
      operator.skip_current:
        guard: itinerary.open
        target: NEXT
        internal: true
        do:
          - itinerary.close: {status: SKIPPED}
    initial: GOING
    states:
      GOING: {after: {1 s: {target: THERE, do: [itinerary.close: {status: OK}]}}}
      THERE: {after: {1 s: NEXT}}
      NEXT:
        always:
          - {target: GOING, guard: itinerary.remaining > 0, do: itinerary.advance}
          - target: toured
      toured: {type: final}
  done: {type: final}
""",
    "double-close: closed on one way only": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    on_done: done
    initial: GOING
    states:
      GOING:
        after:
          1 s: {target: THERE, guard: reason == 'late', do: [itinerary.close: {status: OK}]}
          2 s: THERE
      THERE:
        always:
          - target: GOING
            guard: itinerary.remaining > 0
            do: [itinerary.close: {status: OK}, itinerary.advance]
          - target: toured
      toured: {type: final}
  done: {type: final}
""",
    "open-visit: the rest is closed before going on": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    on_done: done
    initial: GOING
    states:
      GOING: {after: {1 s: {target: THERE, do: [itinerary.close_rest: {status: SKIPPED}]}}}
      THERE:
        always:
          - {target: GOING, guard: itinerary.remaining > 0, do: itinerary.advance}
          - target: toured
      toured: {type: final}
  done: {type: final}
""",
    "unknown-input: asked first": """\
  A:
    entry:
      - set: {home: "${ input.pose if known(input.pose) else param.dock_pose }"}
    on:
      operator.dock:
        - {target: B, guard: known(input.pose) and input.pose.x > '1 m'}
        - {target: done, guard: not known(input.pose) or input.pose.x <= '1 m'}
      operator.skip_current: {target: done, guard: input.battery.low or input.estop or home.x > '1 m'}
  B: {after: {1 s: done}}
  done: {type: final}
""",
    "shared-resource: one after the other": f"""\
  A:
    type: parallel
    on_done: done
    states:
      LEFT:
        initial: B
        states:
          B: {{invoke: {DOCK}, on_done: C, on_error: C}}
          C: {{invoke: {DOCK}, on_done: over, on_error: over}}
          over: {{type: final}}
      RIGHT:
        states:
          D: {{invoke: {LOOK}, on_done: over, on_error: over}}
          over: {{type: final}}
  done: {{type: final}}
""",
    "region-leak: back into the own region, or anew into the whole": """\
  A:
    type: parallel
    on:
      operator.dock: LEFT.C
      operator.skip_current: done
    states:
      LEFT: {initial: B, states: {B: {after: {1 s: C}}, C: {after: {1 s: B}}}}
      RIGHT: {after: {5 s: A}}
  done: {type: final}
""",
    "unheard-event: raised anywhere, and heard": """\
  A:
    entry: [raise: {event: a.entry}]
    exit: [raise: {event: a.exit}]
    budget: {after: 1 min, code: late, target: done, do: [raise: {event: a.budget}]}
    on:
      operator.dock: {do: [raise: {event: a.on}]}
    always: {guard: laps < 3, do: [{set: {laps: 5}}, {raise: {event: a.always}}]}
    after: {1 s: {target: B, do: [raise: {event: a.after}]}}
  B:
    invoke: {do: nav.localize, with: {max_variance: 1}, timeout: {after: 5 s, code: late}}
    on_done: {target: C, do: [raise: {event: b.done}]}
    on_error: {target: C, do: [raise: {event: b.error}]}
  C:
    for_each:
      item: tag
      in: ${ tags.numeric_order() }
      key: ${ tag.id }
      invoke: {do: bridge.read_tag, with: {tag_id: "${ tag.id }"}, timeout: {after: 5 s, code: late}}
      on_done: {do: [raise: {event: c.done}]}
      on_error: {do: [raise: {event: c.error}]}
    on:
      a.entry: done
      a.exit: done
      a.budget: done
      a.on: done
      a.always: done
      a.after: done
      b.done: done
      b.error: done
      c.done: done
      c.error: done
    after: {1 s: done}
  done: {type: final}
""",
    "open-visit, double-close: only in a state that is asked for": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    on:
      operator.dock:
        - {target: GOING, internal: true, guard: in_state('A.CLOSED'), do: itinerary.advance}
        - {target: CLOSED, internal: true, do: [itinerary.close: {status: SKIPPED}]}
      operator.skip_current:
        - {guard: not in_state("GOING"), do: itinerary.advance}
    initial: GOING
    states:
      GOING: {after: {10 s: {target: CLOSED, do: [itinerary.close: {status: OK}]}}}
      CLOSED: {after: {10 s: done}}
  done: {type: final}
""",
    "begins-anew: internal, by history, after the end, on purpose": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    history: shallow
    on:
      operator.dock: {target: B, internal: true}
      operator.skip_current: A.history
      operator.resume: {target: A, do: [itinerary.close_rest: {status: SKIPPED}]}
    on_done:
      - {target: B, guard: laps > 2}
      - target: done
    initial: B
    states:
      B: {after: {1 s: {target: C, do: [itinerary.close: {status: OK}]}}}
      C: {always: [{target: B, guard: itinerary.remaining > 0, do: itinerary.advance}, {target: over}]}
      over: {type: final}
  done: {type: final}
""",
    "untold-rest: told on the way, later, when it is left, by who comes back, or of nobody": """\
  A:
    itinerary: {items: "${ tags.numeric_order() }"}
    budget: {after: 1 min, code: late, target: B, do: [itinerary.close_rest: {status: SKIPPED}]}
    initial: V
    states: {V: &visit {after: {1 s: {target: W, do: [itinerary.close: {status: OK}]}}}, W: {after: {1 s: B}}}
  B:
    itinerary: {items: "${ tags.numeric_order() }"}
    exit:
      - itinerary.close_rest: {status: SKIPPED}
    after: {1 min: C}
    initial: V
    states: {V: *visit, W: {after: {1 s: C}}}
  C:
    itinerary: {items: "${ tags.numeric_order() }", sweeps: 0}
    after: {1 min: D}
    initial: V
    states: {V: *visit, W: {after: {1 s: D}}}
  D:
    itinerary: {items: "${ tags.numeric_order() }", on_abort: leave_open}
    after: {1 min: E}
    initial: V
    states: {V: *visit, W: {after: {1 s: E}}}
  E:
    itinerary: {items: "${ tags.numeric_order() }"}
    history: deep
    on: {operator.dock: AWAY}
    after: {1 min: READY}
    initial: V
    states: {V: *visit, W: {after: {1 s: done}}}
  AWAY: {on: {operator.resume: E.history}}
  done: {type: final}
""",
    "unheard-event: heard by name, by its beginning, by anybody": """\
  A:
    entry:
      - raise: {event: door.opened}
      - raise: {event: lamp.lit}
    exit:
      - raise: {event: bell.rung}
    on:
      door.opened: B
      lamp.*: done
  B: {on: {"*": done}}
  done: {type: final}
""",
    "unreachable-state: what is entered with it, anew or again": """\
  A:
    history: shallow
    resume_at: {target: C}
    initial: B
    states:
      B: {on: {operator.dock: W}}
      C: {initial: D, states: {D: {after: {1 s: E}}, E: {after: {1 s: B}}}}
  W: {on: {operator.resume: A.history, operator.skip_current: P.L.F}}
  P:
    type: parallel
    states:
      L: {initial: G, states: {F: {after: {1 s: G}}, G: {after: {1 s: F}}}}
      R: {initial: H, states: {H: {after: {1 s: I}}, I: {on: {operator.dock: Q.back}}}}
  Q:
    initial: J
    states:
      back: {type: history, initial: K}
      J: {after: {1 s: done}}
      K: {initial: L, states: {L: {after: {1 s: J}}}}
  done: {type: final}
""",
    "unreachable-state: by history, by a budget, by coming back, as a region": """\
  A:
    history: shallow
    budget: {after: 1 min, code: late, target: B}
    resume_at: C
    initial: D
    states:
      C: {after: {1 s: D}}
      D: {on: {operator.dock: W}}
  B:
    type: parallel
    states:
      E: {after: {1 s: done}}
      F:
        initial: G
        states:
          G: {on: {operator.dock: back}}
          H: {after: {1 s: done}}
          back: {type: history, initial: H}
  W: {on: {operator.resume: A.history}}
  done: {type: final}
""",
    "dead-end: a round that only its budget ends": """\
  A:
    budget: {after: 1 min, code: late, target: done}
    initial: B
    states:
      B: {after: {1 s: C}}
      C: {after: {1 s: B}}
  done: {type: final}
""",
    "never-happens: a mission that only the operator ends": """\
  A: {after: {1 s: B}}
  B: {after: {1 s: A}}
""",
    "no-deadline: the budget around ends it": """\
  A:
    budget: {after: 1 min, code: late, target: done}
    states:
      B: {invoke: {do: nav.localize, with: {max_variance: 1}, timeout: never}, on_done: done}
  done: {type: final}
""",
}


@pytest.mark.parametrize("name", RIGHT)
def test_nothing_is_said_of_what_is_only_nearly_wrong(name: str, tmp_path: Path, catalog: Catalog) -> None:
    """A rule that cries wolf is switched off in people's heads."""
    head = HEAD.replace("context:\n", "context:\n  home: {type: pose, default: '${ param.dock_pose }'}\n")
    mission = tmp_path / "m.yaml"
    mission.write_text(
        (head if "home" in RIGHT[name] else HEAD) + "states:\n" + RIGHT[name], encoding="utf-8"
    )
    chart, found = check_chart(CHARTS / "mini" / LIFECYCLE, [mission], catalog)
    assert [str(diagnostic) for diagnostic in found] == []
    assert chart is not None


def test_what_is_declared_counts_as_used_wherever_it_is_said(tmp_path: Path, catalog: Catalog) -> None:
    """In what a part is given, in an event, in a text of an expression, in a property."""
    (tmp_path / "parts").mkdir()
    for path in (CHARTS / "mini" / LIFECYCLE, CHARTS / "good" / "parts" / "knock.yaml"):
        target = tmp_path / ("parts" if path.name == "knock.yaml" else "") / path.name
        shutil.copy(path, target)
    (tmp_path / "m.yaml").write_text("""\
mission: M
inputs:
  charge: {value: robot.battery, levels: {empty: {below: 5 %}, full: {above: 90 %}}}
codes:
  charged: {label: charged}
  emptied: {label: emptied}
context:
  laps: {type: count, default: 0}
request:
  pause: {type: duration, default: 1 s}
  goal: {type: count, default: 1}
properties:
  enough: {always: request.goal > 0}
initial: A
states:
  A:
    use: knock
    with: {knock_pause_s: "${ request.pause * laps }"}
    on_done: B
  B:
    itinerary: {items: "${ tags.numeric_order() }"}
    on:
      operator.skip_current: {do: [raise: {event: door.opened}, set: {laps: 2}]}
      input.charge.empty: {target: done, code: emptied, do: [itinerary.close_rest: {status: SKIPPED}]}
      operator.dock:
        target: done
        guard: itinerary.open
        do:
          - itinerary.close: {status: OK, code: "${ 'charged' if input.charge.full else '' }"}
  done: {type: final}
""")
    _, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    assert [str(diagnostic) for diagnostic in found] == []


def test_an_error_that_nobody_handles_leads_to_fault(tmp_path: Path, catalog: Catalog) -> None:
    """So FAULT can be entered, although no transition is written."""
    text = (CHARTS / "mini" / LIFECYCLE).read_text(encoding="utf-8")
    (tmp_path / LIFECYCLE).write_text(text + "  FAULT: {on: {operator.reset: READY}}\n", encoding="utf-8")
    _, found = check_chart(tmp_path / LIFECYCLE, [CHARTS / "mini" / "idle.yaml"], catalog)
    assert found == ()


def test_the_shipped_part_needs_its_refusal(tmp_path: Path, catalog: Catalog) -> None:
    """An operator may skip a target that was just read: were it not refused, it would be closed twice."""
    shutil.copytree(MISSIONS, tmp_path, dirs_exist_ok=True)
    part = tmp_path / "parts" / "visit_targets.yaml"
    text = part.read_text(encoding="utf-8")
    refusal = "        on:\n          operator.skip_current: {refuse: already_closed}\n"
    assert text.count(refusal) == 1
    part.write_text(text.replace(refusal, ""), encoding="utf-8")
    _, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "inspection.yaml"], catalog)
    assert [(d.rule, d.problem) for d in found] == [
        ("double-close", "the visit is closed already in 'DWELLING', so this would be refused")
    ]


def test_the_mistakes_of_a_part_are_told_once(tmp_path: Path, catalog: Catalog) -> None:
    """However often it is used."""
    (tmp_path / "parts").mkdir()
    shutil.copy(CHARTS / "mini" / LIFECYCLE, tmp_path)
    (tmp_path / "parts" / "p.yaml").write_text("""\
part: p
states:
  A:
    after: {1 s: over}
    on:
      operator.dock: {target: over, guard: false}
  over: {type: final}
""")
    (tmp_path / "m.yaml").write_text("""\
mission: M
initial: A
states:
  A: {use: p, on_done: B}
  B: {use: p, on_done: done}
  done: {type: final}
""")
    _, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    assert [(d.rule, d.path) for d in found] == [("never-wins", "MISSION.M.A.A.on.operator.dock.0")]


def test_parts_and_their_users_may_call_their_states_alike(tmp_path: Path, catalog: Catalog) -> None:
    """What a part calls its states is its own affair: from outside, the outer one is meant."""
    (tmp_path / "parts").mkdir()
    shutil.copy(CHARTS / "mini" / LIFECYCLE, tmp_path)
    (tmp_path / "parts" / "p.yaml").write_text("""\
part: p
states:
  A:
    on: {operator.skip_current: over}
    after: {1 s: READY}
  over: {type: final}
""")
    (tmp_path / "parts" / "q.yaml").write_text("""\
part: q
initial: A
states:
  A: {use: p, on_done: over, on: {operator.dock: A}}
  over: {type: final}
""")
    (tmp_path / "m.yaml").write_text("""\
mission: M
initial: A
states:
  A: {use: q, on_done: over}
  over: {after: {1 s: READY}}
  READY: {type: final}
""")
    chart, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    assert [str(d) for d in found] == [
        f"{tmp_path}/m.yaml:5:23: warning: MISSION.M.over.after.0: 'READY' means 'MISSION.M.READY' here, "
        "which hides 'READY'; rename one of them [shadowed-state]",
        f"{tmp_path}/parts/p.yaml:5:18: warning: MISSION.M.A.A.A.after.0: 'READY' means 'MISSION.M.READY' "
        "here, which hides 'READY'; rename one of them [shadowed-state]",
    ]
    assert chart is not None
    assert [(rule.event, rule.target) for rule in chart.states["MISSION.M.A.A"].transitions] == [
        ("done", "MISSION.M.A.over"),
        ("operator.dock", "MISSION.M.A.A"),
    ]
    assert chart.states["MISSION.M.A"].transitions[0].target == "MISSION.M.over"


def test_a_slip_in_the_name_of_an_event_hides_no_other_mistake(tmp_path: Path, catalog: Catalog) -> None:
    """Neither in what the event leads to, nor about ways through the chart, nor about what is never read."""
    shutil.copy(CHARTS / "mini" / LIFECYCLE, tmp_path)
    (tmp_path / "m.yaml").write_text("""\
mission: M
params:
  rest: {type: duration, default: 1 s}
initial: A
states:
  A:
    after: {1 s: done}
    on:
      operator.dok: {target: B, do: [set: {reason: 3}]}
      input.battery.lw: C
  B: {after: {1 s: done}}
  C: {after: {1 s: done}}
  D: {after: {1 s: done}}
  done: {type: final}
""")
    _, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    assert [(d.place.line, d.rule, d.path) for d in found] == [
        (3, "unused-parameter", "params.rest"),
        (9, "unknown-event", "MISSION.M.A.on.operator.dok"),
        (9, "wrong-type", "MISSION.M.A.on.operator.dok.do.set.reason"),
        (10, "unknown-event", "MISSION.M.A.on.input.battery.lw"),
        (13, "unreachable-state", "MISSION.M.D"),
    ]


def test_a_mistake_in_a_declaration_is_told_once(tmp_path: Path, catalog: Catalog) -> None:
    """What is declared wrongly is declared all the same, and may be read."""
    shutil.copy(CHARTS / "mini" / LIFECYCLE, tmp_path)
    (tmp_path / "m.yaml").write_text("""\
mission: M
params:
  rest: {type: duration, default: 30}
context:
  laps: {type: count, default: -1}
states:
  A:
    after: {"${ param.rest }": done}
    always: {target: done, guard: laps > 3}
  done: {type: final}
""")
    _, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    assert [(d.place.line, d.rule, d.path) for d in found] == [
        (3, "no-unit", "params.rest.default"),
        (5, "wrong-type", "context.laps.default"),
    ]


def test_a_parallel_state_that_cannot_end_is_told_by_its_regions(tmp_path: Path, catalog: Catalog) -> None:
    """One region has a final state: it is the other one that lacks it."""
    shutil.copy(CHARTS / "mini" / LIFECYCLE, tmp_path)
    (tmp_path / "m.yaml").write_text("""\
mission: M
states:
  P:
    type: parallel
    states:
      L: {on: {operator.dock: done}}
      R: {states: {over: {type: final}}}
    on_done: done
  done: {type: final}
""")
    _, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    assert [str(d) for d in found] == [
        f"{tmp_path}/m.yaml:8:5: error: MISSION.M.P: on_done, but not every region can end: 'L' has no final "
        "state; add one, or remove it [never-happens]"
    ]


def test_an_expression_that_was_refused_is_not_followed(tmp_path: Path, catalog: Catalog) -> None:
    """Rules look at guards that are written wrong too, and one may be deeper than Python can follow."""
    shutil.copy(CHARTS / "mini" / LIFECYCLE, tmp_path)
    (tmp_path / "m.yaml").write_text(f"""\
mission: M
states:
  A:
    always: {{target: done, guard: "{"-" * 1900}1 > 0"}}
    after: {{1 s: done}}
  done: {{type: final}}
""")
    _, found = check_chart(tmp_path / LIFECYCLE, [tmp_path / "m.yaml"], catalog)
    assert [str(d) for d in found] == [
        f"{tmp_path}/m.yaml:4:36: error: MISSION.M.A.always.guard: the expression is too large; "
        "at most 200 operators and operands [bad-expression]"
    ]
