// Made by `lupin types ts` from the interface files of ROS 2. Do not edit it: make it anew.
//
// Values as they travel through rosbridge in JSON. NaN and infinity are null. Arrays of bytes are texts in
// base64. Integers of 64 bits are numbers, exact up to Number.MAX_SAFE_INTEGER. Of a request or a goal, what
// is left out has its default.

/**
 * `action_msgs/msg/GoalInfo`
 * Goal ID
 */
export interface GoalInfo {
  goal_id: UUID;
  /** Time when the goal was accepted */
  stamp: Time;
}

/**
 * `action_msgs/msg/GoalStatus`
 * An action goal can be in one of these states after it is accepted by an action
 * server.
 *
 * For more information, see http://design.ros2.org/articles/actions.html
 */
export interface GoalStatus {
  /** Goal info (contains ID and timestamp). */
  goal_info: GoalInfo;
  /** Action goal state-machine status. */
  status: number;
}

export const GoalStatus = {
  /** Indicates status has not been properly set. */
  STATUS_UNKNOWN: 0,
  /** The goal has been accepted and is awaiting execution. */
  STATUS_ACCEPTED: 1,
  /** The goal is currently being executed by the action server. */
  STATUS_EXECUTING: 2,
  /**
   * The client has requested that the goal be canceled and the action server has
   * accepted the cancel request.
   */
  STATUS_CANCELING: 3,
  /** The goal was achieved successfully by the action server. */
  STATUS_SUCCEEDED: 4,
  /** The goal was canceled after an external request from an action client. */
  STATUS_CANCELED: 5,
  /** The goal was terminated by the action server without an external request. */
  STATUS_ABORTED: 6,
} as const;

/**
 * `action_msgs/msg/GoalStatusArray`
 * An array of goal statuses.
 */
export interface GoalStatusArray {
  status_list: GoalStatus[];
}

/**
 * `action_msgs/srv/CancelGoal_Request`
 * Cancel one or more goals with the following policy:
 *
 * - If the goal ID is zero and timestamp is zero, cancel all goals.
 * - If the goal ID is zero and timestamp is not zero, cancel all goals accepted
 *   at or before the timestamp.
 * - If the goal ID is not zero and timestamp is zero, cancel the goal with the
 *   given ID regardless of the time it was accepted.
 * - If the goal ID is not zero and timestamp is not zero, cancel the goal with
 *   the given ID and all goals accepted at or before the timestamp.
 */
export interface CancelGoalRequest {
  /** Goal info describing the goals to cancel, see above. */
  goal_info?: GoalInfo;
}

/**
 * `action_msgs/srv/CancelGoal_Response`
 * Return codes.
 */
export interface CancelGoalResponse {
  /** Return code, see above definitions. */
  return_code: number;
  /** Goals that accepted the cancel request. */
  goals_canceling: GoalInfo[];
}

export const CancelGoalResponse = {
  /**
   * Indicates the request was accepted without any errors.
   *
   * One or more goals have transitioned to the CANCELING state. The
   * goals_canceling list is not empty.
   */
  ERROR_NONE: 0,
  /**
   * Indicates the request was rejected.
   *
   * No goals have transitioned to the CANCELING state. The goals_canceling list is
   * empty.
   */
  ERROR_REJECTED: 1,
  /**
   * Indicates the requested goal ID does not exist.
   *
   * No goals have transitioned to the CANCELING state. The goals_canceling list is
   * empty.
   */
  ERROR_UNKNOWN_GOAL_ID: 2,
  /**
   * Indicates the goal is not cancelable because it is already in a terminal state.
   *
   * No goals have transitioned to the CANCELING state. The goals_canceling list is
   * empty.
   */
  ERROR_GOAL_TERMINATED: 3,
} as const;

/**
 * `builtin_interfaces/msg/Duration`
 * Duration defines a period between two time points.
 * Messages of this datatype are of ROS Time following this design:
 * https://design.ros2.org/articles/clock_and_time.html
 */
export interface Duration {
  /** The seconds component, valid over all int32 values. */
  sec: number;
  /**
   * The nanoseconds component, valid in the range [0, 1e9), to be added to the seconds component.
   * e.g.
   * The duration -1.7 seconds is represented as {sec: -2, nanosec: 3e8}
   * The duration 1.7 seconds is represented as {sec: 1, nanosec: 7e8}
   */
  nanosec: number;
}

/**
 * `builtin_interfaces/msg/Time`
 * This message communicates ROS Time defined here:
 * https://design.ros2.org/articles/clock_and_time.html
 */
export interface Time {
  /** The seconds component, valid over all int32 values. */
  sec: number;
  /**
   * The nanoseconds component, valid in the range [0, 1e9), to be added to the seconds component.
   * e.g.
   * The time -1.7 seconds is represented as {sec: -2, nanosec: 3e8}
   * The time 1.7 seconds is represented as {sec: 1, nanosec: 7e8}
   */
  nanosec: number;
}

/** `control_msgs/action/GripperCommand_Feedback` */
export interface GripperCommandFeedback {
  position: number | null;
  effort: number | null;
  stalled: boolean;
  reached_goal: boolean;
}

/**
 * `control_msgs/action/GripperCommand_Goal`
 * Move the jaw. Field for field the definition of ROS 2 Jazzy.
 */
export interface GripperCommandGoal {
  command?: GripperCommand;
}

/** `control_msgs/action/GripperCommand_Result` */
export interface GripperCommandResult {
  position: number | null;
  effort: number | null;
  stalled: boolean;
  reached_goal: boolean;
}

/**
 * `control_msgs/msg/GripperCommand`
 * Where the jaw should be. Field for field the definition of ROS 2 Jazzy.
 */
export interface GripperCommand {
  /** m or rad, whichever the joint has */
  position: number | null;
  /** N or Nm; 0.0: the controller's own limit */
  max_effort: number | null;
}

/**
 * `diagnostic_msgs/msg/DiagnosticArray`
 * This message is used to send diagnostic information about the state of the robot.
 */
export interface DiagnosticArray {
  /** for timestamp */
  header: Header;
  /** an array of components being reported on */
  status: DiagnosticStatus[];
}

/**
 * `diagnostic_msgs/msg/DiagnosticStatus`
 * This message holds the status of an individual component of the robot.
 */
export interface DiagnosticStatus {
  /** Level of operation enumerated above. */
  level: number;
  /** A description of the test/component reporting. */
  name: string;
  /** A description of the status. */
  message: string;
  /** A hardware unique string. */
  hardware_id: string;
  /** An array of values associated with the status. */
  values: KeyValue[];
}

export const DiagnosticStatus = {
  /** Possible levels of operations. */
  OK: 0,
  WARN: 1,
  ERROR: 2,
  STALE: 3,
} as const;

/**
 * `diagnostic_msgs/msg/KeyValue`
 * What to label this value when viewing.
 */
export interface KeyValue {
  key: string;
  /** A value to track over time. */
  value: string;
}

/**
 * `geometry_msgs/msg/Point`
 * This contains the position of a point in free space
 */
