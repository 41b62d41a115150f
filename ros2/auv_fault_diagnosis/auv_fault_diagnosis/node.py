"""The ROS 2 node: readings in, diagnostics out.

It subscribes to `readings` (std_msgs/Float64MultiArray) at 10 Hz: one number per channel of
`auv_fault_env.CHANNELS`, in that order and in its units, NaN where there is no reading.
"""

import sys

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from auv_fault_diagnosis.monitor import Settings, Status, monitor_of
from auv_fault_env.errors import InputError, finite_in_range

NAME = "auv_fault_diagnosis"
LEVELS = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)
DEPTH = 10  # messages that are kept for a slow listener
NANOSECOND = 1e-9


def main() -> int:
    """Spin until ROS ends it; 2 if a parameter cannot be used."""
    rclpy.init()
    node = rclpy.create_node(NAME)
    try:
        prepare(node)
        rclpy.spin(node)
    except InputError as error:
        print(f"{NAME}: {error}", file=sys.stderr)
        return 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


def prepare(node: Node) -> None:
    """Give the node its parameters, subscription, publisher and timer."""

    def parameter(name, default):
        return node.declare_parameter(name, default).value

    given = {
        name: parameter(name, one.default) for name, one in Settings.__dataclass_fields__.items()
    }
    monitor = monitor_of(Settings(**given))
    rate = finite_in_range("rate", parameter("rate", 2.0), 0.01, 100.0)
    readings = parameter("readings_topic", "readings")
    diagnostics = parameter("diagnostics_topic", "/diagnostics")
    publisher = node.create_publisher(DiagnosticArray, diagnostics, DEPTH)

    def now() -> float:
        return NANOSECOND * node.get_clock().now().nanoseconds

    def on_readings(message: Float64MultiArray) -> None:
        try:
            monitor.update(message.data, now())
        except InputError as error:
            node.get_logger().error(str(error))

    def on_timer() -> None:
        answer = DiagnosticArray()
        answer.header.stamp = node.get_clock().now().to_msg()
        answer.status = [message_of(one) for one in monitor.statuses(now())]
        publisher.publish(answer)

    node.create_subscription(Float64MultiArray, readings, on_readings, DEPTH)
    node.create_timer(1.0 / rate, on_timer)


def message_of(status: Status) -> DiagnosticStatus:
    """The status as a message; its name begins with that of the node, as aggregators expect."""
    return DiagnosticStatus(
        level=LEVELS[status.level],
        name=f"{NAME}: {status.name}",
        message=status.message,
        hardware_id=status.name,
        values=[KeyValue(key=key, value=value) for key, value in status.values.items()],
    )


if __name__ == "__main__":
    sys.exit(main())
