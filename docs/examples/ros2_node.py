"""A ROS 2 node that diagnoses a vehicle: readings in at 10 Hz, `diagnostic_msgs` out.

    python ros2_node.py --ros-args -p diagnoser:=integrated -r readings:=/vehicle/readings

It hears `readings` (std_msgs/Float64MultiArray): one number per channel of
`auv_fault_env.CHANNELS`, in that order and in its units, NaN where there is no reading. It says
`/diagnostics` (diagnostic_msgs/DiagnosticArray) after each of them: OK or WARN, the most probable
class, and the figures behind it. The vehicle is the nominal one of the diagnoser.
"""

import numpy as np

import diagnosers


def told(belief: diagnosers.Belief, classes: tuple[str, ...]) -> tuple[str, dict[str, float]]:
    """The class to name, and the figures, of a belief over one lane."""
    (name,) = diagnosers.decide(belief, classes)
    log_probability, mean, std = (values[0] for values in belief)
    likely = (
        int(log_probability[1:].argmax()) + 1 if name == diagnosers.UNKNOWN else classes.index(name)
    )
    figures = {
        "p(normal)": np.exp(log_probability[0]),
        f"p({classes[likely]})": np.exp(log_probability[likely]),
    }
    return name, figures | {"severity": mean[likely], "severity std": std[likely]}


def main() -> None:
    """Spin until ROS ends it."""
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
    from rclpy.executors import ExternalShutdownException
    from std_msgs.msg import Float64MultiArray

    rclpy.init()
    node = rclpy.create_node("auv_fault")
    diagnoser = diagnosers.make(node.declare_parameter("diagnoser", "integrated").value)
    diagnoser.reset(1)
    publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)

    def on_readings(message: Float64MultiArray) -> None:
        try:
            belief = diagnoser.update(np.array([message.data]))
        except ValueError as error:  # another number of channels
            node.get_logger().error(str(error))
            return
        name, figures = told(belief, diagnoser.classes)
        status = DiagnosticStatus(name="propulsion", message=name)
        status.level = DiagnosticStatus.OK if name == "normal" else DiagnosticStatus.WARN
        status.values = [KeyValue(key=key, value=f"{value:.3g}") for key, value in figures.items()]
        answer = DiagnosticArray(status=[status])
        answer.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(answer)

    node.create_subscription(Float64MultiArray, "readings", on_readings, 10)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