export interface Point {
  x: number | null;
  y: number | null;
  z: number | null;
}

/**
 * `geometry_msgs/msg/Point32`
 * This contains the position of a point in free space(with 32 bits of precision).
 * It is recommended to use Point wherever possible instead of Point32.
 *
 * This recommendation is to promote interoperability.
 *
 * This message is designed to take up less space when sending
 * lots of points at once, as in the case of a PointCloud.
 */
export interface Point32 {
  x: number | null;
  y: number | null;
  z: number | null;
}

/**
 * `geometry_msgs/msg/Polygon`
 * A specification of a polygon where the first and last points are assumed to be connected
 */
export interface Polygon {
  points: Point32[];
}

/**
 * `geometry_msgs/msg/Pose`
 * A representation of pose in free space, composed of position and orientation.
 */
export interface Pose {
  position: Point;
  orientation: Quaternion;
}

/**
 * `geometry_msgs/msg/PoseStamped`
 * A Pose with reference coordinate frame and timestamp
 */
export interface PoseStamped {
  header: Header;
  pose: Pose;
}

/**
 * `geometry_msgs/msg/PoseWithCovariance`
 * This represents a pose in free space with uncertainty.
 */
export interface PoseWithCovariance {
  pose: Pose;
  /**
   * Row-major representation of the 6x6 covariance matrix
   * The orientation parameters use a fixed-axis representation.
   * In order, the parameters are:
   * (x, y, z, rotation about X axis, rotation about Y axis, rotation about Z axis)
   * `float64[36]`
   */
  covariance: (number | null)[];
}

/**
 * `geometry_msgs/msg/PoseWithCovarianceStamped`
 * This expresses an estimated pose with a reference coordinate frame and timestamp
 */
export interface PoseWithCovarianceStamped {
  header: Header;
  pose: PoseWithCovariance;
}

/**
 * `geometry_msgs/msg/Quaternion`
 * This represents an orientation in free space in quaternion form.
 */
export interface Quaternion {
  /** Default: 0.0 */
  x: number | null;
  /** Default: 0.0 */
  y: number | null;
  /** Default: 0.0 */
  z: number | null;
  /** Default: 1.0 */
  w: number | null;
}

/**
 * `geometry_msgs/msg/Transform`
 * This represents the transform between two coordinate frames in free space.
 */
export interface Transform {
  translation: Vector3;
  rotation: Quaternion;
}

/**
 * `geometry_msgs/msg/TransformStamped`
 * This expresses a transform from coordinate frame header.frame_id
 * to the coordinate frame child_frame_id at the time of header.stamp
 *
 * This message is mostly used by the
 * <a href="https://docs.ros.org/en/rolling/p/tf2/">tf2</a> package.
 * See its documentation for more information.
 *
 * The child_frame_id is necessary in addition to the frame_id
 * in the Header to communicate the full reference for the transform
 * in a self contained message.
 */
export interface TransformStamped {
  /** The frame id in the header is used as the reference frame of this transform. */
  header: Header;
  /** The frame id of the child frame to which this transform points. */
  child_frame_id: string;
  /** Translation and rotation in 3-dimensions of child_frame_id from header.frame_id. */
  transform: Transform;
}

/**
 * `geometry_msgs/msg/Twist`
 * This expresses velocity in free space broken into its linear and angular parts.
 */
export interface Twist {
  linear: Vector3;
  angular: Vector3;
}

/**
 * `geometry_msgs/msg/Vector3`
 * This represents a vector in free space.
 */
export interface Vector3 {
  /**
   * This is semantically different than a point.
   * A vector is always anchored at the origin.
   * When a transform is applied to a vector, only the rotational component is applied.
   */
  x: number | null;
  y: number | null;
  z: number | null;
}

/** `lupin_engine_msgs/action/RunMission_Feedback` */
export interface RunMissionFeedback {
  mission_id: string;
  /** lifecycle, phase and current target of the mission */
  state: string;
  phase: string;
  target: string;
  /** it waits for a person */
  paused: boolean;
  /** that a person is asked; empty: none */
  question: string;
  /** how many targets there are */
  total: number;
  /** how many visits have ended in each outcome */
  counts: OutcomeCount[];
}

/**
 * `lupin_engine_msgs/action/RunMission_Goal`
 * Run a mission: the goal starts it, a cancel aborts it, the result says how each target ended.
 * A goal that is refused is accepted and aborted at once: the rejection of a goal has no text.
 */
export interface RunMissionGoal {
  /** its name, e.g. "InspectionMission" */
  mission?: string;
  /** JSON object with fields of the mission's request, as in Command; empty: {} */
  request?: string;
  /** who asks, for the record, e.g. "shift_planner" */
  by?: string;
  /** when it was sent, by the wall clock: 5 s later it is refused. Zero: at any time */
  stamp?: Time;
}

/** `lupin_engine_msgs/action/RunMission_Result` */
export interface RunMissionResult {
  /** why it was refused, or did not come to its end; empty when it did */
  code: string;
  /** the same in words */
  message: string;
  /** empty when it was refused */
  mission_id: string;
  /** of each target, in their order */
  outcomes: VisitOutcome[];
}

/**
 * `lupin_engine_msgs/msg/OutcomeCount`
 * How many visits have ended in an outcome, over all sweeps.
 */
export interface OutcomeCount {
  /** a name of the profile, e.g. "OK" */
  outcome: string;
  count: number;
}

/**
 * `lupin_engine_msgs/msg/VisitOutcome`
 * How the visit of a target ended.
 */
export interface VisitOutcome {
  target: string;
  /** a name of the profile, e.g. "OK" or "UNREACHABLE"; empty: the visit did not end */
  outcome: string;
  /** whether the visit did what it was for */
  good: boolean;
  /** why it did not */
  code: string;
  detail: string;
}

/**
 * `lupin_engine_msgs/srv/Command_Request`
 * Ask the orchestrator for something, and be sure that it is not done twice.
 */
export interface CommandRequest {
  /** "start", "answer", or an operator's request of the profile: "pause", "skip_current", ... */
  verb?: string;
  /** for "start": name of the mission, e.g. "InspectionMission" */
  mission?: string;
  /**
   * JSON object, at most 65536 letters; empty: {}. For "start" fields of the mission's request;
   * for "answer" {"choice": NAME}
   */
  request?: string;
  /**
   * a UUID, new for each command: the same one within 60 s is answered from memory.
   * Empty: nothing is remembered
   */
  command_id?: string;
  /** who commands, for the record, e.g. "ann@bench-2" */
  by?: string;
}

/** `lupin_engine_msgs/srv/Command_Response` */
export interface CommandResponse {
  accepted: boolean;
  /** empty when accepted; else why not, for programs */
  code: string;
  /** the answer in words */
  message: string;
  /** the mission that has begun */
  mission_id: string;
  /**
   * the step in which this was decided, as on ~/steps; 0: it came to none
   * `uint64`
   */
  step: number;
  /** this is the answer to an earlier command of the same id */
  repeated: boolean;
}

