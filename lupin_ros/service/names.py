"""The names on the network that the orchestrator and its clients share; loads without ROS."""

from __future__ import annotations

from lupin_engine.plugin import Access

#: The orchestrator's node.
NODE = "mission_orchestrator"

#: Every step as JSON.
STEPS_TOPIC = f"/{NODE}/steps"

#: Which missions there are, and what their requests take, as JSON.
MISSIONS_TOPIC = f"/{NODE}/missions"

#: The chart that runs, with its picture and its files, as JSON.
CHART_TOPIC = f"/{NODE}/chart"

#: What each request would do now, or why it would be refused, as JSON.
POSSIBLE_TOPIC = f"/{NODE}/possible"

#: The service that answers a question with a choice (std_srvs/srv/Trigger).
ANSWER_SERVICE = f"/{NODE}/answer/{{}}"

#: The service by which anything is asked of the orchestrator, its type, and the hash of that.
COMMAND_SERVICE = f"/{NODE}/command"
COMMAND_TYPE = "lupin_engine_msgs/srv/Command"
COMMAND_HASH = "e3082568131722648efec9c442969ef1023b509ce7de89606224ed23ccfdfa22"

#: The action by which a program runs a mission, and its type; pages have the service instead.
RUN_ACTION, RUN_TYPE = "mission/run", "lupin_engine_msgs/action/RunMission"

#: The targets for RViz, below the node's namespace.
MARKERS_TOPIC, MARKERS_TYPE = "lupin/markers", "visualization_msgs/msg/MarkerArray"

#: How every node is, once a second (diagnostic_msgs/msg/DiagnosticArray); a name of ROS.
DIAGNOSTICS_TOPIC = "/diagnostics"

#: The services by which displays draw and explain the chart, and their types.
DRAW_SERVICE, EXPLAIN_SERVICE = f"/{NODE}/draw", f"/{NODE}/explain"
DRAW_TYPE, EXPLAIN_TYPE = "lupin_engine_msgs/srv/Draw", "lupin_engine_msgs/srv/Explain"

#: Which of these people's pages may use.
ACCESS = Access(
    viewer=(
        *(STEPS_TOPIC, MISSIONS_TOPIC, CHART_TOPIC, POSSIBLE_TOPIC, DIAGNOSTICS_TOPIC, f"/{MARKERS_TOPIC}"),
        *(DRAW_SERVICE, EXPLAIN_SERVICE),
    ),
    operator=(COMMAND_SERVICE, ANSWER_SERVICE.format("*")),
)
