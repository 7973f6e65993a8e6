"""Types of ROS 2's own packages that messages of slipd use (Humble to Kilted have the same)."""

from __future__ import annotations

from slipd_client.ros.ros_types import type_from_text

_TEXTS = {
    "builtin_interfaces/Time": """
        int32 sec
        uint32 nanosec
    """,
    "std_msgs/Header": """
        builtin_interfaces/Time stamp
        string frame_id
    """,
    "geometry_msgs/Vector3": """
        float64 x
        float64 y
        float64 z
    """,
    "geometry_msgs/Point": """
        float64 x
        float64 y
        float64 z
    """,
    "geometry_msgs/Quaternion": """
        float64 x
        float64 y
        float64 z
        float64 w
    """,
    "geometry_msgs/Wrench": """
        geometry_msgs/Vector3 force
        geometry_msgs/Vector3 torque
    """,
    "geometry_msgs/WrenchStamped": """
        std_msgs/Header header
        geometry_msgs/Wrench wrench
    """,
    "geometry_msgs/PointStamped": """
        std_msgs/Header header
        geometry_msgs/Point point
    """,
    "geometry_msgs/Transform": """
        geometry_msgs/Vector3 translation
        geometry_msgs/Quaternion rotation
    """,
    "geometry_msgs/TransformStamped": """
        std_msgs/Header header
        string child_frame_id
        geometry_msgs/Transform transform
    """,
    "tf2_msgs/TFMessage": """
        geometry_msgs/TransformStamped[] transforms
    """,
    "sensor_msgs/Image": """
        std_msgs/Header header
        uint32 height
        uint32 width
        string encoding
        uint8 is_bigendian
        uint32 step
        uint8[] data
    """,
    "sensor_msgs/Imu": """
        std_msgs/Header header
        geometry_msgs/Quaternion orientation
        float64[9] orientation_covariance
        geometry_msgs/Vector3 angular_velocity
        float64[9] angular_velocity_covariance
        geometry_msgs/Vector3 linear_acceleration
        float64[9] linear_acceleration_covariance
    """,
    "diagnostic_msgs/KeyValue": """
        string key
        string value
    """,
    "diagnostic_msgs/DiagnosticStatus": """
        byte OK=0
        byte WARN=1
        byte ERROR=2
        byte STALE=3
        byte level
        string name
        string message
        string hardware_id
        diagnostic_msgs/KeyValue[] values
    """,
    "diagnostic_msgs/DiagnosticArray": """
        std_msgs/Header header
        diagnostic_msgs/DiagnosticStatus[] status
    """,
}

STOCK_TYPES = {name: type_from_text(name, text) for name, text in _TEXTS.items()}
"""Every type by its name, "package/Name"."""