/**
 * `lupin_engine_msgs/srv/Draw_Request`
 * Draw the chart that runs, with some of its states folded. Nothing changes by it.
 */
export interface DrawRequest {
  /** hash of the chart that is meant, as on ~/chart; another one is refused. Empty: whichever runs */
  chart?: string;
  /** full names of states that are shown without what is in them; empty: all is shown */
  folded?: string[];
}

/** `lupin_engine_msgs/srv/Draw_Response` */
export interface DrawResponse {
  success: boolean;
  /** why nothing was drawn */
  message: string;
  /** hash of the chart that runs */
  chart: string;
  /** groups of states carry `data-state`, those of transitions `data-transition` */
  svg: string;
}

/**
 * `lupin_engine_msgs/srv/Explain_Request`
 * What each transition of a state would do now, and why it cannot be taken. Nothing changes by it.
 */
export interface ExplainRequest {
  /** hash of the chart that is meant, as on ~/chart; another one is refused. Empty: whichever runs */
  chart?: string;
  /** full name of a state, or id of a transition */
  element?: string;
}

/** `lupin_engine_msgs/srv/Explain_Response` */
export interface ExplainResponse {
  success: boolean;
  /** why nothing is explained */
  message: string;
  /** hash of the chart that runs */
  chart: string;
  /** JSON object: docs/operating.md says what is in it */
  explanation: string;
}

/**
 * `lupin_msgs/msg/AnomalyReport`
 * Something out of the ordinary that belongs to no tag, such as a fallen plant or a pest between the tables.
 */
export interface AnomalyReport {
  /** where; orientation.w == 0: unknown */
  pose: PoseStamped;
  description: string;
  /** 0 is informative, more is more urgent */
  severity: number;
}

/**
 * `lupin_msgs/msg/DiscoveredTag`
 * A tag that perception has found by itself.
 */
export interface DiscoveredTag {
  tag_id: string;
  /** map frame, metres; an orientation of all zeros is the identity */
  pose_in_map: Pose;
  /** dominant species seen beside it, "" when none yet */
  species: string;
  /** in [0, 1]; 0 while `species` is empty */
  species_confidence: number | null;
  /** a bug was seen beside it */
  anomaly: boolean;
  /** confident detections behind this entry; ask for several before trusting it */
  sightings: number;
}

/**
 * `lupin_msgs/msg/DiscoveredTags`
 * All tags found so far: the whole table every time, never a difference. Empty is normal at the start.
 */
export interface DiscoveredTags {
  /** frame "map" */
  header: Header;
  tags: DiscoveredTag[];
}

/**
 * `lupin_msgs/msg/FlowerObservation`
 * The flowers seen at one tag.
 */
export interface FlowerObservation {
  tag_id: string;
  /** the tag, frame "map", metres; pose.orientation.w == 0: unknown */
  pose: PoseStamped;
  /** dominant species: "tulip_red" | "tulip_white" | "tulip_pink", "" for none */
  species: string;
  /** of `species`, in [0, 1] */
  confidence: number | null;
  /** a bug was seen at this tag */
  anomaly: boolean;
  /** one entry per bloom */
  flowers: FlowerPoint[];
  /** outline of the planter box, map frame, metres */
  box_footprint: Polygon;
}

/**
 * `lupin_msgs/msg/FlowerPoint`
 * One bloom in a planter box.
 */
export interface FlowerPoint {
  /** map frame, metres; z is 0, as depth is not measured */
  position: Point;
  /** as in FlowerObservation; "" when only a bug was seen here */
  species: string;
  /** of `species`, in [0, 1] */
  confidence: number | null;
  /** a bug was seen here */
  anomaly: boolean;
}

/**
 * `lupin_msgs/msg/MissionState`
 * What the orchestrator is doing, published at a steady rate whether or not a mission runs.
 */
export interface MissionState {
  header: Header;
  /** "" when no mission is active */
  mission_id: string;
  /** e.g. "InspectionMission", "ExplorationMission"; "" when none is active */
  mission_type: string;
  /**
   * Two levels of the same answer: BOOT READY PREPARE EXPLORING INSPECTING MONITORING RETURNING DONE FAULT,
   * and below some of them NAVIGATING SCANNING CONFIRMING PUBLISHING LOCALIZING ("" where there is no sub-state).
   */
  lifecycle_state: string;
  mission_phase: string;
  /** the tag being worked on, "" when none */
  current_target: string;
  /** Counters over the targets of this mission; each closed target counts in exactly one of the lower four. */
  targets_total: number;
  /** Observation.STATUS_OK */
  targets_completed: number;
  /** Observation.STATUS_SCAN_FAILED */
  targets_failed: number;
  /** Observation.STATUS_UNREACHABLE */
  targets_unreachable: number;
  /** Observation.STATUS_SKIPPED */
  targets_skipped: number;
  /** code of the last notable event, "" when there was none */
  last_error: string;
  /** the same event in words for an operator */
  last_event: string;
  last_event_severity: number;
  /** Progress of a search; both stay 0 in a mission that does not search. */
  tags_discovered: number;
  discovery_goal: number;
  estop_engaged: boolean;
  paused: boolean;
  /** state of charge as the orchestrator understands it */
  battery_percentage: number | null;
  battery_low: boolean;
  /** zero until a mission has started */
  started_at: Time;
}

export const MissionState = {
  SEVERITY_INFO: 0,
  SEVERITY_WARN: 1,
  SEVERITY_ERROR: 2,
} as const;

/**
 * `lupin_msgs/msg/Observation`
 * One thing that a mission learnt about the world: an envelope with a payload chosen by `kind`.
 *
 * A consumer branches on `kind`, reads the one payload that belongs to it and skips kinds it does not know.
 * New kinds and statuses are appended; existing numbers never change.
 */
export interface Observation {
  /** frame "map"; stamp = when the observation was made */
  header: Header;
  /** the run that made it */
  mission_id: string;
  /** who made it, e.g. "InspectionMission" */
  source: string;
  kind: number;
  status: number;
  /** the reason in words when status is not OK, else "" */
  status_detail: string;
  /** The payloads. Those that `kind` does not select stay at their defaults, and so do all of them unless OK. */
  tag_reading: TagReading;
  flower: FlowerObservation;
  anomaly: AnomalyReport;
  /**
   * Where the tag is, in metres in the map frame; only with STATUS_OK. The tag's own pose if it is known,
   * otherwise the pose from which the robot looked at it.
   * orientation.w == 0 says that there is no pose: no real rotation is sent that way.
   */
  tag_pose_in_map: Pose;
}

export const Observation = {
  KIND_TAG_READING: 0,
  KIND_FLOWER: 1,
  KIND_ANOMALY: 2,
  STATUS_OK: 0,
  /** the robot could not get to the target */
  STATUS_UNREACHABLE: 1,
  /** it got there, the scan did not succeed */
  STATUS_SCAN_FAILED: 2,
  /** closed by the operator or by the end of the mission */
  STATUS_SKIPPED: 3,
} as const;

