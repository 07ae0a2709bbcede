//! Definitions of the ROS 2 messages in a recording, as `ros2msg` texts.

use super::cycle::Cycle;

/// How the texts are written.
pub const ENCODING: &str = "ros2msg";
/// How the messages are written.
pub const MESSAGE_ENCODING: &str = "cdr";

/// Name of the message that holds a whole cycle.
pub const CYCLE: &str = "magsteer_msgs/msg/Cycle";
/// A pose with its time and frame.
pub const POSE: &str = "geometry_msgs/msg/PoseStamped";
/// Values of joints, by name.
pub const JOINTS: &str = "sensor_msgs/msg/JointState";
/// A line of a log.
pub const LOG: &str = "rcl_interfaces/msg/Log";

const HEADER: &str = "\
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
";

const TIME: &str = "\
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
";

/// The definition of [`POSE`].
pub fn pose() -> String {
    let pose = "\
std_msgs/Header header
geometry_msgs/Pose pose
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
";
    [pose, HEADER, TIME].concat()
}

/// The definition of [`JOINTS`].
pub fn joints() -> String {
    let joints = "\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
";
    [joints, HEADER, TIME].concat()
}

/// The definition of [`LOG`].
pub fn log() -> String {
    let log = "\
byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
";
    [log, TIME].concat()
}

/// The definition of [`CYCLE`], every field with its meaning.
pub fn cycle() -> String {
    let line =
        |field: &super::cycle::Field| format!("# {}\n{} {}\n", field.meaning.trim(), field.ros, field.name);
    Cycle::FIELDS.iter().map(line).collect()
}
