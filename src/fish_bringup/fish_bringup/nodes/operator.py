# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The operator's word: calls the service arm of the robot's owner of the arming state (node rotor, or the simulator)."""

from __future__ import annotations

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool

from fish_report.errors import UserError


def set_armed(armed: bool, namespace: str, domain: int | None, timeout: float) -> tuple[bool, str]:
    """Arm or disarm the robot of a namespace; whether it was done, and what the robot said.

    Args:
        armed: true arms, false disarms.
        namespace: of the robot, such as /fish.
        domain: ROS domain; None: that of the environment.
        timeout: s to wait for the service and for its answer.

    Raises:
        UserError: nobody serves arm there, or nobody answers.
    """
    context = Context()
    rclpy.init(context=context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("operator", namespace=namespace, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    client, name = node.create_client(SetBool, "arm"), f"{namespace.rstrip('/')}/arm"
    try:
        if not client.wait_for_service(timeout):
            raise UserError(
                f"no service {name} on ROS domain {context.get_domain_id()} within {timeout:g} s; start the robot "
                "(node rotor, or the simulator), or give --domain and --namespace"
            )
        future = client.call_async(SetBool.Request(data=armed))
        executor.spin_until_future_complete(future, timeout)
        answer = future.result() if future.done() else None
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    if answer is None:
        raise UserError(f"{name} did not answer within {timeout:g} s; see the log of its node")
    return bool(answer.success), str(answer.message)