/**
 * `lupin_msgs/msg/SensorReading`
 * One measured quantity.
 */
export interface SensorReading {
  /** "temperature" | "humidity" | "co2" | "light" | "soil_moisture" */
  name: string;
  /** in the unit that the sensor reports */
  value: number | null;
}

/**
 * `lupin_msgs/msg/TagReading`
 * What the sensors at one greenhouse tag measured in one poll.
 */
export interface TagReading {
  /** decimal id, the same in detector, simulator and HMI */
  tag_id: string;
  /** when the poll happened */
  stamp: Time;
  /** time of day inside the greenhouse simulation, s, in [0, 86400) */
  sim_time_of_day_seconds: number | null;
  /** the sensors that this tag has: any subset, not always all five */
  readings: SensorReading[];
}

/**
 * `lupin_msgs/msg/TwinState`
 * The digital twin's table of tags, whole every time. Empty is normal at the start.
 */
export interface TwinState {
  /** frame "map" */
  header: Header;
  tags: TwinTagState[];
}

/**
 * `lupin_msgs/msg/TwinTagState`
 * Everything that the digital twin knows about one tag.
 */
export interface TwinTagState {
  tag_id: string;
  /**
   * map frame, metres; kept from the first good scan.
   * orientation.w == 0: never observed, draw no pin
   */
  pose: Pose;
  /** the newest value of each sensor; look it up by name */
  readings: SensorReading[];
  /** time of the newest observation */
  last_observed: Time;
  /** age of that observation when this was published, s */
  stale_seconds: number | null;
  /** dominant species, "" until classified */
  species: string;
  /** in [0, 1]; 0 while `species` is empty */
  species_confidence: number | null;
  /** whether the newest look saw a bug */
  anomaly: boolean;
  flowers: FlowerPoint[];
  /** outline of the planter box, map frame, metres */
  box_footprint: Polygon;
}

/**
 * `lupin_msgs/srv/ArmLibraryEdit_Request`
 * Rename or delete an entry of the arm library.
 */
export interface ArmLibraryEditRequest {
  /** "pose" | "sequence" */
  kind?: string;
  name?: string;
  /** "" deletes the entry */
  new_name?: string;
}

/** `lupin_msgs/srv/ArmLibraryEdit_Response` */
export interface ArmLibraryEditResponse {
  success: boolean;
  message: string;
}

/**
 * `lupin_msgs/srv/ArmRecord_Request`
 * Record a motion of the arm.
 */
export interface ArmRecordRequest {
  /** "start" | "save" | "cancel" */
  action?: string;
  name?: string;
  /** for "start": "kinesthetic" (torque off, moved by hand) | "teleop" (torque on) */
  mode?: string;
  include_gripper?: boolean;
  /** replace an entry of the same name */
  overwrite?: boolean;
}

/** `lupin_msgs/srv/ArmRecord_Response` */
export interface ArmRecordResponse {
  success: boolean;
  message: string;
  /** length of the recording, s */
  duration_s: number | null;
  n_waypoints: number;
}

/**
 * `lupin_msgs/srv/CalibrateArm_Request`
 * Zero the arm's servos, a procedure in steps. On the real robot only.
 */
export interface CalibrateArmRequest {
  /** "start" | "commit" | "cancel" | "status" */
  action?: string;
}

/** `lupin_msgs/srv/CalibrateArm_Response` */
export interface CalibrateArmResponse {
  success: boolean;
  /** "IDLE" | "AWAITING_POSE" */
  state: string;
  message: string;
  /** order of the two lists below */
  joint_names: string[];
  /** written to the servos, hundredths of a degree */
  offsets_applied: number[];
  /** measured differences, raw servo ticks */
  diffs_observed: number[];
}

/**
 * `lupin_msgs/srv/ConfirmTag_Request`
 * Does the camera see this tag from where the robot stands now? On the real robot only.
 */
export interface ConfirmTagRequest {
  expected_tag_id?: string;
}

/** `lupin_msgs/srv/ConfirmTag_Response` */
export interface ConfirmTagResponse {
  detected: boolean;
  /** in [0, 1]; the scale is the detector's own */
  detection_confidence: number | null;
  /** map frame, metres; orientation.w == 0: no pose, always so if not detected */
  tag_pose_in_map: Pose;
  /** why not, when not detected */
  error_message: string;
}

/**
 * `lupin_msgs/srv/GetArmLibrary_Request`
 * List the saved poses and sequences without their waypoints.
 */
export type GetArmLibraryRequest = Record<string, never>;

/** `lupin_msgs/srv/GetArmLibrary_Response` */
export interface GetArmLibraryResponse {
  success: boolean;
  /** {"poses": [{name, note, has_gripper}], "sequences": [{name, mode, duration_s, n_waypoints, include_gripper}]} */
  json: string;
}

/**
 * `lupin_msgs/srv/GetField_Request`
 * A sensor quantity interpolated over a rectangle of the map.
 */
export interface GetFieldRequest {
  /** "temperature" | "humidity" | "co2" | "light" | "soil_moisture" */
  sensor_type?: string;
  /** edge of a cell, m */
  resolution?: number | null;
  /** the rectangle, map frame, m */
  bbox_min_x?: number | null;
  bbox_min_y?: number | null;
  bbox_max_x?: number | null;
  bbox_max_y?: number | null;
}

/** `lupin_msgs/srv/GetField_Response` */
export interface GetFieldResponse {
  /** false for an unknown sensor or an empty rectangle */
  ok: boolean;
  error_message: string;
  /** row by row from the origin, width * height; NaN where nothing is known */
  values: (number | null)[];
  /** cells along x */
  width: number;
  /** cells along y */
  height: number;
  /** corner of cell (0, 0), map frame, m */
  origin_x: number | null;
  origin_y: number | null;
  /** edge of a cell in this answer, m */
  resolution_used: number | null;
  /** over the cells that have a value; 0 when none has */
  value_min: number | null;
  value_max: number | null;
  /** observations that went into it */
  sample_count: number;
}

/**
 * `lupin_msgs/srv/GetTagReading_Request`
 * Read the sensors at one tag once.
 */
export interface GetTagReadingRequest {
  tag_id?: string;
}

/** `lupin_msgs/srv/GetTagReading_Response` */
export interface GetTagReadingResponse {
  status: number;
  /** "" with STATUS_OK */
  error_message: string;
  /** at its defaults unless STATUS_OK */
  reading: TagReading;
}

export const GetTagReadingResponse = {
  STATUS_OK: 0,
  STATUS_UNKNOWN_TAG: 1,
  /** a known tag without a reading now: see error_message */
  STATUS_READING_FAILED: 2,
} as const;

/**
 * `lupin_msgs/srv/PlayArmSequence_Request`
 * Play a recorded motion.
 */
export interface PlayArmSequenceRequest {
  name?: string;
  /** 1 is as recorded; the server keeps it within [0.25, 2] */
  speed?: number | null;
}

