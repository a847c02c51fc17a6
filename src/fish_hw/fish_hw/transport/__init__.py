# Copyright 2026 Robot fish maintainers
# SPDX-License-Identifier: Apache-2.0
"""Everything that touches a port: the only place that imports pyserial, smbus2 and the video capture.

Byte streams have `write(data)`, `read(timeout_s)` and `close()`; I2C buses have `write(address, data)`,
`read(address, count)` and `close()`. A port that cannot be opened raises PortUnavailable, one that fails
while in use raises TransportError.
"""
