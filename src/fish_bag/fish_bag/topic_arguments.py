# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""The arguments by which a command learns how the topics of recordings are called."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

from fish_bag.topic_map import TopicMap, load_topic_map
from fish_report.errors import user_errors


def add_topic_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --topics and --namespace."""
    parser.add_argument(
        "--topics", type=Path, help="YAML topic map (default: the names of the format)"
    )
    parser.add_argument("--namespace", help="robot's namespace (default: found from the topics)")


def topic_map(args: argparse.Namespace) -> TopicMap:
    """The topic map that these arguments give.

    Raises:
        UserError: the file is no topic map.
    """
    with user_errors():
        topics = load_topic_map(args.topics) if args.topics else TopicMap()
    return topics if args.namespace is None else replace(topics, namespace=args.namespace)