/** `lupin_msgs/srv/PlayArmSequence_Response` */
export interface PlayArmSequenceResponse {
  success: boolean;
  message: string;
}

/**
 * `lupin_msgs/srv/SaveArmPose_Request`
 * Save a pose of the arm under a name.
 */
export interface SaveArmPoseRequest {
  name?: string;
  /** true: take the joints as they are now and ignore the angles below */
  from_current?: boolean;
  /** four joint angles, rad */
  arm_rad?: (number | null)[];
  /** rad, read only when has_gripper */
  gripper_rad?: number | null;
  has_gripper?: boolean;
  /** replace an entry of the same name */
  overwrite?: boolean;
}

/** `lupin_msgs/srv/SaveArmPose_Response` */
export interface SaveArmPoseResponse {
  success: boolean;
  message: string;
}

/**
 * `lupin_msgs/srv/SetArmPreset_Request`
 * Move the arm to a pose known by name.
 */
export interface SetArmPresetRequest {
  name?: string;
}

/** `lupin_msgs/srv/SetArmPreset_Response` */
export interface SetArmPresetResponse {
  success: boolean;
  message: string;
}

/**
 * `lupin_msgs/srv/StartMission_Request`
 * Ask the orchestrator to run a mission.
 */
export interface StartMissionRequest {
  /** e.g. "InspectionMission", "ExplorationMission" */
  mission_type?: string;
  /** tags to visit, in order; empty: all known tags by number. A searching mission ignores it */
  tag_sequence?: string[];
  /** how many tags a search must find; 0: the mission's own default */
  discovery_goal?: number;
}

/** `lupin_msgs/srv/StartMission_Response` */
export interface StartMissionResponse {
  accepted: boolean;
  /** set when accepted */
  mission_id: string;
  /** why not, when refused */
  error_message: string;
}

/**
 * `mirte_msgs/msg/ServoPosition`
 * Where a servo of the MIRTE arm is. Field for field the vendor's definition.
 */
export interface ServoPosition {
  header: Header;
  /** rad */
  angle: number | null;
  /** counts of the servo itself */
  raw: number;
}

/**
 * `mirte_msgs/srv/GetServoOffset_Request`
 * Read a servo's zero offset. Field for field the vendor's definition.
 */
export type GetServoOffsetRequest = Record<string, never>;

/** `mirte_msgs/srv/GetServoOffset_Response` */
export interface GetServoOffsetResponse {
  centidegrees: number;
}

/**
 * `mirte_msgs/srv/SetServoAngleWithSpeed_Request`
 * Turn a servo at a given speed. Field for field the vendor's definition.
 */
export interface SetServoAngleWithSpeedRequest {
  angle?: number | null;
  /** per second */
  rate?: number | null;
  /**
   * whether angle and rate are in degrees; else in radians
   * Default: true
   */
  degrees?: boolean;
}

export const SetServoAngleWithSpeedRequest = {
  DEGREES: true,
  RADIANS: false,
} as const;

/** `mirte_msgs/srv/SetServoAngleWithSpeed_Response` */
export interface SetServoAngleWithSpeedResponse {
  status: boolean;
}

/**
 * `mirte_msgs/srv/SetServoAngle_Request`
 * Turn a servo. Field for field the vendor's definition.
 */
export interface SetServoAngleRequest {
  angle?: number | null;
  /**
   * whether the angle is in degrees; else in radians
   * Default: true
   */
  degrees?: boolean;
}

export const SetServoAngleRequest = {
  DEGREES: true,
  RADIANS: false,
} as const;

/** `mirte_msgs/srv/SetServoAngle_Response` */
export interface SetServoAngleResponse {
  status: boolean;
}

/**
 * `mirte_msgs/srv/SetServoOffset_Request`
 * Write a servo's zero offset. Field for field the vendor's definition.
 */
export interface SetServoOffsetRequest {
  centidegrees?: number;
}

/** `mirte_msgs/srv/SetServoOffset_Response` */
export type SetServoOffsetResponse = Record<string, never>;

/** `nav2_msgs/action/NavigateToPose_Feedback` */
export interface NavigateToPoseFeedback {
  current_pose: PoseStamped;
  navigation_time: Duration;
  estimated_time_remaining: Duration;
  number_of_recoveries: number;
  /** m */
  distance_remaining: number | null;
}

/**
 * `nav2_msgs/action/NavigateToPose_Goal`
 * Drive to a pose. Field for field the definition of ROS 2 Jazzy.
 */
export interface NavigateToPoseGoal {
  /** metres, in the frame of its header */
  pose?: PoseStamped;
  /** "": the server's default tree */
  behavior_tree?: string;
}

/** `nav2_msgs/action/NavigateToPose_Result` */
export interface NavigateToPoseResult {
  error_code: number;
  error_msg: string;
}

export const NavigateToPoseResult = {
  NONE: 0,
} as const;

/**
 * `nav_msgs/msg/MapMetaData`
 * This hold basic information about the characteristics of the OccupancyGrid
 */
export interface MapMetaData {
  /** The time at which the map was loaded */
  map_load_time: Time;
  /**
   * The map resolution
   * [m/cell]
   */
  resolution: number | null;
  /**
   * Map width
   * [cells]
   */
  width: number;
  /**
   * Map height
   * [cells]
   */
  height: number;
  /**
   * The origin of the map [m, m, rad].  This is the real-world pose of the
   * bottom left corner of cell (0,0) in the map.
   */
  origin: Pose;
}

/**
 * `nav_msgs/msg/OccupancyGrid`
 * This represents a 2-D grid map
 */
export interface OccupancyGrid {
  header: Header;
  /** MetaData for the map */
  info: MapMetaData;
  /**
   * The map data, in row-major order, starting with (0,0).
   * Cell (1, 0) will be listed second, representing the next cell in the x direction.
   * Cell (0, 1) will be at the index equal to info.width, followed by (1, 1).
   * The values inside are application dependent, but frequently,
   * 0 represents unoccupied, 1 represents definitely occupied, and
   * -1 represents unknown.
   */
  data: number[];
}

/**
 * `nav_msgs/msg/Path`
 * An array of poses that represents a Path for a robot to follow.
 */
export interface Path {
  /** Indicates the frame_id of the path. */
  header: Header;
  /** Array of poses to follow. */
  poses: PoseStamped[];
}

/**
 * `rcl_interfaces/msg/ParameterType`
 * These types correspond to the value that is set in the ParameterValue message.
 */
export type ParameterType = Record<string, never>;

export const ParameterType = {
  /** Default value, which implies this is not a valid parameter. */
  PARAMETER_NOT_SET: 0,
  PARAMETER_BOOL: 1,
  PARAMETER_INTEGER: 2,
  PARAMETER_DOUBLE: 3,
  PARAMETER_STRING: 4,
  PARAMETER_BYTE_ARRAY: 5,
  PARAMETER_BOOL_ARRAY: 6,
  PARAMETER_INTEGER_ARRAY: 7,
  PARAMETER_DOUBLE_ARRAY: 8,
  PARAMETER_STRING_ARRAY: 9,
} as const;

/** `sensor_msgs/msg/BatteryState` */
export interface BatteryState {
  header: Header;
  /** Voltage in Volts (Mandatory) */
  voltage: number | null;
  /** Temperature in Degrees Celsius (If unmeasured NaN) */
  temperature: number | null;
  /** Negative when discharging (A)  (If unmeasured NaN) */
  current: number | null;
  /** Current charge in Ah  (If unmeasured NaN) */
  charge: number | null;
  /** Capacity in Ah (last full capacity)  (If unmeasured NaN) */
  capacity: number | null;
  /** Capacity in Ah (design capacity)  (If unmeasured NaN) */
  design_capacity: number | null;
  /** Charge percentage on 0 to 1 range  (If unmeasured NaN) */
  percentage: number | null;
  /** The charging status as reported. Values defined above */
  power_supply_status: number;
  /** The battery health metric. Values defined above */
  power_supply_health: number;
  /** The battery chemistry. Values defined above */
  power_supply_technology: number;
  /** True if the battery is present */
  present: boolean;
  /**
   * An array of individual cell voltages for each cell in the pack
   * If individual voltages unknown but number of cells known set each to NaN
   */
  cell_voltage: (number | null)[];
  /**
   * An array of individual cell temperatures for each cell in the pack
   * If individual temperatures unknown but number of cells known set each to NaN
   */
  cell_temperature: (number | null)[];
  /** The location into which the battery is inserted. (slot number or plug) */
  location: string;
  /** The best approximation of the battery serial number */
  serial_number: string;
}

export const BatteryState = {
  /**
   * Constants are chosen to match the enums in the linux kernel
   * defined in include/linux/power_supply.h as of version 3.7
   * The one difference is for style reasons the constants are
   * all uppercase not mixed case.
   * Power supply status constants
   */
  POWER_SUPPLY_STATUS_UNKNOWN: 0,
  POWER_SUPPLY_STATUS_CHARGING: 1,
  POWER_SUPPLY_STATUS_DISCHARGING: 2,
  POWER_SUPPLY_STATUS_NOT_CHARGING: 3,
  POWER_SUPPLY_STATUS_FULL: 4,
  /** Power supply health constants */
  POWER_SUPPLY_HEALTH_UNKNOWN: 0,
  POWER_SUPPLY_HEALTH_GOOD: 1,
  POWER_SUPPLY_HEALTH_OVERHEAT: 2,
  POWER_SUPPLY_HEALTH_DEAD: 3,
  POWER_SUPPLY_HEALTH_OVERVOLTAGE: 4,
  POWER_SUPPLY_HEALTH_UNSPEC_FAILURE: 5,
  POWER_SUPPLY_HEALTH_COLD: 6,
  POWER_SUPPLY_HEALTH_WATCHDOG_TIMER_EXPIRE: 7,
  POWER_SUPPLY_HEALTH_SAFETY_TIMER_EXPIRE: 8,
  /**
   * Power supply technology (chemistry) constants
   * Unknown battery technology
   */
  POWER_SUPPLY_TECHNOLOGY_UNKNOWN: 0,
  /** Nickel-Metal Hydride battery */
  POWER_SUPPLY_TECHNOLOGY_NIMH: 1,
  /** Lithium-ion battery */
  POWER_SUPPLY_TECHNOLOGY_LION: 2,
  /** Lithium Polymer battery */
  POWER_SUPPLY_TECHNOLOGY_LIPO: 3,
  /** Lithium Iron Phosphate battery */
  POWER_SUPPLY_TECHNOLOGY_LIFE: 4,
  /** Nickel-Cadmium battery */
  POWER_SUPPLY_TECHNOLOGY_NICD: 5,
  /** Lithium Manganese Dioxide battery */
  POWER_SUPPLY_TECHNOLOGY_LIMN: 6,
  /** Ternary Lithium battery */
  POWER_SUPPLY_TECHNOLOGY_TERNARY: 7,
  /** Valve Regulated Lead-Acid battery */
  POWER_SUPPLY_TECHNOLOGY_VRLA: 8,
} as const;

/**
 * `sensor_msgs/msg/CompressedImage`
 * This message contains a compressed image.
 */
export interface CompressedImage {
  /**
   * Header timestamp should be acquisition time of image
   * Header frame_id should be optical frame of camera
   * origin of frame should be optical center of cameara
   * +x should point to the right in the image
   * +y should point down in the image
   * +z should point into to plane of the image
   */
  header: Header;
  /**
   * Specifies the format of the data
   * Acceptable values differ by the image transport used:
   * - compressed_image_transport:
   *     ORIG_PIXFMT; CODEC compressed
   *   where:
   *   - ORIG_PIXFMT is pixel format of the raw image, i.e.
   *     the content of sensor_msgs/Image/encoding with
   *     values from include/sensor_msgs/image_encodings.h
   *   - CODEC is one of [jpeg, png, tiff]
   *   - COMPRESSED_PIXFMT is only appended for color images
   *     and is the pixel format used by the compression
   *     algorithm. Valid values for jpeg encoding are:
   *     [bgr8, rgb8]. Valid values for png encoding are:
   *     [bgr8, rgb8, bgr16, rgb16].
   *   If the field is empty or does not correspond to the
   *   above pattern, the image is treated as bgr8 or mono8
   *   jpeg image (depending on the number of channels).
   * - compressed_depth_image_transport:
   *     ORIG_PIXFMT; compressedDepth CODEC
   *   where:
   *   - ORIG_PIXFMT is pixel format of the raw image, i.e.
   *     the content of sensor_msgs/Image/encoding with
   *     values from include/sensor_msgs/image_encodings.h
   *     It is usually one of [16UC1, 32FC1].
   *   - CODEC is one of [png, rvl]
   *   If the field is empty or does not correspond to the
   *   above pattern, the image is treated as png image.
   * - Other image transports can store whatever values they
   *   need for successful decoding of the image. Refer to
   *   documentation of the other transports for details.
   * [COMPRESSED_PIXFMT]
   */
  format: string;
  /**
   * Compressed image buffer
   * `uint8[]`
   */
  data: string;
}

/**
 * `sensor_msgs/msg/JointState`
 * This is a message that holds data to describe the state of a set of torque controlled joints.
 *
 * The state of each joint (revolute or prismatic) is defined by:
 *  * the position of the joint (rad or m),
 *  * the velocity of the joint (rad/s or m/s) and
 *  * the effort that is applied in the joint (Nm or N).
 *
 * Each joint is uniquely identified by its name
 * The header specifies the time at which the joint states were recorded. All the joint states
 * in one message have to be recorded at the same time.
 *
 * This message consists of a multiple arrays, one for each part of the joint state.
 * The goal is to make each of the fields optional. When e.g. your joints have no
 * effort associated with them, you can leave the effort array empty.
 *
 * All arrays in this message should have the same size, or be empty.
 * This is the only way to uniquely associate the joint name with the correct
 * states.
 */
export interface JointState {
  header: Header;
  name: string[];
  position: (number | null)[];
  velocity: (number | null)[];
  effort: (number | null)[];
}

/**
 * `std_msgs/msg/Bool`
 * This was originally provided as an example message.
 * It is deprecated as of Foxy
 * It is recommended to create your own semantically meaningful message.
 * However if you would like to continue using this please use the equivalent in example_msgs.
 */
export interface Bool {
  data: boolean;
}

/** `std_msgs/msg/ColorRGBA` */
export interface ColorRGBA {
  r: number | null;
  g: number | null;
  b: number | null;
  a: number | null;
}

/**
 * `std_msgs/msg/Header`
 * Standard metadata for higher-level stamped data types.
 * This is generally used to communicate timestamped data
 * in a particular coordinate frame.
 */
export interface Header {
  /** Two-integer timestamp that is expressed as seconds and nanoseconds. */
  stamp: Time;
  /** Transform frame with which this data is associated. */
  frame_id: string;
}

/**
 * `std_msgs/msg/String`
 * This was originally provided as an example message.
 * It is deprecated as of Foxy
 * It is recommended to create your own semantically meaningful message.
 * However if you would like to continue using this please use the equivalent in example_msgs.
 */
export interface StdMsgsString {
  data: string;
}

/** `std_srvs/srv/SetBool_Request` */
export interface SetBoolRequest {
  /** e.g. for hardware enabling / disabling */
  data?: boolean;
}

/** `std_srvs/srv/SetBool_Response` */
export interface SetBoolResponse {
  /** indicate successful run of triggered service */
  success: boolean;
  /** informational, e.g. for error messages */
  message: string;
}

/** `std_srvs/srv/Trigger_Request` */
export type TriggerRequest = Record<string, never>;

/** `std_srvs/srv/Trigger_Response` */
export interface TriggerResponse {
  /** indicate successful run of triggered service */
  success: boolean;
  /** informational, e.g. for error messages */
  message: string;
}

/**
 * `tf2_msgs/msg/TFMessage`
 * A batch of coordinate transforms. Field for field the definition of ROS 2 Jazzy.
 */
export interface TFMessage {
  transforms: TransformStamped[];
}

/**
 * `trajectory_msgs/msg/JointTrajectory`
 * The header is used to specify the coordinate frame and the reference time for
 * the trajectory durations
 */
export interface JointTrajectory {
  header: Header;
  /**
   * The names of the active joints in each trajectory point. These names are
   * ordered and must correspond to the values in each trajectory point.
   */
  joint_names: string[];
  /**
   * Array of trajectory points, which describe the positions, velocities,
   * accelerations and/or efforts of the joints at each time point.
   */
  points: JointTrajectoryPoint[];
}

/**
 * `trajectory_msgs/msg/JointTrajectoryPoint`
 * Each trajectory point specifies either positions[, velocities[, accelerations]]
 * or positions[, effort] for the trajectory to be executed.
 * All specified values are in the same order as the joint names in JointTrajectory.msg.
 */
export interface JointTrajectoryPoint {
  /**
   * Single DOF joint positions for each joint relative to their "0" position.
   * The units depend on the specific joint type: radians for revolute or
   * continuous joints, and meters for prismatic joints.
   */
  positions: (number | null)[];
  /**
   * The rate of change in position of each joint. Units are joint type dependent.
   * Radians/second for revolute or continuous joints, and meters/second for
   * prismatic joints.
   */
  velocities: (number | null)[];
  /**
   * Rate of change in velocity of each joint. Units are joint type dependent.
   * Radians/second^2 for revolute or continuous joints, and meters/second^2 for
   * prismatic joints.
   */
  accelerations: (number | null)[];
  /**
   * The torque or the force to be applied at each joint. For revolute/continuous
   * joints effort denotes a torque in newton-meters. For prismatic joints, effort
   * denotes a force in newtons.
   */
  effort: (number | null)[];
  /** Desired time from the trajectory start to arrive at this trajectory point. */
  time_from_start: Duration;
}

/**
 * `unique_identifier_msgs/msg/UUID`
 * A universally unique identifier (UUID).
 *
 *  http://en.wikipedia.org/wiki/Universally_unique_identifier
 *  http://tools.ietf.org/html/rfc4122.html
 */
export interface UUID {
  /** `uint8[16]` */
  uuid: string;
}

/**
 * `visualization_msgs/msg/Marker`
 * See:
 *  - http://www.ros.org/wiki/rviz/DisplayTypes/Marker
 *  - http://www.ros.org/wiki/rviz/Tutorials/Markers%3A%20Basic%20Shapes
 *
 * for more information on using this message with rviz.
 */
export interface Marker {
  /** Header for timestamp and frame id. */
  header: Header;
  /**
   * Namespace in which to place the object.
   * Used in conjunction with id to create a unique name for the object.
   */
  ns: string;
  /** Object ID used in conjunction with the namespace for manipulating and deleting the object later. */
  id: number;
  /** Type of object. */
  type: number;
  /**
   * Action to take; one of:
   *  - 0 add/modify an object
   *  - 1 (deprecated)
   *  - 2 deletes an object (with the given ns and id)
   *  - 3 deletes all objects (or those with the given ns if any)
   */
  action: number;
  /** Pose of the object with respect the frame_id specified in the header. */
  pose: Pose;
  /** Scale of the object; 1,1,1 means default (usually 1 meter square). */
  scale: Vector3;
  /**
   * Color of the object; in the range:
   * [0.0-1.0]
   */
  color: ColorRGBA;
  /**
   * How long the object should last before being automatically deleted.
   * 0 indicates forever.
   */
  lifetime: Duration;
  /** If this marker should be frame-locked, i.e. retransformed into its frame every timestep. */
  frame_locked: boolean;
  /** Only used if the type specified has some use for them (eg. POINTS, LINE_STRIP, ARROW_STRIP, etc.) */
  points: Point[];
  /**
   * Only used if the type specified has some use for them (eg. POINTS, LINE_STRIP, etc.)
   * The number of colors provided must either be 0 or equal to the number of points provided.
   * NOTE: alpha is not yet used
   */
  colors: ColorRGBA[];
  /**
   * Texture resource is a special URI that can either reference a texture file in
   * a format acceptable to (resource retriever)
   * or an embedded texture via a string matching the format:
   *   "embedded://texture_name"
   * [https://docs.ros.org/en/rolling/p/resource_retriever/]
   */
  texture_resource: string;
  /**
   * An image to be loaded into the rendering engine as the texture for this marker.
   * This will be used iff texture_resource is set to embedded.
   */
  texture: CompressedImage;
  /**
   * Location of each vertex within the texture; in the range:
   * [0.0-1.0]
   */
  uv_coordinates: UVCoordinate[];
  /** Only used for text markers */
  text: string;
  /**
   * Only used for MESH_RESOURCE markers.
   * Similar to texture_resource, mesh_resource uses resource retriever to load a mesh.
   * Optionally, a mesh file can be sent in-message via the mesh_file field. If doing so,
   * use the following format for mesh_resource:
   *   "embedded://mesh_name"
   */
  mesh_resource: string;
  mesh_file: MeshFile;
  mesh_use_embedded_materials: boolean;
}

export const Marker = {
  ARROW: 0,
  CUBE: 1,
  SPHERE: 2,
  CYLINDER: 3,
  LINE_STRIP: 4,
  LINE_LIST: 5,
  CUBE_LIST: 6,
  SPHERE_LIST: 7,
  POINTS: 8,
  TEXT_VIEW_FACING: 9,
  MESH_RESOURCE: 10,
  TRIANGLE_LIST: 11,
  ARROW_STRIP: 12,
  ADD: 0,
  MODIFY: 0,
  DELETE: 2,
  DELETEALL: 3,
} as const;

/** `visualization_msgs/msg/MarkerArray` */
export interface MarkerArray {
  markers: Marker[];
}

/**
 * `visualization_msgs/msg/MeshFile`
 * Used to send raw mesh files.
 */
export interface MeshFile {
  /**
   * The filename is used for both debug purposes and to provide a file extension
   * for whatever parser is used.
   */
  filename: string;
  /**
   * This stores the raw text of the mesh file.
   * `uint8[]`
   */
  data: string;
}

/**
 * `visualization_msgs/msg/UVCoordinate`
 * Location of the pixel as a ratio of the width of a 2D texture.
 * Values should be in range:.
 * [0.0-1.0]
 */
export interface UVCoordinate {
  u: number | null;
  v: number | null;
}

export const MSG_TYPES = {
  GoalInfo: "action_msgs/msg/GoalInfo",
  GoalStatus: "action_msgs/msg/GoalStatus",
  GoalStatusArray: "action_msgs/msg/GoalStatusArray",
  Duration: "builtin_interfaces/msg/Duration",
  Time: "builtin_interfaces/msg/Time",
  GripperCommand: "control_msgs/msg/GripperCommand",
  DiagnosticArray: "diagnostic_msgs/msg/DiagnosticArray",
  DiagnosticStatus: "diagnostic_msgs/msg/DiagnosticStatus",
  KeyValue: "diagnostic_msgs/msg/KeyValue",
  Point: "geometry_msgs/msg/Point",
  Point32: "geometry_msgs/msg/Point32",
  Polygon: "geometry_msgs/msg/Polygon",
  Pose: "geometry_msgs/msg/Pose",
  PoseStamped: "geometry_msgs/msg/PoseStamped",
  PoseWithCovariance: "geometry_msgs/msg/PoseWithCovariance",
  PoseWithCovarianceStamped: "geometry_msgs/msg/PoseWithCovarianceStamped",
  Quaternion: "geometry_msgs/msg/Quaternion",
  Transform: "geometry_msgs/msg/Transform",
  TransformStamped: "geometry_msgs/msg/TransformStamped",
  Twist: "geometry_msgs/msg/Twist",
  Vector3: "geometry_msgs/msg/Vector3",
  OutcomeCount: "lupin_engine_msgs/msg/OutcomeCount",
  VisitOutcome: "lupin_engine_msgs/msg/VisitOutcome",
  AnomalyReport: "lupin_msgs/msg/AnomalyReport",
  DiscoveredTag: "lupin_msgs/msg/DiscoveredTag",
  DiscoveredTags: "lupin_msgs/msg/DiscoveredTags",
  FlowerObservation: "lupin_msgs/msg/FlowerObservation",
  FlowerPoint: "lupin_msgs/msg/FlowerPoint",
  MissionState: "lupin_msgs/msg/MissionState",
  Observation: "lupin_msgs/msg/Observation",
  SensorReading: "lupin_msgs/msg/SensorReading",
  TagReading: "lupin_msgs/msg/TagReading",
  TwinState: "lupin_msgs/msg/TwinState",
  TwinTagState: "lupin_msgs/msg/TwinTagState",
  ServoPosition: "mirte_msgs/msg/ServoPosition",
  MapMetaData: "nav_msgs/msg/MapMetaData",
  OccupancyGrid: "nav_msgs/msg/OccupancyGrid",
  Path: "nav_msgs/msg/Path",
  ParameterType: "rcl_interfaces/msg/ParameterType",
  BatteryState: "sensor_msgs/msg/BatteryState",
  CompressedImage: "sensor_msgs/msg/CompressedImage",
  JointState: "sensor_msgs/msg/JointState",
  Bool: "std_msgs/msg/Bool",
  ColorRGBA: "std_msgs/msg/ColorRGBA",
  Header: "std_msgs/msg/Header",
  StdMsgsString: "std_msgs/msg/String",
  TFMessage: "tf2_msgs/msg/TFMessage",
  JointTrajectory: "trajectory_msgs/msg/JointTrajectory",
  JointTrajectoryPoint: "trajectory_msgs/msg/JointTrajectoryPoint",
  UUID: "unique_identifier_msgs/msg/UUID",
  Marker: "visualization_msgs/msg/Marker",
  MarkerArray: "visualization_msgs/msg/MarkerArray",
  MeshFile: "visualization_msgs/msg/MeshFile",
  UVCoordinate: "visualization_msgs/msg/UVCoordinate",
} as const;

export const SRV_TYPES = {
  CancelGoal: "action_msgs/srv/CancelGoal",
  Command: "lupin_engine_msgs/srv/Command",
  Draw: "lupin_engine_msgs/srv/Draw",
  Explain: "lupin_engine_msgs/srv/Explain",
  ArmLibraryEdit: "lupin_msgs/srv/ArmLibraryEdit",
  ArmRecord: "lupin_msgs/srv/ArmRecord",
  CalibrateArm: "lupin_msgs/srv/CalibrateArm",
  ConfirmTag: "lupin_msgs/srv/ConfirmTag",
  GetArmLibrary: "lupin_msgs/srv/GetArmLibrary",
  GetField: "lupin_msgs/srv/GetField",
  GetTagReading: "lupin_msgs/srv/GetTagReading",
  PlayArmSequence: "lupin_msgs/srv/PlayArmSequence",
  SaveArmPose: "lupin_msgs/srv/SaveArmPose",
  SetArmPreset: "lupin_msgs/srv/SetArmPreset",
  StartMission: "lupin_msgs/srv/StartMission",
  GetServoOffset: "mirte_msgs/srv/GetServoOffset",
  SetServoAngle: "mirte_msgs/srv/SetServoAngle",
  SetServoAngleWithSpeed: "mirte_msgs/srv/SetServoAngleWithSpeed",
  SetServoOffset: "mirte_msgs/srv/SetServoOffset",
  SetBool: "std_srvs/srv/SetBool",
  Trigger: "std_srvs/srv/Trigger",
} as const;

export const ACTION_TYPES = {
  GripperCommand: "control_msgs/action/GripperCommand",
  RunMission: "lupin_engine_msgs/action/RunMission",
  NavigateToPose: "nav2_msgs/action/NavigateToPose",
} as const;
